//! Injection near the PWM frequency with a period of three samples: method 10 of the review (Kim & Sul 2011, III,
//! reference 13).
//!
//! The method injects a voltage V e^{j 2 pi k / 3} in stator axes. The changes of current and injected flux linkage
//! from one interval to the next obey delta i = S delta psi + D e^{j 2 theta} conj(delta psi), as complex numbers.
//! After multiplication by delta psi and summation over one period, the first term cancels: sum(delta i delta psi) = D
//! e^{j 2 theta} sum |delta psi|^2. In the estimated frame, the argument of the sum is 2 theta~: the angle comes
//! directly from voltage and current differences. It does not depend on the amplitude, needs no inductance except the
//! sign of D, and has no dead point at 90 deg. The current controller's voltage contributes a known share to delta i,
//! which would not cancel; [`response`] subtracts it first. The mean of three currents does not contain the carrier.
//!
//! Limits: above about 0.2 of the rated speed, the injection takes voltage that the drive needs; the controlled current
//! has one sample of delay.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample, SetupOf};
use crate::estimator::saliency::{self, Admittance, CLIP, response};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::atan2;
use fmu_core::unit::VOLT;
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// The parameters with the prefix `near_pwm.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NearPwmParameters {
    /// Magnitude V of the injected voltage in V, > 0.
    pub voltage: f64,
}

impl Default for NearPwmParameters {
    fn default() -> Self {
        Self { voltage: 150.0 }
    }
}

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NearPwmInjection {
    tracker: Tracker,
    /// Response of the last interval in A.
    response: DqHat,
    /// Injected voltage of the last interval in V.
    u: DqHat,
    /// Products of the last two intervals in A.V, the newest first.
    products: [DqHat; 2],
    /// Currents of the last two samples in the estimated frame, in A, the newest first.
    currents: [DqHat; 2],
}

/// Product of two vectors, taken as complex numbers.
#[inline]
fn product(a: DqHat, b: DqHat) -> DqHat {
    DqHat::new(a.d() * b.d() - a.q() * b.q(), a.d() * b.q() + a.q() * b.d())
}

impl NearPwmInjection {
    fn estimate<All: AsRef<NearPwmParameters>>(&self, context: &ContextOf<All>, sample: &Sample, i: DqHat) -> Estimate {
        const HALF_SQRT_3: f64 = 0.866_025_403_784_438_6;
        let direction = match sample.k % 3 {
            0 => AlphaBeta::new(1.0, 0.0),
            1 => AlphaBeta::new(-0.5, HALF_SQRT_3),
            _ => AlphaBeta::new(-0.5, -HALF_SQRT_3),
        };
        let axis = Axis::<Estimated>::at(self.tracker.theta);
        let injection = Injection::Stator(direction * context.of::<NearPwmParameters>().voltage);
        Estimate { theta: self.tracker.theta, axis, w: self.tracker.w, half: None, i: axis.to_stator(i), injection }
    }
}

impl<All: AsRef<NearPwmParameters> + AsRef<TrackerParameters>> Estimating<All> for NearPwmInjection {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let this = Self { tracker: Tracker::at(theta, w, context.T_s), currents: [i; 2], ..Self::default() };
        (this, this.estimate(context, sample, i))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let Self { tracker, response: last, u: u_last, products, currents } = self;
        tracker.advance(context.T_s);
        let middle = Axis::<Estimated>::at(0.5 * (tracker.theta_last + tracker.theta));
        let (x, u) = (response(context.motor, middle, sample, context.T_s), middle.from_stator(sample.u_injected));
        let newest = product(x - *last, u - *u_last);
        (*last, *u_last) = (x, u);
        let sum = newest + products[0] + products[1];
        *products = [newest, products[0]];
        let sign = Admittance::of(context.motor).difference.signum();
        let e = 0.5 * atan2(sign * sum.q(), sign * sum.d());
        tracker.correct(context, context.of::<TrackerParameters>().bandwidth, e.clamp(-CLIP, CLIP), sample);

        let i = Axis::<Estimated>::at(tracker.theta).from_stator(sample.i);
        let free = (i + currents[0] + currents[1]) * (1.0 / 3.0);
        *currents = [i, currents[0]];
        self.estimate(context, sample, free)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        saliency::validate(setup)
    }
}

type P = Row<NearPwmParameters>;

/// The variables; their owner adds the prefix `near_pwm.`.
pub const NEAR_PWM: &Table<NearPwmParameters> = table![
    P::parameter("voltage", &VOLT, "Injected voltage vector, which turns by 120 degrees each sample", |p| {
        &mut p.voltage
    })
    .above(0.0)
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{finds_the_rotor, injected, salient};

    #[test]
    fn finds_the_rotor_with_every_delay() {
        finds_the_rotor::<NearPwmInjection>(&EstimatorParameters::default(), 0.05);
    }

    /// The argument of the sum is 2 theta~ for every angle and any inductances of the correct order.
    #[test]
    fn the_angle_is_straight() {
        let mut par = EstimatorParameters::default();
        par.tracker.bandwidth = 1e-9;
        for degrees in [-28.0_f64, -10.0, 5.0, 28.0] {
            let mut tracker = Tracker::default();
            let theta_tilde = degrees.to_radians();
            injected::<NearPwmInjection>(&par, &salient(), 0.0, theta_tilde, 1, 10, |state| tracker = state.tracker);
            let e = tracker.w_frame / (2.0 * par.tracker.bandwidth);
            assert!((e - theta_tilde).to_degrees().abs() < 0.05, "{degrees} deg: {}", e.to_degrees());
        }
    }
}
