//! The comparison: runs every estimator through every scenario on all cores, with the native models, then measures, checks
//! and plots the results.
//!
//! - [`candidate`]: an estimator with the drive it is compared on; [`scenario`]: the test it runs through;
//! - [`running`]: the courses of a running drive; [`measure`]: the numbers measured in a run; [`figures`]: the figures that the review's list expects;
//! - [`table`], [`html`], [`plots`]: the output for an engineer.

pub mod candidate;
pub mod figures;
pub mod html;
pub mod measure;
mod parameters;
pub mod plots;
pub mod running;
pub mod scenario;
mod signal;
pub mod table;
mod weakening;

use crate::output::Folder;
use crate::queue;
use anyhow::Result;
use candidate::{Candidate, Entry};
use measure::{Measure, Trace};
use plots::Plot;
use scenario::{Effort, SCENARIOS, Scenario};
use std::path::Path;

/// The result of one estimator in one scenario.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// Numbers, and the run over time if it is worth a plot.
    Measured(Vec<Measure>, Option<Trace>),
    /// Why the scenario does not apply to this estimator.
    NotApplicable(&'static str),
    /// The drive could not be started: the message about inconsistent parameters.
    Refused(String),
}

/// One estimator in one scenario, with the result.
#[derive(Clone, Debug)]
pub struct Run {
    /// The row.
    pub entry: Entry,
    /// The scenario.
    pub scenario: &'static Scenario,
    /// The result.
    pub outcome: Outcome,
}

impl Run {
    /// The numbers; none where the scenario does not apply.
    pub fn measures(&self) -> &[Measure] {
        match &self.outcome {
            Outcome::Measured(measures, _) => measures,
            _ => &[],
        }
    }

    /// The run over time.
    pub fn trace(&self) -> Option<&Trace> {
        match &self.outcome {
            Outcome::Measured(_, trace) => trace.as_ref(),
            _ => None,
        }
    }

    /// The numbers that differ from their expected values.
    pub fn outside(&self) -> impl Iterator<Item = &Measure> {
        self.measures().iter().filter(|m| m.expected.is_some_and(|e| !e.holds(m.value)))
    }

    /// Whether every number is as expected.
    pub fn holds(&self) -> bool {
        !matches!(self.outcome, Outcome::Refused(_)) && self.outside().next().is_none()
    }
}

/// Which estimators run through which scenarios, and how thoroughly.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The estimators, the rows.
    pub entries: Vec<Entry>,
    /// The scenarios, the columns.
    pub scenarios: Vec<&'static Scenario>,
    /// How thoroughly.
    pub effort: Effort,
}

impl Selection {
    /// Every estimator in every scenario.
    pub fn all(effort: Effort) -> Self {
        Self { entries: Entry::all(), scenarios: SCENARIOS.iter().collect(), effort }
    }
}

/// Runs the selection on all cores and calls `done` after each run.
pub fn run(selection: &Selection, done: impl Fn() + Sync) -> Vec<Run> {
    let Selection { entries, scenarios, effort } = selection;
    let jobs: Vec<_> = entries.iter().flat_map(|&entry| scenarios.iter().map(move |&s| (entry, s))).collect();
    queue::map(&jobs, |&(entry, scenario)| {
        let candidate = Candidate::new(entry);
        let mut outcome = match (scenario.run)(&candidate, *effort) {
            Ok(outcome) => outcome,
            Err(fault) => Outcome::Refused(fault.message().into()),
        };
        if let Outcome::Measured(measures, _) = &mut outcome {
            for m in measures {
                m.expected = figures::of(entry.name, scenario.id, m.name);
            }
        }
        done();
        Run { entry, scenario, outcome }
    })
}

/// Writes table, CSV, plots and page to `out`.
///
/// # Errors
/// A file cannot be written.
pub fn write(cells: &[Run], out: &Path) -> Result<()> {
    let out = Folder::create(out)?;
    let plots = plots::all(cells);
    for Plot { name, figure } in &plots {
        out.write(&format!("{name}.svg"), &fmu_plot::svg::draw(figure)?)?;
    }
    out.write("compare.csv", &table::csv(cells))?;
    out.write("compare.txt", &table::text(cells))?;
    out.write("compare.md", &table::markdown(cells))?;
    out.write("compare.html", &html::page(cells, &plots)?)
}
