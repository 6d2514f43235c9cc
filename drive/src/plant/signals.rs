//! Inputs and outputs of the plant.

use crate::frame::Phases;
use crate::plant::power::{Energy, Powers};
use serde::{Deserialize, Serialize};

/// Inputs, held over a communication step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlantInputs {
    /// Stator voltage references in V, averages over a PWM period.
    pub u: Phases,
    /// DC-link voltage in V, >= 0.
    pub u_dc: f64,
    /// Load torque in N.m, positive against positive speed; ignored with an imposed speed.
    pub tau_load: f64,
    /// Imposed mechanical speed of the shaft in rad/s.
    pub speed_shaft: f64,
    /// Imposed mechanical angle of the shaft in rad, at the beginning of the step.
    pub angle_shaft: f64,
    /// Whether the gates switch; false: only the diodes conduct.
    pub enable: bool,
}

impl Default for PlantInputs {
    fn default() -> Self {
        let u = Phases::default();
        Self { u, u_dc: 325.0, tau_load: 0.0, speed_shaft: 0.0, angle_shaft: 0.0, enable: true }
    }
}

/// Outputs, at the end of a communication step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlantOutputs {
    /// Stator currents in A, positive into the machine.
    pub i: Phases,
    /// Mechanical speed in rad/s.
    pub speed: f64,
    /// Mechanical angle in rad, not wrapped.
    pub angle: f64,
    /// Electrical angle in rad, in (-pi, pi].
    pub theta_e: f64,
    /// Electromagnetic torque in N.m.
    pub tau_e: f64,
    /// d-axis stator current in A.
    pub i_d: f64,
    /// q-axis stator current in A.
    pub i_q: f64,
    /// Power between DC link, machine and shaft, mean over the last step.
    pub powers: Powers,
    /// Torque of the shaft on the load in N.m.
    pub tau_shaft: f64,
    /// Energy since the start.
    pub energy: Energy,
}
