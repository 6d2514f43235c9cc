//! Square-wave injection at half the PWM frequency: 9 of the review (Kim & Sul 2011, III; Yoon, Sul, Morimoto, Ide 2011).
//!
//! A voltage +-V along the estimated d axis, a period of 2 samples (+-) or 4 (+--+). With the change of the current from
//! one half period to the next, all in the estimated frame, theta~ = theta - theta^ and D of
//! [`saliency`](crate::estimator::saliency):
//! delta i_q = delta psi_q / L_q + D sin(2 theta~) delta psi_d, so e = (delta i_q - delta psi_q / L_q) delta psi_d /
//! (2 D delta psi_d^2). No filter anywhere. psi is the integral of the whole voltage that acted, the current
//! controller's too: without its share T_s / L_q du_q noise goes round through the current loop into the angle, a limit
//! cycle that pins the speed loop near 20 Hz. The mean of two currents half a period apart is free of the carrier.
//!
//! Limits: above about 0.2 of the rated speed the voltage is missed elsewhere; e has zeros at 0, 90 and 180 deg, of which
//! 90 deg is unstable.

use crate::estimator::saliency::{Admittance, CLIP, Change, validate_saliency};
use crate::estimator::tracker::Tracker;
use crate::estimator::{Context, Estimate, Estimating, Injection, Sample};
use crate::frame::{Axis, DqHat, Estimated};
use fmu_core::unit::VOLT;
use fmu_core::{Fault, Row, Table};
use serde::{Deserialize, Serialize};

/// Parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SquareWaveParameters {
    /// Voltage V, > 0.
    pub voltage: f64,
    /// Samples in a period: 2 or 4.
    pub samples: i32,
}

impl Default for SquareWaveParameters {
    fn default() -> Self {
        Self { voltage: 150.0, samples: 2 }
    }
}

impl SquareWaveParameters {
    /// The voltage of the command of sample `k` in V.
    #[inline]
    pub fn command(&self, k: u64) -> f64 {
        let positive = if self.samples == 4 { matches!(k % 4, 0 | 3) } else { k % 2 == 0 };
        if positive { self.voltage } else { -self.voltage }
    }
}

/// The demodulation: angle errors in a frame that someone else turns, and the current without the carrier.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SquareWave {
    /// Changes in the last intervals, the newest first.
    changes: [Change; 2],
    /// Currents of the last samples in the estimated frame, in A, the newest first.
    currents: [DqHat; 2],
}

impl SquareWave {
    /// With the current `i` (A) in the estimated frame.
    pub fn start(i: DqHat) -> Self {
        Self { currents: [i; 2], ..Self::default() }
    }

    /// Angle error theta - theta^ (rad) and the current without the carrier (A) at this sample, with the frame at
    /// `theta_last` and `theta` (rad).
    #[inline]
    pub fn update(&mut self, context: &Context, sample: &Sample, theta_last: f64, theta: f64) -> (f64, DqHat) {
        let Context { motor, T_s, .. } = *context;
        let par = &context.par.square_wave;
        let half = usize::from(par.samples == 4);
        let change = Change::over(theta_last, theta, sample, T_s);
        let delta = change.beyond(self.changes[half]);
        self.changes = [change, self.changes[0]];
        let along = delta.psi.d();
        let least = par.voltage * T_s;
        let slope = 2.0 * Admittance::of(motor).difference * (along * along).max(least * least);
        let e = (delta.i.q() - delta.psi.q() / motor.L_q) * along / slope;

        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let free = (i + self.currents[half]) * 0.5;
        self.currents = [i, self.currents[0]];
        (e.clamp(-CLIP, CLIP), free)
    }
}

/// State.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SquareWaveInjection {
    tracker: Tracker,
    demodulation: SquareWave,
}

impl SquareWaveInjection {
    fn estimate(&self, context: &Context, sample: &Sample, i: DqHat) -> Estimate {
        Estimate {
            theta: self.tracker.theta,
            w: self.tracker.w,
            i: Axis::<Estimated>::at(self.tracker.theta).to_stator(i),
            injection: Injection::Estimated(DqHat::new(context.par.square_wave.command(sample.k), 0.0)),
        }
    }
}

impl Estimating for SquareWaveInjection {
    fn start(context: &Context, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let this = Self { tracker: Tracker::at(theta, w, context.T_s), demodulation: SquareWave::start(i) };
        (this, this.estimate(context, sample, i))
    }

    #[inline]
    fn update(&mut self, context: &Context, sample: &Sample) -> Estimate {
        let Self { tracker, demodulation } = self;
        tracker.advance(context.T_s);
        let (e, i) = demodulation.update(context, sample, tracker.theta_last, tracker.theta);
        tracker.correct(context, context.par.tracker.bandwidth, e, sample.tau_ref);
        self.estimate(context, sample, i)
    }

    fn validate(context: &Context) -> Result<(), Fault> {
        let samples = context.par.square_wave.samples;
        if samples != 2 && samples != 4 {
            return Err(Fault::value("square_wave.samples", samples, "2 or 4"));
        }
        validate_saliency(context.motor)
    }
}

type P = Row<SquareWaveParameters>;

/// The variables; their owner gives the prefix `square_wave.`.
pub const SQUARE_WAVE: &Table<SquareWaveParameters> = &Table::new(
    const {
        &[
            P::parameter("voltage", &VOLT, "Voltage injected along the estimated magnet axis, square wave", |p| {
                &mut p.voltage
            })
            .above(0.0),
            P::integer_parameter("samples", "Samples in a period of the square wave, 2 or 4", |p| &mut p.samples)
                .at_least(2.0)
                .at_most(4.0),
        ]
    },
);
