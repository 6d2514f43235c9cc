//! A communication step of the plant: the shaft, the number of integration steps, the gates, the means.

use crate::integration::{LARGEST_TURN, LONGEST_SUBSTEP};
use crate::legs::Legs;
use crate::losses::flow::Lossy;
use crate::losses::{self, Losses};
use crate::machine;
use crate::mechanics::Shaft;
use crate::model::PmsmPlant;
use crate::power::{Energy, Powers};
use crate::rates::{Held, Passed};
use crate::signals::PlantInputs;
use crate::state::{State, axis_at};
use crate::tables::PlantParameters;
use crate::thermal::ThermalMode;
use drive_base::frame::AlphaBeta;
use drive_base::integrate::rk4;
use drive_base::math::all_finite;
use drive_base::modulation::limit_to_hexagon;
use fmu_core::{Fault, Step};
use nalgebra::SVector;

/// Maximum number of substeps in one communication step: 1000 s of simulated time.
const MAX_SUBSTEPS: f64 = 1e7;

/// Greatest electrical speed in rad/s, 160 kHz: nine times that of the fastest drives there are, which turn at a million rpm
/// with one pole pair. Only a diverging coupling gets there. It bounds the work of a step, whatever the inputs are: at most
/// 4e6 integration steps per second of its size, and 16e6 with losses.
const FASTEST: f64 = 1e6;

impl PmsmPlant {
    /// The state at the beginning of a step and what passes until it is reached: an imposed shaft takes the angle of the
    /// drive train. A difference from the angle at the end of the last step turns the rotor under the stator flux
    /// linkage, which cannot jump; the magnetic field then does work on the shaft.
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    fn at_the_shaft(&self) -> (State, Passed) {
        let PlantParameters { saturation, mechanics, .. } = &self.parameters;
        let PlantInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        if !mechanics.imposed {
            return (self.state, Passed::default());
        }
        let motor = &self.warm.motor;
        let axis = axis_at(motor, angle_shaft);
        let machine = self.machine();
        let psi = machine.from_stator(axis, machine.to_stator(self.state.axis, self.state.psi));
        let stored = |psi| machine::magnetic_energy(motor, saturation, psi);
        let energy = Energy { mech: stored(self.state.psi) - stored(psi), ..Energy::default() };
        (State { psi, speed: speed_shaft, angle: angle_shaft, axis }, Passed { energy, ..Passed::default() })
    }

