//! The checker's findings in a file, for the test programs that use it; each names its `PROGRAM`.

use fmu_check::{Options, report::Report};
use std::path::Path;
use std::time::Duration;

/// All findings about a file. Timing has no influence here, however busy the machine is.
pub fn check(path: &Path, only: &[&str]) -> Report {
    check_within(path, only, 120)
}

/// [`check`] with the seconds that a probe may take: few for an FMU that hangs.
pub fn check_within(path: &Path, only: &[&str], seconds: u64) -> Report {
    let options = Options {
        only: only.iter().map(ToString::to_string).collect(),
        patience: Some(Duration::from_secs(seconds)),
        timeout: None,
        program: Some(super::PROGRAM.into()),
        ..Options::default()
    };
    fmu_check::run(path, &options).unwrap_or_else(|e| panic!("{e}"))
}

/// The ids of the violated checks.
pub fn violated(report: &Report) -> Vec<&'static str> {
    report.violated().map(|f| f.id).collect()
}

/// The result of a check that should have failed.
pub fn listed(report: &Report) -> String {
    report.violated().map(|f| format!("{}: {:?}", f.id, f.verdict)).collect::<Vec<_>>().join("\n")
}
