//! What calls take and how they end, in the words of the facade.

use super::value::Values;
use crate::abi::log::Status;
use model_description::BaseType;

/// A call that did not succeed.
pub(super) enum Refusal {
    /// The FMU returned something else than OK or a warning.
    Status(&'static str, Status),
    /// The FMU returned no instance.
    Null(&'static str),
    /// The call could not be made.
    Impossible(String),
}

/// Result of a call.
pub(super) type Outcome<T = ()> = Result<T, Refusal>;

/// Judges a status: a warning is a success.
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

/// What an instance is made for.
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

/// Which partial derivatives: value references and the seed.
#[derive(Clone, Copy)]
pub(super) struct Directions<'a> {
    pub(super) unknowns: &'a [u32],
    pub(super) knowns: &'a [u32],
    pub(super) seed: &'a [f64],
}

/// Refuses arrays that do not have one element each.
pub(super) fn same_length(what: &str, lengths: &[usize]) -> Outcome {
    if lengths.windows(2).all(|pair| pair[0] == pair[1]) {
        return Ok(());
    }
    let found = lengths.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    Err(Refusal::Impossible(format!("{what} must have as many elements, and have {found}")))
}

/// A value that does not fit the type that crosses the interface.
pub(super) fn misfit(base: BaseType, values: &Values) -> Refusal {
    Refusal::Impossible(format!("{values} is not a value of the type {base}"))
}
