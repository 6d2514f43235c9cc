//! A communication step of the plant: the shaft, the number of integration steps, the gates, the means.

use crate::circuit::{Circuit, Passed, Rates, blocked_rates};
use crate::integration::LARGEST_TURN;
use crate::legs::Legs;
use crate::losses::Losses;
use crate::losses::flow::{Dissipation, Ideal, Path, Switches};
use crate::machine;
use crate::mechanics::{Coulomb, Shaft, Standstill, Whole};
use crate::model::PmsmPlant;
use crate::power::{Energy, Powers};
use crate::signals::PlantInputs;
use crate::state::{State, axis_at};
use crate::thermal::ThermalMode;
use drive_base::frame::{AlphaBeta, Dq};
use drive_base::integrate::rk4;
use drive_base::math::all_finite;
use fmu_core::{Fault, Step};
use nalgebra::SVector;

/// Maximum number of substeps in one communication step: 1000 s of simulated time.
const MAX_SUBSTEPS: f64 = 1e7;

/// Maximum electrical speed in rad/s, 160 kHz: nine times the speed of the fastest drives, which turn at a million rpm with one
/// pole pair. Only a diverging coupling reaches it. It bounds the work of a step for any inputs: at most 4e6 integration
/// steps per second of its size, and 16e6 with losses.
const FASTEST: f64 = 1e6;

