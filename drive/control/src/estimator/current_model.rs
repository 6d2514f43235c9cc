//! The current model (Kim & Sul (28)-(30), Fig. 5, after Matsui 1993): method 5 of the review.
//!
//! The model predicts one step from the measured current of the last sample. It uses the estimated speed and assumes a
//! correctly aligned frame: i_dM = i_d + T_s / L_d (v_d - R i_d + w L_q i_q + (w_f - w) L_d i_q), i_qM = i_q + T_s /
//! L_q (v_q - R i_q - w L_d i_d - (w_f - w) L_q i_d - w psi_M). The deviation `di = i[k] - i_M` shows the speed error
//! on the q-axis and the angle error on the d-axis: di_d = psi_M T_s w sin theta~ / L_d, di_q = psi_M T_s (w - w_r cos
//! theta~) / L_q. A low-pass smooths the speed; the angle is corrected as in the voltage model
//! ([`follower`](crate::estimator::follower)).
//! Correction to the paper: the q row of (30) is psi_M T_s (w^ - w_r cos theta~) / L_q, with the speed error in the
//! fraction. The turn of the rotor in a sample counts ([`Interval::turn`]).
//!
//! Limits: the same as for the voltage model, because the two models are equivalent and differ only in form. It holds rated load
//! down to 0.010 of the rated speed, 0.010 with a compensated dead time.

use crate::estimator::contract::ContextOf;
use crate::estimator::emf::pole;
use crate::estimator::follower::{Follower, MatsuiParameters, Rows};
use crate::estimator::interval::Interval;
use serde::{Deserialize, Serialize};

/// The model as an estimator.
pub type CurrentModel = Follower<CurrentRows>;

/// The rows of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurrentRows;

impl<All: AsRef<MatsuiParameters>> Rows<All> for CurrentRows {
    #[inline]
    fn rows(w: &mut f64, context: &ContextOf<All>, x: &Interval, slip: f64) -> f64 {
        let ContextOf { motor, T_s, .. } = *context;
        let (speeds, changes) = x.turn(T_s);
        let (w_x, slip) = (speeds * *w, speeds * slip);
        let r_d = x.v.d() - motor.R_s * x.i.d() + (w_x * motor.L_q + slip * motor.L_d) * x.i.q();
        let r_q = x.v.q() - motor.R_s * x.i.q() - (w_x * motor.L_d + slip * motor.L_q) * x.i.d() - w_x * motor.psi_M;
        let change = (x.i_now - x.i_last) * changes;
        let di_d = change.d() - T_s / motor.L_d * r_d;
        let di_q = change.q() - T_s / motor.L_q * r_q;
        *w -= (1.0 - pole(context.of::<MatsuiParameters>().filter, T_s)) * di_q * motor.L_q / (T_s * motor.psi_M);
        -di_d * motor.L_d / T_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::testing::{comes_to_the_rotor, with_L_q};

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<CurrentModel>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<CurrentModel>(1.2), with_L_q::<CurrentModel>(0.8));
        assert!((more - 5.5).abs() < 0.3 && (less + 5.9).abs() < 0.3, "{more} {less} deg");
    }
}
