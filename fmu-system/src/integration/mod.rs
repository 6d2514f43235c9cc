//! Integration of ordinary differential equations with events, for Model Exchange: numerics independent of FMUs.
//!
//! [`HybridSystem`] is the integrated system; [`Driver`] steps it and handles its events: it hits time events exactly, locates state
//! events, which are changes of sign of indicators, and restarts after each event. [`Solver`] selects the method: `rk4` with a
//! fixed step, or `dopri` with a step controlled by its error estimate.
//!
//! The integrators are our own: event location needs their stages and interpolants, every trial step may be discarded by an FMU,
//! and together they are shorter than the adapters that a crate of integrators would need. Both are explicit: a stiff FMU runs
//! with many steps, which [`HybridSystem::limited`] is notified of.

mod dopri;
mod driver;
mod hybrid;
mod locate;
mod rk4;
mod stability;
mod steps;
#[cfg(test)]
mod tests;

pub use driver::{Driver, Solver, StopReason};
pub use hybrid::{HybridSystem, TrialError};
pub use stability::advice;
