//! Energies and torque in Model Exchange: the integrals between two points of the importer's solution.
//!
//! The importer passes on the states that its solver accepted, but not the path between them. The plant therefore integrates
//! each interval once more: from the importer's states, it solves the equations of [`exchange`](crate::exchange), with the
//! powers as further states, by the classical Runge-Kutta method in stator axes. The steps are those of Co-Simulation, at
//! most 100 us and 0.25 rad of electrical angle, so the energies are equally accurate for any step of the importer. The
//! next interval starts from the importer's states again, so errors do not accumulate. Between two points the inputs
//! are taken as straight lines: a curved input costs h^2/12 of its second derivative, with h the importer's step. The gates,
//! and whether the diodes block, change in events only.
//!
//! With an imposed shaft, the angle is the integral of the speed. These are definitions; tests compare them with
//! Co-Simulation.

use crate::circuit::Rates;
use crate::machine;
use crate::model::PmsmPlant;
use crate::power::Energy;
use crate::signals::PlantInputs;
use crate::state::{Accepted, Instant, axis_at};
use drive_base::frame::AlphaBeta;
use drive_base::integrate::rk4;
use drive_base::math::all_finite;
use fmu_core::{Account, Elapsed, Fault};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Energies and impulse since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Total {
    /// Energies in J.
    pub energy: Energy,
    /// Integral of the torque of the shaft on the load in N.m.s.
    pub impulse: f64,
    /// Time of the last point.
    pub time: Elapsed,
}

impl PmsmPlant {
    /// [`CompletedSteps::complete`](fmu_core::CompletedSteps::complete) under these `inputs`.
    ///
    /// # Errors
    /// The step cannot be integrated.
    pub fn complete_under(&mut self, inputs: &PlantInputs, now: Elapsed) -> Result<(), Fault> {
        let h = now.since(self.point.time);
        if h > 0.0 {
            let (energy, impulse) = self.between(&self.point, inputs, h)?;
            if self.parameters.mechanics.imposed {
                let start = &self.point.inputs;
                let turn = 0.5 * (start.speed_shaft + inputs.speed_shaft) * h;
                self.following.count(turn, inputs.angle_shaft - start.angle_shaft - turn);
            }
            self.energy.add(&energy);
            self.point.impulse += impulse;
        }
        self.point = Accepted { time: now, inputs: inputs.clone(), state: self.state, impulse: self.point.impulse };
        Ok(())
    }

    /// [`CompletedSteps::account`](fmu_core::CompletedSteps::account).
    pub fn account(&mut self, account: Account) {
        let mut counts = (self.energy, self.point.clone());
        self.kept.follow(account, &mut counts);
        (self.energy, self.point) = counts;
    }

    /// The totals at the last point.
    pub fn total(&self) -> Total {
        Total { energy: self.energy, impulse: self.point.impulse, time: self.point.time }
    }

    /// Energies and integral of the torque over the `h` (s) from the point `start` to the inputs at the `end`.
    fn between(&self, start: &Accepted, end: &PlantInputs, h: f64) -> Result<(Energy, f64), Fault> {
        let Accepted { inputs, state, .. } = start;
        let (imposed, motor) = (self.parameters.mechanics.imposed, &self.parameters.motor);
        let angle = if imposed { inputs.angle_shaft } else { state.angle };
        let psi = self.machine::<false>().to_stator(axis_at(motor, angle), state.psi);
        let speeds = if imposed { [inputs.speed_shaft, end.speed_shaft] } else { [state.speed, self.state.speed] };
        let speed = speeds[0].abs().max(speeds[1].abs());
        let mut left = if self.parameters.is_switched() || self.idles(inputs) {
            self.count(h, self.warm.longest, speed)?
        } else {
            let legs = self.legs(inputs);
            self.substeps(h, speed, &legs, &self.switches(inputs, legs))?
        };
        let step = h / left;
        let mut x = SVector::from([psi.alpha(), psi.beta(), state.speed, angle, 0.0, 0.0, 0.0, 0.0, 0.0]);
        while left > 0.0 {
            x = rk4(x, step, |x| {
                let inputs = inputs.toward(end, x[8] / h);
                let speed = if imposed { inputs.speed_shaft } else { x[2] };
                let rates = self.rates_at(&inputs, AlphaBeta::new(x[0], x[1]), speed, x[3]);
                let Rates { d_psi, acceleration, p_in, losses, tau_given, .. } = rates;
                let tau_shaft = self.parameters.mechanics.tau_shaft(tau_given, inputs.tau_load);
                let (p_mech, p_loss) = (tau_shaft * speed, losses.sum());
                SVector::from([d_psi.alpha(), d_psi.beta(), acceleration, speed, p_in, p_mech, p_loss, tau_shaft, 1.0])
            });
            left -= 1.0;
        }
        if !all_finite([x[4], x[5], x[6], x[7]]) {
            return Err(self.diverged(h));
        }
        Ok((Energy { r#in: x[4], mech: x[5], loss: x[6] }, x[7]))
    }

    /// The rates with the flux linkage `psi` (Wb) in stator axes, the `speed` (rad/s) and the `angle` (rad).
    fn rates_at(&self, inputs: &PlantInputs, psi: AlphaBeta, speed: f64, angle: f64) -> Rates {
        let motor = self.motor(inputs);
        let (machine, axis) = (self.machine_of(&motor), axis_at(&motor, angle));
        let idle = self.idles(inputs);
        let (psi, i) = if idle {
            let i = self.idle_current(&motor, speed);
            (machine::flux(&motor, i), i)
        } else {
            let psi = machine.from_stator(axis, psi);
            (psi, machine.current(psi))
        };
        self.rates(inputs, &Instant { psi, i, speed, angle, axis, idle })
    }
}
