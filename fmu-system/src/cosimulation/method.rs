//! How to run the FMUs of a system.

use crate::integration::Solver;
use fmu_import::{Error, Fmu, Kind};
use model_description::{FmiVersion, Interface};

/// How to run the FMUs of a system.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// Co-Simulation: the FMUs step themselves.
    CoSimulation {
        /// FMUs that have event mode use it: their events are handled at their time, between steps.
        event_mode: bool,
        /// FMUs may return early from a step.
        early_return: bool,
    },
    /// Model Exchange: the master integrates all FMUs together.
    ModelExchange(Integration),
}

impl Default for Method {
    /// Co-Simulation without event mode and early return.
    fn default() -> Self {
        Self::CoSimulation { event_mode: false, early_return: false }
    }
}

/// Settings of Model Exchange. The settings after the solver are for testing FMUs: with correct FMUs, they change results only
/// within the solver's tolerance.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Integration {
    /// How states are integrated.
    pub solver: Solver,
    /// Names of FMUs that still step themselves (Co-Simulation), from communication point to communication point.
    pub stepping: Vec<String>,
    /// At an event, the FMUs are updated from the last one added to the first.
    pub reversed: bool,
    /// Event mode is entered this time (s) after the time event of an FMU.
    pub late: f64,
    /// Times (s) of additional events that no FMU requests, in ascending order.
    pub extra_events: Vec<f64>,
}

impl Method {
    /// The interface for an instance of this FMU.
    pub(super) fn kind(&self, name: &str, fmu: &Fmu) -> Kind {
        let description = fmu.description();
        let can = |flag: fn(&Interface) -> bool| {
            description.version == FmiVersion::V3 && description.co_simulation.as_ref().is_some_and(flag)
        };
        match self {
            Self::ModelExchange(integration) if integration.stepping.iter().any(|other| other == name) => {
                Kind::default()
            }
            Self::ModelExchange(_) => Kind::ModelExchange,
            Self::CoSimulation { event_mode, early_return } => Kind::CoSimulation {
                event_mode: *event_mode && can(Interface::has_event_mode),
                early_return: *early_return && can(Interface::may_return_early),
            },
        }
    }

    /// Refuses a method that no instance supports, and invalid settings.
    pub(super) fn check(&self, kinds: &[Kind], sequential: bool) -> Result<(), Error> {
        let refused = |setting: &str, cause: &str| Err(Error::usage(setting, cause));
        let wrong = |cause: String| Err(Error::usage("settings", cause));
        let any = |used: fn(&Kind) -> bool| kinds.iter().any(used);
        match self {
            Self::CoSimulation { event_mode: false, early_return: false } => return Ok(()),
            Self::CoSimulation { event_mode, early_return } => {
                if *event_mode && !any(|k| matches!(k, Kind::CoSimulation { event_mode: true, .. })) {
                    return refused("event_mode", "no FMU has event mode (hasEventMode, FMI 3.0 Co-Simulation)");
                }
                if *early_return && !any(|k| matches!(k, Kind::CoSimulation { early_return: true, .. })) {
                    return refused(
                        "early_return",
                        "no FMU returns early (mightReturnEarlyFromDoStep, FMI 3.0 Co-Simulation)",
                    );
                }
            }
            Self::ModelExchange(integration) => {
                if let Solver::Dopri { rtol } = integration.solver
                    && !(1e-14..=0.1).contains(&rtol)
                {
                    return wrong(format!("the relative tolerance {rtol} must be between 1e-14 and 0.1"));
                }
                if !(integration.late >= 0.0 && integration.late.is_finite()) {
                    return wrong(format!("events cannot be late by {} s", integration.late));
                }
            }
        }
        if sequential {
            return wrong("FMUs are stepped one after the other only in plain Co-Simulation".into());
        }
        Ok(())
    }
}
