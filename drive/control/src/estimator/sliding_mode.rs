//! Sliding-mode observer of the back EMF, as published by manufacturers of controllers (Microchip, AN1078 "Sensorless field
//! oriented control of a PMSM", 2010; Texas Instruments, SPRABQ3, 2013), for salient machines by the extended EMF (Chen, Tomita,
//! Doki, Okuma, IEEE Trans. Ind. Electron. 50 (2), 2003).
//!
//! In stator axes, with e = E (-sin theta, cos theta), E as in [`extended_emf`](crate::estimator::extended_emf):
//! L_d di/dt = u - R i + j w (L_d - L_q) i - e, and its copy L_d di^/dt = u - R i + j w^ (L_d - L_q) i - z,
//! z = K sat((i^ - i) / delta) on each axis. With K > |E| the error i^ - i stays within the boundary layer delta, where z
//! follows e with the `bandwidth` w_z = K / (delta L_d): from sample to sample z' = z + a (e - z), a = w_z T_s. A small
//! delta (a near 1) is the switching function; beyond a = 2 the sampled observer chatters.
//!
//! At constant speed z lags by phi = arg(1 - (1 - a) e^{-j w T_s}), and by w T_s / 2, because e is the mean of the
//! interval. The application notes add this lag to the angle, and the low-pass filter's lag; here the filter (`emf.bandwidth`)
//! acts in the estimated frame, without lag. The [tracker](crate::estimator::tracker) receives theta~ = atan2(-s e_d, s e_q).
//!
//! Limits: the same as for the extended EMF. It holds rated load down to 0.020 of the rated speed, 0.020 with a compensated dead
//! time. K below |E| loses the angle.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample, SetupOf};
use crate::estimator::emf::{self, Direction, EmfParameters, pole};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::{atan2, sin_cos};
use fmu_core::unit::{RAD_PER_S, VOLT};
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SlidingModeParameters {
    /// Gain K in V, > 0: above the maximum EMF.
    pub gain: f64,
    /// Bandwidth w_z in rad/s within the boundary layer, > 0.
    pub bandwidth: f64,
}

impl Default for SlidingModeParameters {
    fn default() -> Self {
        Self { gain: 1000.0, bandwidth: 5000.0 }
    }
}

/// State at the last sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SlidingMode {
    tracker: Tracker,
    /// Error i^ - i in A.
    i: AlphaBeta,
    /// Filtered EMF in V, in the estimated frame.
    e: DqHat,
    direction: Direction,
}

impl<All: AsRef<SlidingModeParameters> + AsRef<EmfParameters> + AsRef<TrackerParameters>> Estimating<All>
    for SlidingMode
{
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let ContextOf { motor, T_s, .. } = *context;
        let axis = Axis::<Estimated>::at(theta);
        let e = DqHat::new(0.0, w * (motor.psi_M + (motor.L_d - motor.L_q) * axis.from_stator(sample.i).d()));
        let i = axis.to_stator(e) * (1.0 / (motor.L_d * context.of::<SlidingModeParameters>().bandwidth));
        let tracker = Tracker::at(theta, w, T_s);
        (Self { tracker, i, e, direction: Direction::of(w) }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        let &SlidingModeParameters { gain, bandwidth } = context.of();
        self.tracker.advance(T_s);
        let w = self.tracker.w;
        let slope = bandwidth * motor.L_d;
        let sliding = |i: AlphaBeta| {
            let z = |x: f64| (slope * x).max(-gain).min(gain);
            AlphaBeta::new(z(i.alpha()), z(i.beta()))
        };
        let mean = (sample.i_last + sample.i) * 0.5;
        let e = sample.u - mean * motor.R_s + mean.turned() * (w * (motor.L_d - motor.L_q));
        self.i += (e - sliding(self.i)) * (T_s / motor.L_d) - (sample.i - sample.i_last);

        let keeps = 1.0 - bandwidth * T_s;
        let (sin, cos) = sin_cos(w * T_s);
        let lag = atan2(keeps * sin, 1.0 - keeps * cos) + 0.5 * w * T_s;
        let z = Axis::<Estimated>::at(self.tracker.theta - lag).from_stator(sliding(self.i));
        self.e += (z - self.e) * (1.0 - pole(context.of::<EmfParameters>().bandwidth, T_s));
        emf::follow(&mut self.tracker, &mut self.direction, context, self.e, sample)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        let bandwidth = setup.of::<SlidingModeParameters>().bandwidth;
        if bandwidth * setup.T_s > 1.0 {
            let allowed = format!("at most 1 / T_s = {} rad/s, or the sampled observer chatters", 1.0 / setup.T_s);
            return Err(setup.fault("sliding_mode.bandwidth", allowed));
        }
        emf::validate(setup)
    }
}

type P = Row<SlidingModeParameters>;

/// The observer's variables; their owner adds the prefix `sliding_mode.`.
pub const SLIDING_MODE: &Table<SlidingModeParameters> = table![
    P::parameter("gain", &VOLT, "Sliding gain, above the greatest back EMF", |p| &mut p.gain).above(0.0).tunable(),
    P::parameter("bandwidth", &RAD_PER_S, "Bandwidth within the boundary layer, at most 1/T_s", |p| {
        &mut p.bandwidth
    })
    .above(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{beside, comes_to_the_rotor, salient, with_L_q};
    use drive_base::frame::Dq;

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<SlidingMode>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<SlidingMode>(1.2), with_L_q::<SlidingMode>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }

    /// A gain below the EMF loses the angle; a gain above it does not.
    #[test]
    fn the_gain_must_exceed_the_emf() {
        let mut par = EstimatorParameters::default();
        let mut off = |gain: f64| {
            par.sliding_mode.gain = gain;
            let point = (471.0, Dq::new(-0.84, 5.59));
            beside::<SlidingMode>(&par, &salient(), point, 0.3, 10_000).0.to_degrees().abs()
        };
        let emf = 471.0 * (salient().psi_M + 0.84 * 15e-3);
        assert!(off(1.1 * emf) < 0.02 && off(0.6 * emf) > 1.0, "{} {} deg", off(1.1 * emf), off(0.6 * emf));
    }
}
