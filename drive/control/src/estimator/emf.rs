//! Shared parts of the back-EMF estimators: parameters, the observer of one axis, the sign of the direction.
//!
//! In the estimated frame, which turns at w_f, each axis has the voltage equation v = R i + L p i + cross + e. The
//! known terms give r = v - R i - cross. The remainder, e = r - L p i, contains the angle: (e_d, e_q) = E (-sin theta~,
//! cos theta~) with theta~ = theta - theta^, where E has the sign of w.
//!
//! [`AxisObserver`] is Kim & Sul (14), (15) and (21) for one axis with corrections: the innovation is i - i^ with the
//! MEASURED i, the EMF gain is negative (continuous: l_1 = 2 w_o - R/L, l_2 = -w_o^2 L), and R i and the cross terms
//! use the measured current, so that the poles do not depend on the speed. Sampled, with both poles at z = exp(-w_o
//! T_s): i' = i^ + T_s / L (r - e^), i^ = i' + (1 - z^2)(i - i'), e^ = e^ - (1 - z)^2 L / T_s (i - i').
//!
//! The paper neglects (w_f - w) L i in (18). Without this term, motoring produces a right-half-plane zero at about E /
//! (L_d i_q), and the drive cannot hold rated load below 0.220 to 0.270 of the rated speed: `frame_term` keeps the term.
//!
//! A reversal at light load is lost in the papers' form: the sign of E is taken from w^, and where w^ changes its sign too
//! late or too early, the angle error is off by half a turn. With `hold_reversal`, [`follow`] takes the direction from the
//! EMF itself near standstill. The rotor's angle cannot jump, so the frame that was right before the reversal is right
//! after it: e_q = w psi_M cos theta~ then gives the speed with its sign, and -e_d / e_q the angle error without one. With
//! the share g = w_h^2 psi_M^2 / (|e|^2 + w_h^2 psi_M^2) of standstill, w_h = `w_hold`,
//!
//! ```text
//! theta~ = (1 - g) atan2(-s e_d, s e_q), s = sign e_q where g > 1/2        dw^/dt += g w_o / 3 (e_q / psi_M - w^)
//! ```
//!
//! The angle's gain fades with the EMF, and the speed goes on through zero with e_q, so that theta^ is its integral: the
//! error grows with the time spent there, by (R - R^) i / psi_M in rad/s. It is meant for passing through zero, not for staying
//! there.
//!
//! At a constant speed, a wrong R^ or psi^ leaves e_q / psi_M beside the rotor's speed, and w^ between the two: off by up to 18 %
//! at 0.05 of the rated speed. The frame follows the rotor all the same, so its speed w_f is right. Where g < 0.85 ([`Direction`]),
//! the estimator supplies w^ + f y instead of w^, with f = 1 for g < 0.75 and f = 0 for g > 0.85, linear between them:
//!
//! ```text
//! dy/dt = 0.03 rho (f (w_f - w^) - y), |w_f - w^| limited to max(w_h, |w^|) / 4
//! ```

