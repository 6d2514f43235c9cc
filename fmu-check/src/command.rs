//! The command `fmu check`: checks whether an FMU conforms to its standard.

use crate::baseline::Baseline;
use crate::confidence::Confidence;
use crate::error::Error;
use crate::report::Report;
use crate::{self as check, Options, formats, replay, report};
use clap::{Args, ValueEnum};
use fmu_import::{guard, printable_lines, whole};
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Duration;

/// Checks an FMU for Co-Simulation or Model Exchange of FMI 2.0 or FMI 3.0, made by any tool: archive, description, and
/// behavior of its binary.
///
/// Every check has an id, a clause of the standard, and a level: must (the standard requires it), should (the standard
/// recommends it) or hard (the standard leaves it open, but a robust FMU does it). Each probe of the binary runs in its own
/// process, with limits, so a crash or a hang is a finding. The code of the FMU runs on this computer with your rights: check
/// only FMUs that you would run. --sandbox takes the network away from it.
///
/// Each finding is certain, likely or a hint: --confidence certain counts only the first kind.
///
/// Exit status: 0 if no must is violated, 1 if one is, 2 if a file is not an FMU. With --strict, a violated should or hard
/// and a check that is not determined count like a must. With --baseline, every violated check that the file does not have
/// counts, at every level.
///
///   fmu check target/fmu/fmi3/PmsmPlant.fmu
///   fmu check other.fmu --format html > report.html
///   fmu check other.fmu --only lifecycle,X01b
///   fmu check build/*.fmu --baseline fmu-check.toml --format junit > check.xml
///   fmu check --explain S02a
///   fmu check other.fmu --replay T02b
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
#[expect(clippy::struct_excessive_bools, reason = "options of a command")]
pub struct CheckArguments {
    /// FMUs to check
    #[arg(value_name = "FILE.fmu", required_unless_present_any = ["list", "explain"])]
    pub files: Vec<PathBuf>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Run only these checks: ids or group names
    #[arg(long, value_name = "ID,GROUP", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Findings below this confidence do not count
    #[arg(long, value_enum, value_name = "CONFIDENCE", default_value_t)]
    pub confidence: Confidence,
    /// Findings of these checks do not count
    #[arg(long, value_name = "ID", value_delimiter = ',')]
    pub allow: Vec<String>,
    /// File with known findings, for example fmu-check.toml: exit with status 1 only for others
    #[arg(long, value_name = "FILE.toml")]
    pub baseline: Option<PathBuf>,
    /// Write all findings to this file, as a baseline
    #[arg(long, value_name = "FILE.toml", conflicts_with = "baseline")]
    pub write_baseline: Option<PathBuf>,
    /// Also show checks that passed and checks that do not apply
    #[arg(long, short)]
    pub verbose: bool,
    /// Time limit for everything, in seconds; what has not run by then is not determined
    #[arg(long, value_name = "S")]
    pub timeout: Option<f64>,
    /// Time limit for one call of the binary, in seconds [default: 10]
    #[arg(long, value_name = "S")]
    pub patience: Option<f64>,
    /// Address space of one probe, in GiB; 0 for no limit on it and on open files
    #[arg(long, value_name = "GIB", default_value_t = guard::Allowance::default().memory >> 30, value_parser = clap::value_parser!(u64).range(..=1 << 20))]
    pub memory: u64,
    /// Run the probes without network (Linux with user namespaces; refused elsewhere)
    #[arg(long)]
    pub sandbox: bool,
    /// Exit with status 1 unless every applicable check passes
    #[arg(long)]
    pub strict: bool,
    /// List all checks and exit
    #[arg(long, exclusive = true)]
    pub list: bool,
    /// Explain a check: what is required and where, how it is tried, the usual fix
    #[arg(long, value_name = "ID", exclusive = true)]
    pub explain: Option<String>,
    /// Repeat one check of the binary and print its calls with what they return; ID#N for its case N alone
    #[arg(long, value_name = "ID[#N]", conflicts_with_all = [
        "format", "only", "confidence", "allow", "baseline", "write_baseline", "verbose", "strict", "timeout",
    ])]
    pub replay: Option<String>,
}

/// Output formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text for a terminal.
    #[default]
    Text,
    /// JSON for a program: a report, or a list of reports for several files.
    Json,
    /// One HTML page for a browser.
    Html,
    /// JUnit XML for a CI.
    Junit,
    /// SARIF 2.1.0 for a code host.
    Sarif,
}

/// Whether a name belongs to a check or a group.
fn is_check(name: &str) -> bool {
    check::GROUPS.iter().any(|g| g.checks.iter().any(|c| c.id.eq_ignore_ascii_case(name)))
}

