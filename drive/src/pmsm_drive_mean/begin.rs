//! How `PmsmDriveMean` begins in a steady state ([`beginning`](crate::beginning)): by algebra.

use super::PmsmDriveMean;
use crate::beginning::{Beginning, Operating};
use crate::steady::{Condition, Point};
use drive_plant::thermal::{Temperatures, ThermalMode};
use fmu_core::Fault;

/// Maximum number of rounds for the voltage of the link, and the relative change at which they end.
const ROUNDS: u32 = 20;
const SMALL: f64 = 1e-12;

impl PmsmDriveMean {
    /// Whether it begins in a steady state.
    fn begins_steadily(&self) -> bool {
        self.beginning.steady != Beginning::Off && self.inputs.enable && !self.inputs.asc
    }

    /// Temperatures (K) and the point of its beginning, unless it begins as the other initial values say.
    ///
    /// # Errors
    /// Those of [`Beginning::point`].
    fn beginning(&self) -> Result<Option<(Temperatures, Point)>, Fault> {
        if !self.begins_steadily() {
            return Ok(None);
        }
        let (plant, controller) = (&self.drive.plant, &self.drive.controller);
        let speed = if plant.mechanics.imposed { self.inputs.speed_shaft } else { plant.initial.speed };
        let given = match plant.thermal.mode {
            ThermalMode::Imposed => self.inputs.thermal.imposed,
            _ => self.drive.start_temperatures(),
        };
        let mut u_dc = self.inputs.u_dc;
        for _ in 0..ROUNDS {
            let tau = if controller.speed_loop.torque_mode {
                self.reference(&self.drive.at(&Condition { speed, u_dc, temperatures: given }))
            } else {
                self.inputs.tau_load
            };
            let at = Operating { speed, u_dc, tau, coolant: self.inputs.thermal.coolant };
            let found = self.beginning.steady.point(&self.drive, at, given)?;
            let next = self.voltage(found.1.powers.p_in);
            if (next - u_dc).abs() <= SMALL * u_dc {
                return Ok(Some(found));
            }
            u_dc = next;
        }
        Err(Fault::new(format!("initial.steady: the source of the DC link cannot supply the drive at {speed} rad/s")))
    }

    /// Checks that there is a steady state.
    ///
    /// # Errors
    /// Those of [`Beginning::point`].
    pub(super) fn validate_beginning(&self) -> Result<(), Fault> {
        self.beginning().map(|_| ())
    }

    /// Takes over the steady state.
    pub(super) fn begin_steadily(&mut self) {
        let Ok(Some((temperatures, point))) = self.beginning() else { return };
        let (gains, k) = self.drive.settled().speed_loop();
        let speed = self.speed(&self.state);
        let integral = point.tau_ref / k - gains.wanted(0.0, speed, speed);
        let torque_mode = self.drive.controller.speed_loop.torque_mode;
        self.network = temperatures;
        self.state.tau = point.tau_ref;
        (self.state.speed_ref, self.state.integral) = (speed, if torque_mode { 0.0 } else { integral });
    }
}
