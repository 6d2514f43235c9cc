//! A linear machine on ideal legs, with friction and the loss of a constant resistance: most drives, in the least time.
//!
//! ```text
//! i     = (psi - psi_M e) / L_q + (1/L_d - 1/L_q) ((psi - psi_M e) . e) e         e the direction of the d-axis
//! d psi/dt = u - R_s i,   tau_e = 1.5 n_p psi x i
//! ```
//!
//! in stator axes: [`machine`](crate::machine) without transformations. u is held over a step, so the energy from the
//! link is 1.5 u times the integral of i, and that to the load tau_load times the angle.

use crate::integration::{LARGEST_TURN, LONGEST_SUBSTEP};
use crate::legs::Legs;
use crate::losses::{self, Losses};
use crate::model::PmsmPlant;
use crate::power::Energy;
use crate::rates::{Circuit, Passed, integral};
use crate::state::State;
use crate::tables::PlantParameters;
use drive_base::frame::{AlphaBeta, Axis, Rotor};
use drive_base::math::{reciprocal, tanh};
use drive_base::modulation::limit_to_hexagon;
use drive_base::motor::Motor;
use fmu_core::{Fault, Step};
use serde::{Deserialize, Serialize};

/// Constants of machine and shaft, from the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Linear {
    psi_M: f64,
    R_s: f64,
    by_L_q: f64,
    /// 1/L_d - 1/L_q in 1/H.
    saliency: f64,
    /// Acceleration (rad/s2) of torques: 1.5 n_p / J over psi x i, and 1/J over a torque in N.m.
    accelerates: f64,
    by_J: f64,
    B: f64,
    B_by_J: f64,
    tau_coulomb: f64,
    by_w_coulomb: f64,
    /// Speed in rad/s from which on the nearest number to tanh(speed / w_coulomb) is +-1.
    w_full: f64,
}

impl Linear {
    /// With the machine `motor` at its temperatures; `None` if it saturates, for legs with dead time, other losses or an
    /// imposed shaft.
    pub(super) fn new(parameters: &PlantParameters, motor: &Motor) -> Option<Self> {
        let PlantParameters { saturation, inverter, mechanics, .. } = parameters;
        if !saturation.is_none() || inverter.dead_time > 0.0 || mechanics.imposed || losses::any(parameters) {
            return None;
        }
        let Motor { n_p, R_s, L_d, L_q, psi_M } = *motor;
        let (by_L_d, by_L_q, by_J) = (reciprocal(L_d), reciprocal(L_q), reciprocal(mechanics.J));
        Some(Self {
            psi_M,
            R_s,
            by_L_q,
            saliency: by_L_d - by_L_q,
            accelerates: 1.5 * f64::from(n_p) * by_J,
            by_J,
            B: mechanics.B,
            B_by_J: mechanics.B * by_J,
            tau_coulomb: mechanics.tau_coulomb,
            by_w_coulomb: reciprocal(mechanics.w_coulomb),
            w_full: 20.0 * mechanics.w_coulomb,
        })
    }

    /// Whether the Coulomb torque is less than the whole one at the `speed` (rad/s).
    #[inline]
    pub(super) fn is_near_standstill(&self, speed: f64) -> bool {
        speed.abs() <= self.w_full
    }

    /// Coulomb torque in N.m at any `speed` (rad/s).
    #[cold]
    #[inline(never)]
    fn whole_coulomb(&self, speed: f64) -> f64 {
        self.tau_coulomb * tanh(speed * self.by_w_coulomb)
    }

    /// Over a step that begins at the `speed` (rad/s), under the voltage `u` (V) and the load `tau_load` (N.m).
    #[inline]
    pub(super) fn held<'a, const NEAR: bool>(
        &'a self,
        u: AlphaBeta,
        tau_load: f64,
        speed: f64,
        coulomb: &'a mut Coulomb,
    ) -> LinearHeld<'a, NEAR> {
        if NEAR && ((speed - coulomb.speed) * self.by_w_coulomb).abs() > 0.5 * Coulomb::REACH {
            *coulomb = self.coulomb(speed);
        }
        let (sign, tau_full) = (1.0_f64.copysign(speed), self.tau_coulomb.copysign(speed));
        LinearHeld { linear: self, u, tau_load, sign, tau_full, coulomb }
    }

    /// The Coulomb torque about the `speed` (rad/s). The coefficients of y = tanh x follow from y' = 1 - y^2.
    #[inline(never)]
    fn coulomb(&self, speed: f64) -> Coulomb {
        let y = tanh(speed * self.by_w_coulomb);
        let c_1 = 1.0 - y * y;
        let c_2 = -y * c_1;
        let c_3 = (-2.0 * y * c_2 - c_1 * c_1) * (1.0 / 3.0);
        let series = [y, c_1, c_2, c_3, -0.5 * (y * c_3 + c_1 * c_2)].map(|c| c * self.tau_coulomb);
        Coulomb { speed, series }
    }
}

