//! Square-wave injection at half the PWM frequency: method 9 (Kim & Sul 2011, III; Yoon, Sul, Morimoto, Ide 2011).
//!
//! The method injects u = +-V along the estimated d-axis, with a period of 2 samples (+-) or 4 (+--+). Let delta be the
//! change from one half period to the next in the estimated frame, theta~ = theta - theta^, and x and D the response
//! and D of [`saliency`]. Then delta x_q = T_s D sin(2 theta~) delta u_d, so e = delta
//! x_q / (2 T_s D delta u_d). The method uses no filter.
//!
//! x is the change of the current minus the share of the current controller's voltage. Without subtracting this share,
//! T_s / L_q du_q, noise feeds back through the current loop into the angle: a limit cycle that locks the speed loop
//! near 20 Hz. The mean of two currents half a period apart does not contain the carrier.
//!
//! Limits: above about 0.2 of the rated speed, the injection takes voltage that the drive needs; e has zeros at 0, 90
//! and 180 deg, of which 90 deg is unstable.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample, SetupOf};
use crate::estimator::saliency::{self, Admittance, CLIP, response};
use crate::estimator::tracker::{Tracker, TrackerParameters};
use drive_base::frame::{Axis, DqHat, Estimated};
use fmu_core::unit::VOLT;
use fmu_core::{Fault, Row, Table, table};
use serde::{Deserialize, Serialize};

/// The parameters with the prefix `square_wave.`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SquareWaveParameters {
    /// Amplitude V of the injected voltage in V, > 0.
    pub voltage: f64,
    /// Samples per period: 2 or 4.
    pub samples: i32,
}

impl Default for SquareWaveParameters {
    fn default() -> Self {
        Self { voltage: 150.0, samples: 2 }
    }
}

impl SquareWaveParameters {
    /// The voltage for the command of sample `k` in V.
    #[inline]
    pub fn command(&self, k: u64) -> f64 {
        let positive = if self.samples == 4 { matches!(k % 4, 0 | 3) } else { k.is_multiple_of(2) };
        if positive { self.voltage } else { -self.voltage }
    }
}

/// The demodulation: angle errors, and the current without the carrier; the caller turns the frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SquareWave {
    /// Responses in the last intervals along the q-axis, in A, the newest first.
    x: [f64; 2],
    /// Injected voltages along the d-axis, in V, the newest first.
    u: [f64; 2],
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
    pub fn update<All: AsRef<SquareWaveParameters>>(
        &mut self,
        context: &ContextOf<All>,
        sample: &Sample,
        theta_last: f64,
        theta: f64,
    ) -> (f64, DqHat) {
        let ContextOf { motor, T_s, .. } = *context;
        let par = context.of::<SquareWaveParameters>();
        let half = usize::from(par.samples == 4);
        let middle = Axis::<Estimated>::at(0.5 * (theta_last + theta));
        let (x, u) = (response(motor, middle, sample, T_s).q(), middle.from_stator(sample.u_injected).d());
        let (delta_x, delta_u) = (x - self.x[half], u - self.u[half]);
        (self.x, self.u) = ([x, self.x[0]], [u, self.u[0]]);
        // If the voltage limit removes the injection, there is no angle information; this avoids a division by zero.
        let square = (delta_u * delta_u).max(par.voltage * par.voltage);
        let e = delta_x * delta_u / (2.0 * T_s * Admittance::of(motor).difference * square);

        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let free = (i + self.currents[half]) * 0.5;
        self.currents = [i, self.currents[0]];
        (e.clamp(-CLIP, CLIP), free)
    }
}

/// State kept from one sample to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SquareWaveInjection {
    tracker: Tracker,
    demodulation: SquareWave,
}

impl SquareWaveInjection {
    fn estimate<All: AsRef<SquareWaveParameters>>(
        &self,
        context: &ContextOf<All>,
        sample: &Sample,
        i: DqHat,
    ) -> Estimate {
        let axis = Axis::<Estimated>::at(self.tracker.theta);
        let injection = Injection::Estimated(DqHat::new(context.of::<SquareWaveParameters>().command(sample.k), 0.0));
        Estimate { theta: self.tracker.theta, axis, w: self.tracker.w, half: None, i: axis.to_stator(i), injection }
    }
}

impl<All: AsRef<SquareWaveParameters> + AsRef<TrackerParameters>> Estimating<All> for SquareWaveInjection {
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let this = Self { tracker: Tracker::at(theta, w, context.T_s), demodulation: SquareWave::start(i) };
        (this, this.estimate(context, sample, i))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let Self { tracker, demodulation } = self;
        tracker.advance(context.T_s);
        let (e, i) = demodulation.update(context, sample, tracker.theta_last, tracker.theta);
        tracker.correct(context, context.of::<TrackerParameters>().bandwidth, e, sample);
        self.estimate(context, sample, i)
    }

    fn validate(setup: &SetupOf<All>) -> Result<(), Fault> {
        let samples = setup.of::<SquareWaveParameters>().samples;
        if samples != 2 && samples != 4 {
            return Err(setup.fault("square_wave.samples", "2 or 4"));
        }
        saliency::validate(setup)
    }
}

type P = Row<SquareWaveParameters>;

/// The variables; their owner adds the prefix `square_wave.`.
pub const SQUARE_WAVE: &Table<SquareWaveParameters> = table![
    P::parameter("voltage", &VOLT, "Square-wave voltage injected on the estimated d axis", |p| &mut p.voltage)
        .above(0.0),
    P::integer_parameter("samples", "Samples per period of the square wave, 2 or 4", |p| &mut p.samples)
        .at_least(2.0)
        .at_most(4.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{finds_the_rotor, injected, salient};

    fn with(samples: i32) -> EstimatorParameters {
        let mut par = EstimatorParameters::default();
        par.square_wave.samples = samples;
        par
    }

    #[test]
    fn finds_the_rotor_with_both_periods_and_every_delay() {
        finds_the_rotor::<SquareWaveInjection>(&with(2), 0.05);
        finds_the_rotor::<SquareWaveInjection>(&with(4), 0.05);
    }

    /// delta i_q / (T_s delta u_d) = D sin(2 theta~) for every angle: the first error of a stationary estimate.
    #[test]
    fn the_response_is_that_of_the_admittance() {
        let mut par = with(2);
        par.tracker.bandwidth = 1e-9;
        let motor = drive_base::motor::Motor { R_s: 1e-9, ..salient() };
        for degrees in [-40.0_f64, -10.0, 5.0, 30.0, 80.0] {
            let theta_tilde = degrees.to_radians();
            let mut tracker = Tracker::default();
            injected::<SquareWaveInjection>(&par, &motor, 0.0, theta_tilde, 1, 10, |state| tracker = state.tracker);
            let e = tracker.w_frame / (2.0 * par.tracker.bandwidth);
            assert!((e - 0.5 * (2.0 * theta_tilde).sin()).abs() < 1e-6, "{degrees} deg: {e}");
        }
    }
}
