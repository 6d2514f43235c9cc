//! Observer and current control of the turning machine.
//!
//! ```text
//! delta   = T (u - R i - loss) - L_q (i[k] - i[k-1])                step of the active flux eta = psi - L_q i
//! eta     gradient observer to |eta| = psi_M + (L_d - L_q) i_d, rate max(0.7 |w|, 10 1/s), then a PLL
//! u       = PI + R i_ref + j w (L i_ref + psi_M), turned ahead by (delay + 1/2) T w, + loss(i_ref)
//! ```
//!
//! The [observer](crate::estimator::gradient) and the [current control](crate::current) are the drive's; the inverter's
//! curve is taken from the observer's voltage and added to the command. w_c = 0.12/T, limited to 0.95 U.
//!
//! The rate must follow the speed: an offset of eta turns the frame of the feed-forward back and forth and so drives a direct
//! current, whose loss at noisy currents is underestimated and feeds the offset. With the rate b it decays by b/2; with b =
//! 0.075 w_r machines with legs of a steep curve kept an offset of 4 % at 0.45 w_r.
//!
//! Between samples the current is not straight: u stays while the EMF turns, and the d-axis current bows by
//! psi_M (w T)^2 / (8 L_d), which may exceed the friction's current, and each leg is steep where its current crosses zero.
//! So loss is the mean along the model's current, from the measured one to the next, where a constant voltage `missing`
//! represents the remaining errors of the model:
//!
//! ```text
//! L di/dt = u e^(-j theta) - R i - loss - j w (L i + psi_M) + missing          8 steps, linearly implicit
//! ```
//!
//! With a straight current instead, psi_M of machines of w T > 0.1 was up to 0.5 % wrong. Derived here.

use super::align::VOLTAGE;
use super::bench::{Bench, Sample};
use super::ripple::Ripple;
use crate::current::{CurrentController, CurrentGains, CurrentLoop};
use crate::estimator::gradient::{GradientObserver, GradientParameters};
use crate::estimator::tracker::{TrackerKind, TrackerParameters};
use crate::estimator::{Context, Estimating, EstimatorParameters, Sample as Observed};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Rate of the observer divided by the speed, and the minimum rate in 1/s.
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
    /// Current at this sample in A, less what the dead time adds to the mean.
    pub(super) i: AlphaBeta,
    /// The [ripple](super::ripple) determines the zone of the dead time.
    pub(super) ripples: bool,
}

impl Turning {
    /// A rotor at rest at 0 rad, with the flux linkage of the swing.
    pub(super) fn new(bench: &Bench, [L_d, L_q]: [f64; 2], rho: f64) -> Self {
        let motor = Motor { R_s: bench.R, L_d, L_q, psi_M: bench.psi_0, ..Motor::default() };
        Self { motor, rho, ..Self::default() }
    }

    /// The observer begins at the angle `theta` (rad), at rest.
    pub(super) fn begin(&mut self, bench: &Bench, sample: &Sample, theta: f64) {
        let par = self.parameters();
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let observed = Observed { i: sample.i, i_last: sample.i_last, ..Observed::default() };
        self.observer = GradientObserver::start(&context, &observed, theta, 0.0).0;
        (self.theta, self.w, self.controller) = (theta, 0.0, CurrentController::default());
    }

    fn parameters(&self) -> EstimatorParameters {
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
        let ripple = self.ripples.then(|| self.ripple(bench, sample, sample.u));
        let legs = self.legs(bench, sample, ripple);
        self.i = sample.i - ripple.map_or(AlphaBeta::ZERO, |ripple| ripple.late(&bench.curve, sample.i));
        let u = sample.u - legs;
        self.delta = (u - resistive) * bench.T - (sample.i - sample.i_last) * self.motor.L_q;
        let observed = Observed { i: sample.i, i_last: sample.i_last, u, ..Observed::default() };
        let par = self.parameters();
        let context = Context { par: &par, motor: &self.motor, J: 0.0, T_s: bench.T };
        let estimate = self.observer.update(&context, &observed);
        (self.theta, self.w) = (estimate.theta, estimate.w);
    }

