//! Temperatures and the values that follow from them and from the parameters, constant over a step.

use super::{T_20, Temperatures};
use crate::machine::Inverse;
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Temperatures, and the machine at them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Warm {
    /// In K.
    pub at: Temperatures,
    /// With the resistance and the permanent-magnet flux linkage at these temperatures.
    pub motor: Motor,
    /// Reciprocals of the inductances.
    pub(crate) inverse: Inverse,
    /// The smallest inductance in H, over all states of a map.
    pub(crate) least_inductance: f64,
    /// Whether the legs are ideal and the constant resistance of the winding is the only loss of the machine.
    pub(crate) ideal: bool,
}

impl Default for Warm {
    fn default() -> Self {
        let motor = Motor::default();
        let least_inductance = motor.L_d.min(motor.L_q);
        Self { at: Temperatures::all(T_20), inverse: Inverse::of(&motor), motor, least_inductance, ideal: false }
    }
}