fn seconds(name: &str, s: Option<f64>) -> Result<Option<Duration>, Error> {
    let duration = |s| Duration::try_from_secs_f64(s).map_err(|e| Error(format!("{name} {s}: {e}")));
    s.map(duration).transpose()
}

/// Runs the command. Returns whether no must is violated, or with `strict` whether every applicable check passes.
///
/// # Errors
/// A file is not an FMU (the others are checked and reported all the same), or an id does not exist.
pub fn run(args: &CheckArguments) -> Result<bool, Error> {
    if args.list {
        print!("{}", report::list());
        return Ok(true);
    }
    if let Some(id) = &args.explain {
        let Some(text) = report::explain(id) else {
            return Err(Error(format!("--explain {id}: unknown check; --list shows all")));
        };
        print!("{text}");
        return Ok(true);
    }
    let group = |name: &str| check::GROUPS.iter().any(|g| g.name.eq_ignore_ascii_case(name));
    if let Some(name) = args.only.iter().find(|name| !is_check(name) && !group(name)) {
        let groups: Vec<_> = check::GROUPS.iter().map(|g| g.name).collect();
        return Err(Error(format!("--only {name}: unknown check (--list shows all) or group: {}", groups.join(", "))));
    }
    if let Some(name) = args.allow.iter().find(|name| !is_check(name)) {
        return Err(Error(format!("--allow {name}: unknown check; --list shows all")));
    }
    if args.verbose && args.format != Format::Text {
        return Err(Error("--verbose: is for --format text; the other formats have every check".into()));
    }
    let options = Options {
        only: args.only.clone(),
        patience: seconds("--patience", args.patience)?,
        timeout: seconds("--timeout", args.timeout)?,
        program: None,
        allowance: guard::Allowance { memory: args.memory << 30, sandbox: args.sandbox, ..Default::default() },
        scripts: args.format == Format::Html,
    };
    if let Some(what) = &args.replay {
        let [file] = args.files.as_slice() else { return Err(Error("--replay takes one file".into())) };
        return replay::run(file, what, &options);
    }
    let baseline = args.baseline.as_deref().map(Baseline::read).transpose()?;
    let began = std::time::Instant::now();
    let mut reports: Vec<Report> = Vec::new();
    let mut unusable = Vec::new();
    for file in &args.files {
        let left = options.timeout.map(|all| all.saturating_sub(began.elapsed()));
        let mut report = match check::run(file, &Options { timeout: left, ..options.clone() }) {
            Ok(report) => report,
            Err(cause) => {
                unusable.push(cause.to_string());
                continue;
            }
        };
        report.confidence = args.confidence;
        report.allow(&args.allow);
        if let Some(baseline) = &baseline {
            baseline.apply(&mut report);
        }
        reports.push(report);
    }
    match (args.format, reports.as_slice()) {
        (_, []) => {}
        (Format::Text, reports) => {
            let text = report::texts(reports, args.verbose) + &news(baseline.as_ref(), reports);
            print!("{}", printable_lines(&text));
        }
        (Format::Json, [report]) if args.files.len() == 1 => println!("{}", report.json()?),
        (Format::Json, reports) => println!("{}", serde_json::to_string_pretty(reports)?),
        (Format::Html, reports) => print!("{}", report::html(reports)),
        (Format::Junit, reports) => print!("{}", formats::junit(reports)),
        (Format::Sarif, reports) => println!("{}", serde_json::to_string_pretty(&formats::sarif(reports))?),
    }
    // The other files are reported.
    if !unusable.is_empty() {
        return Err(Error(unusable.join("\n")));
    }
    if let Some(path) = &args.write_baseline {
        whole::write(path, Baseline::text(&reports).as_bytes()).map_err(|e| Error(e.to_string()))?;
    }
    let holds = |report: &Report| match (args.strict, &baseline) {
        (true, _) => report.is_clean(),
        (false, Some(_)) => report.unknown().next().is_none(),
        (false, None) => report.conforms(),
    };
    Ok(reports.iter().all(holds))
}

/// Findings missing from the baseline, and baseline entries that no longer occur.
fn news(baseline: Option<&Baseline>, reports: &[Report]) -> String {
    let mut out = String::new();
    for report in baseline.map_or(&[][..], |_| reports) {
        let new: Vec<_> = report.unknown().map(|f| f.id).collect();
        let gone = baseline.map(|b| b.fixed(report)).unwrap_or_default();
        for (what, ids) in [("new", new.join(", ")), ("fixed, no longer needed in the baseline", gone.join(", "))] {
            if !ids.is_empty() {
                let _ = writeln!(out, "{}: {what}: {ids}", report.file);
            }
        }
    }
    out
}
