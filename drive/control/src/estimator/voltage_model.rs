//! The voltage model (Kim & Sul (24)-(27), Fig. 4, after Matsui 1993): method 4 of the review.
//!
//! The q row gives the speed: w_cal = (v_q - R i_q - L_q p i_q - (w_f - w) L_q i_d) / (psi_M + L_d i_d), smoothed to w.
//! The residual of the d row, dv_d = v_d - R i_d - L_d p i_d + w L_q i_q + (w_f - w) L_d i_q = -w psi_M sin theta~,
//! gives the angle: e = -s dv_d / (psi_M |w|) corrects the frame ([`follower`](crate::estimator::follower)).
//! Correction to the paper: the q row of (24) is L_q p i_q + w L_d i_d; (25) is exact only with the frame-speed term,
//! and with the turn of the rotor in a sample ([`Interval::turn`]): without it, the speed is 0.7 % low at 0.42 rad.
//!
//! Limits: it holds rated load down to 0.010 of the rated speed, 0.010 with a compensated dead time. L_q + 20 %
//! shifts the angle by 5.5 deg and makes rated load oscillate above 0.75 of the rated speed. The derivative of the
//! current makes the speed noisy.

use crate::estimator::contract::ContextOf;
use crate::estimator::emf::pole;
use crate::estimator::follower::{Follower, MatsuiParameters, Rows};
use crate::estimator::interval::Interval;
use serde::{Deserialize, Serialize};

/// The model as an estimator.
pub type VoltageModel = Follower<VoltageRows>;

/// The rows of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VoltageRows;

impl<All: AsRef<MatsuiParameters>> Rows<All> for VoltageRows {
    #[inline]
    fn rows(w: &mut f64, context: &ContextOf<All>, x: &Interval, slip: f64) -> f64 {
        let ContextOf { motor, T_s, .. } = *context;
        let (speeds, changes) = x.turn(T_s);
        let p_i = (x.i_now - x.i_last) * (changes / T_s);
        let slip = speeds * slip;
        let w_cal = (x.v.q() - motor.R_s * x.i.q() - motor.L_q * p_i.q() - slip * motor.L_q * x.i.d())
            / (speeds * (motor.psi_M + motor.L_d * x.i.d()));
        *w += (1.0 - pole(context.of::<MatsuiParameters>().filter, T_s)) * (w_cal - *w);
        x.v.d() - motor.R_s * x.i.d() - motor.L_d * p_i.d() + (speeds * *w * motor.L_q + slip * motor.L_d) * x.i.q()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::testing::{comes_to_the_rotor, with_L_q};

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<VoltageModel>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<VoltageModel>(1.2), with_L_q::<VoltageModel>(0.8));
        assert!((more - 5.5).abs() < 0.3 && (less + 5.9).abs() < 0.3, "{more} {less} deg");
    }
}
