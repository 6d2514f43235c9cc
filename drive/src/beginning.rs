//! The beginning in a steady state: `initial.steady`.
//!
//! A drive begins at rest, or at `plant.initial.speed` without current: a system model then begins with a transient. With
//! `initial.steady`, it begins at that speed (with `mechanics.imposed` at `speed_shaft`) with the torque of `tau_load`, in torque mode
//! with `tau_ref`: the current, both loops, the estimator, the voltage of the link and, with `Thermal`, the temperatures have their
//! steady values.
//!
//! `PmsmDriveMean` computes them; for `PmsmDrive` see [`begin`](crate::pmsm_drive).

use crate::steady::{At, Condition, Point, Steady};
use drive_plant::thermal::{Temperatures, ThermalMode};
use fmu_core::{Fault, Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};

enumeration! {
    /// The state in which a drive begins; values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum Beginning("Beginning", "State in which the drive begins") {
        #[default]
        1 Off "Without current, at the other initial values, with the start of the controller";
        2 Electrical "In the steady state of speed and torque, at the temperature thermal.T_start";
        3 Thermal "In the steady state of speed and torque with its temperatures";
    }
}

/// Parameters of the beginning.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BeginningParameters {
    /// The state.
    pub steady: Beginning,
}

type P = Row<BeginningParameters>;

/// Variables of the beginning.
pub const BEGINNING: &Table<BeginningParameters> = table![P::enumeration_parameter(
    "initial.steady",
    "The drive begins at plant.initial.speed, or with mechanics.imposed at speed_shaft, in the steady state with the torque of tau_load at \
     the start, in torque mode of tau_ref",
    &Field(|p| &mut p.steady),
)];

/// The operating point of a beginning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Operating {
    /// Mechanical speed in rad/s.
    pub(crate) speed: f64,
    /// Voltage in V of the link.
    pub(crate) u_dc: f64,
    /// Torque in N.m: at the shaft, or in torque mode the reference.
    pub(crate) tau: f64,
    /// Temperature of the coolant in K.
    pub(crate) coolant: f64,
}

impl Beginning {
    /// Temperatures (K) and the point at which this `drive` begins; `given` are the temperatures that no network supplies.
    ///
    /// # Errors
    /// The drive does not give this torque, or has no steady temperatures.
    pub(crate) fn point(
        self,
        drive: &Steady,
        at: Operating,
        given: Temperatures,
    ) -> Result<(Temperatures, Point), Fault> {
        let Operating { speed, u_dc, tau, coolant } = at;
        let by_reference = drive.controller.speed_loop.torque_mode;
        let find = |at: &At<'_>| if by_reference { Some(at.by_reference(tau)) } else { at.by_shaft(tau) };
        let condition = Condition { speed, u_dc, temperatures: given };
        if self == Self::Thermal {
            if drive.plant.thermal.mode != ThermalMode::Network {
                return Err(Fault::new("initial.steady = 3 (Thermal) needs plant.thermal.mode = 2 (Network)"));
            }
            if let Some(found) = drive.warmed(speed, u_dc, coolant, find) {
                return Ok(found);
            }
        } else if let Some(point) = find(&drive.at(&condition)) {
            return Ok((given, point));
        }
        let [low, high] = drive.at(&condition).ends().map(|end| end.powers.tau_shaft);
        Err(Fault::new(if tau >= low && tau <= high {
            format!(
                "initial.steady = 3 (Thermal): with {tau} N.m at {speed} rad/s, the winding or the magnet has no steady temperature"
            )
        } else {
            format!(
                "initial.steady: at {speed} rad/s and u_dc = {u_dc} V, the drive gives {low} to {high} N.m, not tau_load = {tau} N.m"
            )
        }))
    }
}
