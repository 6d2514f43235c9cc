//! Inputs and outputs of the controller.

use crate::commission::{CommissionFault, CommissionState};
use crate::modes::ModeInputs;
use crate::start::StartState;
use crate::trip::Cause;
use drive_base::connection::{Commanded, Measured};
use drive_base::frame::{DqHat, Phases};
use drive_base::math::all_finite;
use serde::{Deserialize, Serialize};

/// Inputs, read at the sample instants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is a variable")]
pub struct ControllerInputs {
    /// Measured stator currents in A.
    pub i: Phases,
    /// Measured DC-link voltage in V, >= 0.
    pub u_dc: f64,
    /// Mechanical speed reference in rad/s.
    pub speed_ref: f64,
    /// Electrical angle of a sensor in rad.
    pub theta_meas: f64,
    /// Mechanical speed of a sensor in rad/s.
    pub speed_meas: f64,
    /// Torque reference in N.m, in torque mode.
    pub tau_ref: f64,
    /// The controller operates; false: it stays in its initial state and commands 0 V.
    pub enable: bool,
    /// Active short circuit: the controller stays in its initial state and short-circuits the machine.
    pub asc: bool,
    /// The sensor of the shaft works.
    pub sensor_valid: bool,
    /// The self-commissioning runs, unless `commission.mode` is Off.
    pub commission_start: bool,
    /// Brake, coast and the limits of the torque.
    pub modes: ModeInputs,
    /// Share of the full torque that a drive with a hot winding allows, 0..1; no variable of the controller.
    pub derating: f64,
}

impl ControllerInputs {
    /// Adopts the measurements of the sensors at the plant.
    #[inline]
    pub fn measure(&mut self, plant: Measured) {
        (self.i, self.theta_meas, self.speed_meas) = (plant.i, plant.theta_e, plant.speed);
    }

    /// Whether all values are finite.
    pub fn is_finite(&self) -> bool {
        let Self { i, u_dc, speed_ref, theta_meas, speed_meas, tau_ref, modes, .. } = self;
        let references = [*speed_ref, *tau_ref, modes.tau_max, modes.tau_min];
        all_finite([i.a, i.b, i.c, *u_dc, *theta_meas, *speed_meas]) && all_finite(references)
    }
}

impl Default for ControllerInputs {
    fn default() -> Self {
        Self {
            i: Phases::default(),
            u_dc: 325.0,
            speed_ref: 0.0,
            theta_meas: 0.0,
            speed_meas: 0.0,
            tau_ref: 0.0,
            enable: true,
            asc: false,
            sensor_valid: true,
            commission_start: false,
            modes: ModeInputs::default(),
            derating: 1.0,
        }
    }
}

/// Outputs: the results of sample k, visible from t_k + T_s on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "each is a variable")]
pub struct ControllerOutputs {
    /// Stator voltage references in V, inside the hexagon of u_dc.
    pub u: Phases,
    /// Estimated mechanical speed in rad/s.
    pub speed_est: f64,
    /// Estimated electrical angle in rad, in (-pi, pi], for the instant t_k + T_s.
    pub theta_est: f64,
    /// Stator current in the estimated rotor frame in A.
    pub i: DqParts,
    /// Its reference in A.
    pub i_ref: DqParts,
    /// Lock indicator: 0 if the estimate follows the rotor, 1 and above if it is lost.
    pub lock_lost: f64,
    /// Whether the controller operates.
    pub enabled: bool,
    /// Whether the inverter should short-circuit the machine.
    pub short_circuit: bool,
    /// What has tripped.
    pub tripped: Cause,
    /// The sensor of the shaft is lost: the fallback supplies angle and speed.
    pub sensor_lost: bool,
    /// Whether the hexagon of u_dc limited the voltage references.
    pub voltage_limited: bool,
    /// Whether a current or torque limit limited the current references.
    pub current_limited: bool,
    /// Maximum torque in N.m that the references may request.
    pub tau_max: f64,
    /// Minimum torque in N.m that the references may request.
    pub tau_min: f64,
    /// Voltage that the current loop requests, as a share of u_dc / sqrt(3).
    pub u_share: f64,
    /// Field weakening lowers the reference of i_d.
    pub weakens: bool,
    /// Resistance in Ohm that the estimator uses: adapted, or the controller's estimate.
    pub R_s_est: f64,
    /// State of the self-commissioning.
    pub commission_state: CommissionState,
    /// Why the self-commissioning has stopped.
    pub commission_fault: CommissionFault,
    /// What the start does.
    pub start_state: StartState,
}

impl ControllerOutputs {
    /// What the plant receives.
    #[inline]
    pub fn commanded(&self) -> Commanded {
        Commanded { u: self.u, enable: self.enabled, asc: self.short_circuit }
    }

    /// Whether all values are finite.
    pub fn is_finite(&self) -> bool {
        // The limits of the torque are bounded, and the share of the voltage is finite with u.
        let Self { u, speed_est, theta_est, i, i_ref, lock_lost, .. } = self;
        all_finite([u.a, u.b, u.c, *speed_est, *theta_est, i.d, i.q, i_ref.d, i_ref.q, *lock_lost])
    }
}

/// The two components of a vector, as variables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DqParts {
    /// Component on the estimated d axis.
    pub d: f64,
    /// Component on the estimated q axis.
    pub q: f64,
}

impl From<DqHat> for DqParts {
    fn from(v: DqHat) -> Self {
        Self { d: v.d(), q: v.q() }
    }
}
