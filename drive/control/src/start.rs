//! The I-f start: a current of fixed magnitude accelerates the rotor to a speed at which the back EMF reveals the
//! angle.
//!
//! 1. Two alignments of `t_align` each: the current first points 90 degrees behind `initial.theta_est`, then at it. A
//!    single alignment fails if the rotor is half a turn away.
//! 2. Waits for a reference (of speed, or of torque in torque mode); then the frame accelerates at `acceleration` to
//!    `speed` in the direction of the reference.
//! 3. Holds that speed for `settle`, then hands over: the angle is the frame angle corrected by the angle of the back
//!    EMF, theta = theta_f + atan2(-s e_d, s e_q), e = v - R i - j w_f (L_d i_d + j L_q i_q), low-passed. The current
//!    controller's integrators are rotated to the new frame; the speed controller's integrator starts with the present
//!    torque.
//!
//! Damping: a rotor on a current vector oscillates with w_0 = sqrt(n_p K I / J) without damping. e_q / psi_M is its
//! speed, so i_q = -2 zeta w_0 J / (n_p K) (e_q / psi_M - w_f), limited to I, produces a damping torque, even at
//! standstill.
//!
//! Above psi_M / (L_q - L_d), a current on the d-axis does not hold the rotor, because the reluctance torque outweighs that of the
//! magnet: `reluctance.rs` is the start for these currents.
//!
//! Limits: the load must stay below K I; at standstill, e_q contains the voltage errors of the inverter.
//!
//! Neither paper uses this start: the sequence and the damping are derived here for the back-EMF methods (Kim & Sul
//! 2011, section II), which have no signal at standstill. Angles in rad (electrical), w_0 and w_f in rad/s
//! (electrical), i in A, K in N.m/A.

use crate::estimator::interval::Interval;
use crate::estimator::{Context, Sample};
use crate::reluctance::{CHANGE_OF_CURRENT, Line};
use drive_base::frame::DqHat;
use drive_base::math::{atan2, exp};
use fmu_core::unit::{AMPERE, Exponents, Quantity, SECOND, SPEED, Unit};
use fmu_core::{Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Mechanical acceleration.
pub(crate) const RAD_PER_S2: Quantity =
    Quantity::new("AngularAcceleration", Unit::si("rad/s2", Exponents::mechanical(0, 0, -2, 0).with_rad(1)));

/// Damping ratio of the rotor on the current vector.
const ZETA: f64 = 0.5;
/// Bandwidth of the back-EMF filter in rad/s.
const FILTER: f64 = TAU * 60.0;
/// Time in s for the change to the current of the hand-over, above psi_M / (L_q - L_d).
const CHANGE: f64 = 0.01;
/// Time in s in which i_q rises there.
const RISE: f64 = 0.05;

enumeration! {
    /// The start sequences; the assigned values never change.
    #[derive(Serialize, Deserialize)]
    pub enum StartMode("Start", "Start sequence before the estimator takes over") {
        1 Direct "No sequence: the estimator starts at once";
        2 CurrentFrequency "I-f start: a rotating current vector takes the rotor to start.speed";
        3 Injection "At standstill: injection finds the d axis, voltage pulses find the north pole";
    }
}

enumeration! {
    /// What the start of a drive does; the assigned values never change.
    #[derive(Default, Serialize, Deserialize)]
    pub enum StartState("StartState", "What the start of the drive does") {
        #[default]
        1 Idle "The controller rests: before its first sample, not enabled, tripped, short-circuited or commissioning";
        2 Aligning "At rest: a current aligns the rotor, injection and pulses find it, or the resistance is measured";
        3 Ramping "A rotating current takes the rotor to start.speed";
        4 Catching "With start.catch: finds angle and speed of a rotor that turns";
        5 Running "The estimator supplies the angle: speed or torque follow the reference";
    }
}

/// The parameters with the prefix `start.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StartParameters {
    /// Selected start sequence.
    pub mode: StartMode,
    /// Current I in A, > 0.
    pub i: f64,
    /// Duration of each of the two alignments in s, > 0.
    pub t_align: f64,
    /// Mechanical acceleration in rad/s2, > 0.
    pub acceleration: f64,
    /// Mechanical speed of the handover in rad/s, > 0: 0.15 of the rated speed is a good value.
    pub speed: f64,
    /// Time at that speed in s, >= 0.
    pub settle: f64,
    /// Flying start: finds the rotor before the sequence.
    pub catch: bool,
}