use crate::estimator::contract::{ContextOf, Estimate, Sample, SetupOf};
use crate::estimator::interval::Interval;
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::DqHat;
use drive_base::math::{atan2, exp};
use fmu_core::unit::RAD_PER_S;
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The parameters with the prefix `emf.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EmfParameters {
    /// EMF bandwidth in rad/s, > 0: both poles of the observers, and the pole of the direct-EMF filter.
    pub bandwidth: f64,
    /// Electrical speed in rad/s, > 0, that the estimate must reach in the opposite direction to change the sign.
    pub w_sign: f64,
    /// Keeps the frame-speed term.
    pub frame_term: bool,
    /// Holds the rotor in a reversal.
    pub hold_reversal: bool,
    /// Electrical speed w_h in rad/s, > 0, below which the direction is kept through a reversal.
    pub w_hold: f64,
}

impl Default for EmfParameters {
    fn default() -> Self {
        Self { bandwidth: TAU * 150.0, w_sign: 5.0, frame_term: true, hold_reversal: false, w_hold: 30.0 }
    }
}

impl EmfParameters {
    /// Frame speed minus the speed `w` (rad/s), or 0 if the term is neglected.
    #[inline]
    pub fn slip(&self, interval: &Interval, w: f64) -> f64 {
        if self.frame_term { interval.w_frame - w } else { 0.0 }
    }
}

/// Direction of rotation, and the speed by which the frame slips where the EMF guides the speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Direction {
    /// Sign of the direction, with hysteresis.
    sign: f64,
    /// Speed of the frame minus w^ in rad/s, smoothed.
    slip: f64,
}

impl Default for Direction {
    fn default() -> Self {
        Self { sign: 1.0, slip: 0.0 }
    }
}

/// Share g of standstill above which the frame's speed is not used: it is the integral of the EMF's error there.
const STANDS: f64 = 0.85;

/// Width in g of the transition below [`STANDS`].
const FADE: f64 = 0.1;

/// Bandwidth of the smoothed slip as a share of the tracker's.
const SMOOTH: f64 = 0.03;

/// Maximum slip as a share of the speed and of `w_hold`.
const MOST: f64 = 0.25;

impl Direction {
    /// At the speed `w` (rad/s).
    pub fn of(w: f64) -> Self {
        Self { sign: if w < 0.0 { -1.0 } else { 1.0 }, slip: 0.0 }
    }

    /// The sign for the speed `w` (rad/s): it changes when `w` passes `w_sign` in the opposite direction.
    #[inline]
    pub fn update(&mut self, w: f64, w_sign: f64) -> f64 {
        if w * self.sign < -w_sign {
            self.sign = -self.sign;
        }
        self.sign
    }

    /// The tracker follows the angle error `e` (rad) at the share `g` of standstill; the speed is that of the frame.
    #[inline]
    pub fn follow<All: AsRef<EmfParameters> + AsRef<TrackerParameters>>(
        &mut self,
        tracker: &mut Tracker,
        context: &ContextOf<All>,
        (g, e): (f64, f64),
        sample: &Sample,
    ) -> Estimate {
        let estimate = tracker.follow(context, e, sample);
        let turns = ((STANDS - g) / FADE).clamp(0.0, 1.0);
        let most = MOST * context.of::<EmfParameters>().w_hold.max(tracker.w.abs());
        let slip = turns * (tracker.w_frame - tracker.w).clamp(-most, most);
        self.slip += context.T_s * SMOOTH * context.of::<TrackerParameters>().bandwidth * (slip - self.slip);
        Estimate { w: estimate.w + turns * self.slip, ..estimate }
    }
}

/// The angle error theta - theta^ in rad from the EMF (`e_d`, `e_q`) (V), for the direction sign `s`.
#[inline]
pub fn angle_error(s: f64, e_d: f64, e_q: f64) -> f64 {
    atan2(-s * e_d, s * e_q)
}

/// The last step of the methods that observe the EMF `e` (V): the tracker follows its angle.
#[inline]
pub fn follow<All: AsRef<EmfParameters> + AsRef<TrackerParameters>>(
    tracker: &mut Tracker,
    direction: &mut Direction,
    context: &ContextOf<All>,
    e: DqHat,
    sample: &Sample,
) -> Estimate {
    let s = direction.update(tracker.w, context.of::<EmfParameters>().w_sign);
    if !context.of::<EmfParameters>().hold_reversal {
        return tracker.follow(context, angle_error(s, e.d(), e.q()), sample);
    }
    let g = hold(tracker, context, e);
    let s = if g > 0.5 { 1.0_f64.copysign(e.q()) } else { s };
    direction.follow(tracker, context, (g, (1.0 - g) * angle_error(s, e.d(), e.q())), sample)
}

/// Guides the speed through zero with the EMF `e` (V); returns the share g of standstill.
#[inline]
pub fn hold<All: AsRef<EmfParameters>>(tracker: &mut Tracker, context: &ContextOf<All>, e: DqHat) -> f64 {
    let ContextOf { motor, T_s, .. } = *context;
    let least = context.of::<EmfParameters>().w_hold * motor.psi_M;
    let g = least * least / (e.dot(e) + least * least);
    tracker.w += T_s * g * context.of::<EmfParameters>().bandwidth / 3.0 * (e.q() / motor.psi_M - tracker.w);
    g
}

/// Observer for the current and EMF of one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AxisObserver {
    i: f64,
    e: f64,
}

impl AxisObserver {
    /// At the measured current `i` (A) and the EMF `e` (V).
    pub fn at(i: f64, e: f64) -> Self {
        Self { i, e }
    }

    /// The EMF in V. Inputs: the voltage `r` (V) without R i and cross terms, the current `i` (A) at the end of the
    /// interval, and the inductance `L` (H); the pole is `z` = exp(-w_o T_s).
    #[inline]
    pub fn update(&mut self, z: f64, L: f64, T_s: f64, r: f64, i: f64) -> f64 {
        let predicted = self.i + T_s / L * (r - self.e);
        let innovation = i - predicted;
        self.i = predicted + (1.0 - z * z) * innovation;
        self.e -= (1.0 - z) * (1.0 - z) * L / T_s * innovation;
        self.e
    }
}

/// Checks that the tracker's bandwidth is at most one third of the EMF bandwidth.
///
/// # Errors
/// States by how much the tracker is too fast.
pub fn validate<All: AsRef<EmfParameters> + AsRef<TrackerParameters>>(setup: &SetupOf<All>) -> Result<(), Fault> {
    let (rho, w_o) = (setup.of::<TrackerParameters>().bandwidth, setup.of::<EmfParameters>().bandwidth);
    if rho > w_o / 3.0 * (1.0 + 1e-9) {
        let observer = setup.tell("emf.bandwidth");
        let allowed = format!("at most a third of {observer}, or the tracker rings on the EMF's lag");
        return Err(setup.fault("tracker.bandwidth", allowed));
    }
    Ok(())
}

/// Pole of a sampled first-order system with the bandwidth `w` (rad/s).
#[inline]
pub fn pole(w: f64, T_s: f64) -> f64 {
    exp(-w * T_s)
}

type P = Row<EmfParameters>;

/// The variables; their owner adds the prefix `emf.`.
pub const EMF: &Table<EmfParameters> = table![
    P::parameter("bandwidth", &RAD_PER_S, "Bandwidth of the back-EMF observer or filter", |p| &mut p.bandwidth)
        .above(0.0)
        .tunable(),
    P::parameter(
        "w_sign",
        &RAD_PER_S,
        "Electrical speed beyond zero at which the estimated direction of rotation changes",
        |p| &mut p.w_sign,
    )
    .above(0.0),
    P::boolean_parameter(
        "frame_term",
        "Keep the term of the estimated frame's speed error, which Kim & Sul drop in (18); false: methods with this term alone",
        |p| &mut p.frame_term,
    ),
    P::boolean_parameter(
        "hold_reversal",
        "Near standstill, the direction of rotation comes from the EMF: a reversal at light load is held; estimators \
                 other than the EMF methods refuse it",
        |p| &mut p.hold_reversal,
    ),
    P::parameter(
        "w_hold",
        &RAD_PER_S,
        "Electrical speed below which emf.hold_reversal takes the speed from the EMF",
        |p| &mut p.w_hold,
    )
    .above(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_poles_of_the_axis_observer_are_where_they_should_be() {
        // Free response: i = 0, r = 0. Both poles at z: error(k) = (a + b k) z^k, so x(k+2) - 2 z x(k+1) + z^2 x(k) = 0.
        let (z, L, T_s) = (pole(TAU * 150.0, 1e-4), 36e-3, 1e-4);
        let mut o = AxisObserver::at(0.0, 10.0);
        let mut e = [10.0, o.update(z, L, T_s, 0.0, 0.0), 0.0];
        for _ in 0..100 {
            e[2] = o.update(z, L, T_s, 0.0, 0.0);
            assert!((e[2] - 2.0 * z * e[1] + z * z * e[0]).abs() < 1e-12, "{e:?}");
            e = [e[1], e[2], 0.0];
        }
    }

    #[test]
    fn the_sign_has_hysteresis() {
        let mut direction = Direction::of(20.0);
        for (w, sign) in [(-4.0, 1.0), (-6.0, -1.0), (4.0, -1.0), (6.0, 1.0)] {
            assert!((direction.update(w, 5.0) - sign).abs() < 1e-15);
        }
    }

    /// Near standstill, the correction of the angle fades and the speed follows e_q / psi_M; at speed, neither.
    #[test]
    fn a_reversal_is_held_near_standstill() {
        let (mut par, motor) = (crate::estimator::EstimatorParameters::default(), drive_base::motor::Motor::default());
        par.emf.hold_reversal = true;
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: 1e-4 };
        let rho = par.tracker.bandwidth;
        for (w, g) in [(par.emf.w_hold, 0.5), (3.0 * par.emf.w_hold, 0.1), (0.0, 1.0)] {
            let (mut tracker, mut direction) = (Tracker::at(0.0, w, 1e-4), Direction::of(w));
            let (angle, length) = (0.1, motor.psi_M * w);
            let e = DqHat::new(-length * f64::sin(angle), length * f64::cos(angle));
            follow(&mut tracker, &mut direction, &context, e, &Sample::default());
            let slow = 1e-4 * g * par.emf.bandwidth / 3.0 * (e.q() / motor.psi_M - w);
            let expected = if w > 0.0 { (1.0 - g) * angle } else { 0.0 };
            assert!((tracker.w_frame - w - slow - 2.0 * rho * expected).abs() < 1e-9, "{w} rad/s: {tracker:?}");
            assert!((tracker.w - w - slow - 1e-4 * rho * rho * expected).abs() < 1e-9, "{w} rad/s: {tracker:?}");
        }
    }

    /// Where the EMF is smaller than at w_h, its sign gives the direction; elsewhere the tracker's sign does.
    #[test]
    fn the_direction_comes_from_a_small_emf() {
        let (mut par, motor) = (crate::estimator::EstimatorParameters::default(), drive_base::motor::Motor::default());
        par.emf.hold_reversal = true;
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: 1e-4 };
        for share in [0.9, 1.1] {
            // The rotor turns backwards, the tracker still forwards.
            let (mut tracker, mut direction) = (Tracker::at(0.0, 1.0, 1e-4), Direction::of(1.0));
            let length = share * par.emf.w_hold * motor.psi_M;
            let e = DqHat::new(0.1 * length, -length);
            follow(&mut tracker, &mut direction, &context, e, &Sample::default());
            let angle = f64::atan2(0.1, 1.0) - if share < 1.0 { 0.0 } else { std::f64::consts::PI };
            let g = 1.0 / (1.0 + share * share * 1.01);
            let correction = (tracker.w_frame - tracker.w) / par.tracker.bandwidth;
            let expected = (1.0 - g) * angle * (2.0 - 1e-4 * par.tracker.bandwidth);
            assert!((correction - expected).abs() < 1e-9, "{correction}, not {expected}, at {share} w_h");
        }
    }
}