/// Coulomb torque near a speed; it serves until the speed has left its reach.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Coulomb {
    /// In rad/s.
    speed: f64,
    /// Series of the torque (N.m) in x = speed / w_coulomb from there on.
    series: [f64; 5],
}

impl Default for Coulomb {
    /// Of no speed.
    fn default() -> Self {
        Self { speed: f64::INFINITY, series: [0.0; 5] }
    }
}

impl Coulomb {
    /// Greatest change of x: the first term left out is below 2e-16.
    const REACH: f64 = 1e-3;
}

/// The same with what is held over a step; `NEAR` standstill or not.
pub(super) struct LinearHeld<'a, const NEAR: bool> {
    linear: &'a Linear,
    u: AlphaBeta,
    tau_load: f64,
    /// Sign of the speed, and the whole Coulomb torque against it in N.m.
    sign: f64,
    tau_full: f64,
    coulomb: &'a Coulomb,
}

impl<const NEAR: bool> LinearHeld<'_, NEAR> {
    /// Coulomb torque in N.m at the `speed` (rad/s).
    #[inline]
    fn coulomb(&self, speed: f64) -> f64 {
        if NEAR {
            let Coulomb { speed: near, series: [c_0, c_1, c_2, c_3, c_4] } = *self.coulomb;
            let x = (speed - near) * self.linear.by_w_coulomb;
            if x.abs() <= Coulomb::REACH {
                return c_0 + x * ((c_1 + c_2 * x) + x * x * (c_3 + c_4 * x));
            }
        } else if speed * self.sign > self.linear.w_full {
            return self.tau_full;
        }
        self.linear.whole_coulomb(speed)
    }
}

/// What passes at an instant: the current in A and the friction loss in W.
pub(super) struct Through {
    i: AlphaBeta,
    p_friction: f64,
}

impl<const NEAR: bool> Circuit for LinearHeld<'_, NEAR> {
    type At = Through;

    #[expect(clippy::inline_always, reason = "its four calls take half of the time of a step")]
    #[inline(always)]
    fn slopes(&self, axis: Axis<Rotor>, psi: AlphaBeta, speed: f64) -> (AlphaBeta, f64, Through) {
        let Linear { psi_M, R_s, by_L_q, saliency, accelerates, by_J, B, B_by_J, .. } = *self.linear;
        let x = psi - axis.along(psi_M);
        let i = x * by_L_q + axis.along(saliency * axis.from_stator(x).d());
        let coulomb = self.coulomb(speed);
        let braking = (self.tau_load + coulomb) * by_J + B_by_J * speed;
        let acceleration = accelerates * psi.cross(i) - braking;
        (self.u - i * R_s, acceleration, Through { i, p_friction: (B * speed + coulomb) * speed })
    }

    #[expect(clippy::inline_always, reason = "as for `slopes`")]
    #[inline(always)]
    fn passed(&self, stages: &[Through; 4], h: f64, turned: f64) -> Passed {
        let over = |value: fn(&Through) -> f64| integral(h, stages, value);
        let charge = AlphaBeta::new(over(|k| k.i.alpha()), over(|k| k.i.beta()));
        let cu = 1.5 * self.linear.R_s * over(|k| k.i.dot(k.i));
        let friction = over(|k| k.p_friction);
        let energy = Energy { r#in: 1.5 * self.u.dot(charge), mech: self.tau_load * turned, loss: cu + friction };
        Passed { energy, losses: Losses { cu, friction, ..Losses::none() }, impulse: 0.0 }
    }
}

impl PmsmPlant {
    /// A communication step of `h` (s) of a `linear` machine on ideal legs, which switch.
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    fn pass_linear(&self, linear: &Linear, coulomb: &mut Coulomb, h: f64) -> Result<(State, Passed), Fault> {
        let u = limit_to_hexagon(self.inputs.u, self.inputs.u_dc);
        let w = (f64::from(self.warm.motor.n_p) * self.state.speed).abs();
        if h <= LONGEST_SUBSTEP && w * h <= LARGEST_TURN {
            return Ok(self.drive_linear(linear, coulomb, &self.state, h, u));
        }
        let mut left = self.count(h, LONGEST_SUBSTEP, self.state.speed)?;
        let (h, mut state, mut passed) = (h / left, self.state, Passed::default());
        while left > 0.0 && !self.is_too_fast(state.speed) {
            let (next, step) = self.drive_again(linear, coulomb, &state, h, u);
            state = next;
            passed.add(&step);
            left -= 1.0;
        }
        Ok((state, passed))
    }