impl PmsmPlant {
    /// The state at the beginning of a step, and the energy transferred in reaching it: an imposed shaft adopts the angle of the
    /// drive train. A difference from the angle at the end of the last step turns the rotor under the stator flux
    /// linkage, which cannot jump; the magnetic field then does work on the shaft.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    pub(super) fn at_the_shaft(&self) -> (State, Passed) {
        let mechanics = &self.parameters.mechanics;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        if !mechanics.imposed {
            return (self.state, Passed::default());
        }
        let motor = &self.warm.motor;
        let axis = axis_at(motor, angle_shaft);
        let machine = self.machine::<false>();
        let psi = machine.from_stator(axis, machine.to_stator(self.state.axis, self.state.psi));
        let stored = |psi| machine::magnetic_energy(motor, self.parameters.magnetics(), psi);
        let energy = Energy { mech: stored(self.state.psi) - stored(psi), ..Energy::default() };
        (State { psi, speed: speed_shaft, angle: angle_shaft, axis }, Passed { energy, ..Passed::default() })
    }

    /// Number of integration steps in a step of `h` (s) that begins at the mechanical `speed` (rad/s), with a voltage that
    /// depends on the currents.
    pub(super) fn substeps(&self, h: f64, speed: f64, legs: &Legs, switches: &Switches) -> Result<f64, Fault> {
        let inverter = &self.parameters.inverter;
        let longest = if switches.kinks() {
            // Half a time constant in the zone: kinks are not searched, so the energies need shorter steps.
            0.5 * self.warm.longest.min(legs.time(self.warm.least_inductance, inverter.devices.threshold()))
        } else {
            self.warm.longest
        };
        self.count(h, longest, speed)
    }

    /// Number of integration steps of at most `longest` (s) in `h` (s) that begin at the mechanical `speed` (rad/s).
    #[inline(never)]
    pub(super) fn count(&self, h: f64, longest: f64, speed: f64) -> Result<f64, Fault> {
        if self.is_too_fast(speed) {
            return Err(self.too_fast(speed));
        }
        let longest = longest.min(LARGEST_TURN / (f64::from(self.parameters.motor.n_p) * speed).abs());
        let count = (h / longest - 1e-9).ceil().max(1.0);
        if count > MAX_SUBSTEPS {
            let limit = MAX_SUBSTEPS * longest;
            return Err(Fault::value("the step size", format!("{h} s"), format!("at most {limit} s")));
        }
        Ok(count)
    }

    /// One integration step of `h` (s) with the gates off.
    #[inline(never)]
    fn coast(&self, start: &State, h: f64, legs: &Legs, switches: Switches) -> (State, Passed) {
        let (motor, machine) = (&self.warm.motor, self.machine::<false>());
        let shaft = self.shaft(start.speed);
        let Some(lost) = self.remaining(start, legs) else {
            let dissipation = self.parameters.dissipation(machine.resistance(), machine.electrical(start.speed));
            let path = Path { u: AlphaBeta::ZERO, dissipation, drops: switches };
            return self.integrate_switches(start, h, &Circuit { machine, path, shaft });
        };
        let x = rk4(SVector::from([start.speed, start.angle, 0.0, 0.0, 0.0, 0.0]), h, |x| {
            let i = self.idle_current(motor, x[0]);
            let Rates { acceleration, losses, tau_given, .. } =
                blocked_rates(&machine, &shaft, machine::flux(motor, i), i, x[0]);
            let p_mech = shaft.tau_shaft(tau_given) * x[0];
            SVector::from([acceleration, x[0], p_mech, losses.iron, losses.friction, tau_given])
        });
        let state = State::new(motor, self.idle_flux(motor, x[0]), x[0], x[1]);
        let losses = Losses { cu: lost, iron: x[3], friction: x[4], ..Losses::none() };
        (state, Passed { energy: Energy { r#in: 0.0, mech: x[2], loss: losses.sum() }, losses, impulse: x[5] })
    }

    /// The shaft at speeds close to this `speed` (rad/s).
    #[inline]
    pub(super) fn shaft(&self, speed: f64) -> Shaft<'_, Standstill> {
        let mechanics = &self.parameters.mechanics;
        Shaft::new(mechanics, self.inputs.tau_load, Standstill::new(mechanics, speed))
    }

    /// An integration step of `h` (s) with ideal legs under the voltage `u` (V), for a linear or a nonlinear machine.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    fn integrate_ideal<C: Coulomb<f64>, const LINEAR: bool>(
        &self,
        start: &State,
        h: f64,
        u: AlphaBeta,
        coulomb: C,
    ) -> (State, Passed) {
        let machine = self.machine::<LINEAR>();
        let path = Path { u, dissipation: Dissipation { R: machine.resistance(), G: None }, drops: Ideal };
        let shaft = Shaft::new(&self.parameters.mechanics, self.inputs.tau_load, coulomb);
        self.integrate(start, h, &Circuit { machine, path, shaft })
    }

    /// [`integrate_ideal`](Self::integrate_ideal) of a linear machine.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    fn integrate_linear(&self, start: &State, h: f64, u: AlphaBeta) -> (State, Passed) {
        let mechanics = &self.parameters.mechanics;
        if mechanics.is_whole(start.speed) {
            self.integrate_ideal::<_, true>(start, h, u, Whole::new(mechanics, start.speed))
        } else {
            self.integrate_ideal::<_, true>(start, h, u, Standstill::new(mechanics, start.speed))
        }
    }

    /// [`integrate_ideal`](Self::integrate_ideal) of any machine.
    #[inline(never)]
    fn integrate_any(&self, start: &State, h: f64, u: AlphaBeta) -> (State, Passed) {
        let mechanics = &self.parameters.mechanics;
        if self.parameters.is_linear() {
            self.integrate_linear(start, h, u)
        } else if mechanics.is_whole(start.speed) {
            self.integrate_ideal::<_, false>(start, h, u, Whole::new(mechanics, start.speed))
        } else {
            self.integrate_ideal::<_, false>(start, h, u, Standstill::new(mechanics, start.speed))
        }
    }

    /// Voltage (V) of the legs before any drop, under the inputs.
    #[inline]
    fn voltage(&self) -> AlphaBeta {
        self.inputs.voltage(self.parameters.inverter.pwm.modulation.mode)
    }

    /// A communication step of `h` (s) with ideal legs, which switch or short-circuit the machine.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    fn pass_ideal(&self, h: f64) -> Result<(State, Passed), Fault> {
        let u = self.voltage();
        let mechanics = &self.parameters.mechanics;
        let is_one = self.is_one_step(h, self.machine::<true>().electrical(self.state.speed));
        if is_one && self.parameters.is_linear() && !mechanics.imposed {
            let (next, step) = self.integrate_linear(&self.state, h, u);
            if mechanics.shorter(h, self.state.speed, next.speed).is_none() {
                return Ok((next, step));
            }
        }
        self.pass_ideal_in_steps(h, u)
    }

    /// [`pass_ideal`](Self::pass_ideal) in several integration steps, with saturation or with an imposed shaft.
    #[inline(never)]
    fn pass_ideal_in_steps(&self, h: f64, u: AlphaBeta) -> Result<(State, Passed), Fault> {
        let (mut state, mut passed) = self.at_the_shaft();
        let is_one = self.is_one_step(h, self.machine::<true>().electrical(state.speed));
        let count = if is_one { 1.0 } else { self.count(h, self.warm.longest, state.speed)? };
        let (longest, mut left, mut limit) = (h / count, h, f64::INFINITY);
        while left > 1e-9 * h && !self.is_too_fast(state.speed) {
            let h = if left < longest * (1.0 + 1e-9) { left } else { longest }.min(limit);
            let (next, step) = self.integrate_any(&state, h, u);
            if let Some(shorter) = self.parameters.mechanics.shorter(h, state.speed, next.speed) {
                limit = shorter;
                continue;
            }
            (state, limit) = (next, f64::INFINITY);
            passed.add(&step);
            left -= h;
        }
        Ok((state, passed))
    }

    /// Whether one integration step suffices for `h` (s) at the electrical speed `w` (rad/s).
    #[inline]
    fn is_one_step(&self, h: f64, w: f64) -> bool {
        h <= self.warm.longest && w.abs() * h <= LARGEST_TURN
    }

    /// A communication step of `h` (s) with the gates off, with dead time or with losses.
    #[inline(never)]
    fn advance_general(&mut self, step: &Step) -> Result<(), Fault> {
        if self.parameters.is_switched() {
            return self.advance_switched(step);
        }
        let h = step.h;
        let conducts = !self.inputs.is_off();
        let legs = self.legs(&self.inputs);
        let switches = self.switches(&self.inputs, legs);
        let (mut state, mut passed) = self.at_the_shaft();
        let count = self.substeps(h, state.speed, &legs, &switches)?;
        let (mut lost, mut by_iron) = (None, Dq::ZERO);
        if conducts {
            let (step, current) = self.pass_kinks(&mut state, h, self.voltage(), &legs, switches);
            passed.add(&step);
            by_iron = current;
        } else {
            let mut left = count;
            while left > 0.0 && !self.is_too_fast(state.speed) {
                let (next, step) = self.coast(&state, h / count, &legs, switches);
                state = next;
                passed.add(&step);
                left -= 1.0;
            }
            lost = self.remaining(&state, &legs);
            if let Some(lost) = lost {
                state.psi = self.idle_flux(&self.warm.motor, state.speed);
                passed.energy.loss += lost;
                passed.losses.cu += lost;
            }
        }
        self.conclude(h, state, &passed, lost.is_some(), &legs)?;
        if !self.parameters.iron.is_none() {
            self.by_iron = if conducts { by_iron } else { self.current_by_iron() };
        }
        Ok(())
    }

    /// A communication step of `h` (s) at constant temperatures.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    pub(super) fn advance_at_temperature(&mut self, step: &Step) -> Result<(), Fault> {
        if !self.warm.ideal || self.inputs.is_off() {
            return self.advance_general(step);
        }
        let h = step.h;
        let (state, passed) = self.pass_ideal(h)?;
        let legs = Legs::switching(&self.parameters.inverter, self.inputs.u_dc);
        self.conclude(h, state, &passed, false, &legs)
    }

    /// A communication step of `h` (s) with changing temperatures.
    #[inline(never)]
    pub(super) fn advance_with_temperatures(&mut self, step: &Step) -> Result<(), Fault> {
        self.with_temperatures(step.h, |plant| plant.advance_at_temperature(step))
    }

    /// Applies the imposed temperatures, makes a step of `h` (s) by `advance`, and warms up the network.
    #[inline]
    pub(super) fn with_temperatures(
        &mut self,
        h: f64,
        advance: impl FnOnce(&mut Self) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let mode = self.parameters.thermal.mode;
        if mode == ThermalMode::Imposed {
            self.impose()?;
        }
        advance(self)?;
        if mode == ThermalMode::Network {
            self.warm_up(h)?;
        }
        Ok(())
    }

    /// Sets the `state` at the end of a step of `h` (s), in which `passed` was transferred.
    #[expect(clippy::inline_always, reason = "as for `integrate`")]
    #[inline(always)]
    pub(super) fn conclude(
        &mut self,
        h: f64,
        state: State,
        passed: &Passed,
        blocked: bool,
        legs: &Legs,
    ) -> Result<(), Fault> {
        let (State { psi, speed, angle, .. }, energy) = (state, &passed.energy);
        if self.is_too_fast(speed) {
            return Err(self.too_fast(speed));
        }
        if !all_finite([psi.d(), psi.q(), speed, angle, energy.r#in, energy.mech, energy.loss]) {
            return Err(self.diverged(h));
        }
        (self.state, self.blocked) = (state, blocked);
        self.energy.add(energy);
        let tau_shaft = self.parameters.mechanics.tau_shaft(passed.impulse * (1.0 / h), self.inputs.tau_load);
        let i_dc = |p_in| self.inputs.dc_current(p_in, legs, || self.currents());
        self.powers = Powers::mean(energy, passed.losses, tau_shaft, h, i_dc);
        Ok(())
    }

    /// Whether the mechanical `speed` (rad/s) exceeds [`FASTEST`].
    #[inline]
    pub(super) fn is_too_fast(&self, speed: f64) -> bool {
        (f64::from(self.warm.motor.n_p) * speed).abs() > FASTEST
    }

    /// Refuses a step that begins or ends at such a speed.
    #[cold]
    #[inline(never)]
    fn too_fast(&self, speed: f64) -> Fault {
        let cause = format!("the shaft turns at {speed} rad/s, beyond the {} rad/s of any machine", self.fastest());
        let remedy = if self.parameters.mechanics.imposed { "" } else { " or use mechanics.imposed" };
        Fault::new(format!("{cause}: the coupling is unstable; shorten the communication step{remedy}"))
    }

    /// [`FASTEST`] as a mechanical speed in rad/s.
    pub(super) fn fastest(&self) -> f64 {
        FASTEST / f64::from(self.parameters.motor.n_p)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn diverged(&self, h: f64) -> Fault {
        Fault::new(format!(
            "the machine's state is no longer finite after a step of {h} s; the previous step ended with {}",
            self.state.described()
        ))
    }

    /// Energy (J) of the remaining current, which is lost at once when the diodes block; `None` while they conduct.
    pub(super) fn remaining(&self, state: &State, legs: &Legs) -> Option<f64> {
        let motor = &self.warm.motor;
        let i = machine::current(motor, self.parameters.magnetics(), state.psi) - self.idle_current(motor, state.speed);
        let blocked = legs.block(motor, state.axis, i, f64::from(motor.n_p) * state.speed);
        let stored = |psi| machine::magnetic_energy(motor, self.parameters.magnetics(), psi);
        blocked.then(|| stored(state.psi) - stored(self.idle_flux(motor, state.speed)))
    }
}

#[cfg(test)]
mod tests {
    use crate::model::PmsmPlant;
    use drive_base::frame::Phases;
    use fmu_core::{Block, Elapsed, Step};

    /// With the gates off, the current flows back through the diodes until these block; the remaining energy is lost in the
    /// copper.
    #[test]
    fn every_loss_is_in_the_sum() {
        let mut block = Block::<PmsmPlant>::default();
        block.model.inputs.u = Phases { a: 20.0, b: -10.0, c: -10.0 };
        block.initialize();
        let (mut now, mut lost) = (Elapsed::ZERO, 0.0);
        for k in 0..100 {
            block.model.inputs.enable = k < 10;
            let h = if k < 10 { 1e-4 } else { 2e-6 };
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            let powers = &block.out.powers;
            assert!((powers.losses.sum() - powers.p_loss).abs() < 1e-12 * (1.0 + powers.p_loss), "{k}: {powers:?}");
            lost += powers.p_loss * h;
        }
        assert!(block.out.i.a.abs() < 1e-15, "the diodes block: {} A", block.out.i.a);
        assert!((lost - block.out.energy.loss).abs() < 1e-12, "{lost} J");
    }
}
