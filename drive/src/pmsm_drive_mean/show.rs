//! The outputs of `PmsmDriveMean`: those of `PmsmDrive` with their steady meaning.

use super::{MeanOutputs, PmsmDriveMean, State};
use crate::pmsm_drive::{DriveOutputs, Means};
use crate::steady::{Point, Region, within};
use drive_base::frame::{Axis, Phases, Rotor};
use drive_base::math::wrap;
use drive_control::signals::{ControllerOutputs, DqParts};
use drive_plant::losses::efficiency;
use drive_plant::power::Powers;
use drive_plant::signals::PlantOutputs;
use drive_plant::thermal::Temperatures;

impl PmsmDriveMean {
    /// The outputs in this state with its point, these `powers` and `temperatures` (K).
    pub(super) fn show(
        &self,
        state: &State,
        point: &Point,
        powers: Powers,
        temperatures: Temperatures,
        out: &mut MeanOutputs,
    ) {
        let (plant, controller) = (&self.drive.plant, &self.drive.controller);
        let (speed, enabled) = (self.speed(state), self.inputs.enable);
        let angle = if plant.mechanics.imposed && !self.moved { self.inputs.angle_shaft } else { state.angle };
        let theta = f64::from(plant.motor.n_p) * angle;
        let axis = Axis::<Rotor>::at(theta);
        let Point { i, u, psi, tau_e, u_share, region, limits: [tau_min, tau_max], tau_ref, .. } = *point;
        let theta_e = wrap(theta);
        let parts = DqParts { d: i.d(), q: i.q() };
        let Powers { p_in, p_mech, p_loss, tau_shaft, losses, .. } = powers;
        let at_limit = matches!(region, Region::Limit | Region::Mtpv);
        out.psi = psi;
        out.drive = DriveOutputs {
            plant: PlantOutputs {
                i: Phases::from_stator(axis.to_stator(i)),
                speed,
                angle,
                theta_e,
                tau_e,
                i_d: i.d(),
                i_q: i.q(),
                powers,
                energy: self.energy,
                efficiency: efficiency(p_in, p_mech),
                temperatures,
                heat: plant.thermal.heat_at(self.inputs.thermal.coolant, &temperatures, &losses),
            },
            controller: ControllerOutputs {
                u: if enabled { Phases::from_stator(axis.to_stator(u)) } else { Phases::default() },
                speed_est: speed,
                theta_est: theta_e,
                i: parts,
                i_ref: parts,
                lock_lost: 0.0,
                enabled,
                voltage_limited: enabled && tau_ref.abs() < within(state.tau, point.limits).abs() - 1e-9 * tau_max,
                current_limited: enabled && at_limit,
                tau_max,
                tau_min,
                u_share,
                weakens: enabled && matches!(region, Region::Weakening | Region::Mtpv),
                R_s_est: controller.motor.R_s,
            },
            means: if self.moved { Means { p_in, p_mech, p_loss, tau_shaft } } else { Means::default() },
        };
    }
}
