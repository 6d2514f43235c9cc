//! Observer for the extended EMF (Kim & Sul (16)-(23), after Morimoto et al. 2002): method 3 of the review.
//!
//! The EMF contains all of the saliency: with L_d on both axes and w L_q in both cross terms,
//! v_d = R i_d + L_d p i_d - w L_q i_q - (w_f - w) L_d i_q + e_d, v_q = R i_q + L_d p i_q + w L_q i_d + (w_f - w) L_d i_d + e_q,
//! (e_d, e_q) = E_ex (-sin theta~, cos theta~), E_ex = w ((L_d - L_q) i_d + psi_M) - (L_d - L_q) p i_q, exactly.
//! Each axis has one observer ([`emf`]). A tracker receives theta~ = atan2(-s e_d, s e_q), where s is the sign of w.
//! Correction to the paper: (19) and (21) use the measured current in the innovation; (20) is missing.
//!
//! **A wrong R^** adds (R - R^) i to the EMF and is not integrated: with E = w (psi_M + (L_d - L_q) i_d), the estimate settles
//! at tan theta~ = (R - R^) i_d / (E + (R - R^) i_q). It does not swing, and it is at the rotor as long as the sum keeps the
//! sign of w:
//! |w| > (R^ - R) |i_q| / (psi_M + (L_d - L_q) i_d), motoring with R^ > R or generating with R^ < R. Below, the estimate is half a turn
//! off.
//!
//! Limits: the angle requires an EMF. It holds rated load down to 0.010 of the rated speed, 0.020 with a compensated dead
//! time. A reversal at light load is ambiguous by half a turn, unless `emf.hold_reversal` holds it. L_q + 20 % at rated
//! load shifts the angle by 5.8 deg. The speed that `emf.hold_reversal` takes from the EMF is e_q / (psi_M + (L_d - L_q) i_d).

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample, SetupOf};
use crate::estimator::emf::{self, AxisObserver, Direction, EmfParameters, pole};
use crate::estimator::interval::Interval;
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::DqHat;
use drive_base::math::at_least;
use fmu_core::Fault;
use serde::{Deserialize, Serialize};

/// The observer for both axes: it returns one angle error per interval; the caller turns the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtendedEmfObserver {
    d: AxisObserver,
    q: AxisObserver,
    direction: Direction,
}

impl ExtendedEmfObserver {
    /// At the electrical speed `w` (rad/s) in a correctly aligned frame, with the currents of `now`.
    pub fn start<All>(context: &ContextOf<All>, now: &Interval, w: f64) -> Self {
        let motor = context.motor;
        let e_q = w * (motor.psi_M + (motor.L_d - motor.L_q) * now.i_now.d());
        Self {
            d: AxisObserver::at(now.i_now.d(), 0.0),
            q: AxisObserver::at(now.i_now.q(), e_q),
            direction: Direction::of(w),
        }
    }

    /// Angle error theta - theta^ in rad from one interval, at the speed estimate `w` (rad/s).
    #[inline]
    pub fn angle_error<All: AsRef<EmfParameters>>(&mut self, context: &ContextOf<All>, x: &Interval, w: f64) -> f64 {
        let e = self.emf(context, x, w);
        let s = self.direction.update(w, context.of::<EmfParameters>().w_sign);
        emf::angle_error(s, e.d(), e.q())
    }

    /// Extended EMF in V.
    #[inline]
    fn emf<All: AsRef<EmfParameters>>(&mut self, context: &ContextOf<All>, x: &Interval, w: f64) -> DqHat {
        let ContextOf { motor, T_s, .. } = *context;
        let z = pole(context.of::<EmfParameters>().bandwidth, T_s);
        let cross = w * motor.L_q + context.of::<EmfParameters>().slip(x, w) * motor.L_d;
        let r = x.v - x.i * motor.R_s - x.i.turned() * cross;
        let e_d = self.d.update(z, motor.L_d, T_s, r.d(), x.i_now.d());
        let e_q = self.q.update(z, motor.L_d, T_s, r.q(), x.i_now.q());
        DqHat::new(e_d, e_q)
    }
}

/// Minimum flux linkage of the extended EMF, as a share of psi_M.
const LEAST_FLUX: f64 = 0.2;

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ExtendedEmf {
    tracker: Tracker,
    observer: ExtendedEmfObserver,
}

