//! Rotating injection in stator axes: method 7 of the review (Kim & Sul (38)-(40)).
//!
//! A voltage u = V e^{j phi k} in stator axes changes the current by T_s (S u + D e^{j 2 theta} conj(u)) per sample
//! ([`saliency`]): one part turns with the carrier, the other against it. A band-pass, a
//! multiplication by u e^{-j 2 theta^} (heterodyne) and a low-pass ([`carrier`]) give eps = T_s D V^2 sin(2 theta~) and
//! e = eps / (2 T_s D V^2).
//!
//! The band-pass delays the part that turns against the carrier by 2 w T_s / alpha. The estimator adds half of this to
//! e: w T_s / alpha, which is w / (zeta w_h) for a short T_s, or 0.9 deg at 0.1 of the rated speed of a 2.2 kW machine.
//! R i in the response would shift the angle by R S / w_h, 0.8 deg.
//!
//! Limits: the filters add delay; both axes carry carrier current.

use crate::estimator::carrier::{self, BandPass, Carrier, CarrierParameters, PeriodMean};
use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample, SetupOf};
use crate::estimator::saliency::{self, Admittance, CLIP, response};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, Estimated, Stator};
use fmu_core::Fault;
use serde::{Deserialize, Serialize};

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RotatingInjection {
    tracker: Tracker,
    /// Filter of the measured current.
    notch: BandPass<Stator>,
    /// Filter of the response to the injected voltage.
    band_pass: BandPass<Stator>,
    low_pass: PeriodMean,
}

impl RotatingInjection {
    fn estimate(&self, carrier: &Carrier, i: AlphaBeta) -> Estimate {
        let injection = Injection::Stator(AlphaBeta::new(carrier.cos, carrier.sin));
        Estimate::injecting(self.tracker.theta, self.tracker.w, i, injection)
    }
}

impl<All: AsRef<CarrierParameters> + AsRef<TrackerParameters>> Estimating<All> for RotatingInjection {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let (tracker, notch) = (Tracker::at(theta, w, context.T_s), BandPass::start(sample.i));
        let this = Self { tracker, notch, ..Self::default() };
        (this, this.estimate(&Carrier::at(context, sample.k), sample.i))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let Self { tracker, notch, band_pass, low_pass } = self;
        let ContextOf { motor, T_s, .. } = *context;
        tracker.advance(T_s);
        let carrier = Carrier::at(context, sample.k);
        let middle = Axis::<Estimated>::at(0.5 * (tracker.theta_last + tracker.theta));
        let response = middle.to_stator(response(motor, middle, sample, T_s));
        let (x, u) = (middle.from_stator(band_pass.update(&carrier, response)), middle.from_stator(sample.u_injected));
        // Im(x u): the part against the carrier becomes constant; the part with the carrier turns twice as fast.
        let epsilon = low_pass.update(&carrier, x.d() * u.q() + x.q() * u.d());

        let (V, D) = (context.of::<CarrierParameters>().voltage, Admittance::of(motor).difference);
        let e = epsilon / (2.0 * T_s * D * V * V) + tracker.w * T_s / carrier.alpha;
        tracker.correct(context, context.of::<TrackerParameters>().bandwidth, e.clamp(-CLIP, CLIP), sample);
        let free = sample.i - notch.update(&carrier, sample.i);
        self.estimate(&carrier, free)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        carrier::validate(setup)?;
        saliency::validate(setup)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{finds_the_rotor, injected, salient};

    #[test]
    fn finds_the_rotor_with_every_delay() {
        finds_the_rotor::<RotatingInjection>(&EstimatorParameters::default(), 0.1);
    }

    /// The effect of subtracting R i from the response: with R^ = 0 the angle error is R S / w_h, 0.78 deg.
    #[test]
    fn resistance_would_turn_the_angle() {
        let par = EstimatorParameters::default();
        let motor = drive_base::motor::Motor { R_s: 7.2, ..salient() };
        let rest = |plant| injected::<RotatingInjection>(&par, plant, 0.0, 0.1, 1, 4000, |_| ());
        let expected = 3.6 * Admittance::of(&salient()).sum / par.carrier.frequency;
        let turned = rest(&motor);
        assert!((turned - expected).abs() < 0.05 * expected.abs(), "{turned} rad, expected {expected} rad");
        assert!(rest(&salient()).abs() < 0.01 * expected);
    }
}
