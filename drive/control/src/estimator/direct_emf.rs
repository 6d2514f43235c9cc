//! The back EMF calculated from the voltage equation (Kim & Sul (11)-(13)): method 1 of the review.
//!
//! The method assumes constant currents: e_d = v_d - R i_d + w L_q i_q + (w_f - w) L_d i_q, e_q = v_q - R i_q - w L_d
//! i_d - (w_f - w) L_q i_d. A first-order low-pass filters both (`emf.bandwidth`). From (e_d, e_q) = w psi_M (-sin
//! theta~, cos theta~), a tracker receives theta~ = atan2(-s e_d, s e_q).
//! Correction to the paper: (11) contains w_r, not the printed speed estimate.
//!
//! Limits: the calculated EMF includes L p i, and therefore the current loop's voltage noise and each load change. It
//! holds rated load down to 0.020 of the rated speed, 0.020 with a compensated dead time. A reversal at light load is
//! ambiguous by half a turn, unless `emf.hold_reversal` holds it.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample, SetupOf};
use crate::estimator::emf::{self, Direction, EmfParameters, pole};
use crate::estimator::interval::Interval;
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::DqHat;
use fmu_core::Fault;
use serde::{Deserialize, Serialize};

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DirectEmf {
    tracker: Tracker,
    /// Filtered EMF in V.
    e: DqHat,
    direction: Direction,
}

impl<All: AsRef<EmfParameters> + AsRef<TrackerParameters>> Estimating<All> for DirectEmf {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let e = DqHat::new(0.0, w * context.motor.psi_M);
        let tracker = Tracker::at(theta, w, context.T_s);
        (Self { tracker, e, direction: Direction::of(w) }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        self.tracker.advance(T_s);
        let x = Interval::new(self.tracker.theta_last, self.tracker.theta, sample, T_s);
        let w = self.tracker.w;
        let slip = context.of::<EmfParameters>().slip(&x, w);
        let e = DqHat::new(
            x.v.d() - motor.R_s * x.i.d() + (w * motor.L_q + slip * motor.L_d) * x.i.q(),
            x.v.q() - motor.R_s * x.i.q() - (w * motor.L_d + slip * motor.L_q) * x.i.d(),
        );
        self.e += (e - self.e) * (1.0 - pole(context.of::<EmfParameters>().bandwidth, T_s));
        emf::follow(&mut self.tracker, &mut self.direction, context, self.e, sample)
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
        comes_to_the_rotor::<DirectEmf>(157.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<DirectEmf>(1.2), with_L_q::<DirectEmf>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }
}
