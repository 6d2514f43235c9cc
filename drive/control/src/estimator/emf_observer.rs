//! State observer for the back EMF (Kim & Sul (14), (15), after Son et al. 2002): method 2 of the review.
//!
//! This is the extended-EMF observer, but with L_d on the d-axis and L_q on the q-axis:
//! v_d = R i_d + L_d p i_d - w L_q i_q - (w_f - w) L_d i_q + e_d, v_q = R i_q + L_q p i_q + w L_d i_d + (w_f - w) L_q i_d + e_q.
//! The relation (e_d, e_q) = w psi_M (-sin theta~, cos theta~) holds to first order in theta~ for constant currents
//! (11).
//! Correction to the paper: in (14) the EMF columns have -1/L_d and -1/L_q, and the input is (v_ds, v_qs); (11) has
//! w_r.
//!
//! Limits: the same as for the extended EMF; for large angle errors, the neglected saliency slows convergence. It holds rated
//! load down to 0.020 of the rated speed, 0.020 with a compensated dead time.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample, SetupOf};
use crate::estimator::emf::{self, AxisObserver, Direction, EmfParameters, pole};
use crate::estimator::interval::Interval;
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::DqHat;
use fmu_core::Fault;
use serde::{Deserialize, Serialize};

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EmfObserver {
    tracker: Tracker,
    d: AxisObserver,
    q: AxisObserver,
    direction: Direction,
}

impl<All: AsRef<EmfParameters> + AsRef<TrackerParameters>> Estimating<All> for EmfObserver {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let tracker = Tracker::at(theta, w, context.T_s);
        let now = Interval::new(tracker.theta_last, theta, sample, context.T_s).i_now;
        let observer = Self {
            tracker,
            d: AxisObserver::at(now.d(), 0.0),
            q: AxisObserver::at(now.q(), w * context.motor.psi_M),
            direction: Direction::of(w),
        };
        (observer, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        self.tracker.advance(T_s);
        let x = Interval::new(self.tracker.theta_last, self.tracker.theta, sample, T_s);
        let (w, z) = (self.tracker.w, pole(context.of::<EmfParameters>().bandwidth, T_s));
        let slip = context.of::<EmfParameters>().slip(&x, w);
        let r_d = x.v.d() - motor.R_s * x.i.d() + (w * motor.L_q + slip * motor.L_d) * x.i.q();
        let r_q = x.v.q() - motor.R_s * x.i.q() - (w * motor.L_d + slip * motor.L_q) * x.i.d();
        let e_d = self.d.update(z, motor.L_d, T_s, r_d, x.i_now.d());
        let e_q = self.q.update(z, motor.L_q, T_s, r_q, x.i_now.q());
        emf::follow(&mut self.tracker, &mut self.direction, context, DqHat::new(e_d, e_q), sample)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        emf::validate(setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::testing::{comes_to_the_rotor, with_L_q};

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<EmfObserver>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<EmfObserver>(1.2), with_L_q::<EmfObserver>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }
}
