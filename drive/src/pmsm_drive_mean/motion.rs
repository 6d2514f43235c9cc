//! Torque and shaft over time: the rates of the states, and a step of any length.
//!
//! The speed loop is the controller's, without sampling ([`speed`](drive_control::speed)): wanted i_q = K_p (b w_ref -
//! w) + I, dI/dt = K_i (w_ref - w). While a limit is active and the error would increase the excess, I is stopped, over a band
//! of 1 % above the limit, so that the rates are continuous. With field weakening, I follows the limit at the bandwidth of the
//! speed loop, as in the controller.
//!
//! A step: in torque mode, until a limit is active, x is exactly an exponential, and its mean acts on the shaft. Otherwise x, I
//! and the speed advance together by the Rosenbrock method of Verwer et al. 1999 (ROS2, DOI 10.1137/S1064827597326651), gamma =
//! 1 - 1/sqrt 2: second order with any matrix, and stable for any lag. With the matrix M = 1 - gamma h J,
//!
//! ```text
//! M k_1 = f(y),   M k_2 = f(y + h k_1) - 2 k_1,   y + h (3 k_1 + k_2)/2,   error about h (k_1 + k_2)/2
//! ```
//!
//! A step with an error above [`SMALL`] is divided into parts. Losses are the mean of both stages. The power from the link is
//! the sum of the losses, the power to the load and the change of the kinetic energy, so that the energies balance: the mean of
//! the stages would miss the change of the kinetic energy by the error of the speed, which accumulates on a ramp.

use super::{Passed, PmsmDriveMean, State};
use crate::lag::{integrates, lagging};
use crate::pmsm_drive::DriveInputs;
use crate::steady::{Point, Steady, within};
use drive_base::math::exp;
use drive_plant::power::Powers;
use drive_plant::thermal::Temperatures;
use fmu_core::{Dual, Fault};

const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Allowed errors in a part of a step: torque and integral part relative to the maximum torque, speed relative to itself plus 1
/// rad/s.
const SMALL: [f64; 2] = [2e-3, 1e-4];

/// Minimum torque to which errors refer, as a share of the full torque.
const LEAST_SHARE: f64 = 1e-3;

/// Minimum part in s, and maximum number of parts of a step.
const SHORTEST: f64 = 1e-8;
const MAX_PARTS: u32 = 100_000;

/// Maximum number of rounds for the limits at the voltage of a step's end.
const LIMIT_ROUNDS: u32 = 20;

/// An instant: rates of torque (N.m/s), integral part (A/s) and speed (rad/s2), and the point.
pub(super) struct Rates {
    pub(super) tau: f64,
    pub(super) integral: f64,
    pub(super) speed: f64,
    pub(super) point: Point,
    /// Whether a limit is active.
    limited: bool,
    /// The maximum torque reference in N.m.
    highest: f64,
}

impl PmsmDriveMean {
    /// The rates in this state, at the temperatures `at` (K).
    pub(super) fn rates(&self, state: &State, at: Temperatures) -> Rates {
        let Steady { plant, controller, .. } = &self.drive;
        let condition = self.condition(state, at);
        let (speed, point) = (condition.speed, self.point_at(state, at));
        let accelerate = |point: &Point| {
            if plant.mechanics.imposed {
                0.0
            } else {
                (point.powers.tau_shaft - self.inputs.tau_load) / plant.mechanics.J
            }
        };
        let lag = controller.current.bandwidth;
        if !self.gates() {
            let (tau, integral) = (-lag * state.tau, -lag * state.integral);
            return Rates { tau, integral, speed: accelerate(&point), point, limited: true, highest: 0.0 };
        }
        let limits = self.narrowed(state, &point);
        let [low, high] = point.limits;
        // Without any torque, errors still refer to a small share of the full torque.
        let full = self.drive.settled().speed_loop().1 * controller.limit.i;
        let highest = high.max(-low).max(LEAST_SHARE * full);
        let (wanted, integral, limited) = if self.torque_mode() {
            let at_shaft = self.at_shaft();
            let asked = if at_shaft { self.reference(&self.at(state, &point)) } else { self.tau_ref() };
            let (wanted, integral, bounded) = self.in_range(state, speed, asked, limits);
            (wanted, integral, !bounded)
        } else {
            let (gains, k) = self.drive.settled().speed_loop();
            let error = state.speed_ref - speed;
            let wanted = k * gains.wanted(state.integral, state.speed_ref, speed);
            let cut = wanted - within(wanted, limits);
            let [_, k_i] = gains.slopes();
            let frees = controller.modes.frees(self.follows);
            let share = if frees { 0.0 } else { integrates(cut, error, highest) };
            let follow = if controller.weakening.used { controller.speed_loop.bandwidth * cut / k } else { 0.0 };
            let follow = if frees { lag * state.integral } else { follow };
            (wanted, share * k_i * error - follow, cut != 0.0)
        };
        let tau = lag * (within(wanted, limits) - state.tau);
        Rates { tau, integral, speed: accelerate(&point), point, limited, highest }
    }

