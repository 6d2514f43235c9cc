//! Gradient observer of the stator flux (Lee, Hong, Nam, Ortega, Praly, Astolfi, "Sensorless control of surface-mount
//! permanent-magnet synchronous motors based on a nonlinear observer", IEEE Trans. Power Electron. 25 (2), 2010; Ortega,
//! Praly, Astolfi, Lee, Nam, "Estimation of rotor position and speed of permanent magnet synchronous motors with
//! guaranteed stability", IEEE Trans. Control Syst. Technol. 19 (3), 2011).
//!
//! In stator axes, eta = psi_s - L_q i has the direction of the rotor and the length psi_a = psi_M + (L_d - L_q) i_d. The
//! papers treat L_d = L_q; with L_q and this length, the observer also suits a salient machine:
//!
//! ```text
//! d psi_s^/dt = u - R i + gamma / 2 eta^ (psi_a^2 - |eta^|^2)        eta^ = psi_s^ - L_q i
//! ```
//!
//! The last term is the gradient of (psi_a^2 - |eta^|^2)^2 / 8, and pulls eta^ to the circle at the rate
//! b = gamma psi_M^2, which is the parameter. The [tracker](crate::estimator::tracker) follows the angle of eta^. Around
//! the rotor the flux error has the poles s^2 + b s + w^2: a small b is slow, a large one loses the rotor at low speed,
//! where the slow pole is w^2 / b.
//!
//! `clamped` is the form that open motor controllers use: no gradient, but both components of eta^ are limited to
//! +-psi_a. It costs less and corrects only components that have left the square.
//!
//! Limits: a constant error of R i or of the current adds up at low speed. It holds rated load down to 0.010 of the rated
//! speed, 0.010 with a compensated dead time. With the clamp, an angle error remains where eta^ leaves the circle but not
//! the square.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, Estimated};
use drive_base::math::atan2;
use fmu_core::unit::PER_SECOND;
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Minimum length of eta as a share of `psi_M`.
const LEAST: f64 = 0.1;

/// Parameters of the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GradientParameters {
    /// Rate gamma psi_M^2 in 1/s at which eta converges to the circle, > 0.
    pub bandwidth: f64,
    /// Clamp instead of the gradient.
    pub clamped: bool,
}

impl Default for GradientParameters {
    fn default() -> Self {
        Self { bandwidth: 50.0, clamped: false }
    }
}

/// State at the last sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GradientObserver {
    tracker: Tracker,
    /// Stator flux linkage without L_q i in Wb.
    eta: AlphaBeta,
}

impl<All: AsRef<GradientParameters> + AsRef<TrackerParameters>> Estimating<All> for GradientObserver {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let axis = Axis::<Estimated>::at(theta);
        let eta = axis.along(length(context, axis, sample));
        (Self { tracker: Tracker::at(theta, w, context.T_s), eta }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        self.tracker.advance(T_s);
        let axis = Axis::<Estimated>::at(self.tracker.theta);
        let psi_a = length(context, axis, sample);
        let mean = (sample.i_last + sample.i) * 0.5;
        self.eta += (sample.u - mean * motor.R_s) * T_s - (sample.i - sample.i_last) * motor.L_q;
        if context.of::<GradientParameters>().clamped {
            let within = |x: f64| x.max(-psi_a).min(psi_a);
            self.eta = AlphaBeta::new(within(self.eta.alpha()), within(self.eta.beta()));
        } else {
            // At most the full correction, since a state far off would overshoot.
            let off = 1.0 - self.eta.dot(self.eta) / (psi_a * psi_a);
            let gain =
                0.5 * T_s * context.of::<GradientParameters>().bandwidth * psi_a * psi_a / (motor.psi_M * motor.psi_M);
            self.eta = self.eta * (1.0 + (gain * off).max(-0.5));
        }
        let eta = axis.from_stator(self.eta);
        self.tracker.correct(context, context.of::<TrackerParameters>().bandwidth, atan2(eta.q(), eta.d()), sample);
        Estimate { theta: self.tracker.theta, axis, w: self.tracker.w, i: sample.i, ..Estimate::default() }
    }
}

/// Length psi_a of eta in Wb.
#[inline]
fn length<All>(context: &ContextOf<All>, axis: Axis<Estimated>, sample: &Sample) -> f64 {
    let motor = context.motor;
    (motor.psi_M + (motor.L_d - motor.L_q) * axis.from_stator(sample.i).d()).max(LEAST * motor.psi_M)
}

type P = Row<GradientParameters>;

/// The observer's variables; their owner adds the prefix `gradient.`.
pub const GRADIENT: &Table<GradientParameters> = table![
    P::parameter("bandwidth", &PER_SECOND, "Rate at which GradientObserver brings the flux to the circle", |p| {
        &mut p.bandwidth
    })
    .above(0.0)
    .tunable(),
    P::boolean_parameter(
        "clamped",
        "GradientObserver, the others refuse it: both components of the flux limited to the magnet's, as in open motor controllers",
        |p| &mut p.clamped,
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{beside, comes_to_the_rotor, salient, with_L_q};
    use drive_base::frame::Dq;

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<GradientObserver>(94.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<GradientObserver>(1.2), with_L_q::<GradientObserver>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }

    /// The clamp removes an initial flux error in at least one direction.
    #[test]
    fn the_clamp_holds_the_rotor() {
        let mut par = EstimatorParameters::default();
        par.gradient.clamped = true;
        for (w, degrees) in [(235.0, 20.0_f64), (-235.0, -20.0)] {
            let point = (w, Dq::new(-0.84, 5.59));
            let (angle, _) = beside::<GradientObserver>(&par, &salient(), point, degrees.to_radians(), 10_000);
            assert!(angle.to_degrees().abs() < 2.0, "{w} rad/s: {} deg", angle.to_degrees());
        }
    }

    /// Without voltage and current, |eta| returns to psi_M: d|eta|/dt = b/2 |eta| (1 - |eta|^2 / psi_M^2); clamped, at once.
    #[test]
    fn the_length_returns_with_the_bandwidth() {
        let (mut par, motor, T_s) = (EstimatorParameters::default(), salient(), 1e-4);
        for clamped in [false, true] {
            par.gradient = GradientParameters { bandwidth: 80.0, clamped };
            let context = ContextOf { par: &par, motor: &motor, J: 15e-3, T_s };
            let (mut observer, _) = GradientObserver::start(&context, &Sample::default(), 0.0, 0.0);
            observer.eta = observer.eta * 1.02;
            observer.update(&context, &Sample::default());
            let expected = if clamped { 1.0 } else { 1.02 * (1.0 + 0.5 * T_s * 80.0 * (1.0 - 1.02 * 1.02)) };
            let length = observer.eta.magnitude() / motor.psi_M;
            assert!((length - expected).abs() < 1e-12, "{length}, not {expected}");
        }
    }
}
