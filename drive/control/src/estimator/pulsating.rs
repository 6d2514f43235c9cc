//! Pulsating injection along the estimated d-axis: method 8 of the review (Kim & Sul (42)-(45)).
//!
//! A voltage u = V cos(phi k) along the estimated d-axis changes the current within one sample by x_d = T_s (S + D cos
//! 2 theta~) u, x_q = T_s D sin(2 theta~) u, with theta~ = theta - theta^ and S, D from
//! [`saliency`].
//! - Heterodyne: band-pass, times 2 u, low-pass ([`carrier`]): eps = T_s D V^2 sin(2 theta~).
//! - 45-degree measurement axes (Fig. 10): the magnitudes of (x_d + x_q) / sqrt 2 and (x_d - x_q) / sqrt 2 are equal where
//!   theta~ = 0. Rectified, subtracted, low-pass: 2 sqrt 2 / pi T_s D V sin(2 theta~), for any phase of the carrier.
//!
//! The error is e = eps / (2 T_s D V^2). Correction to the paper: (44) has cos^2 and sin^2 of theta~ and no 1/2, so
//! (45) is low by a factor of 2. Limits: the filters add delay; e has zeros at 0, 90 and 180 deg, of which 90 deg is
//! unstable.

use crate::estimator::carrier::{self, BandPass, Carrier, CarrierParameters, PeriodMean};
use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample, SetupOf};
use crate::estimator::saliency::{self, Admittance, CLIP, response};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use fmu_core::{Fault, Field, Row, Table, enumeration, table};
use serde::{Deserialize, Serialize};

enumeration! {
    /// The demodulation methods; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum Demodulation("Demodulation", "Demodulation of pulsating injection") {
        1 Heterodyne "Product with the carrier, Kim & Sul 2011, Fig. 9";
        2 MeasurementAxes "Magnitudes in axes at 45 degrees, Fig. 10";
    }
}

/// The parameters with the prefix `pulsating.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PulsatingParameters {
    /// Demodulation method that extracts the angle error from the carrier current.
    pub demodulation: Demodulation,
}

impl Default for PulsatingParameters {
    fn default() -> Self {
        Self { demodulation: Demodulation::Heterodyne }
    }
}

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PulsatingInjection {
    tracker: Tracker,
    /// Filter of the current.
    notch: BandPass<Estimated>,
    /// Filter of the response to the injected voltage.
    band_pass: BandPass<Estimated>,
    low_pass: PeriodMean,
}

impl PulsatingInjection {
    fn estimate(&self, carrier: &Carrier, i: AlphaBeta) -> Estimate {
        let injection = Injection::Estimated(DqHat::new(carrier.cos, 0.0));
        Estimate::injecting(self.tracker.theta, self.tracker.w, i, injection)
    }
}

impl<All: AsRef<CarrierParameters> + AsRef<PulsatingParameters> + AsRef<TrackerParameters>> Estimating<All>
    for PulsatingInjection
{
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let (tracker, notch) = (Tracker::at(theta, w, context.T_s), BandPass::start(i));
        let this = Self { tracker, notch, ..Self::default() };
        (this, this.estimate(&Carrier::at(context, sample.k), sample.i))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, SQRT_2};
        let Self { tracker, notch, band_pass, low_pass } = self;
        let ContextOf { motor, T_s, .. } = *context;
        tracker.advance(T_s);
        let carrier = Carrier::at(context, sample.k);
        let middle = Axis::<Estimated>::at(0.5 * (tracker.theta_last + tracker.theta));
        let x = band_pass.update(&carrier, response(motor, middle, sample, T_s));
        let demodulated = if context.of::<PulsatingParameters>().demodulation == Demodulation::MeasurementAxes {
            let magnitudes = ((x.d() + x.q()).abs() - (x.d() - x.q()).abs()) * FRAC_1_SQRT_2;
            magnitudes * (0.5 * FRAC_PI_2 * SQRT_2) * context.of::<CarrierParameters>().voltage
        } else {
            2.0 * x.q() * middle.from_stator(sample.u_injected).d()
        };
        let epsilon = low_pass.update(&carrier, demodulated);
        let V = context.of::<CarrierParameters>().voltage;
        let e = epsilon / (2.0 * T_s * Admittance::of(motor).difference * V * V);
        tracker.correct(context, context.of::<TrackerParameters>().bandwidth, e.clamp(-CLIP, CLIP), sample);

        let axis = Axis::<Estimated>::at(tracker.theta);
        let i = axis.from_stator(sample.i);
        let free = axis.to_stator(i - notch.update(&carrier, i));
        self.estimate(&carrier, free)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        carrier::validate(setup)?;
        saliency::validate(setup)
    }
}

type P = Row<PulsatingParameters>;

/// The variables; their owner adds the prefix `pulsating.`.
pub const PULSATING: &Table<PulsatingParameters> = table![P::enumeration_parameter(
    "demodulation",
    "Demodulation of the carrier current; the second is refused with estimators other than PulsatingInjection",
    &Field(|p| &mut p.demodulation),
)];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::finds_the_rotor;

    #[test]
    fn finds_the_rotor_with_both_demodulations_and_every_delay() {
        let mut par = EstimatorParameters::default();
        for &demodulation in Demodulation::ALL {
            par.pulsating.demodulation = demodulation;
            finds_the_rotor::<PulsatingInjection>(&par, 0.1);
        }
    }
}