    /// A step of `h` (s) with the temperatures `at` (K).
    pub(super) fn pass(&self, h: f64, at: Temperatures) -> Result<Passed, Fault> {
        let Steady { plant, controller, .. } = &self.drive;
        let (torque, range) = (self.torque_mode(), controller.modes.speed.used);
        if plant.mechanics.imposed && (torque && !range || !self.gates()) {
            return Ok(self.pass_imposed(h, at));
        }
        let (mut state, mut done, mut part, mut powers) = (self.state, 0.0, h, Powers::default());
        for _ in 0..MAX_PARTS {
            let left = h - done;
            let ends = part >= left * (1.0 - 1e-12);
            let length = if ends { left } else { part };
            let (next, mean, error) = self.part(&state, length, at);
            if error > 1.0 && length > SHORTEST {
                part = length * (0.9 / error.sqrt()).clamp(0.05, 0.5);
                continue;
            }
            done += length;
            state = next;
            powers = if ends && length >= h { mean } else { powers.with(mean, length / done) };
            if ends {
                if plant.mechanics.imposed {
                    state = self.on_the_shaft(state, h);
                }
                return Ok(Passed { point: self.point_at(&state, at), state, powers });
            }
            part = length * (0.9 / error.max(1e-3).sqrt()).clamp(0.5, 5.0);
        }
        Err(Fault::new(format!(
            "a step of {h} s takes more than {MAX_PARTS} parts: the coupling is unstable; shorten it"
        )))
    }

    /// Torque in N.m after `h` (s) from `start` (N.m) with the constant torque reference `target` (N.m); and the weight of the
    /// start in its mean.
    fn lagging(&self, start: f64, target: f64, h: f64) -> (f64, f64) {
        lagging(self.drive.controller.current.bandwidth, start, target, h)
    }

    /// `state` after a step of `h` (s) with the imposed shaft.
    fn on_the_shaft(&self, state: State, h: f64) -> State {
        let DriveInputs { speed_shaft, angle_shaft, .. } = self.inputs;
        State { speed: speed_shaft, angle: angle_shaft + speed_shaft * h, ..state }
    }

    /// A step of `h` (s) in torque mode, or disabled, on an imposed shaft: no integration.
    fn pass_imposed(&self, h: f64, at: Temperatures) -> Passed {
        if self.linked() {
            return self.pass_imposed_on_link(h, at);
        }
        let condition = self.condition(&self.state, at);
        let drive = self.under(&condition);
        let enable = self.gates();
        let limits = Point { limits: drive.limits(), ..Point::default() };
        let target = if enable { within(self.reference(&drive), self.narrowed(&self.state, &limits)) } else { 0.0 };
        let (tau, share) = self.lagging(self.state.tau, target, h);
        let state = State { tau, integral: 0.0, speed_ref: self.inputs.speed_ref, ..self.state };
        let point = self.point_of(&drive, (tau, self.diodes));
        // The powers change with the torque, from the end of the last step to the end of this one.
        Passed { state: self.on_the_shaft(state, h), powers: point.powers.with(self.point.powers, share), point }
    }

    /// [`pass_imposed`](Self::pass_imposed) on the DC link: the limits are those of the voltage at the end of the step.
    fn pass_imposed_on_link(&self, h: f64, at: Temperatures) -> Passed {
        let mut point = self.point_at(&self.state, at);
        for round in 0.. {
            let drive = self.at(&self.state, &point);
            let allowed = self.narrowed(&self.state, &point);
            let target = if self.gates() { within(self.reference(&drive), allowed) } else { 0.0 };
            let (tau, share) = self.lagging(self.state.tau, target, h);
            let state = State { tau, integral: 0.0, speed_ref: self.inputs.speed_ref, ..self.state };
            let limits = point.limits;
            point = self.point_at(&state, at);
            let moved = (0..2).map(|k| (point.limits[k] - limits[k]).abs()).fold(0.0, f64::max);
            if moved <= 1e-9 * limits[1].max(-limits[0]) || round >= LIMIT_ROUNDS {
                let powers = point.powers.with(self.point.powers, share);
                return Passed { state: self.on_the_shaft(state, h), powers, point };
            }
        }
        unreachable!("the last round returns")
    }

    /// A part of a step, of `h` (s): the state after it, the mean powers, and the error relative to the allowed one.
    fn part(&self, start: &State, h: f64, at: Temperatures) -> (State, Powers, f64) {
        let tau_ref = self.tau_ref();
        let free = |[low, high]: [f64; 2]| tau_ref >= low && tau_ref <= high;
        if !self.gates() {
            return self.part_with(start, h, at, Some([0.0; 2])).1;
        }
        // A reference at the shaft changes with the speed.
        let exact = self.torque_mode() && !self.at_shaft() && !self.drive.controller.modes.speed.used;
        if exact {
            let limits = self.narrowed(start, &self.point_at(start, at));
            if free(limits) {
                let (end, found) = self.part_with(start, h, at, Some(limits));
                if free(end) {
                    return found;
                }
            }
        }
        self.part_with(start, h, at, None).1
    }

