//! Trackers: they calculate angle and speed from an angle error e = theta - theta^ (Kim & Sul's sign).
//!
//! - PLL, poles (s + rho)^2: theta^ += T_s (w^ + 2 rho e), w^ += T_s rho^2 e.
//! - Mechanical observer, poles (s + rho)^3, with the torque reference tau* as feed-forward:
//!   theta^ += T_s (w^ + 3 rho e), w^ += T_s (n_p / J (tau* - tau_L) + 3 rho^2 e), tau_L -= T_s J / n_p rho^3 e.
//!
//! The PLL follows a constant speed without an error. The mechanical observer follows a constant load without an error
//! and, if J is correct, every change of the machine's torque, so its speed does not lag. Limits: after a filter or observer
//! of bandwidth w_o, rho <= w_o / 3; below 2 pi 15 rad/s, a 50 % load step loses synchronism.

use crate::estimator::contract::{ContextOf, Estimate, Sample, SetupOf};
use drive_base::math::at_least;
use fmu_core::unit::RAD_PER_S;
use fmu_core::{Fault, Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

enumeration! {
    /// The trackers; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum TrackerKind("Tracker", "Tracker of angle and speed from an angle error") {
        1 Pll "Phase-locked loop of second order";
        2 MechanicalObserver "Observer of speed and load torque, of third order";
    }
}

/// The parameters with the prefix `tracker.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackerParameters {
    /// The selected tracker.
    pub kind: TrackerKind,
    /// Pole rho in rad/s, > 0, with multiplicity two or three.
    pub bandwidth: f64,
}

impl Default for TrackerParameters {
    fn default() -> Self {
        Self { kind: TrackerKind::Pll, bandwidth: 2.0 * std::f64::consts::PI * 20.0 }
    }
}

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Tracker {
    /// Electrical angle at this sample in rad, not wrapped.
    pub theta: f64,
    /// Electrical angle at the last sample in rad.
    pub theta_last: f64,
    /// Electrical speed in rad/s.
    pub w: f64,
    /// Frame speed from this sample to the next in rad/s: w plus the angle correction.
    pub w_frame: f64,
    /// Load torque in N.m (mechanical observer).
    pub tau_load: f64,
}

impl Tracker {
    /// At the electrical angle `theta` (rad), turning at `w` (rad/s).
    pub fn at(theta: f64, w: f64, T_s: f64) -> Self {
        Self { theta, theta_last: theta - w * T_s, w, w_frame: w, tau_load: 0.0 }
    }

    /// Advances to the next sample, `T_s` (s) later; each update calls this first.
    #[inline]
    pub fn advance(&mut self, T_s: f64) {
        self.theta_last = self.theta;
        self.theta += T_s * self.w_frame;
    }

    /// Corrects the state with the angle error `e` (rad) and the bandwidth `rho` (rad/s): the angle from the next
    /// sample on, the speed immediately. Field weakening may require a faster one.
    #[inline]
    pub fn correct<All: AsRef<TrackerParameters>>(
        &mut self,
        context: &ContextOf<All>,
        rho: f64,
        e: f64,
        sample: &Sample,
    ) {
        let (T_s, rho) = (context.T_s, at_least(rho, sample.rho));
        if context.of::<TrackerParameters>().kind == TrackerKind::MechanicalObserver {
            let inertia = context.J / f64::from(context.motor.n_p);
            self.w_frame = self.w + 3.0 * rho * e;
            self.w += T_s * ((sample.tau_ref - self.tau_load) / inertia + 3.0 * rho * rho * e);
            self.tau_load -= T_s * inertia * rho * rho * rho * e;
        } else {
            self.pull(rho, e, T_s);
        }
    }

    /// Corrects the state as the PLL does.
    #[inline]
    pub(crate) fn pull(&mut self, rho: f64, e: f64, T_s: f64) {
        self.w_frame = self.w + 2.0 * rho * e;
        self.w += T_s * rho * rho * e;
    }
}

/// Checks that the tracker can work.
///
/// # Errors
/// The mechanical observer has no inertia value.
pub fn validate<All: AsRef<TrackerParameters>>(setup: &SetupOf<All>) -> Result<(), Fault> {
    let observes_load = setup.of::<TrackerParameters>().kind == TrackerKind::MechanicalObserver;
    if observes_load && setup.J.partial_cmp(&0.0) != Some(Ordering::Greater) {
        return Err(Fault::new(format!(
            "{} and {}: that observer divides torque by inertia, which must be above 0",
            setup.tell("mechanics.J"),
            setup.tell("tracker.kind")
        )));
    }
    Ok(())
}

impl Tracker {
    /// The common last step of the methods that calculate an angle error: the tracker follows `e` (rad) and supplies
    /// the estimated angle and speed.
    #[inline]
    pub fn follow<All: AsRef<TrackerParameters>>(
        &mut self,
        context: &ContextOf<All>,
        e: f64,
        sample: &Sample,
    ) -> Estimate {
        self.correct(context, context.of::<TrackerParameters>().bandwidth, e, sample);
        Estimate::new(self.theta, self.w, sample)
    }
}

