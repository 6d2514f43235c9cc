//! The vocabulary of the checker: levels, checks, groups, verdicts and options.

use super::confidence::Confidence;
use super::fmu_file::FmuFile;
use super::level::Level;
use super::session::{NotDetermined, Session};
use fmu_import::guard::Allowance;
use model_description::FmiVersion;
use serde::Serialize;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The levels in FMI 2.0 and in FMI 3.0; `None` if the standard has no such requirement.
#[derive(Clone, Copy, Debug)]
pub struct Levels(pub(super) Option<Level>, pub(super) Option<Level>);

impl Levels {
    pub(super) const MUST: Self = Self::both(Level::Must);
    pub(super) const SHOULD: Self = Self::both(Level::Should);
    pub(super) const HARD: Self = Self::both(Level::Hard);

    const fn both(level: Level) -> Self {
        Self(Some(level), Some(level))
    }

    /// The level in one standard.
    pub const fn of(self, version: FmiVersion) -> Option<Level> {
        match version {
            FmiVersion::V2 => self.0,
            FmiVersion::V3 => self.1,
        }
    }
}

/// One requirement.
pub struct Check {
    /// Short name, for example `V04`.
    pub id: &'static str,
    /// The requirement, in one sentence.
    pub requirement: &'static str,
    /// Where the standards say so.
    pub clause: &'static str,
    /// How binding it is.
    pub levels: Levels,
    /// The files that the check reads or the calls that it makes, in one sentence.
    pub tried: &'static str,
    /// The usual fix, in one sentence.
    pub fix: &'static str,
    pub(super) run: Run,
}

impl Check {
    /// Whether it calls the binary.
    pub(super) fn is_probe(&self) -> bool {
        !matches!(self.run, Run::File(_))
    }
}

/// How a check runs.
#[derive(Clone, Copy)]
pub(super) enum Run {
    /// Examines the file.
    File(fn(&FmuFile) -> Verdict),
    /// Calls the binary in its own process.
    Probe(fn(&Session) -> Result<(), NotDetermined>),
    /// Like `Probe`, but with instances for Model Exchange if there is no co-simulation: no steps.
    Any(fn(&Session) -> Result<(), NotDetermined>),
    /// Like `Any`; any output to the console or the working directory is a violation.
    Silent(fn(&Session) -> Result<(), NotDetermined>),
    /// Like `Probe`, in two processes that must report the same.
    Twice(fn(&Session) -> Result<(), NotDetermined>),
    /// Like `Probe`, with instances for Model Exchange.
    Exchange(fn(&Session) -> Result<(), NotDetermined>),
    /// Like `Probe`, with instances for Scheduled Execution.
    Scheduled(fn(&Session) -> Result<(), NotDetermined>),
}

/// Checks that belong together.
pub struct Group {
    /// Name for `--only`.
    pub name: &'static str,
    /// Title in reports.
    pub title: &'static str,
    /// The checks, in the order of the report.
    pub checks: &'static [Check],
}

/// The result of a check, with evidence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "evidence", rename_all = "snake_case")]
pub enum Verdict {
    /// The requirement holds as far as it was tested.
    Pass(Vec<String>),
    /// The requirement is violated.
    Violated(Vec<String>),
    /// The requirement does not apply to this FMU, for this reason.
    NotApplicable(String),
    /// The check could not decide, for this reason.
    NotDetermined(String),
}

/// A verdict with details that only a probe can supply.
#[derive(Clone, Debug)]
pub(super) struct Conclusion {
    pub(super) verdict: Verdict,
    /// The level of the finding, if lower than the check's.
    pub(super) lower: Option<Level>,
    /// Confidence of the finding.
    pub(super) confidence: Confidence,
    /// A call crashed the process or did not return: an importer would have crashed or hung.
    pub(super) fatal: bool,
    /// The calls that led to the finding, with what they returned.
    pub(super) calls: Vec<String>,
    /// All of them, one by one, if scripts were requested.
    pub(super) script: Vec<String>,
}

impl From<Verdict> for Conclusion {
    fn from(verdict: Verdict) -> Self {
        Self {
            verdict,
            lower: None,
            confidence: Confidence::Certain,
            fatal: false,
            calls: Vec::new(),
            script: Vec::new(),
        }
    }
}

impl Verdict {
    /// A pass if the condition holds, otherwise a violation.
    pub(super) fn holds(holds: bool, finding: impl FnOnce() -> String) -> Self {
        if holds { Self::Pass(Vec::new()) } else { Self::Violated(vec![finding()]) }
    }

    /// A pass if there are no findings, otherwise a violation.
    pub(super) fn of(findings: Vec<String>) -> Self {
        if findings.is_empty() { Self::Pass(Vec::new()) } else { Self::Violated(findings) }
    }
}

/// A check and its verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Id of the check.
    pub id: &'static str,
    /// Name of its group.
    pub group: &'static str,
    /// What is required.
    pub requirement: &'static str,
    /// Where the standards say so.
    pub clause: &'static str,
    /// Level of the check for the standard of this FMU, or of the finding, if that is lower.
    pub level: Level,
    /// How sure it is.
    pub confidence: Confidence,
    /// A call of the FMU crashed the process or did not return.
    pub fatal: bool,
    /// Accepted by `--allow` or listed in the baseline: it does not count.
    pub known: bool,
    /// The calls of a probe that led to the finding, with what they returned; `--replay` repeats them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calls: Vec<String>,
    /// All calls up to the finding, for the script of the HTML page.
    #[serde(skip)]
    pub(super) script: Vec<String>,
    /// Result.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// Options of a check run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Ids of checks or names of groups; empty for all.
    pub only: Vec<String>,
    /// Time limit for one call of the binary; `None` for 10 s.
    pub patience: Option<Duration>,
    /// Time limit for everything; checks that have not run by then are not determined.
    pub timeout: Option<Duration>,
    /// Program with the hidden command `probe` that plays the guard ([`fmu_import::guard::serve`]); `None` for the running
    /// executable.
    pub program: Option<PathBuf>,
    /// Resource limits of a probe.
    pub allowance: Allowance,
    /// Whether each finding of the binary comes with all its calls, for [`report::Report::html`](crate::report::Report::html).
    pub scripts: bool,
}

impl Options {
    /// Deadline of the whole run if it begins now.
    pub(super) fn deadline(&self) -> Option<Instant> {
        Instant::now().checked_add(self.timeout?)
    }
}
