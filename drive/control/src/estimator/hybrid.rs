//! Hybrid: square-wave injection at low speed, extended EMF above it; method 12 of the review (Kim & Sul 2011, IV).
//!
//! The angle error is e = (1 - h) e_injection + h e_EMF, with h = (|w^| - w_low) / (w_high - w_low) limited to [0, 1].
//! [`square_wave`](crate::estimator::square_wave) and [`extended_emf`](crate::estimator::extended_emf) supply the two
//! errors. One tracker follows e; its pole changes with h from `tracker.bandwidth` to `hybrid.bandwidth`. Both
//! observers process every sample, so neither has to settle at the transition. At h = 1 the hybrid injects nothing; at
//! h = 0 it ignores the EMF. The carrier enters the EMF observer through both voltage and current.
//!
//! Transition speeds: 0.1 and 0.2 of the rated speed; above them the injection lacks voltage, below them the EMF is too
//! small. Limits: the same as for the active method; a machine without saliency needs another low-speed method.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample, SetupOf};
use crate::estimator::emf::EmfParameters;
use crate::estimator::extended_emf::ExtendedEmfObserver;
use crate::estimator::interval::Interval;
use crate::estimator::square_wave::{SquareWave, SquareWaveInjection, SquareWaveParameters};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{Axis, DqHat, Estimated};
use fmu_core::unit::RAD_PER_S;
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// The parameters with the prefix `hybrid.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HybridParameters {
    /// Electrical speed in rad/s up to which only the injection is used, >= 0.
    pub w_low: f64,
    /// Electrical speed in rad/s from which only the EMF is used, > w_low.
    pub w_high: f64,
    /// Tracker pole in rad/s where only the EMF is used, > 0.
    pub bandwidth: f64,
}

impl Default for HybridParameters {
    /// 0.1 and 0.2 of 75 Hz.
    fn default() -> Self {
        Self { w_low: TAU * 7.5, w_high: TAU * 15.0, bandwidth: TAU * 20.0 }
    }
}

impl HybridParameters {
    /// Share h of the EMF at the electrical speed `w` (rad/s).
    #[inline]
    fn share(&self, w: f64) -> f64 {
        ((w.abs() - self.w_low) / (self.w_high - self.w_low)).clamp(0.0, 1.0)
    }
}

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Hybrid {
    tracker: Tracker,
    injection: SquareWave,
    emf: ExtendedEmfObserver,
}

impl Hybrid {
    fn estimate<All: AsRef<HybridParameters> + AsRef<SquareWaveParameters>>(
        &self,
        context: &ContextOf<All>,
        sample: &Sample,
        i: DqHat,
    ) -> Estimate {
        let Tracker { theta, w, .. } = self.tracker;
        let injection = if context.of::<HybridParameters>().share(w) < 1.0 {
            Injection::Estimated(DqHat::new(context.of::<SquareWaveParameters>().command(sample.k), 0.0))
        } else {
            Injection::None
        };
        let axis = Axis::<Estimated>::at(theta);
        Estimate { theta, axis, w, half: None, i: axis.to_stator(i), injection }
    }
}

impl<All: AsRef<HybridParameters> + AsRef<SquareWaveParameters> + AsRef<EmfParameters> + AsRef<TrackerParameters>>
    Estimating<All> for Hybrid
{
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let tracker = Tracker::at(theta, w, context.T_s);
        let now = Interval::new(tracker.theta_last, theta, sample, context.T_s);
        let emf = ExtendedEmfObserver::start(context, &now, w);
        let this = Self { tracker, injection: SquareWave::start(now.i_now), emf };
        (this, this.estimate(context, sample, now.i_now))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let Self { tracker, injection, emf } = self;
        tracker.advance(context.T_s);
        let x = Interval::new(tracker.theta_last, tracker.theta, sample, context.T_s);
        let (e_injection, i) = injection.update(context, sample, tracker.theta_last, tracker.theta);
        let e_emf = emf.angle_error(context, &x, tracker.w);
        let h = context.of::<HybridParameters>().share(tracker.w);
        let rho =
            (1.0 - h) * context.of::<TrackerParameters>().bandwidth + h * context.of::<HybridParameters>().bandwidth;
        tracker.correct(context, rho, (1.0 - h) * e_injection + h * e_emf, sample);
        self.estimate(context, sample, i)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        let &HybridParameters { w_low, w_high, .. } = setup.of();
        if w_low >= w_high {
            let allowed = format!("above {}", setup.tell("hybrid.w_low"));
            return Err(setup.fault("hybrid.w_high", allowed));
        }
        SquareWaveInjection::validate(setup)
    }
}

type P = Row<HybridParameters>;

/// The variables; their owner adds the prefix `hybrid.`.
pub const HYBRID: &Table<HybridParameters> = table![
    P::parameter("w_low", &RAD_PER_S, "Electrical speed up to which the hybrid uses the injection alone", |p| {
        &mut p.w_low
    })
    .at_least(0.0),
    P::parameter("w_high", &RAD_PER_S, "Electrical speed from which the hybrid uses the back EMF alone", |p| {
        &mut p.w_high
    })
    .above(0.0),
    P::parameter(
        "bandwidth",
        &RAD_PER_S,
        "Magnitude of the tracker pole where the hybrid uses the back EMF alone",
        |p| &mut p.bandwidth,
    )
    .above(0.0)
    .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{beside, comes_to_the_rotor, finds_the_rotor, salient};
    use drive_base::frame::Dq;

    #[test]
    fn finds_the_rotor_at_standstill_and_at_speed() {
        let mut par = EstimatorParameters::default();
        // The injection test bench has no EMF: only the injection is used there.
        (par.hybrid.w_low, par.hybrid.w_high) = (1e3, 2e3);
        finds_the_rotor::<Hybrid>(&par, 0.05);
        comes_to_the_rotor::<Hybrid>(100.0);
    }

    /// Above w_high, the angle error follows e_0 (1 - rho t) e^{-rho t} with both poles at rho = `hybrid.bandwidth`,
    /// for every `tracker.bandwidth`; the EMF observer adds its lag of about 2 ms.
    #[test]
    fn above_the_transition_the_pole_is_that_of_the_hybrid() {
        let (mut par, t, start) = (EstimatorParameters::default(), 0.02, 0.05);
        for rho in [TAU * 5.0, TAU * 8.0] {
            par.hybrid.bandwidth = rho;
            let (angle, _) = beside::<Hybrid>(&par, &salient(), (300.0, Dq::new(-0.84, 5.59)), start, 200);
            let expected = start * (1.0 - rho * t) * (-rho * t).exp();
            assert!((angle - expected).abs() < 0.1 * start, "{rho} rad/s: {angle} rad, not {expected} rad");
        }
    }

    #[test]
    fn the_share_goes_from_the_injection_to_the_emf() {
        let par = HybridParameters { w_low: 40.0, w_high: 80.0, ..HybridParameters::default() };
        for (w, h) in [(0.0, 0.0), (-40.0, 0.0), (50.0, 0.25), (-60.0, 0.5), (80.0, 1.0), (-400.0, 1.0)] {
            assert!((par.share(w) - h).abs() < 1e-15);
        }
    }
}