type P = Row<TrackerParameters>;

/// The tracker's variables; their owner adds the prefix `tracker.`.
pub const TRACKER: &Table<TrackerParameters> = table![
    P::enumeration_parameter(
        "kind",
        "Tracker of angle and speed from the angle error; estimators without a tracker refuse the second",
        &Field(|p| &mut p.kind),
    ),
    P::parameter(
        "bandwidth",
        &RAD_PER_S,
        "Magnitude of the tracker's double or triple pole; field weakening raises it where angle errors make torque",
        |p| &mut p.bandwidth,
    )
    .above(0.0)
    .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::motor::Motor;

    /// Angle and speed error after `n` samples when following a rotor with a constant acceleration (rad/s2).
    fn behind(kind: TrackerKind, acceleration: f64, tau_ref: f64, n: u32) -> (f64, f64) {
        let par = EstimatorParameters {
            tracker: TrackerParameters { kind, ..TrackerParameters::default() },
            ..EstimatorParameters::default()
        };
        let motor = Motor::default();
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: 1e-4 };
        let mut tracker = Tracker::at(0.3, 0.0, context.T_s);
        let (mut theta, mut w) = (0.0, 50.0);
        for _ in 0..n {
            tracker.advance(context.T_s);
            theta += context.T_s * w + 0.5 * context.T_s * context.T_s * acceleration;
            w += context.T_s * acceleration;
            tracker.correct(
                &context,
                par.tracker.bandwidth,
                theta - tracker.theta,
                &Sample { tau_ref, ..Sample::default() },
            );
        }
        (theta - tracker.theta, w - tracker.w)
    }

    #[test]
    fn steady_errors_are_those_of_the_loop_type() {
        let rho = TrackerParameters::default().bandwidth;
        let (angle, speed) = behind(TrackerKind::Pll, 0.0, 0.0, 5000);
        assert!(angle.abs() < 1e-10 && speed.abs() < 1e-9, "PLL at constant speed: {angle} rad, {speed} rad/s");
        let (angle, _) = behind(TrackerKind::Pll, 1000.0, 0.0, 5000);
        assert!((angle - 1000.0 / (rho * rho)).abs() < 1e-4, "PLL at constant acceleration: {angle} rad");
        let (angle, speed) = behind(TrackerKind::MechanicalObserver, 1000.0, 0.0, 10_000);
        assert!(angle.abs() < 1e-9 && speed.abs() < 0.2, "the unknown load becomes tau_load: {angle}, {speed}");
    }

    /// Both trackers have the poles of their equations: with E s the response to an angle error of 1 rad, 1/(s + rho)^n gives
    /// e^{-x} (1 - x) and e^{-x} (1 - 2 x + x^2 / 2), x = rho t. The observed load follows a step with rho^3/(s + rho)^3.
    #[test]
    fn an_angle_error_decays_with_the_double_and_the_triple_pole() {
        let (motor, J, T_s, rho) = (Motor { n_p: 5, ..Motor::default() }, 4e-3, 1e-6, 100.0);
        for (kind, load) in
            [(TrackerKind::Pll, 0.0), (TrackerKind::MechanicalObserver, 0.0), (TrackerKind::MechanicalObserver, 2.0)]
        {
            let par = EstimatorParameters {
                tracker: TrackerParameters { kind, bandwidth: rho },
                ..EstimatorParameters::default()
            };
            let context = ContextOf { par: &par, motor: &motor, J, T_s };
            let (start, a) = (if load > 0.0 { 0.0 } else { 1.0 }, -5.0 * load / J);
            let (mut tracker, mut theta, mut w) = (Tracker::at(0.0, 70.0, T_s), start, 70.0);
            for k in 1..=50_000_u32 {
                tracker.advance(T_s);
                theta += T_s * w;
                w += T_s * a;
                tracker.correct(&context, rho, theta - tracker.theta, &Sample::default());
                let x = rho * T_s * f64::from(k);
                if k % 10_000 != 0 {
                    continue;
                }
                let (seen, expected) = match kind {
                    _ if load > 0.0 => (tracker.tau_load / load, 1.0 - (-x).exp() * (1.0 + x + 0.5 * x * x)),
                    TrackerKind::Pll => (theta - tracker.theta, (-x).exp() * (1.0 - x)),
                    TrackerKind::MechanicalObserver => {
                        (theta - tracker.theta, (-x).exp() * (1.0 - 2.0 * x + 0.5 * x * x))
                    }
                };
                assert!((seen - expected).abs() < 1e-3, "{kind:?} at {x} / rho: {seen} instead of {expected}");
            }
        }
    }
}