impl<All: AsRef<EmfParameters> + AsRef<TrackerParameters>> Estimating<All> for ExtendedEmf {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let tracker = Tracker::at(theta, w, context.T_s);
        let now = Interval::new(tracker.theta_last, theta, sample, context.T_s);
        let observer = ExtendedEmfObserver::start(context, &now, w);
        (Self { tracker, observer }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let Self { tracker, observer } = self;
        tracker.advance(context.T_s);
        let x = Interval::new(tracker.theta_last, tracker.theta, sample, context.T_s);
        let mut e = observer.emf(context, &x, tracker.w);
        if context.of::<EmfParameters>().hold_reversal {
            // The EMF of the magnet alone, from which the speed is computed.
            let motor = context.motor;
            let active = motor.psi_M + (motor.L_d - motor.L_q) * x.i.d();
            e = e * (motor.psi_M / at_least(active, LEAST_FLUX * motor.psi_M));
        }
        emf::follow(tracker, &mut observer.direction, context, e, sample)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        emf::validate(setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{beside, comes_to_the_rotor, salient, with_L_q};
    use drive_base::frame::Dq;
    use drive_base::math::wrap;
    use drive_base::motor::Motor;
    use std::f64::consts::PI;

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<ExtendedEmf>(47.0);
    }

    /// Near standstill, half of the speed comes from e_q. With i_d = -6 A, E_ex is 1.17 times the EMF of the magnet.
    #[test]
    fn a_held_reversal_counts_the_reluctance() {
        let mut par = EstimatorParameters::default();
        (par.emf.hold_reversal, par.emf.w_hold) = (true, 80.0);
        for w in [60.0, 120.0, -60.0] {
            let (angle, speed) = beside::<ExtendedEmf>(&par, &salient(), (w, Dq::new(-6.0, 8.0)), 0.1, 10_000);
            assert!(angle.abs().to_degrees() < 0.02, "{w} rad/s: {} deg off", angle.to_degrees());
            assert!(speed.abs() < 0.02, "{w} rad/s: {speed} rad/s off");
        }
    }

    /// With a wrong resistance or magnet, a held reversal still supplies the speed of the rotor, in both directions.
    #[test]
    fn a_held_reversal_has_no_speed_error() {
        let (motor, mut par) = (salient(), EstimatorParameters::default());
        (par.emf.hold_reversal, par.emf.w_hold) = (true, 80.0);
        for hat in
            [Motor { R_s: 0.8 * motor.R_s, ..motor.clone() }, Motor { psi_M: 1.15 * motor.psi_M, ..motor.clone() }]
        {
            for w in [60.0, 100.0, -60.0, 300.0] {
                let (angle, speed) = beside::<ExtendedEmf>(&par, &hat, (w, Dq::new(0.0, 4.0)), 0.1, 50_000);
                assert!(speed.abs() < 0.02, "{w} rad/s: {speed} rad/s off");
                assert!(angle.abs() < 0.1, "{w} rad/s: {angle} rad off");
            }
        }
    }

    /// tan theta~ = (R - R^) i_d / (E + (R - R^) i_q), and half a turn more where the sum has the other sign: with R^ = 2 R below 36 rad/s.
    #[test]
    fn a_wrong_resistance_turns_it_and_has_a_bound() {
        let (motor, par) = (salient(), EstimatorParameters::default());
        for (share, w, i_q, off) in [
            (2.0, 47.0, 5.59, 0.0),
            (2.0, 20.0, 5.59, PI),
            (2.0, -47.0, -5.59, 0.0),
            (2.0, 30.0, -5.59, 0.0),
            (0.2, 30.0, 5.59, 0.0),
            (0.2, 20.0, -5.59, PI),
        ] {
            let hat = Motor { R_s: share * motor.R_s, ..motor.clone() };
            let i = Dq::new(-0.84, i_q);
            let (angle, speed) = beside::<ExtendedEmf>(&par, &hat, (w, i), 0.1, 20_000);
            let (lost, E) = (motor.R_s - hat.R_s, w * (motor.psi_M + (motor.L_d - motor.L_q) * i.d()));
            let expected = (lost * i.d() / (E + lost * i.q())).atan() + off;
            let error = wrap(angle - expected).to_degrees();
            assert!(
                error.abs() < 0.1 && speed.abs() < 0.05,
                "R^ = {share} R, {w} rad/s, {i_q} A: {error} deg, {speed} rad/s"
            );
        }
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<ExtendedEmf>(1.2), with_L_q::<ExtendedEmf>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }
}
