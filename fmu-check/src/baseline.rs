//! The baseline: known findings of a project, so that its CI fails only on new ones.
//!
//! ```toml
//! ["Pump, FMI 2.0"]
//! must = ["S02a"]
//! hard = ["G01b", "L08n"]
//! ```

use crate::error::Error;
use crate::level::Level;
use crate::report::{Report, level};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// The known findings of each model and standard.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
pub struct Baseline(BTreeMap<String, Known>);

/// Ids of the violated checks, by level.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Known {
    must: Vec<String>,
    should: Vec<String>,
    hard: Vec<String>,
}

impl Known {
    fn of(&self, level: Level) -> &[String] {
        match level {
            Level::Must => &self.must,
            Level::Should => &self.should,
            Level::Hard => &self.hard,
        }
    }
}

const LEVELS: [Level; 3] = [Level::Must, Level::Should, Level::Hard];

fn key(report: &Report) -> String {
    format!("{}, FMI {}", report.model.as_deref().unwrap_or("?"), report.fmi_version)
}

impl Baseline {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read or is not a baseline.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error(format!("{}: {e}", path.display())))?;
        toml::from_str(&text).map_err(|e| Error(format!("{}: {e}", path.display())))
    }

    /// Marks what is known. A finding that is more binding than it was is new.
    pub fn apply(&self, report: &mut Report) {
        let Some(known) = self.0.get(&key(report)) else { return };
        for finding in &mut report.findings {
            let levels = LEVELS.iter().filter(|l| **l <= finding.level);
            finding.known |= levels.flat_map(|l| known.of(*l)).any(|id| id == finding.id);
        }
    }

    /// Known findings that no longer occur.
    pub fn fixed(&self, report: &Report) -> Vec<String> {
        let found: Vec<_> = report.violated().map(|f| f.id).collect();
        let ran = |id: &str| report.finding(id).is_some();
        let Some(known) = self.0.get(&key(report)) else { return Vec::new() };
        let ids = LEVELS.iter().flat_map(|l| known.of(*l));
        ids.filter(|id| ran(id) && !found.contains(&id.as_str())).cloned().collect()
    }

    /// The text of a baseline with all findings of these reports.
    pub fn text(reports: &[Report]) -> String {
        let mut out = String::from(
            "# What `fmu check --baseline` knows: it fails on other findings. --write-baseline writes it.\n",
        );
        let mut of_model: BTreeMap<String, Vec<&Report>> = BTreeMap::new();
        for report in reports {
            of_model.entry(key(report)).or_default().push(report);
        }
        for (key, reports) in of_model {
            let _ = writeln!(out, "\n[{}]", serde_json::Value::from(key));
            for l in LEVELS {
                let mut ids: Vec<_> =
                    reports.iter().flat_map(|r| r.violated()).filter(|f| f.level == l).map(|f| f.id).collect();
                ids.dedup();
                if !ids.is_empty() {
                    let _ = writeln!(out, "{} = {}", level(l), serde_json::Value::from(ids));
                }
            }
        }
        out
    }
}
