//! The drive: its parameters, its state and its outputs.

use super::map::Map;
use crate::happened::Happened;
use crate::speed_watch::SpeedWatch;
use drive_control::speed::SpeedLoop;
use drive_plant::power::Energy;
use serde::{Deserialize, Serialize};

/// A drive given by tables.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct MappedDrive {
    /// Inputs, constant over a communication step.
    pub inputs: MappedInputs,
    /// The tables.
    pub map: Map,
    /// The shaft.
    pub shaft: MappedShaft,
    /// 1/t_lag in rad/s.
    pub bandwidth: f64,
    /// The speed loop.
    pub speed_loop: SpeedLoop,
    pub(super) state: State,
    /// Energies in J.
    pub(super) energy: Energy,
    /// Powers and torque at the end of the last step.
    pub(super) last: Last,
    /// Whether it has operated.
    pub(super) active: bool,
    /// The first step, after which the tables are checked.
    pub(super) first: Happened,
    pub(super) overspeed: Happened,
    pub(super) off_voltage: Happened,
    pub(super) far_voltage: Happened,
    /// Time in s for which the torque reference has exceeded its limits.
    pub(super) clipped_for: f64,
    /// Whether the speed comes to its reference.
    pub(super) watch: SpeedWatch,
}

/// Inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MappedInputs {
    /// Mechanical speed reference in rad/s.
    pub speed_ref: f64,
    /// Torque reference in N.m at the shaft, in torque mode.
    pub tau_ref: f64,
    /// The drive operates; false: the gates are off.
    pub enable: bool,
    /// DC-link voltage in V.
    pub u_dc: f64,
    /// Load torque in N.m.
    pub tau_load: f64,
    /// Imposed speed in rad/s and angle in rad of the shaft.
    pub speed_shaft: f64,
    /// Angle at the beginning of the communication step.
    pub angle_shaft: f64,
    /// Temperature of the coolant in K.
    pub T_coolant: f64,
}

/// The shaft.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MappedShaft {
    /// Moment of inertia in kg.m2.
    pub J: f64,
    /// The drive train imposes the speed.
    pub imposed: bool,
    /// Initial speed in rad/s.
    pub speed: f64,
}

impl Default for MappedDrive {
    fn default() -> Self {
        let map = Map::default();
        let inputs = MappedInputs {
            speed_ref: 0.0,
            tau_ref: 0.0,
            enable: true,
            u_dc: map.u_dc,
            tau_load: 0.0,
            speed_shaft: 0.0,
            angle_shaft: 0.0,
            T_coolant: 293.15,
        };
        Self {
            inputs,
            map,
            shaft: MappedShaft { J: 1.5e-3, imposed: false, speed: 0.0 },
            bandwidth: 500.0,
            speed_loop: SpeedLoop::default(),
            state: State::default(),
            energy: Energy::default(),
            last: Last::default(),
            active: false,
            first: Happened::default(),
            overspeed: Happened::default(),
            off_voltage: Happened::default(),
            far_voltage: Happened::default(),
            clipped_for: 0.0,
            watch: SpeedWatch::default(),
        }
    }
}

/// Quantities that take time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct State {
    /// Torque in N.m: x.
    pub(super) tau: f64,
    /// Integral part of the speed loop in N.m.
    pub(super) integral: f64,
    /// Speed reference on its ramp in rad/s.
    pub(super) speed_ref: f64,
    /// Mechanical speed in rad/s.
    pub(super) speed: f64,
    /// Mechanical angle in rad, not wrapped.
    pub(super) angle: f64,
    /// Overload: 1 is the limit.
    pub(super) overload: f64,
}

/// Powers in W and torque in N.m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Last {
    pub(super) p_in: f64,
    pub(super) p_mech: f64,
    pub(super) p_loss: f64,
    pub(super) tau_shaft: f64,
}

/// Outputs.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MappedOutputs {
    /// Mechanical speed in rad/s.
    pub speed: f64,
    /// Mechanical angle in rad.
    pub angle: f64,
    /// Torque of the shaft on the load in N.m.
    pub tau_shaft: f64,
    /// Current from the DC link in A.
    pub i_dc: f64,
    /// Power from the DC link in W.
    pub p_in: f64,
    /// Power to the load in W.
    pub p_mech: f64,
    /// Losses in W.
    pub p_loss: f64,
    /// Efficiency.
    pub efficiency: f64,
    /// Energies in J.
    pub energy: Energy,
    /// Heat to the coolant in W.
    pub Q_coolant: f64,
    /// Maximum torque in N.m.
    pub tau_max: f64,
    /// Minimum torque in N.m.
    pub tau_min: f64,
    /// Overload.
    pub overload: f64,
    /// The drive operates.
    pub enabled: bool,
}

impl MappedDrive {
    /// Mechanical speed (rad/s) in this state.
    pub(super) fn speed(&self, state: &State) -> f64 {
        if self.shaft.imposed { self.inputs.speed_shaft } else { state.speed }
    }

    /// Whether u_dc is one at which the drive operates.
    pub(super) fn has_voltage(&self) -> bool {
        let u_dc = self.inputs.u_dc;
        u_dc > 0.0 && (self.map.u_min..=self.map.u_max).contains(&u_dc)
    }

    /// Whether the drive operates.
    pub(super) fn is_active(&self) -> bool {
        self.inputs.enable && self.has_voltage()
    }
}
