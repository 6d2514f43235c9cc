//! Estimators in scenarios, on all cores.

use super::candidate::{Candidate, Entry};
use super::figures;
use super::measure::{Effort, Measure, Outcome, Trace};
use super::scenario::{SCENARIOS, Scenario, ScenarioRun};
use drive_tools::queue;

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
    /// The numbers; empty if the scenario does not apply.
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

/// The estimators, the scenarios, and the effort of a comparison.
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
        let ScenarioRun::Review(run) = scenario.run else { unreachable!("a scenario of one machine") };
        let ran = run(&Candidate::new(entry), *effort);
        let mut outcome = ran.unwrap_or_else(|fault| Outcome::Refused(fault.message().into()));
        if let Outcome::Measured(measures, _) = &mut outcome {
            for m in measures {
                m.expected = figures::of(entry.name, scenario.id, m.name);
            }
        }
        done();
        Run { entry, scenario, outcome }
    })
}
