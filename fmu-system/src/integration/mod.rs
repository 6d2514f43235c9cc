//! Integration of ordinary differential equations with events, for Model Exchange: numerics that know no FMU.
//!
//! [`Hybrid`] is what is integrated; [`Driver`] steps it and handles its events: it lands on time events exactly, locates state
//! events, which are changes of sign of indicators, and begins anew after each event. [`Solver`] selects how it steps:
//! `rk4` with a fixed step, or `dopri` with a step that its error estimate controls.
//!
//! The integrators are our own: event location needs their stages and interpolants, every trial step may be discarded by an FMU,
//! and together they are shorter than the adapters that a crate of integrators would need. Both are explicit: a stiff FMU runs
//! with many steps.

mod dopri;
mod driver;
mod locate;
mod rk4;
mod steps;
#[cfg(test)]
mod tests;

pub use driver::{Driver, Stop};

use fmu_import::{CompletedStep, Error, Update};

/// How states are integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// The classical Runge-Kutta method of order 4, with the communication step as its step; a step that an event, an input or
    /// a communication point cuts is shorter.
    Rk4,
    /// The method of Dormand and Prince of order 5, with an adaptive step.
    Dopri {
        /// Relative tolerance of a step; the absolute one is this times the nominal value of each state.
        rtol: f64,
    },
}

impl Default for Solver {
    /// Adaptive, with a relative tolerance of 1e-6.
    fn default() -> Self {
        Self::Dopri { rtol: 1e-6 }
    }
}

/// Why a trial evaluation has no result.
pub enum Trial {
    /// The point is outside of what the system can compute: a shorter step may succeed.
    Discard(Error),
    /// The run is over.
    Stop(Error),
}

impl Trial {
    /// What it says.
    pub fn into_error(self) -> Error {
        match self {
            Self::Discard(error) | Self::Stop(error) => error,
        }
    }
}

/// Ordinary differential equations with events.
pub trait Hybrid {
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
    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Trial>;

    /// Event indicators: a change between positive and not positive is a state event.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn indicators(&mut self, t: f64, x: &[f64], z: &mut [f64]) -> Result<(), Trial>;

    /// A step ended here: asks for a step event.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn completed_step(&mut self, t: f64, x: &[f64]) -> Result<CompletedStep, Error>;

    /// Handles an event; changes states that jump. The next event time in the result is absolute.
    ///
    /// # Errors
    /// The system cannot compute it.
    fn event(&mut self, t: f64, x: &mut [f64]) -> Result<Update, Error>;
}