    /// [`part`](Self::part), with x as an exponential within these limits (N.m) or as one of the states; also returns the limits
    /// at its end.
    fn part_with(
        &self,
        start: &State,
        h: f64,
        at: Temperatures,
        limits: Option<[f64; 2]>,
    ) -> ([f64; 2], (State, Powers, f64)) {
        let Steady { plant, controller, .. } = &self.drive;
        let (imposed, exact) = (plant.mechanics.imposed, limits.is_some());
        let mut y = *start;
        let lag = controller.current.bandwidth;
        if !exact {
            // The ramp is a straight line; the part uses its middle.
            let reached = self.ramped(start.speed_ref, h);
            y.speed_ref = 0.5 * (if self.speed_ref().1 > 0.0 { start.speed_ref } else { reached } + reached);
        }
        let mut end_tau = 0.0;
        if let Some(limits) = limits {
            let (end, share) = self.lagging(start.tau, within(self.tau_ref(), limits), h);
            (end_tau, y.tau) = (end, end + (start.tau - end) * share);
        }
        let one = self.rates(&y, at);
        let (gains, k) = self.drive.settled().speed_loop();
        let [k_p, k_i] = gains.slopes();
        let g = GAMMA * h;
        // Rows of the matrix: the lag, the speed loop unless a limit is active, the shaft.
        let a = if exact { 0.0 } else { g * lag };
        let loops = if exact || one.limited { 0.0 } else { a * k };
        let c = if imposed { 0.0 } else { g / plant.mechanics.J };
        let friction = plant.mechanics.friction(Dual::new(self.speed(&y), 1.0)).change;
        let (d, e) = (c * friction, if exact || one.limited { 0.0 } else { g * k_i });
        let solve = |tau: f64, integral: f64, speed: f64| {
            // From the last row to the first: I = b_I - e w, x = (b_x - loops (K_p w - I)) / (1 + a).
            let by = 1.0 / (1.0 + a);
            let w = (speed + c * by * (tau + loops * integral)) / (1.0 + d + c * by * loops * (k_p + e));
            let i = integral - e * w;
            [by * (tau - loops * (k_p * w - i)), i, w]
        };
        let lagging = |rate: f64| if exact { 0.0 } else { rate };
        // With the gates off, the integral part decays with the lag, unused.
        let enable = self.gates();
        let of_loop = |rate: f64| if enable { rate } else { 0.0 };
        let k_1 = solve(lagging(one.tau), of_loop(one.integral), one.speed);
        let ahead =
            State { tau: y.tau + h * k_1[0], integral: y.integral + h * k_1[1], speed: y.speed + h * k_1[2], ..y };
        let two = self.rates(&ahead, at);
        let k_2 =
            solve(lagging(two.tau) - 2.0 * k_1[0], of_loop(two.integral) - 2.0 * k_1[1], two.speed - 2.0 * k_1[2]);
        let step = |n: usize| h * (1.5 * k_1[n] + 0.5 * k_2[n]);
        let off = |n: usize| 0.5 * h * (k_1[n] + k_2[n]).abs();
        let speed = y.speed + step(2);
        let torque = off(0).max(k * off(1)) / (SMALL[0] * one.highest.max(1e-6));
        let error = torque.max(off(2) / (SMALL[1] * (1.0 + speed.abs())));
        let state = State {
            tau: if exact { end_tau } else { y.tau + step(0) },
            integral: if enable { y.integral + step(1) } else { y.integral * exp(-lag * h) },
            speed_ref: self.ramped(start.speed_ref, h),
            speed,
            angle: start.angle + 0.5 * h * (start.speed + speed),
        };
        let powers =
            self.powers_of(&one.point, self.speed(&y)).with(self.powers_of(&two.point, self.speed(&ahead)), 0.5);
        let powers = if imposed { powers } else { self.balanced(powers, [start, &state], h) };
        (self.narrowed(&ahead, &two.point), (state, powers, error))
    }

    /// The mean `powers` of a part of a step of `h` (s) between two states, balanced with the power to the load and the change
    /// of the kinetic energy: by the power from the link, or without such a power by the losses.
    fn balanced(&self, powers: Powers, [start, end]: [&State; 2], h: f64) -> Powers {
        let kept = 0.5 * self.drive.plant.mechanics.J * (end.speed * end.speed - start.speed * start.speed) / h;
        let p_mech = self.inputs.tau_load * 0.5 * (start.speed + end.speed);
        if !self.gates() && powers.p_in == 0.0 {
            return Powers { p_mech, p_loss: -(p_mech + kept), ..powers };
        }
        let p_in = p_mech + kept + powers.p_loss;
        let u_dc = self.voltage(p_in);
        Powers { p_mech, p_in, i_dc: if u_dc > 0.0 { p_in / u_dc } else { 0.0 }, ..powers }
    }
}
