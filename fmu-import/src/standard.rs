//! Arguments and results of calls, in the terms of the facade.

use crate::abi::log::Status;
use crate::error::Error;
use crate::value::Values;
use model_description::BaseType;

/// A call that did not succeed.
pub(super) enum Refusal {
    /// The FMU returned a status other than OK or Warning.
    Status(&'static str, Status),
    /// The FMU returned no instance.
    Null(&'static str),
    /// The call could not be made.
    Impossible(String),
}

/// Result of a call.
pub(super) type Outcome<T = ()> = Result<T, Refusal>;

/// Converts a status: a warning is a success.
#[inline]
pub(super) fn judge(function: &'static str, status: Status) -> Outcome {
    if status.is_ok() { Ok(()) } else { Err(Refusal::Status(function, status)) }
}

/// The times of an experiment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Experiment {
    pub(super) start: f64,
    pub(super) stop: Option<f64>,
    pub(super) tolerance: Option<f64>,
}

/// The interface of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Steps, which the FMU computes.
    CoSimulation {
        /// Events are handled in event mode, outside of steps (FMI 3.0 only).
        event_mode: bool,
        /// `DoStep` may return before the end of the step (FMI 3.0 only).
        early_return: bool,
    },
    /// States, derivatives and events, for an integrator of the importer.
    ModelExchange,
}

impl Default for Kind {
    /// Co-Simulation without event mode and early return.
    fn default() -> Self {
        Self::CoSimulation { event_mode: false, early_return: false }
    }
}

/// Selection of partial derivatives: value references and the seed.
#[derive(Clone, Copy)]
pub(super) struct Directions<'a> {
    pub(super) unknowns: &'a [u32],
    pub(super) knowns: &'a [u32],
    pub(super) seed: &'a [f64],
}

/// What `DoStep` returned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepped {
    /// The FMU requests the end of the simulation.
    pub terminate: bool,
    /// The FMU must enter event mode before the next step (FMI 3.0 only).
    pub event: bool,
    /// The step ended before its end (FMI 3.0 only).
    pub early: bool,
    /// Time (s) that the step reached.
    pub last: f64,
}

/// Result of an update of the discrete states.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "the results of the standards")]
pub struct Update {
    /// The FMU needs another update.
    pub again: bool,
    /// The FMU requests the end of the simulation.
    pub terminate: bool,
    /// Nominal values of states have changed.
    pub nominals_changed: bool,
    /// States have jumped.
    pub states_changed: bool,
    /// Time (s) of the next time event, if one is known. Every update determines it anew.
    pub next_event_time: Option<f64>,
}

/// Result of a completed integrator step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompletedStep {
    /// There is a step event.
    pub enter_event_mode: bool,
    /// The FMU requests the end of the simulation.
    pub terminate: bool,
}

/// Refuses arrays of different lengths.
pub(super) fn same_length(what: &str, lengths: &[usize]) -> Outcome {
    if lengths.windows(2).all(|pair| pair[0] == pair[1]) {
        return Ok(());
    }
    let found = lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    Err(Refusal::Impossible(format!("{what} must have as many elements, and have {found}")))
}

/// A value that does not fit the type of the interface.
pub(super) fn misfit(base: BaseType, values: &Values) -> Refusal {
    Refusal::Impossible(format!("{values} is not a value of the type {base}"))
}

/// Combines a refusal and the FMU's log message into an error.
pub(super) fn explain(instance: &str, refusal: Refusal, message: Option<String>) -> Error {
    let instance = instance.to_owned();
    match refusal {
        Refusal::Status(function, status) => Error::call(instance, function, status.to_string(), message),
        Refusal::Null(function) => Error::call(instance, function, "no instance".into(), message),
        Refusal::Impossible(cause) => Error::Usage { instance, cause },
    }
}
