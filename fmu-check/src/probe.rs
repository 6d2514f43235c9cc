//! One probe: runs one check of the binary in this process and writes its findings to a file for the parent.

use crate::check::Run;
use crate::checks::GROUPS;
use crate::confidence::Confidence;
use crate::error::Error;
use crate::level::Level;
pub use crate::lines::ProbeArguments;
use crate::lines::{Line, SAID};
use crate::session::{NotDetermined, NotOpened, Session};
use fmu_import::guard;
use fmu_import::raw::{Arguments, take_events};
use std::fs;
use std::path::Path;

/// Checks that are violated if the probe cannot start; all others are then not determined.
const VIOLATED_WHEN_BLOCKED: [&str; 3] = ["B00", "L00", "E00"];

/// Exit status of a probe that could not write its findings.
pub(super) const NOT_WRITTEN: i32 = 74;

/// Runs one probe, in this process.
///
/// # Errors
/// The check is unknown, or the folder is not readable.
pub fn run(args: &ProbeArguments) -> Result<(), Error> {
    guard::end_with_parent();
    let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == args.id);
    let probe = match check.map(|c| c.run) {
        None | Some(Run::File(_)) => {
            return Err(Error(format!("there is no probe {}: --list names the checks", args.id)));
        }
        Some(Run::Probe(probe) | Run::Any(probe) | Run::Silent(probe) | Run::Twice(probe)) => probe,
        Some(Run::Exchange(probe) | Run::Scheduled(probe)) => probe,
    };
    match Session::open(args) {
        Ok(session) => {
            if let Err(NotDetermined(why)) = probe(&session) {
                session.write(&if VIOLATED_WHEN_BLOCKED.contains(&check.map_or("", |c| c.id)) {
                    Line::Violated(None, Confidence::Certain, format!("{why}{}", said(&session, &why)))
                } else {
                    Line::NotDetermined(why)
                });
            }
            session.write(&Line::Done);
            // The parent reads the findings; a crash while the process ends is also a finding.
            session.record_call("(the process ends)");
            let lost = session.lost.get();
            std::mem::forget(session);
            if lost {
                std::process::exit(NOT_WRITTEN);
            }
        }
        Err(why) => {
            let line = match why {
                NotOpened::Load(why) if args.id == "B00" && !needs_tool(&args.dir) => {
                    // A library or a version of it is missing on this computer, which the standards only recommend avoiding.
                    if [
                        "cannot open shared object file",
                        "not found",
                        "GetLastError 126",
                        "code: 126",
                        "Library not loaded",
                    ]
                    .iter()
                    .any(|sign| why.contains(sign))
                    {
                        Line::Violated(Some(Level::Should), Confidence::Certain, why)
                    } else {
                        Line::Violated(None, Confidence::Certain, why)
                    }
                }
                NotOpened::Load(why) | NotOpened::Here(why) => Line::NotDetermined(why),
            };
            let text = [line, Line::Done].iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>()?;
            fs::write(&args.out, text.join("\n"))?;
        }
    }
    Ok(())
}

/// The last message of an FMU that does not run; one that makes no instance may give the reason only with logging on.
fn said(session: &Session, why: &str) -> String {
    if why.contains("returned NULL") {
        let _ = session.instantiate(&Arguments { logging: true, ..session.arguments("probe") });
    }
    let text = take_events().into_iter().rev().find_map(|event| event.text.filter(|text| !text.trim().is_empty()));
    text.map_or_else(String::new, |text| format!("{SAID}{:?}", text.trim()))
}

/// Whether the FMU needs a tool that may not be here.
fn needs_tool(dir: &Path) -> bool {
    let xml = fs::read(dir.join("modelDescription.xml")).unwrap_or_default();
    let interface =
        model_description::read(&xml).ok().and_then(|d| d.co_simulation.or(d.model_exchange).or(d.scheduled_execution));
    interface.is_some_and(|i| i.needs_execution_tool())
}
