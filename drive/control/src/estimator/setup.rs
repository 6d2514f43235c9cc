//! What an estimator may know of the controller around it, to check that it can work there.

use crate::estimator::{EstimatorParameters, Kind};
use drive_base::motor::Motor;
use fmu_core::Fault;
use std::fmt::Display;

/// The controller that an estimator is to work in.
#[derive(Clone, Copy)]
#[expect(clippy::struct_excessive_bools, reason = "settings of the controller, each on its own")]
pub struct Setup<'a> {
    /// The chosen estimator.
    pub kind: Kind,
    /// The estimators' parameters.
    pub par: &'a EstimatorParameters,
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Estimate of the inertia in kg.m2.
    pub J: f64,
    /// Sample period in s.
    pub T_s: f64,
    /// The current loop decouples with the references.
    pub reference_feed_forward: bool,
    /// The current loop has an active resistance.
    pub active_resistance: bool,
    /// The start finds the rotor by injection.
    pub starts_by_injection: bool,
    /// Field weakening is in use.
    pub weakens: bool,
    /// Name, value and unit of the controller's variable with this name.
    pub tell: &'a dyn Fn(&str) -> String,
}

impl Setup<'_> {
    /// Name, value and unit of the controller's variable `name`: for messages.
    pub fn tell(&self, name: &str) -> String {
        (self.tell)(name)
    }

    /// A fault of the variable `name`: its name, value and unit, and what is `allowed`.
    pub fn fault(&self, name: &str, allowed: impl Display) -> Fault {
        Fault::new(format!("{} is not allowed: {allowed}", self.tell(name)))
    }
}
