//! Whether a co-simulation FMU keeps to FMI 2.0 or FMI 3.0, whoever made it.
//!
//! The checks are data ([`GROUPS`]): an id, one sentence, the clause, how binding it is in either standard, and the function
//! that looks. Checks of the file run here; those of the binary each run in a process of their own ([`probe`]), so that a
//! crash or a hang is a verdict. Nothing here believes what `fmu build` does.

#![forbid(unsafe_code)]
#![allow(clippy::unnecessary_wraps, reason = "all probes have one signature")]

mod access;
mod archive;
mod bench;
mod binary;
mod clocked;
pub mod command;
mod dependencies;
mod derivatives;
mod host;
mod instances;
mod it;
mod layered;
mod lifecycle;
mod logging;
pub mod probe;
pub mod report;
mod rules;
mod schema;
mod state;
mod structure;
mod subject;
mod table;
mod terminals;
mod time;
mod units;
mod values;
mod variables;
mod xml;
mod zip;

use bench::{Bench, Blocked};
use model_description::FmiVersion;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
pub use subject::{Subject, Unusable};

/// How binding a requirement is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// The standard demands it.
    Must,
    /// The standard, or its guides, recommend it.
    Should,
    /// The standard leaves it open; a robust FMU does it.
    Hard,
}

/// How binding in FMI 2.0 and in FMI 3.0; `None` where there is no such requirement.
#[derive(Clone, Copy, Debug)]
pub struct Levels(Option<Level>, Option<Level>);

impl Levels {
    const MUST: Self = Self::both(Level::Must);
    const SHOULD: Self = Self::both(Level::Should);
    const HARD: Self = Self::both(Level::Hard);

    const fn both(level: Level) -> Self {
        Self(Some(level), Some(level))
    }

    /// That of one standard.
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
    /// What is required, in one sentence.
    pub requirement: &'static str,
    /// Where the standards say so.
    pub clause: &'static str,
    /// How binding it is.
    pub levels: Levels,
    run: Run,
}

/// Who looks.
#[derive(Clone, Copy)]
enum Run {
    /// Looks at the file.
    File(fn(&Subject) -> Verdict),
    /// Calls the binary, in a process of its own.
    Probe(fn(&Bench) -> Result<(), Blocked>),
    /// The same, and what the process writes to the console or into its folder is a violation.
    Silent(fn(&Bench) -> Result<(), Blocked>),
    /// The same in two processes, which must tell the same.
    Twice(fn(&Bench) -> Result<(), Blocked>),
}

/// Checks that belong together.
pub struct Group {
    /// Short name, for `--only`.
    pub name: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// Its checks.
    pub checks: &'static [Check],
}

/// Every check.
pub const GROUPS: &[Group] = &[
    Group { name: "archive", title: "The archive", checks: archive::CHECKS },
    Group { name: "xml", title: "modelDescription.xml", checks: xml::CHECKS },
    Group { name: "variables", title: "Variables, types and units", checks: variables::CHECKS },
    Group { name: "structure", title: "Model structure", checks: structure::CHECKS },
    Group { name: "terminals", title: "Terminals and icons", checks: terminals::CHECKS },
    Group { name: "binary", title: "The binary", checks: binary::CHECKS },
    Group { name: "lifecycle", title: "Life cycle", checks: lifecycle::CHECKS },
    Group { name: "access", title: "Getting and setting", checks: access::CHECKS },
    Group { name: "time", title: "Steps and time", checks: time::CHECKS },
    Group { name: "state", title: "FMU state", checks: state::CHECKS },
    Group { name: "logging", title: "Logging", checks: logging::CHECKS },
    Group { name: "instances", title: "Instances, threads, loading", checks: instances::CHECKS },
    Group { name: "host", title: "A guest in the importer's process", checks: host::CHECKS },
];

/// What came out of a check, with what was seen.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "verdict", content = "evidence", rename_all = "snake_case")]
pub enum Verdict {
    /// The requirement holds, as far as was looked.
    Pass(Vec<String>),
    /// It does not.
    Violated(Vec<String>),
    /// It is not about this FMU; the reason.
    NotApplicable(String),
    /// It could not be found out; the reason.
    NotDetermined(String),
}

impl Verdict {
    /// A pass, or a violation for every finding.
    fn of(findings: Vec<String>) -> Self {
        if findings.is_empty() { Self::Pass(Vec::new()) } else { Self::Violated(findings) }
    }
}

/// A check and its verdict.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// Of the check.
    pub id: &'static str,
    /// Name of its group.
    pub group: &'static str,
    /// What is required.
    pub requirement: &'static str,
    /// Where the standards say so.
    pub clause: &'static str,
    /// How binding it is for this FMU.
    pub level: Level,
    /// What came out.
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// What is to be checked, and how.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Ids or names of groups; empty for all.
    pub only: Vec<String>,
    /// Time that one probe of the binary may take; `None` for the default.
    pub patience: Option<Duration>,
    /// The program that has the hidden command `probe`; `None` for the running one.
    pub program: Option<PathBuf>,
}

/// Checks a file.
///
/// # Errors
/// It cannot be read, or is no FMU of FMI 2.0 or 3.0 at all.
pub fn run(path: &Path, options: &Options) -> Result<report::Report, Unusable> {
    let subject = Subject::open(path)?;
    let version = subject.version;
    let wanted = |group: &Group, check: &Check| {
        let named = |name: &String| name.eq_ignore_ascii_case(check.id) || name.eq_ignore_ascii_case(group.name);
        options.only.is_empty() || options.only.iter().any(named)
    };
    let all = GROUPS.iter().flat_map(|group| group.checks.iter().map(move |check| (group, check)));
    let chosen: Vec<_> = all
        .filter(|(group, check)| wanted(group, check))
        .filter_map(|(group, check)| check.levels.of(version).map(|level| (group, check, level)))
        .collect();
    let verdicts = probe::run_all(&subject, &chosen.iter().map(|(_, check, _)| *check).collect::<Vec<_>>(), options);
    let findings = chosen.iter().zip(verdicts).map(|((group, check, level), verdict)| Finding {
        id: check.id,
        group: group.name,
        requirement: check.requirement,
        clause: check.clause,
        level: *level,
        verdict,
    });
    Ok(report::Report::new(&subject, findings.collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_unique_and_every_check_is_told() {
        let checks: Vec<&Check> = GROUPS.iter().flat_map(|g| g.checks).collect();
        for (i, check) in checks.iter().enumerate() {
            assert!(checks[..i].iter().all(|c| c.id != check.id), "{} twice", check.id);
            assert!(check.requirement.ends_with('.'), "{}", check.id);
            assert!(!check.clause.is_empty() && (check.levels.0.is_some() || check.levels.1.is_some()), "{}", check.id);
        }
    }
}
