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
use crate::current::{CurrentController, CurrentGains, CurrentLoop};
use crate::estimator::gradient::{GradientObserver, GradientParameters};
use crate::estimator::tracker::{TrackerKind, TrackerParameters};
use crate::estimator::{Context, Estimating, EstimatorParameters, Sample as Observed};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Rate of the observer over the rated speed, and the least one in 1/s.
const RATE: (f64, f64) = (0.7, 10.0);

/// Steps of the model's current in a period.
const STEPS: f64 = 8.0;
/// Passes of the model's current until it ends where it began.
const PASSES: usize = 2;

/// A turning machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Turning {
    /// Values of the control; `psi_M` follows the findings.
    pub(super) motor: Motor,
    /// Bandwidth of the PLL in rad/s.
    pub(super) rho: f64,
    observer: GradientObserver,
    controller: CurrentController,
    /// Electrical angle in rad, not wrapped, and speed in rad/s.
    pub(super) theta: f64,
    pub(super) w: f64,
    /// Step of the active flux at this sample in Wb.
    pub(super) delta: AlphaBeta,
}

impl Turning {
    /// A rotor at rest at 0 rad, with the flux linkage of the swing.
    pub(super) fn new(bench: &Bench, [L_d, L_q]: [f64; 2], rho: f64) -> Self {
        let motor = Motor { R_s: bench.R, L_d, L_q, psi_M: bench.psi_0, ..Motor::default() };
        Self { motor, rho, ..Self::default() }
    }

    /// The observer begins at the angle `theta` (rad), at rest.
    pub(super) fn begin(&mut self, bench: &Bench, sample: &Sample, theta: f64) {
        let par = self.parameters(bench);
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let observed = Observed { i: sample.i, i_last: sample.i_last, ..Observed::default() };
        self.observer = GradientObserver::start(&context, &observed, theta, 0.0).0;
        (self.theta, self.w, self.controller) = (theta, 0.0, CurrentController::default());
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
        let legs = self.legs(bench, sample);
        let u = sample.u - legs;
        self.delta = (u - resistive) * bench.T - (sample.i - sample.i_last) * self.motor.L_q;
        let observed = Observed { i: sample.i, i_last: sample.i_last, u, ..Observed::default() };
        let par = self.parameters(bench);
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let estimate = self.observer.update(&context, &observed);
        (self.theta, self.w) = (estimate.theta, estimate.w);
    }

    /// Rotor's frame after `samples` from the last one.
    fn ahead(&self, bench: &Bench, samples: f64) -> Axis<Estimated> {
        Axis::at(self.theta + samples * bench.T * self.w)
    }

    /// Mean voltage in V that the legs took since the last sample: along the model's current from the last measured one, with
    /// the constant voltage `missing` that makes it end at this one. Between samples the current bows, because u stays while
    /// the EMF turns.
    fn legs(&self, bench: &Bench, sample: &Sample) -> AlphaBeta {
        let Motor { R_s, L_d, L_q, psi_M, .. } = self.motor;
        let h = bench.T / STEPS;
        let start = self.ahead(bench, 0.0);
        let (from, to) = (start.from_stator(sample.i_last), self.ahead(bench, 1.0).from_stator(sample.i));
        let first = bench.curve.loss_and_slope(sample.i_last);
        let (mut missing, mut legs) = (DqHat::ZERO, AlphaBeta::ZERO);
        for _ in 0..PASSES {
            let (mut axis, mut i, mut sum) = (start, from, AlphaBeta::ZERO);
            let (mut loss, mut slope) = first;
            let (mut k, mut conductance) = (0.0, DqHat::ZERO);
            while k < STEPS {
                sum += loss;
                let middle = axis.slightly_ahead(0.5 * h * self.w);
                let v = middle.from_stator(sample.u - loss) - i * R_s + missing;
                let v = v - DqHat::new(-L_q * i.q(), L_d * i.d() + psi_M) * self.w;
                // Implicit in what the legs and the resistance do to the current: stable where they are steep.
                let half = 0.5 * h * (R_s + slope);
                let damped = DqHat::new(h / (L_d + half), h / (L_q + half));
                i += DqHat::new(damped.d() * v.d(), damped.q() * v.q());
                let kept = |g: f64, damped: f64| g * (1.0 - damped * (R_s + slope)).max(0.0) + damped;
                conductance = DqHat::new(
                    kept(conductance.d(), damped.d()),
                    kept(conductance.q(), damped.q()),
                );
                axis = axis.slightly_ahead(h * self.w);
                (loss, slope) = bench.curve.loss_and_slope(axis.to_stator(i));
                k += 1.0;
            }
            let off = to - i;
            missing += DqHat::new(off.d() / conductance.d(), off.q() / conductance.q());
            legs = (sum + (loss - first.0) * 0.5) * (1.0 / STEPS);
        }
        legs
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