    /// Number of integration steps in a step of `h` (s) that begins at the mechanical `speed` (rad/s).
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    pub(super) fn substeps(&self, h: f64, speed: f64, legs: &Legs, lossy: bool) -> Result<f64, Fault> {
        let PlantParameters { motor, inverter, .. } = &self.parameters;
        let w = (f64::from(motor.n_p) * speed).abs();
        let threshold = if lossy { inverter.devices.threshold() } else { 0.0 };
        let longest = if legs.drop() || threshold > 0.0 {
            Self::within_the_zone(motor, legs, threshold)
        } else {
            LONGEST_SUBSTEP
        };
        if h <= longest && w * h <= LARGEST_TURN {
            return Ok(1.0);
        }
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
    fn coast(&self, start: &State, h: f64, legs: &Legs, lossy: Option<&Lossy<'_>>) -> (State, Passed) {
        let Some(lost) = self.remaining(start, legs) else {
            return match lossy {
                None => self.drive_held::<false>(start, h, AlphaBeta::ZERO, legs, None),
                lossy => self.drive_lossy(start, h, AlphaBeta::ZERO, legs, lossy),
            };
        };
        let motor = &self.warm.motor;
        let held = Held {
            machine: self.machine(),
            u: AlphaBeta::ZERO,
            legs: None,
            lossy: None,
            shaft: Shaft::new(&self.parameters.mechanics, self.inputs.tau_load, start.speed),
        };
        let x = rk4(SVector::from([start.speed, start.angle, 0.0, lost, 0.0, 0.0]), h, |x| {
            let i = self.idle_current(motor, x[0]);
            let rates = held.idle_rates(machine::flux(motor, i), i, x[0]);
            SVector::from([rates.acceleration, x[0], rates.p_mech, rates.p_loss, rates.losses.iron, rates.tau_shaft])
        });
        let state = State::new(motor, self.idle_flux(motor, x[0]), x[0], x[1]);
        let losses = Losses { cu: lost, iron: x[4], friction: x[3] - lost - x[4], ..Losses::none() };
        (state, Passed { energy: Energy { r#in: 0.0, mech: x[2], loss: x[3] }, losses, impulse: x[5] })
    }

    /// A communication step; `LOSSY`: with the gates off or with losses besides that of a constant resistance.
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    pub(super) fn step<const LOSSY: bool>(&mut self, step: &Step) -> Result<(), Fault> {
        let PlantInputs { enable, u_dc, .. } = self.inputs;
        let legs = self.legs(&self.inputs);
        let lossy = if LOSSY {
            let sw = if enable { self.sw.per_ampere(&self.parameters.inverter, u_dc) } else { 0.0 };
            Lossy::new(&self.parameters, enable, u_dc, legs.i_zone(), sw)
        } else {
            None
        };
        let (mut state, mut passed) = self.at_the_shaft();
        let mut left = self.substeps(step.h, state.speed, &legs, lossy.is_some())?;
        let h = step.h / left;
        let u = limit_to_hexagon(self.inputs.u, self.inputs.u_dc);
        let mut by_iron = None;
        if LOSSY
            && self.inputs.enable
            && let Some(lossy) = &lossy
        {
            let (switched, current) = self.switch(&mut state, step.h, u, &legs, lossy);
            passed.add(&switched);
            (by_iron, left) = (Some(current), 0.0);
        }
        while left > 0.0 && !self.is_too_fast(state.speed) {
            let (next, driven) = match (LOSSY, self.inputs.enable, lossy.as_ref()) {
                (false, ..) => self.drive_held::<false>(&state, h, u, &legs, None),
                (true, true, lossy) => self.drive_lossy(&state, h, u, &legs, lossy),
                (true, false, lossy) => self.coast(&state, h, &legs, lossy),
            };
            state = next;
            passed.add(&driven);
            left -= 1.0;
        }
        let lost = if !LOSSY || self.inputs.enable { None } else { self.remaining(&state, &legs) };
        if let Some(lost) = lost {
            state.psi = self.idle_flux(&self.warm.motor, state.speed);
            passed.energy.loss += lost;
            passed.losses.cu += lost;
        }
        if !LOSSY {
            passed.losses.cu = passed.energy.loss - passed.losses.friction;
        }
        self.conclude(step.h, state, &passed, lost.is_some(), &legs)?;
        if LOSSY && !self.parameters.iron.is_none() {
            self.by_iron = by_iron.unwrap_or_else(|| self.current_by_iron());
        }
        Ok(())
    }

    /// Takes the `state` at the end of a step of `h` (s) and what `passed` in it.
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
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
        self.powers = Powers::mean(energy, passed.losses, tau_shaft, h, &self.inputs, legs, || self.currents());
        Ok(())
    }

    /// Whether the mechanical `speed` (rad/s) is beyond [`FASTEST`].
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
            "the machine's state left the finite numbers within a step of {h} s; the step before it ended with {}",
            self.state.tell()
        ))
    }

    /// [`step`](Self::step) of any machine.
    #[inline(never)]
    pub(super) fn step_general(&mut self, step: &Step) -> Result<(), Fault> {
        if self.inputs.enable && !losses::any(&self.parameters) {
            self.step::<false>(step)
        } else {
            self.step::<true>(step)
        }
    }

    /// The same with temperatures that change.
    #[inline(never)]
    pub(super) fn step_with_temperatures(&mut self, step: &Step) -> Result<(), Fault> {
        let mode = self.parameters.thermal.mode;
        if mode == ThermalMode::Imposed {
            self.impose()?;
        }
        match self.step_linear(step) {
            Some(done) => done?,
            None => self.step_general(step)?,
        }
        if mode == ThermalMode::Network {
            self.warm_up(step.h)?;
        }
        Ok(())
    }

    /// Energy (J) of the remaining current, which is lost at once when the diodes block; `None` while they conduct.
    fn remaining(&self, state: &State, legs: &Legs) -> Option<f64> {
        let (motor, saturation) = (&self.warm.motor, &self.parameters.saturation);
        let i = machine::current(motor, saturation, state.psi) - self.idle_current(motor, state.speed);
        let blocked = legs.block(motor, state.axis, i, f64::from(motor.n_p) * state.speed);
        let stored = |psi| machine::magnetic_energy(motor, saturation, psi);
        blocked.then(|| stored(state.psi) - stored(self.idle_flux(motor, state.speed)))
    }
}
