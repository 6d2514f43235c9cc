//! Torque at the air gap or at the shaft: the meaning of `tau_ref`, `tau_max` and `tau_min`.
//!
//! The controller's references and limits are torques of the air gap, by its estimates. The shaft gets less: friction, the share
//! of the torque that the iron takes, and the error of the estimates with a hot magnet or a saturated core. With `torque.at` =
//! Shaft the drive is calibrated: it converts both by its [steady state](crate::steady) at the present speed, DC-link voltage and
//! temperatures,
//!
//! ```text
//! reference of the controller = x with tau_shaft(x) = tau_ref,   tau_max = tau_shaft(tau_max of the controller), tau_min likewise
//! ```
//!
//! as a drive that was measured on a test bench does. The friction of the model is 0 at standstill and has the sign of the speed,
//! so the conversion is continuous through zero speed. What the steady state lacks stays: the error of an estimated angle, the
//! voltage lost in a dead time, and the delay of the current loop. A free shaft has this torque for its inertia and its load.

use crate::pair::Pair;
use crate::steady::{At, Condition, Steady};
use drive_control::modes::ModeInputs;
use drive_control::signals::ControllerOutputs;
use drive_control::tables::ControllerParameters;
use fmu_core::{Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};

enumeration! {
    /// Where the torques of the interface apply; values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum TorqueAt("TorqueAt", "Where tau_ref, tau_max and tau_min apply") {
        #[default]
        1 AirGap "The air gap, by the controller's estimates";
        2 Shaft "The shaft: friction, iron loss and the errors of the estimates are compensated";
    }
}

/// Parameters of the torques of the interface.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TorqueParameters {
    /// Where they apply.
    pub at: TorqueAt,
}

type P = Row<TorqueParameters>;

/// Variables of the torques of the interface.
pub const TORQUE: &Table<TorqueParameters> = table![P::enumeration_parameter(
    "torque.at",
    "Where tau_ref, tau_max and tau_min apply: AirGap, or Shaft, where the drive gives the torque that is asked for",
    &Field(|p| &mut p.at),
)];

impl At<'_> {
    /// Torque limits of the air gap in N.m, 0 or less and 0 or more, for limits at the shaft in N.m.
    pub(crate) fn references_for(&self, [low, high]: [f64; 2]) -> [f64; 2] {
        [self.reference_for(low).min(0.0), self.reference_for(high).max(0.0)]
    }

    /// Torques at the shaft in N.m for torque references at the air gap in N.m.
    pub(crate) fn at_shaft(&self, limits: [f64; 2]) -> [f64; 2] {
        limits.map(|tau| self.by_reference(tau).powers.tau_shaft)
    }
}

/// The conversion in a drive with samples.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Calibration {
    drive: Steady,
    /// Minimum and maximum torque at the shaft in N.m, by the controller's last outputs.
    pub(crate) limits: [f64; 2],
}

impl Calibration {
    /// For these parameters of plant and controller, with the `limits` (N.m) until now.
    pub(crate) fn new(drive: Steady, limits: [f64; 2]) -> Self {
        Self { drive: drive.sampled(), limits }
    }

    /// Sets the controller's reference and limits for the torque `tau_ref` (N.m) and the limits at the shaft.
    #[inline(never)]
    pub(crate) fn ask(&self, pair: &mut Pair, (tau_ref, limits): (f64, ModeInputs)) {
        let ControllerParameters { speed_loop, modes, .. } = &self.drive.controller;
        if speed_loop.torque_mode {
            pair.controller.model.inputs.tau_ref = self.drive.at(&condition(pair)).reference_for(tau_ref);
        }
        if modes.tau_used {
            let ModeInputs { tau_max, tau_min, .. } = limits;
            let [low, high] = self.drive.at(&condition(pair)).references_for([tau_min, tau_max]);
            let limits = &mut pair.controller.model.inputs.modes;
            (limits.tau_min, limits.tau_max) = (low, high);
        }
    }

    /// Takes over the controller's limits; a controller at rest has none.
    #[inline(never)]
    pub(crate) fn take(&mut self, pair: &Pair) {
        let ControllerOutputs { tau_min, tau_max, .. } = *pair.controller.model.shown();
        let limits = [tau_min, tau_max];
        self.limits = if limits.iter().all(|&limit| limit == 0.0) {
            limits
        } else {
            self.drive.at(&condition(pair)).at_shaft(limits)
        };
    }
}

/// Speed, voltage and temperatures of the drive now.
fn condition(pair: &Pair) -> Condition {
    let plant = &pair.plant.model;
    let temperatures = plant.temperatures(&plant.inputs);
    Condition { speed: plant.measured().speed, u_dc: plant.inputs.u_dc, temperatures }
}