impl Default for StartParameters {
    fn default() -> Self {
        Self {
            mode: StartMode::Direct,
            i: 5.0,
            t_align: 0.25,
            acceleration: 100.0,
            speed: 24.0,
            settle: 0.2,
            catch: false,
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    #[default]
    Behind,
    On,
    Ramp,
    Hold,
}

/// State: the frame of the rotating current vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentFrequencyStart {
    stage: Stage,
    /// Samples in this stage.
    n: f64,
    /// Electrical angle of the frame in rad.
    theta: f64,
    /// Electrical speed of the frame in rad/s.
    w: f64,
    /// Back EMF in the frame in V, low-passed.
    e: DqHat,
    /// Current without damping in A, above psi_M / (L_q - L_d).
    i: DqHat,
    /// Angle of the rotor behind the frame, while the current changes to that of the hand-over.
    behind: Option<f64>,
    /// Direction of the ramp, 1 or -1; 0 before it.
    side: f64,
}

/// Requests of the start at a sample; angles in rad and speeds in rad/s, electrical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartStep {
    /// Control the current `i_ref` (A) in the frame at `theta`, which turns at `w`.
    Current {
        /// Angle of the frame.
        theta: f64,
        /// Speed of the frame.
        w: f64,
        /// Current reference in the frame.
        i_ref: DqHat,
    },
    /// The rotor is at `theta` and turns at `w`: the estimator takes over.
    HandOver {
        /// Angle of the rotor.
        theta: f64,
        /// Speed of the rotor.
        w: f64,
        /// Final angle of the frame.
        theta_frame: f64,
    },
}

impl CurrentFrequencyStart {
    /// On the ramp, with a rotor at `theta` (rad) that turns at `w` (rad/s). If the `reference` has the opposite sign, the frame decelerates and
    /// reverses.
    pub(crate) fn turning(par: &StartParameters, context: &Context, (theta, w): (f64, f64), reference: f64) -> Self {
        let side = if w * reference < 0.0 { -w.signum() } else { w.signum() };
        let i = Line::of(context.motor, context.J, par.i).map_or(DqHat::ZERO, |line| DqHat::new(0.5 * line.i_0(), 0.0));
        let e = DqHat::new(0.0, w * context.motor.psi_M);
        Self { stage: Stage::Ramp, theta: theta - context.T_s * w, w, e, i, side, ..Self::default() }
    }

    /// What it does.
    pub fn state(&self) -> StartState {
        match self.stage {
            Stage::Behind | Stage::On => StartState::Aligning,
            Stage::Ramp | Stage::Hold => StartState::Ramping,
        }
    }

    /// One sample. The second alignment brings the rotor to `theta_est` (rad); the sign of `reference` sets the
    /// direction of rotation.
    pub fn update(
        &mut self,
        par: &StartParameters,
        context: &Context,
        theta_est: f64,
        reference: f64,
        sample: &Sample,
    ) -> StartStep {
        let Context { motor, T_s, J, .. } = *context;
        let n_p = f64::from(motor.n_p);
        let theta_last = self.theta;
        let jumps = self.n == 0.0 && matches!(self.stage, Stage::Behind | Stage::On);
        self.theta = match self.stage {
            Stage::Behind => theta_est - FRAC_PI_2,
            Stage::On => theta_est,
            Stage::Ramp | Stage::Hold => self.theta + T_s * self.w,
        };
        let line = Line::of(motor, J, par.i);
        if !jumps {
            let x = Interval::new(theta_last, self.theta, sample, T_s);
            let flux = |i: DqHat| DqHat::new(motor.L_d * i.d(), motor.L_q * i.q());
            let mut e = x.v - x.i * motor.R_s - flux(x.i).turned() * self.w;
            let mut filter = FILTER;
            if let Some(line) = &line {
                e = e - flux(x.i_now - x.i_last) * (CHANGE_OF_CURRENT / T_s);
                filter = line.filter(self.i, FILTER);
            }
            self.e += (e - self.e) * (1.0 - exp(-filter * T_s));
        }

        self.n += 1.0;
        let t = self.n * T_s;
        let (rated, side) = (n_p * par.speed, if reference < 0.0 { -1.0 } else { 1.0 });
        match self.stage {
            Stage::Behind if t >= par.t_align => self.enter(Stage::On),
            Stage::On if t >= par.t_align && reference != 0.0 => self.enter(Stage::Ramp),
            Stage::Ramp => {
                // The direction is set once, at the first sample of the ramp.
                self.side = if self.side == 0.0 { side } else { self.side };
                let share = if line.is_some() { share(t) } else { 1.0 };
                self.w = self.side * (self.side * self.w + T_s * n_p * par.acceleration * share).min(rated);
                let risen = share >= 1.0;
                if self.side * self.w >= rated && risen {
                    self.enter(Stage::Hold);
                }
            }
            Stage::Hold if t >= par.settle && line.is_some() => {
                let behind = self.behind.unwrap_or_default();
                return StartStep::HandOver { theta: self.theta - behind, w: self.w, theta_frame: self.theta };
            }
            Stage::Hold if t >= par.settle => {
                let s = self.w.signum();
                let theta = self.theta + atan2(-s * self.e.d(), s * self.e.q());
                return StartStep::HandOver { theta, w: self.w, theta_frame: self.theta };
            }
            _ => {}
        }
        let grown = if self.stage == Stage::Behind { (3.0 * t / par.t_align).min(1.0) } else { 1.0 };
        if let Some(line) = line {
            let i_ref = self.on_line(&line, par, (n_p, T_s), (side, grown));
            return StartStep::Current { theta: self.theta, w: self.w, i_ref };
        }
        let K = motor.torque_constant();
        let w_0 = (n_p * K * par.i / J).sqrt();
        let i_q = damping(w_0, J, n_p * K, self.e.q() / motor.psi_M - self.w, par.i);
        StartStep::Current { theta: self.theta, w: self.w, i_ref: DqHat::new(par.i * grown, i_q * grown) }
    }

