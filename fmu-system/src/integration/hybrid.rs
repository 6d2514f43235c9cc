//! The integrated system.

use fmu_import::{CompletedStep, Error, Update};

/// The reason why a trial evaluation has no result.
pub enum TrialError {
    /// The system cannot be computed at this point: a shorter step may succeed.
    Discard(Error),
    /// The run is over.
    Stop(Error),
}

impl TrialError {
    /// What it says.
    pub fn into_error(self) -> Error {
        match self {
            Self::Discard(error) | Self::Stop(error) => error,
        }
    }
}

/// Ordinary differential equations with events.
pub trait HybridSystem {
    /// Nominal values of the states, one for each.
    fn nominals(&self) -> &[f64];

    /// The part whose next event is at or before the time `t` (s), for messages.
    fn name(&self, t: f64) -> String;

    /// Number of event indicators.
    fn indicator_count(&self) -> usize;

    /// Derivatives at a time (s) and a state.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), TrialError>;

    /// Event indicators: a change between positive and not positive is a state event.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<(), TrialError>;

    /// A step ended here: returns whether there is a step event.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn completed_step(&mut self, t: f64, x: &[f64]) -> Result<CompletedStep, Error>;

    /// Handles an event; changes states that jump. The next event time in the result is absolute.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn event(&mut self, t: f64, x: &mut [f64]) -> Result<Update, Error>;

    /// At the time `t` (s), stability limits the steps to `h` (s): [`advice`](super::advice). Called once in a run.
    fn limited(&mut self, _t: f64, _h: f64) {}
}
