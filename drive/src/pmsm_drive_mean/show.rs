//! The outputs of `PmsmDriveMean`: the steady-state outputs of `PmsmDrive`.

use super::{MeanOutputs, PmsmDriveMean, State};
use crate::pmsm_drive::Means;
use crate::steady::{Point, Region, within};
use drive_base::frame::{Axis, Phases, Rotor};
use drive_base::math::wrap;
use drive_control::commission::{CommissionFault, CommissionState};
use drive_control::signals::{ControllerOutputs, DqParts};
use drive_control::start::StartState;
use drive_plant::inverter::Gates;
use drive_plant::losses::efficiency;
use drive_plant::power::Powers;
use drive_plant::signals::PlantOutputs;
use drive_plant::thermal::Temperatures;

impl PmsmDriveMean {
    /// The outputs in this state with its point and these `temperatures` (K), except the controller's.
    pub(super) fn show(&self, state: &State, point: &Point, temperatures: Temperatures, out: &mut MeanOutputs) {
        let plant = &self.drive.plant;
        let speed = self.speed(state);
        let powers = self.powers_of(point, speed);
        let Powers { p_in, p_mech, p_loss, tau_shaft, losses, .. } = powers;
        let (angle, theta, axis) = self.angle(state);
        let Point { i, psi, tau_e, .. } = *point;
        out.psi = psi;
        out.drive.plant = PlantOutputs {
            i: Phases::from_stator(axis.to_stator(i)),
            speed,
            angle,
            theta_e: wrap(theta),
            tau_e,
            i_d: i.d(),
            i_q: i.q(),
            powers,
            energy: self.energy,
            efficiency: efficiency(p_in, p_mech),
            temperatures,
            heat: plant.thermal.heat_at(self.inputs.thermal.coolant, &temperatures, &losses),
        };
        out.drive.link = self.link_outputs(point, &powers, &axis);
        out.drive.means = if self.moved { Means { p_in, p_mech, p_loss, tau_shaft } } else { Means::default() };
    }

    /// Mechanical and electrical angle (rad) and the rotor's axis.
    fn angle(&self, state: &State) -> (f64, f64, Axis<Rotor>) {
        let plant = &self.drive.plant;
        let angle = if plant.mechanics.imposed && !self.moved { self.inputs.angle_shaft } else { state.angle };
        let theta = f64::from(plant.motor.n_p) * angle;
        (angle, theta, Axis::at(theta))
    }

    /// The outputs of a controller with exact estimates.
    pub(super) fn controller(&self, state: &State, point: &Point) -> ControllerOutputs {
        let enabled = self.gates();
        let (_, theta, axis) = self.angle(state);
        let Point { i, u, u_share, region, limits: [_, highest], tau_ref, weakens, .. } = *point;
        let [tau_min, tau_max] = self.limits(state, point);
        let parts = DqParts { d: i.d(), q: i.q() };
        let wanted = within(state.tau, point.limits).abs();
        ControllerOutputs {
            u: if enabled { Phases::from_stator(axis.to_stator(u)) } else { Phases::default() },
            speed_est: self.speed(state),
            theta_est: wrap(theta),
            i: parts,
            i_ref: parts,
            lock_lost: 0.0,
            enabled,
            voltage_limited: enabled && (tau_ref.abs() < wanted - 1e-9 * highest || !self.drive.fits(point)),
            current_limited: enabled && matches!(region, Region::Limit | Region::Mtpv),
            tau_max,
            tau_min,
            u_share,
            weakens,
            short_circuit: self.bridge() == Gates::Short,
            tripped: self.trip.cause,
            // Without samples, no sensor is lost.
            sensor_lost: false,
            R_s_est: self.drive.controller.motor.R_s,
            commission_state: CommissionState::Idle,
            commission_fault: CommissionFault::None,
            // The estimates are exact at once.
            start_state: if enabled { StartState::Running } else { StartState::Idle },
        }
    }
}
