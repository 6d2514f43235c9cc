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
mod hybrid;
mod locate;
mod rk4;
mod steps;
#[cfg(test)]
mod tests;

pub use driver::{Driver, Solver, Stop};
pub use hybrid::{Hybrid, Trial};
