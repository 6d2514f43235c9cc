//! Observer and current control of the turning machine.
//!
//! ```text
//! delta   = T (u - R i - loss) - L_q (i[k] - i[k-1])                step of the active flux eta = psi - L_q i
//! eta     gradient observer to |eta| = psi_M + (L_d - L_q) i_d, rate max(0.075 w_r, 10 1/s), then a PLL
//! u       = PI + R i_ref + j w (L i_ref + psi_M), turned ahead by (delay + 1/2) T w, + loss(i_ref)
//! ```
//!
//! The [observer](crate::estimator::gradient) and the [current control](crate::current) are the drive's; the inverter's
//! curve is taken from the observer's voltage and added to the command. w_c = 0.12/T, limited to 0.95 U.

use super::align::VOLTAGE;
use super::bench::{Bench, Sample};
use super::curve::Between;
use crate::current::{CurrentController, CurrentGains, CurrentLoop};
use crate::estimator::gradient::{GradientObserver, GradientParameters};
use crate::estimator::tracker::{TrackerKind, TrackerParameters};
use crate::estimator::{Context, Estimating, EstimatorParameters, Sample as Observed};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::tanh;
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Rate of the observer over the rated speed, and the least one in 1/s.
const RATE: (f64, f64) = (0.7, 10.0);

/// Share of a sample in the mean current.
const SMOOTH: f64 = 0.2;

/// A turning machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Turning {
    /// Values of the control; `psi_M` follows the findings.
    pub(super) motor: Motor,
    /// Bandwidth of the PLL in rad/s.
    pub(super) rho: f64,
    between: Between,
    observer: GradientObserver,
    controller: CurrentController,
    /// Electrical angle in rad, not wrapped, and speed in rad/s.
    pub(super) theta: f64,
    pub(super) w: f64,
    /// Mean current in the rotor's frame in A.
    smooth: DqHat,
    /// Step of the active flux at this sample in Wb.
    pub(super) delta: AlphaBeta,
}

impl Turning {
    /// A rotor at rest at 0 rad, with the flux linkage of the swing.
    pub(super) fn new(bench: &Bench, [L_d, L_q]: [f64; 2], rho: f64) -> Self {
        let motor = Motor { R_s: bench.R, L_d, L_q, psi_M: bench.psi_0, ..Motor::default() };
        Self { motor, rho, between: Between::new(bench.R * bench.T / L_q), ..Self::default() }
    }

    /// The observer begins at the angle `theta` (rad), at rest.
    pub(super) fn begin(&mut self, bench: &Bench, sample: &Sample, theta: f64) {
        let par = self.parameters(bench);
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let observed = Observed { i: sample.i, i_last: sample.i_last, ..Observed::default() };
        self.observer = GradientObserver::start(&context, &observed, theta, 0.0).0;
        (self.theta, self.w, self.controller) = (theta, 0.0, CurrentController::default());
        self.smooth = self.current(sample);
    }

    fn parameters(&self, bench: &Bench) -> EstimatorParameters {
        let bandwidth = (RATE.0 * self.w.abs()).max(RATE.1);
        EstimatorParameters {
            gradient: GradientParameters { bandwidth, clamped: false },
            tracker: TrackerParameters { kind: TrackerKind::Pll, bandwidth: self.rho },
            ..EstimatorParameters::default()
        }
    }

    /// One sample: angle, speed and the step of the active flux.
    pub(super) fn observe(&mut self, bench: &Bench, sample: &Sample) {
        let resistive = (sample.i_last + sample.i) * (0.5 * bench.R);
        let ahead = self.theta + bench.T * self.w;
        let [last, now] = [self.theta, ahead].map(|theta| Axis::<Estimated>::at(theta));
        self.smooth += (now.from_stator(sample.i) - self.smooth) * SMOOTH;
        let turn = bench.T * self.w;
        let slope = bench.curve.loss_along(last.along(1.0), last.to_stator(self.smooth)).1;
        let x = 0.25 * bench.T * (bench.R + slope) / self.motor.L_d;
        let bow = last.along(-turn * turn * self.motor.psi_M / (8.0 * self.motor.L_d) * tanh(x) / x);
        let legs = self.between.legs(&bench.curve, last.to_stator(self.smooth), now.to_stator(self.smooth), bow);
        let u = sample.u - legs;
        self.delta = (u - resistive) * bench.T - (sample.i - sample.i_last) * self.motor.L_q;
        let observed = Observed { i: sample.i, i_last: sample.i_last, u, ..Observed::default() };
        let par = self.parameters(bench);
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let estimate = self.observer.update(&context, &observed);
        (self.theta, self.w) = (estimate.theta, estimate.w);
    }

    /// Command in V for the current `i_ref` (A) in the rotor's frame.
    pub(super) fn in_rotor_frame(&mut self, bench: &Bench, sample: &Sample, i_ref: DqHat) -> AlphaBeta {
        let motor = self.motor.clone();
        self.command(bench, sample, &motor, (self.theta, self.w), i_ref)
    }

    /// Command in V for the current `i_ref` (A) in the `frame` (rad, rad/s), wherever the rotor is.
    pub(super) fn in_any_frame(&mut self, bench: &Bench, sample: &Sample, frame: (f64, f64), i_ref: DqHat) -> AlphaBeta {
        let motor = Motor { L_d: bench.L_c, L_q: bench.L_c, psi_M: 0.0, ..self.motor.clone() };
        self.command(bench, sample, &motor, frame, i_ref)
    }

    fn command(
        &mut self,
        bench: &Bench,
        sample: &Sample,
        motor: &Motor,
        (theta, w): (f64, f64),
        i_ref: DqHat,
    ) -> AlphaBeta {
        let bandwidth = bench.w_c();
        let integral = 0.25 * (bench.R / (bandwidth * motor.L_q)).max(1.0);
        let par = CurrentLoop { bandwidth, integral, reference_feed_forward: true, ..CurrentLoop::default() };
        let gains = CurrentGains::new(&par, motor);
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let acts = Axis::<Estimated>::at(theta + (bench.delay + 0.5) * bench.T * w);
        let u = self.controller.command(&gains, motor, i_ref, i, w);
        let asked = acts.to_stator(u) + bench.curve.loss(acts.to_stator(i_ref));
        let (size, most) = (asked.magnitude(), VOLTAGE * bench.U);
        if size <= most {
            self.controller.integrate(&gains, i_ref - i, None, bench.T);
            return asked;
        }
        let limited = asked * (most / size);
        self.controller.integrate(&gains, i_ref - i, Some(acts.from_stator(limited - asked)), bench.T);
        limited
    }

    /// The control goes on in the rotor's frame, where the feed-forward is complete.
    pub(super) fn hand_over(&mut self) {
        self.controller = CurrentController::default();
    }

    /// Current in the rotor's frame in A.
    pub(super) fn current(&self, sample: &Sample) -> DqHat {
        Axis::<Estimated>::at(self.theta).from_stator(sample.i)
    }
}