    /// The rotor's frame `samples` after the last one.
    fn ahead(&self, bench: &Bench, samples: f64) -> Axis<Estimated> {
        Axis::at(self.theta + samples * bench.T * self.w)
    }

    /// The ripple at the voltage `u` (V).
    fn ripple(&self, bench: &Bench, sample: &Sample, u: AlphaBeta) -> Ripple {
        Ripple::new(bench, u, sample.u_dc, 0.5 * (self.motor.L_d + self.motor.L_q))
    }

    /// Voltage in V along q that the legs took less since the last sample with a ripple than without.
    pub(super) fn rippled(&self, bench: &Bench, sample: &Sample) -> f64 {
        let i = (sample.i_last + sample.i) * 0.5;
        let ripple = self.ripple(bench, sample, sample.u);
        let less = bench.curve.loss(i) - ripple.loss_and_slope(&bench.curve, i).0;
        self.ahead(bench, -0.5).from_stator(less).q()
    }

    /// Step of the active flux along q in Wb.
    pub(super) fn along_q(&self, bench: &Bench) -> f64 {
        self.ahead(bench, -0.5).from_stator(self.delta).q()
    }

    /// Mean voltage in V that the legs took since the last sample.
    fn legs(&self, bench: &Bench, sample: &Sample, ripple: Option<Ripple>) -> AlphaBeta {
        let lost = |i: AlphaBeta| {
            ripple.map_or_else(|| bench.curve.loss_and_slope(i), |ripple| ripple.loss_and_slope(&bench.curve, i))
        };
        let Motor { R_s, L_d, L_q, psi_M, .. } = self.motor;
        let h = bench.T / STEPS;
        let start = self.ahead(bench, 0.0);
        let (from, to) = (start.from_stator(sample.i_last), self.ahead(bench, 1.0).from_stator(sample.i));
        let first = lost(sample.i_last);
        let (mut missing, mut legs) = (DqHat::ZERO, AlphaBeta::ZERO);
        for _ in 0..PASSES {
            let (mut axis, mut i, mut sum) = (start, from, AlphaBeta::ZERO);
            let ((mut loss, mut slope), mut k) = (first, 0.0);
            // Change of the final current per volt of `missing`, in 1/Ohm.
            let mut gain = DqHat::ZERO;
            while k < STEPS {
                sum += loss;
                let u = axis.slightly_ahead(0.5 * h * self.w).from_stator(sample.u - loss);
                let emf = DqHat::new(L_d * i.d() + psi_M, L_q * i.q()).turned() * self.w;
                let v = u - i * R_s - emf + missing;
                let half = 0.5 * h * (R_s + slope);
                let each = [h / (L_d + half), h / (L_q + half)];
                i += DqHat::new(each[0] * v.d(), each[1] * v.q());
                let decay = each.map(|each| (1.0 - each * (R_s + slope)).max(0.0));
                gain = DqHat::new(decay[0] * gain.d() + each[0], decay[1] * gain.q() + each[1]);
                axis = axis.slightly_ahead(h * self.w);
                (loss, slope) = lost(axis.to_stator(i));
                k += 1.0;
            }
            let off = to - i;
            missing += DqHat::new(off.d() / gain.d(), off.q() / gain.q());
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
    pub(super) fn in_any_frame(
        &mut self,
        bench: &Bench,
        sample: &Sample,
        frame: (f64, f64),
        i_ref: DqHat,
    ) -> AlphaBeta {
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
        let (u, i_then) = (acts.to_stator(u), acts.to_stator(i_ref));
        let legs = if self.ripples {
            self.ripple(bench, sample, u).loss_and_slope(&bench.curve, i_then).0
        } else {
            bench.curve.loss(i_then)
        };
        let asked = u + legs;
        let (size, most) = (asked.magnitude(), VOLTAGE * bench.U);
        if size <= most {
            self.controller.integrate(&gains, i_ref - i, None, bench.T);
            return asked;
        }
        let limited = asked * (most / size);
        self.controller.integrate(&gains, i_ref - i, Some(acts.from_stator(limited - asked)), bench.T);
        limited
    }

    /// Control continues in the rotor's frame, where the feed-forward is complete.
    pub(super) fn hand_over(&mut self) {
        self.controller = CurrentController::default();
    }

    /// Current in the rotor's frame in A.
    pub(super) fn current(&self, sample: &Sample) -> DqHat {
        Axis::<Estimated>::at(self.theta).from_stator(sample.i)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commission::curve::{Curve, POINTS};
    use drive_base::math::{exp, wrap};

    fn bench(resistive: f64) -> Bench {
        let mut curve = Curve::new(10.0);
        for n in 0..POINTS {
            curve.set(n, resistive * curve.current(n));
        }
        Bench { T: 1e-4, delay: 1.0, I: 10.0, U: 100.0, psi_r: 0.2, psi_0: 0.12, R: 0.5, curve, ..Bench::default() }
    }

    /// With an exact EMF, the observer converges to the rotor even if psi_M is 20 % off and the initial angle 0.3 rad off.
    #[test]
    fn the_observer_follows_an_exact_emf() {
        let bench = bench(0.0);
        let mut turning = Turning::new(&bench, [2e-3, 3e-3], 200.0);
        turning.motor.psi_M = 0.12;
        turning.begin(&bench, &Sample::default(), 0.3);
        let (w, psi) = (150.0, 0.12);
        let flux = |k: f64| Axis::<Estimated>::at(w * k * bench.T).along(psi);
        for k in 1..10_000_u32 {
            let k = f64::from(k);
            let delta = flux(k) - flux(k - 1.0);
            turning.observe(&bench, &Sample { u: delta * (1.0 / bench.T), ..Sample::default() });
            assert!((turning.delta - delta).magnitude() < 1e-12);
        }
        let off = wrap(turning.theta - 9_999.0 * w * bench.T);
        assert!(off.abs() < 2e-3 && (turning.w / w - 1.0).abs() < 1e-3, "{off} rad, {} rad/s", turning.w);
    }

    /// At rest, with legs that are resistances, the current between two samples is an exponential.
    #[test]
    fn the_legs_lose_the_mean_of_an_exponential() {
        let (legs, L) = (1.5, 1e-3);
        let bench = bench(legs);
        let turning = Turning::new(&bench, [L, L], 200.0);
        let sample = Sample { i_last: AlphaBeta::new(1.0, -2.0), i: AlphaBeta::new(3.0, 0.5), ..Sample::default() };
        let x = (bench.R + legs) * bench.T / L;
        let mean = 1.0 / (1.0 - exp(-x)) - 1.0 / x;
        let expected = (sample.i_last + (sample.i - sample.i_last) * mean) * legs;
        let found = turning.legs(&bench, &sample, None);
        assert!((found - expected).magnitude() < 1e-3 * expected.magnitude(), "{found:?}, not {expected:?}");
    }

    /// Where the current is the same in the rotor's frame at both samples, it bows along d by psi_M (w T)^2 / (8 L_d).
    #[test]
    fn the_current_bows_between_samples() {
        let (legs, w) = (0.01, 400.0);
        let bench = Bench { R: 0.0, ..bench(legs) };
        let turning = Turning { w, ..Turning::new(&bench, [2e-3, 2e-3], 200.0) };
        let middle = Axis::<Estimated>::at(0.5 * w * bench.T);
        let u = middle.to_stator(DqHat::new(0.0, w * turning.motor.psi_M));
        let found = middle.from_stator(turning.legs(&bench, &Sample { u, ..Sample::default() }, None)).d();
        let turn = w * bench.T;
        let expected = -legs * (2.0 / 3.0) * turning.motor.psi_M * turn * turn / (8.0 * 2e-3);
        assert!((found / expected - 1.0).abs() < 0.03, "{found} V, not {expected} V");
    }
}
