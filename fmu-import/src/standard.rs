//! The interface that both standards implement for the facade.

use super::value::Values;
use crate::abi::log::Status;
use crate::abi::shared::SharedInstance;
use model_description::BaseType;
use std::ops::ControlFlow;

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

/// One instance, seen through either standard. Dropping it frees the instance.
pub(super) trait Standard {
    /// The calls that both standards share: end of initialization, terminate, reset, saved states.
    fn shared(&mut self) -> &mut SharedInstance;
    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome;
    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome;
    fn get(&mut self, base: BaseType, reference: u32, count: usize) -> Outcome<Values>;
    fn set(&mut self, base: BaseType, reference: u32, values: &Values) -> Outcome;
    fn set_debug_logging(&mut self, on: bool) -> Outcome;
    fn setup(&mut self, experiment: Experiment) -> Outcome;
    fn enter_initialization(&mut self) -> Outcome;
    /// Breaks when the FMU asks to end the simulation.
    fn do_step(&mut self, t: f64, h: f64) -> Outcome<ControlFlow<()>>;
    fn last_successful_time(&mut self) -> Outcome<f64>;
}

/// A value that does not fit the type that crosses the interface.
pub(super) fn misfit(base: BaseType, values: &Values) -> Refusal {
    Refusal::Impossible(format!("{values} is not a value of the type {base}"))
}

/// Integers of the width that crosses the interface.
pub(super) fn narrow<T: TryFrom<i128>>(base: BaseType, values: &[i128]) -> Outcome<Vec<T>> {
    let all: Result<Vec<T>, _> = values.iter().map(|&x| T::try_from(x)).collect();
    all.map_err(|_| misfit(base, &Values::Integers(values.to_vec())))
}