    /// The current (A) above psi_M / (L_q - L_d): [`reluctance`](crate::reluctance). `grown` is the share of the first alignment.
    fn on_line(
        &mut self,
        line: &Line,
        par: &StartParameters,
        (n_p, T_s): (f64, f64),
        (side, grown): (f64, f64),
    ) -> DqHat {
        let (aligned, most) = (DqHat::new(0.5 * line.i_0(), 0.0), line.i_q(par.i));
        let (t, side) = (self.n * T_s, if self.side == 0.0 { side } else { self.side });
        let left = (par.settle - t) / CHANGE;
        match self.stage {
            Stage::Behind | Stage::On => {
                self.i = aligned;
                return (aligned + line.damping(aligned, self.e, self.w, 0.5 * line.i_0())) * grown;
            }
            Stage::Hold if left < 1.0 => {
                let behind = *self.behind.get_or_insert_with(|| line.behind(self.i, self.e, self.w));
                return Line::leaving(self.i, behind, left);
            }
            Stage::Ramp => {
                let acceleration = if side * self.w < n_p * par.speed { side * n_p * par.acceleration } else { 0.0 };
                self.i = line.accelerating(share(t), side * most, acceleration);
            }
            Stage::Hold => self.i = line.accelerating(1.0, side * most, 0.0),
        }
        self.i + line.damping(self.i, self.e, self.w, 0.5 * par.i)
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.n) = (stage, 0.0);
    }
}

/// Current in A that damps a rotor of the inertia `J` and the torque `n_p_K` (n_p K) per ampere, which oscillates at `w_0`
/// (rad/s) and turns faster than its current vector by `slip` (rad/s); at most `most` (A).
pub(crate) fn damping(w_0: f64, J: f64, n_p_K: f64, slip: f64, most: f64) -> f64 {
    let gain = 2.0 * ZETA * w_0 * J / n_p_K;
    (-gain * slip).clamp(-most, most)
}

/// Share of i_q and of the acceleration at the time `t` (s) of the ramp, above psi_M / (L_q - L_d).
fn share(t: f64) -> f64 {
    (t / RISE).min(1.0)
}

type P = Row<StartParameters>;

