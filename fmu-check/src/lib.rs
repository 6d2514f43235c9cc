//! Checks whether an FMU for co-simulation or Model Exchange conforms to FMI 2.0 or FMI 3.0, whichever tool made it.
//!
//! The checks are data ([`GROUPS`], one file for each group in `checks/`): an id, one sentence, the clause, the level in each
//! standard, and the function that decides. Checks of the file run in this process. Each check of the binary runs in its own
//! process ([`probe`]), so that a crash or a hang is a verdict. No check depends on the behavior of `fmu build`.

#![forbid(unsafe_code)]

pub mod baseline;
mod check;
mod checks;
pub mod command;
mod confidence;
mod deviation;
mod encoding;
mod error;
mod evidence;
mod exchange;
mod excuse;
mod fmu_file;
mod formats;
mod instance;
mod level;
mod lines;
pub mod probe;
mod queue;
mod replay;
pub mod report;
mod runner;
mod scripts;
mod session;
mod settable;
mod state;
mod states;
mod subjects;
mod ticking;
mod trajectory;
mod watch;
mod zip_headers;

pub use check::{Check, Finding, Group, Levels, Options, Verdict};
pub use checks::GROUPS;
pub use confidence::Confidence;
pub use error::Error;
pub use fmu_file::{FmuFile, Unusable};
pub use level::Level;

use std::path::Path;
use std::sync::Arc;

/// Checks a file.
///
/// # Errors
/// The file cannot be read, or is not an FMU of FMI 2.0 or 3.0.
pub fn run(path: &Path, options: &Options) -> Result<report::Report, Unusable> {
    let fmu = Arc::new(FmuFile::open(path)?);
    let version = fmu.version;
    let wanted = |group: &Group, check: &Check| {
        let named = |name: &String| name.eq_ignore_ascii_case(check.id) || name.eq_ignore_ascii_case(group.name);
        options.only.is_empty() || options.only.iter().any(named)
    };
    let all = GROUPS.iter().flat_map(|group| group.checks.iter().map(move |check| (group, check)));
    let chosen: Vec<_> = all
        .filter(|(group, check)| wanted(group, check))
        .filter_map(|(group, check)| check.levels.of(version).map(|level| (group, check, level)))
        .collect();
    let found = queue::run_all(&fmu, &chosen.iter().map(|(_, check, _)| *check).collect::<Vec<_>>(), options);
    let findings = chosen.iter().zip(found.conclusions).map(|((group, check, level), found)| Finding {
        id: check.id,
        group: group.name,
        requirement: check.requirement,
        clause: check.clause,
        level: found.lower.map_or(*level, |lower| lower.max(*level)),
        confidence: found.confidence.max(Confidence::highest(check.id)),
        fatal: found.fatal,
        known: false,
        verdict: found.verdict,
        calls: found.calls,
        script: found.script,
    });
    let report = report::Report::new(&fmu, findings.collect(), found.varying);
    if Arc::strong_count(&fmu) > 1 {
        fmu.discard();
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_unique_and_every_check_is_documented() {
        let checks: Vec<&Check> = GROUPS.iter().flat_map(|g| g.checks).collect();
        for (i, check) in checks.iter().enumerate() {
            assert!(checks[..i].iter().all(|c| c.id != check.id), "{} twice", check.id);
            for text in [check.requirement, check.tried, check.fix] {
                assert!(text.contains(' ') && text.ends_with('.'), "{}: {text:?}", check.id);
            }
            // One clause for each standard; a must has one where it is a must.
            let clauses: Vec<_> = check.clause.split("; ").filter_map(|c| c.split_once(", ")).collect();
            let one = |version: &str, level: Option<Level>| {
                let of: Vec<_> = clauses.iter().filter(|(v, _)| *v == version).collect();
                let single = of.iter().all(|(_, clause)| clause.bytes().all(|b| b.is_ascii_digit() || b == b'.'));
                assert!(single && of.len() <= 1, "{}: {}", check.id, check.clause);
                assert!(
                    level != Some(Level::Must) || of.len() == 1,
                    "{} must in {version}, by {}",
                    check.id,
                    check.clause
                );
            };
            one("2.0.5", check.levels.0);
            one("3.0.2", check.levels.1);
            assert!(!check.clause.is_empty() && (check.levels.0.is_some() || check.levels.1.is_some()), "{}", check.id);
        }
    }
}
