//! Fundamental voltage feedback (Kim & Sul (31), (32), after Bae et al. 2003): method 6 of the review.
//!
//! In a correctly aligned frame, the current controller's feed-forward (31) supplies the full voltage. The PI output on
//! the d-axis therefore shows the angle error: v_d,fb = -w psi_M sin theta~. A tracker receives e = -s v_d,fb / (psi_M
//! |w|), or, with the frame-speed term, e = -s (v_d,fb + (w_f - w) L_d i_q) / (psi_M |w|). Correction to the paper:
//! (31) has R_s in both rows.
//!
//! The method needs a specific current loop: feed-forward from the references and no active resistance, preferably with
//! `current.integral` = 0.2.
//! Limits: L p i is neglected. It holds rated load down to 0.020 of the rated speed, 0.020 with a compensated dead time;
//! as printed, without the frame term, to 0.120. A reversal at light load is ambiguous by half a turn, unless
//! `emf.hold_reversal` holds it.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample, SetupOf};
use crate::estimator::emf::{self, Direction, EmfParameters, pole};
use crate::estimator::interval::Interval;
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::DqHat;
use fmu_core::Fault;
use serde::{Deserialize, Serialize};

/// Largest angle error in rad that is passed on.
const CLIP: f64 = 0.5;

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VoltageFeedback {
    tracker: Tracker,
    direction: Direction,
    /// Smoothed frame-speed voltage in V.
    frame: f64,
    /// Speed in rad/s that it supplied, which is in the feed-forward.
    w: f64,
}

impl<All: AsRef<EmfParameters> + AsRef<TrackerParameters>> Estimating<All> for VoltageFeedback {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let tracker = Tracker::at(theta, w, context.T_s);
        (Self { tracker, direction: Direction::of(w), frame: 0.0, w }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        self.tracker.advance(T_s);
        let x = Interval::new(self.tracker.theta_last, self.tracker.theta, sample, T_s);
        let w = self.w;
        let s = self.direction.update(w, context.of::<EmfParameters>().w_sign);
        let smoothing = 1.0 - pole(context.of::<EmfParameters>().bandwidth, T_s);
        self.frame += smoothing * (context.of::<EmfParameters>().slip(&x, w) * motor.L_d * x.i.q() - self.frame);
        let v_dfb = sample.u_pi.d() + self.frame;
        let &EmfParameters { hold_reversal, w_hold, w_sign, .. } = context.of();
        let error = |s: f64, least: f64| (-s * v_dfb / (motor.psi_M * w.abs().max(least))).clamp(-CLIP, CLIP);
        let estimate = if hold_reversal {
            // On the q-axis, the feed-forward supplies w^ psi_M of the EMF, the PI the remainder.
            let e_q = w * motor.psi_M + sample.u_pi.q();
            let g = emf::hold(&mut self.tracker, context, DqHat::new(v_dfb, e_q));
            let s = if g > 0.5 { 1.0_f64.copysign(e_q) } else { s };
            self.direction.follow(&mut self.tracker, context, (g, (1.0 - g) * error(s, w_hold)), sample)
        } else {
            self.tracker.follow(context, error(s, w_sign), sample)
        };
        self.w = estimate.w;
        estimate
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        if !setup.reference_feed_forward || setup.active_resistance {
            return Err(Fault::new(format!(
                "{} and {}: {} reads the angle error from the output of the current controller's integrators; set the \
                 first to true and the second to false, so that nothing else appears there",
                setup.tell("current.reference_feed_forward"),
                setup.tell("current.active_resistance"),
                setup.tell("estimator")
            )));
        }
        emf::validate(setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::motor::Motor;

    /// The PI gives -w psi_M sin theta~ on the d axis: the estimate turns toward the rotor, in both directions of rotation.
    #[test]
    fn the_estimate_turns_toward_the_rotor() {
        let (par, motor) = (EstimatorParameters::default(), Motor::default());
        let context = ContextOf { par: &par, motor: &motor, J: 1.5e-3, T_s: 1e-4 };
        for w in [200.0, -200.0] {
            for start in [0.3, -0.3] {
                let (mut theta, first) = (start, Sample::default());
                let (mut estimator, mut estimate) = VoltageFeedback::start(&context, &first, 0.0, w);
                for _ in 0..5000 {
                    let u_pi = DqHat::new(-w * motor.psi_M * (theta - estimate.theta).sin(), 0.0);
                    theta += 1e-4 * w;
                    estimate = estimator.update(&context, &Sample { u_pi, ..first });
                }
                let off = theta - estimate.theta;
                assert!(off.abs() < 0.03, "{w} rad/s, {start} rad ahead: {off} rad");
            }
        }
    }
}