    /// `PmsmPlant::step` of a linear machine on ideal legs, which switch; `None` for other machines.
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    pub(super) fn step_linear(&mut self, step: &Step) -> Option<Result<(), Fault>> {
        let linear = self.warm.linear.as_ref().filter(|_| self.inputs.enable)?;
        let mut coulomb = self.coulomb;
        let (state, passed) = match self.pass_linear(linear, &mut coulomb, step.h) {
            Ok(passed) => passed,
            Err(fault) => return Some(Err(fault)),
        };
        self.coulomb = coulomb;
        let legs = Legs::switching(&self.parameters.inverter, self.inputs.u_dc);
        Some(self.conclude(step.h, state, &passed, false, &legs))
    }

    /// `PmsmPlant::drive` of a `linear` machine under the voltage `u` (V).
    #[expect(clippy::inline_always, reason = "as for `PmsmPlant::drive`")]
    #[inline(always)]
    fn drive_linear(
        &self,
        linear: &Linear,
        coulomb: &mut Coulomb,
        start: &State,
        h: f64,
        u: AlphaBeta,
    ) -> (State, Passed) {
        let tau_load = self.inputs.tau_load;
        if linear.is_near_standstill(start.speed) {
            self.drive(start, h, &linear.held::<true>(u, tau_load, start.speed, coulomb))
        } else {
            self.drive(start, h, &linear.held::<false>(u, tau_load, start.speed, coulomb))
        }
    }

    /// [`drive_linear`](Self::drive_linear) in a loop.
    #[inline(never)]
    fn drive_again(
        &self,
        linear: &Linear,
        coulomb: &mut Coulomb,
        start: &State,
        h: f64,
        u: AlphaBeta,
    ) -> (State, Passed) {
        self.drive_linear(linear, coulomb, start, h, u)
    }
}

#[cfg(test)]
mod tests {
    use crate::model::PmsmPlant;
    use drive_base::frame::{AlphaBeta, Phases};
    use drive_base::motor::Motor;
    use fmu_core::{Block, Elapsed, Step};

    /// A machine from rest to 300 rad/s and back through standstill, by [`Linear`](super::Linear) or by the general
    /// equations.
    fn run(motor: &Motor, h: f64, general: bool) -> Vec<[f64; 10]> {
        let mut block = Block::<PmsmPlant>::default();
        block.model.parameters.motor = motor.clone();
        block.initialize();
        assert!(block.model.warm.linear.is_some());
        if general {
            block.model.warm.linear = None;
        }
        let (mut now, mut angle) = (Elapsed::ZERO, 0.0_f64);
        let sample = |k: u32| {
            let w = if k < 500 { 1.2 * f64::from(k) } else { 600.0 - 1.5 * f64::from(k - 500) };
            angle += w * h;
            let e = 2.0 + motor.psi_M * w;
            block.model.inputs.u = Phases::from_stator(AlphaBeta::new(e * angle.cos(), e * angle.sin()));
            block.model.inputs.tau_load = 0.2;
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            let (out, powers) = (&block.out, &block.out.powers);
            let losses = [powers.losses.cu, powers.losses.friction];
            [
                out.i_d,
                out.i_q,
                out.speed,
                out.angle,
                powers.p_in,
                powers.p_mech,
                powers.i_dc,
                losses[0],
                losses[1],
                powers.p_loss,
            ]
        };
        (0..1000).map(sample).collect()
    }

    #[test]
    fn the_general_equations_say_the_same() {
        let salient = Motor { L_q: 9e-3, ..Motor::default() };
        for (motor, h) in [(&Motor::default(), 1e-4), (&salient, 1e-4), (&salient, 1e-3)] {
            let (ours, general) = (run(motor, h, false), run(motor, h, true));
            assert!(general.iter().any(|y| y[2].abs() < 1.0 && y[1].abs() > 1.0), "through standstill under load");
            for (k, (a, b)) in ours.iter().zip(&general).enumerate() {
                for (i, (a, b)) in a.iter().zip(b).enumerate() {
                    assert!((a - b).abs() < 1e-10 * (1.0 + b.abs()), "step {k}, value {i}: {a}, not {b}");
                }
            }
        }
    }
}