/// Variables of the start; their owner supplies the prefix `start.`.
pub const START: &Table<StartParameters> = table![
    P::enumeration_parameter(
        "mode",
        "Start sequence before the estimator takes over; Injection needs an estimator that injects",
        &Field(|p| &mut p.mode),
    ),
    P::parameter("i", &AMPERE, "Magnitude of the rotating current vector, I-f start", |p| &mut p.i).above(0.0),
    P::parameter("t_align", &SECOND, "Duration of each of the two alignments, I-f start", |p| &mut p.t_align)
        .above(0.0),
    P::parameter("acceleration", &RAD_PER_S2, "Mechanical acceleration of the current vector, I-f start", |p| {
        &mut p.acceleration
    })
    .above(0.0),
    P::parameter("speed", &SPEED, "Mechanical speed at which the estimator takes over, I-f start", |p| {
        &mut p.speed
    })
    .above(0.0),
    P::parameter("settle", &SECOND, "Time at start.speed before the estimator takes over, I-f start", |p| {
        &mut p.settle
    })
    .at_least(0.0),
    P::boolean_parameter(
        "catch",
        "Flying start: with the gates off until then, short-circuit pulses and the EMF at zero current find the speed of the rotor; at rest, \
         the start sequence follows",
        |p| &mut p.catch,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::frame::{AlphaBeta, Axis, Estimated, Rotor};
    use drive_base::math::wrap;
    use drive_base::motor::Motor;
    use drive_plant::machine::flux;

    const T_S: f64 = 1e-4;

    /// Runs the start next to a rotor at `rotor(frame, t)` (rad, for the frame's angle and the time in s) that carries the
    /// requested currents, until hand-over or until `seconds` have passed; returns the last step and the rotor's angle.
    fn beside(reference: f64, seconds: f64, rotor: impl Fn(f64, f64) -> f64) -> (StartStep, f64) {
        let (motor, par, estimators) = (Motor::default(), StartParameters::default(), EstimatorParameters::default());
        let context = Context { par: &estimators, motor: &motor, J: 1.5e-3, T_s: T_S };
        let mut start = CurrentFrequencyStart::default();
        let (mut i_last, mut psi_last, mut theta_last) = (AlphaBeta::ZERO, None, 0.0);
        let (mut frame, mut i_ref, mut t) = (-FRAC_PI_2, DqHat::ZERO, 0.0);
        loop {
            let theta = rotor(frame, t);
            let axis = Axis::<Rotor>::at(theta);
            let i = Axis::<Estimated>::at(frame).to_stator(i_ref);
            let psi = axis.to_stator(flux(&motor, axis.from_stator(i)));
            let u = (psi - psi_last.unwrap_or(psi)) * (1.0 / T_S) + (i_last + i) * (0.5 * motor.R_s);
            let sample = Sample { i, i_last, u, ..Sample::default() };
            let step = start.update(&par, &context, 0.0, reference, &sample);
            let StartStep::Current { theta: at, w, i_ref: next } = step else { return (step, theta) };
            t += T_S;
            if t >= seconds {
                return (step, theta_last);
            }
            (i_last, psi_last, theta_last) = (i, Some(psi), theta);
            (frame, i_ref) = (at + T_S * w, next);
        }
    }

    /// The rotor lags behind its current vector or leads it: the estimator takes over at the rotor, in both directions.
    #[test]
    fn hands_over_at_the_rotor() {
        for (reference, off) in [(50.0, -0.4), (50.0, 0.3), (-50.0, 0.4), (-50.0, -0.3)] {
            let (step, rotor) = beside(reference, 60.0, |frame, _| frame + off);
            let StartStep::HandOver { theta, w, .. } = step else { panic!("{reference} rad/s: {step:?}") };
            let error = wrap(theta - rotor).to_degrees();
            println!("{reference} rad/s, {off} rad: {error} deg off, {w} rad/s");
            assert!(error.abs() < 0.01, "{reference} rad/s, {off} rad: {error} deg");
            let speed = StartParameters::default().speed * 3.0;
            assert!((w - speed.copysign(reference)).abs() < 1e-9, "{w} rad/s");
        }
    }

    /// A rotor that turns through the aligned frame is braked: i_q = -2 zeta w_0 J / (n_p K) w.
    #[test]
    fn damps_the_rotor() {
        let motor = Motor::default();
        let (n_p, K, J) = (3.0, motor.torque_constant(), 1.5e-3);
        let w_0 = (n_p * K * StartParameters::default().i / J).sqrt();
        for w in [4.0, -4.0] {
            let seconds = 0.9 * StartParameters::default().t_align;
            // At the end, the rotor passes the frame.
            let (step, _) = beside(50.0, seconds, |frame, t| frame + w * (t - seconds));
            let StartStep::Current { i_ref, .. } = step else { panic!("{step:?}") };
            let expected = -2.0 * ZETA * w_0 * J / (n_p * K) * w;
            println!("{w} rad/s: {} A, {expected} A", i_ref.q());
            assert!((i_ref.q() / expected - 1.0).abs() < 0.01, "{w} rad/s: {} A, not {expected} A", i_ref.q());
        }
    }

    /// First a quarter of a turn behind the estimate, then on it, then n_p times the acceleration.
    #[test]
    fn the_current_stands_behind_and_then_accelerates() {
        let par = StartParameters::default();
        for (reference, side) in [(50.0, 1.0), (-50.0, -1.0)] {
            for (t, angle, speed) in [
                (0.5 * par.t_align, Some(-FRAC_PI_2), 0.0),
                (1.5 * par.t_align, Some(0.0), 0.0),
                (2.0 * par.t_align + 0.1, None, side * 3.0 * 100.0 * 0.1),
            ] {
                let (step, _) = beside(reference, t, |frame, _| frame);
                let StartStep::Current { theta, w, .. } = step else { panic!("{step:?}") };
                assert!(angle.is_none_or(|angle| (theta - angle).abs() < 1e-9), "{theta} rad after {t} s");
                assert!((w - speed).abs() < 0.2, "{w} rad/s after {t} s, not {speed}");
            }
        }
    }
}
