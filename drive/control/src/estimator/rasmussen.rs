//! Rasmussen's flux observer with speed adaptation, eq (21), and, for zeta = 0, its integral form (16).
//!
//! In the estimated rotor frame: psi_r^ = psi_s^ - L i, d psi_s^/dt = u - R i + v - j w^ psi_s^,
//! v = -c_1 (psi_rd^ - psi_M) - j c_2 psi_rq^, w^ = g_1 psi_rq^ + g_2 int psi_rq^ dt, d theta^/dt = w^.
//! The text before (7) of the paper omits the j on c_2; (7), (16) and (21) have it. In this file theta~ = theta^ -
//! theta, Rasmussen's sign.
//!
//! The poles of the speed adaptation set the gains: g_2 = w_n^2 / psi_M, g_1 = 2 zeta w_n / psi_M.
//!
//! A speed ripple with electrical amplitude dw and frequency W appears in the angle with the factor W^2 / (W + w_n)^2 for zeta =
//! 1: |theta~| = dw W / (W^2 + w_n^2), at most dw / (2 w_n).
//!
//! To sample without bias, psi_s^ is kept in stator axes, which do not turn:
//!
//! ```text
//! psi_s[k]  = psi_s[k-1] + T_s (u - R (i[k-1] + i[k]) / 2 + v[k-1] e^{j (theta^[k-1] + w^[k-1] T_s / 2)})
//! theta^[k] = theta^[k-1] + T_s w^[k-1]
//! ```
//!
//! Forward Euler in the estimated frame would add a bias of w T_s / 2 (1.4 deg at 1500 rpm and 10 kHz). Using the
//! newest command instead of the one that acted would add w T_s.
//!
//! **R^ > R swings at any speed.** A flux error that is constant in stator axes rotates at -w in the rotor frame. The estimated
//! speed swings with it, the speed loop (K_p = J w_s / K) answers with i_q, and the mean of (R^ - R) i in stator axes lets the
//! error grow: e' = (J w_s (R^ - R) w_n 2 a^4 / (3 n_p^2 psi_M^2 (1 + a^2)^2) - c_1 / 2) e with a = w / w_n. So the speed loop
//! is calm while R^ - R < 3 c_1 n_p^2 psi_M^2 / (4 J w_s w_n), for w well above w_n, and a little more below. There is no such
//! loop in torque mode. The adaptation of the resistance removes the cause.
//!
//! **With R^ < R, small torques are lost.** In torque mode, a rotor without a load lies along the current, tan delta = i_q /
//! i_d, and the frame turns on with w^ (psi_rd^ - psi_M cos delta) = (R - R^) i_q, psi_rd^ = psi_M + ((R - R^) i_d - w^ psi_M
//! sin delta) / c_1. With a constant i_d = i_0 and a small delta, this has no solution above delta = (2 - sqrt 2) sqrt((R - R^)
//! i_0 / (psi_M c_1)): the rotor turns. i_0 that falls with the speed lowers the threshold to 0.4 to 0.5 of that. `stands.rs`
//! warns.
//!
//! Limits: at w = 0 the angle is not observable (the slow pole is -w^2/c_1 below |w| = c_1/2). A resistance estimate
//! above the true value diverges at standstill; one below it is safe.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Injection, Sample};
use crate::estimator::resistance::{Adapted, Resistance, ResistanceParameters};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Turn};
use drive_base::motor::Motor;
use fmu_core::unit::{ONE, PER_SECOND, RAD_PER_S};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the observer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RasmussenParameters {
    /// Feedback gain for the d-axis flux error in 1/s, >= 0.
    pub c_1: f64,
    /// Feedback gain for the q-axis flux in 1/s, >= 0.
    pub c_2: f64,
    /// Natural frequency of the speed adaptation in rad/s, > 0.
    pub w_n: f64,
    /// Damping of the speed adaptation, >= 0; 0 gives the integral form (16).
    pub zeta: f64,
}

impl Default for RasmussenParameters {
    fn default() -> Self {
        Self { c_1: 50.0, c_2: 1.0, w_n: 300.0, zeta: 1.0 }
    }
}

/// State of the observer at the last sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rasmussen {
    /// Estimated stator flux linkage in Wb.
    psi_s: AlphaBeta,
    /// Feedback v in V, as it acts in the middle of the interval that begins.
    v: AlphaBeta,
    /// Measured current in A.
    i: AlphaBeta,
    /// Integral part of the speed in rad/s, electrical.
    w_i: f64,
    /// Estimated electrical angle in rad, not wrapped.
    theta: f64,
    /// Estimated electrical speed in rad/s.
    w: f64,
    /// The frame at the next sample, computed in advance: the next sample does not wait for its sine and cosine.
    next: Axis<Estimated>,
    /// Adaptation of the resistance.
    resistance: Resistance,
}

impl<All: AsRef<RasmussenParameters> + AsRef<ResistanceParameters>> Estimating<All> for Rasmussen {
    /// The permanent-magnet flux linkage lies on the estimated d-axis.
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let (motor, i) = (context.motor, sample.i);
        let axis = Axis::<Estimated>::at(theta);
        let psi_s = axis.to_stator(DqHat::new(motor.psi_M, 0.0) + inductive(motor, axis.from_stator(i)));
        let (next, resistance) = (Axis::at(theta + context.T_s * w), Resistance::start(context, sample, w));
        (Self { psi_s, i, theta, w, w_i: w, next, resistance, ..Self::default() }, Estimate::new(theta, w, sample))
    }

    #[inline(always)]
    #[expect(clippy::inline_always, reason = "as for `SensorlessController::cycle`")]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        let par = context.of::<RasmussenParameters>();
        self.theta += T_s * self.w;
        let axis = self.next;
        let resistive = (self.i + sample.i) * (0.5 * self.in_use(context));
        self.psi_s += (sample.u - resistive + self.v) * T_s;
        self.i = sample.i;

        let psi_r = self.psi_r(motor, axis);
        // g_1 psi_rq^ = 2 zeta w_q, g_2 psi_rq^ = w_n w_q
        let w_q = par.w_n / motor.psi_M * psi_r.q();
        self.w_i += T_s * par.w_n * w_q;
        self.w = 2.0 * par.zeta * w_q + self.w_i;
        self.next = Axis::at(self.theta + T_s * self.w);
        let x = psi_r.d() - motor.psi_M;
        let Adapted { c_1, v_q } = if context.of::<ResistanceParameters>().resistance {
            self.resistance.update(context, par.c_1, sample, x, axis.from_stator(sample.i), self.w)
        } else {
            Adapted { c_1: par.c_1, v_q: 0.0 }
        };
        let half = Turn::new(0.5 * T_s * self.w);
        self.v = axis.ahead(half).to_stator(DqHat::new(-c_1 * x, v_q - par.c_2 * psi_r.q()));
        Estimate { theta: self.theta, axis, w: self.w, half: Some(half), i: sample.i, injection: Injection::None }
    }

    #[inline]
    fn resistance(&self, context: &ContextOf<All>) -> f64 {
        self.in_use(context)
    }

    /// The adapted resistance stays.
    fn place(&mut self, context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) {
        *self = Self { resistance: self.resistance, ..Self::start(context, sample, theta, w).0 };
    }

    /// Keeps w^ = g_1 psi_rq^ + w_I constant when g_1 changes.
    fn retune(&mut self, old: &ContextOf<All>, new: &ContextOf<All>) {
        let g_1 = |context: &ContextOf<All>| context.of::<RasmussenParameters>().g_1(context.motor);
        self.w_i += (g_1(old) - g_1(new)) * self.psi_r(new.motor, Axis::at(self.theta)).q();
    }
}

impl RasmussenParameters {
    /// Proportional gain of the speed adaptation in rad/s per Wb.
    #[inline]
    fn g_1(&self, motor: &Motor) -> f64 {
        2.0 * self.zeta * self.w_n / motor.psi_M
    }
}

impl Rasmussen {
    /// Whether the adaptation has measured the resistance.
    #[inline]
    pub fn knows_resistance(&self) -> bool {
        self.resistance.is_known()
    }

    /// Resistance in Ohm.
    #[inline]
    fn in_use<All: AsRef<ResistanceParameters>>(&self, context: &ContextOf<All>) -> f64 {
        if context.of::<ResistanceParameters>().resistance { self.resistance.R } else { context.motor.R_s }
    }

    /// Estimated permanent-magnet flux linkage in Wb at the last sample, in the estimated frame on `axis`.
    #[inline]
    fn psi_r(&self, motor: &Motor, axis: Axis<Estimated>) -> DqHat {
        axis.from_stator(self.psi_s) - inductive(motor, axis.from_stator(self.i))
    }
}

/// L i in Wb.
#[inline]
fn inductive(motor: &Motor, i: DqHat) -> DqHat {
    DqHat::new(motor.L_d * i.d(), motor.L_q * i.q())
}

type P = Row<RasmussenParameters>;

/// The observer's variables; their owner adds the prefix `rasmussen.`.
pub const RASMUSSEN: &Table<RasmussenParameters> = table![
    P::parameter("c_1", &PER_SECOND, "Feedback gain of the d-axis flux error, eq (21)", |p| &mut p.c_1)
        .at_least(0.0)
        .tunable(),
    P::parameter("c_2", &PER_SECOND, "Feedback gain of the q-axis flux, eq (21)", |p| &mut p.c_2)
        .at_least(0.0)
        .tunable(),
    P::parameter("w_n", &RAD_PER_S, "Natural angular frequency of the speed adaptation", |p| &mut p.w_n)
        .above(0.0)
        .tunable(),
    P::parameter("zeta", &ONE, "Damping ratio of the speed adaptation; 0: integral form (16)", |p| &mut p.zeta)
        .at_least(0.0)
        .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use drive_base::frame::Rotor;
    use drive_base::math::wrap;

    const T_S: f64 = 1e-4;

    /// Number of samples in a time (s).
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few seconds")]
    fn samples(seconds: f64) -> usize {
        (seconds / T_S).round() as usize
    }

    fn context<'a>(par: &'a EstimatorParameters, motor: &'a Motor) -> ContextOf<'a, EstimatorParameters> {
        ContextOf { par, motor, J: 1.5e-3, T_s: T_S }
    }

    /// Runs the observer next to a machine that turns at `w` (rad/s, electrical) with the current `i` in its rotor
    /// frame. Returns the angle error in rad at each sample, from `theta_tilde` on. The voltage is the exact mean of
    /// each interval plus `du` (V) in the rotor frame, which the machine does not receive.
    fn beside(par: &RasmussenParameters, hat: &Motor, w: f64, i: DqHat, theta_tilde: f64, seconds: f64) -> Vec<f64> {
        let motor = Motor::default();
        let rotor = |theta: f64| Axis::<Estimated>::at(theta);
        let current = |theta: f64| rotor(theta).to_stator(i);
        let flux = |theta: f64| rotor(theta).to_stator(DqHat::new(motor.psi_M, 0.0) + inductive(&motor, i));
        let par = EstimatorParameters { rasmussen: par.clone(), ..EstimatorParameters::default() };
        let context = context(&par, hat);
        let first = Sample { i: current(0.0), ..Sample::default() };
        let (mut observer, _) = Rasmussen::start(&context, &first, theta_tilde, w);
        let (mut theta, mut errors) = (0.0, vec![theta_tilde]);
        for _ in 0..samples(seconds) {
            let next = theta + w * T_S;
            // Both sides use the trapezoid of R i: the observer's assumption for the current between samples.
            let resistive = (current(theta) + current(next)) * (0.5 * motor.R_s);
            let u = (flux(next) - flux(theta)) * (1.0 / T_S) + resistive;
            theta = next;
            let estimate = observer.update(&context, &Sample { i: current(theta), u, ..Sample::default() });
            errors.push(wrap(estimate.theta - theta));
        }
        errors
    }

    /// The frame after half a sample and after a whole sample has the angle of that instant, for speeds in both directions.
    #[test]
    fn the_frame_goes_on_at_the_estimated_speed() {
        let (par, motor) = (EstimatorParameters::default(), Motor::default());
        let context = context(&par, &motor);
        for w in [800.0, -800.0] {
            let i = AlphaBeta::new(3.0, -1.0);
            let (mut observer, _) = Rasmussen::start(&context, &Sample { i, ..Sample::default() }, 0.7, w);
            let Estimate { theta, axis, w, half, .. } = observer.update(&context, &Sample { i, ..Sample::default() });
            assert!(w.abs() > 100.0 && half.is_some(), "{w} rad/s");
            for (frame, turned) in half.map(|half| (axis.ahead(half), 0.5)).into_iter().chain([(observer.next, 1.0)]) {
                let off = frame.along(1.0) - Axis::<Estimated>::at(theta + turned * T_S * w).along(1.0);
                assert!(off.magnitude() < 1e-15, "{turned} samples later: {off:?}");
            }
        }
    }

    /// Decay rate in 1/s between two stretches, from the largest error of each.
    fn decay(errors: &[f64], from: f64, to: f64, stretch: f64) -> f64 {
        let peak = |t: f64| errors[samples(t)..samples(t + stretch)].iter().fold(0.0_f64, |m, e| m.max(e.abs()));
        (peak(from) / peak(to)).ln() / (to - from)
    }

    fn rpm(n: f64) -> f64 {
        n * std::f64::consts::PI / 10.0 // 3 pole pairs
    }

    /// Rasmussen's Fig. 10: poles at -c_1/2 above |w| = c_1/2, a slow pole at -w^2/c_1 below.
    #[test]
    fn an_initial_error_decays_as_the_linearization_says() {
        let (par, motor, start) = (RasmussenParameters::default(), Motor::default(), 20.0_f64.to_radians());
        for n in [300.0, 500.0, 1000.0, 1500.0] {
            let errors = beside(&par, &motor, rpm(n), DqHat::ZERO, start, 0.4);
            let period = std::f64::consts::TAU / rpm(n);
            let rate = decay(&errors, 0.05, 0.25, period);
            assert!((rate - 25.0).abs() < 2.5, "{n} rpm: {rate} 1/s");
        }
        let errors = beside(&par, &motor, rpm(20.0), DqHat::ZERO, start, 6.0);
        let (rate, expected) = (decay(&errors, 2.0, 5.0, 2.0 * T_S), rpm(20.0) * rpm(20.0) / 50.0);
        assert!((rate / expected - 1.0).abs() < 0.15, "20 rpm: {rate} 1/s, not {expected}");
    }

    /// At standstill the error stays constant: the voltage does not depend on it.
    #[test]
    fn standstill_is_unobservable() {
        let errors = beside(&RasmussenParameters::default(), &Motor::default(), 0.0, DqHat::ZERO, 0.3, 1.0);
        // Only the fast transient of the adaptation changes the error; after it, the error stays constant.
        let (early, late) = (errors[2000], errors[10_000]);
        assert!((early - late).abs() < 1e-6 && late.abs() > 0.05, "{early} {late}");
    }

    /// The steady state that corrects Rasmussen (24): with du = (R - R^) i, exactly
    /// w (psi_rd^ - psi_M cos theta~) = du_q and -w psi_M sin theta~ = du_d - c_1 (psi_rd^ - psi_M), in the estimated
    /// frame. To first order sin theta~ = (-du_d + c_1 du_q / w) / (w psi_M): opposite in sign to the paper.
    #[test]
    fn resistance_error_turns_the_estimate_as_corrected_24_says() {
        let (par, motor) = (RasmussenParameters::default(), Motor::default());
        let hat = Motor { R_s: 0.8 * motor.R_s, ..motor.clone() };
        for (w, i) in [
            (rpm(500.0), DqHat::new(5.0, 0.0)),
            (rpm(500.0), DqHat::new(0.0, 3.0)),
            (rpm(-800.0), DqHat::new(2.0, 3.0)),
        ] {
            let theta_tilde = *beside(&par, &hat, w, i, 0.0, 1.5).last().unwrap();
            // Current in the estimated frame: the rotor-frame current turned back by theta~.
            let seen = Axis::<Rotor>::at(theta_tilde).from_stator(AlphaBeta::new(i.d(), i.q()));
            let (du_d, du_q) = (0.4 * seen.d(), 0.4 * seen.q());
            let psi_rd = du_q / w + motor.psi_M * theta_tilde.cos();
            let residual = -w * motor.psi_M * theta_tilde.sin() - (du_d - par.c_1 * (psi_rd - motor.psi_M));
            assert!(residual.abs() < 2e-3 * (du_d.abs() + du_q.abs()), "residual {residual} V at w = {w}");
            let first_order = (-du_d + par.c_1 * du_q / w) / (w * motor.psi_M);
            assert!((theta_tilde - first_order).abs() < 0.05 * first_order.abs(), "{theta_tilde} {first_order}");
        }
    }

    /// At the start, psi_r^ is the permanent-magnet flux linkage for any current, so the state stays constant.
    #[test]
    fn start_is_an_equilibrium() {
        let motor = Motor::default();
        for i in [AlphaBeta::ZERO, AlphaBeta::new(3.0, -2.0)] {
            let par = EstimatorParameters::default();
            let sample = Sample { i, u: i * motor.R_s, ..Sample::default() };
            let (mut observer, _) = Rasmussen::start(&context(&par, &motor), &sample, 0.7, 0.0);
            let estimate = observer.update(&context(&par, &motor), &sample);
            assert!((estimate.theta - 0.7).abs() < 1e-15 && estimate.w.abs() < 1e-9, "{estimate:?}");
        }
    }

    #[test]
    fn a_start_at_speed_is_without_transient() {
        let errors =
            beside(&RasmussenParameters::default(), &Motor::default(), 400.0, DqHat::new(-1.0, 3.0), 0.0, 0.02);
        let most = errors.iter().map(|error| error.abs()).fold(0.0, f64::max);
        assert!(most < 1e-4, "{most} rad");
    }

    /// Tuning the speed adaptation keeps the estimated speed: w^ = 2 zeta w_n / psi_M psi_rq^ + w_I.
    #[test]
    fn tuning_does_not_change_the_speed() {
        let motor = Motor::default();
        let [old, new] = [(1.0, 300.0), (0.6, 200.0)].map(|(zeta, w_n)| EstimatorParameters {
            rasmussen: RasmussenParameters { w_n, zeta, ..RasmussenParameters::default() },
            ..EstimatorParameters::default()
        });
        let first = Sample::default();
        let (mut observer, _) = Rasmussen::start(&context(&old, &motor), &first, 0.0, 100.0);
        let sample = Sample { u: AlphaBeta::new(3.0, 40.0), ..first };
        for _ in 0..20 {
            observer.update(&context(&old, &motor), &sample);
        }
        let psi_rq = observer.psi_r(&motor, Axis::at(observer.theta)).q();
        assert!(psi_rq.abs() > 1e-3, "{psi_rq} Wb");
        observer.retune(&context(&old, &motor), &context(&new, &motor));
        let speed = 2.0 * 0.6 * 200.0 / motor.psi_M * psi_rq + observer.w_i;
        assert!((speed - observer.w).abs() < 1e-9, "{speed} rad/s, not {} rad/s", observer.w);
    }

    /// Eq (21): v = -c_1 (psi_rd^ - psi_M) - j c_2 psi_rq^, in the frame half a sample ahead.
    #[test]
    fn the_feedback_has_the_signs_of_eq_21() {
        let motor = Motor::default();
        let rasmussen = RasmussenParameters { c_1: 40.0, c_2: 7.0, ..RasmussenParameters::default() };
        let par = EstimatorParameters { rasmussen, ..EstimatorParameters::default() };
        for (w, u) in [(500.0, DqHat::new(30.0, 20.0)), (-500.0, DqHat::new(-10.0, 25.0))] {
            let (mut observer, _) = Rasmussen::start(&context(&par, &motor), &Sample::default(), 0.7, w);
            let sample = Sample { u: Axis::<Estimated>::at(0.7).to_stator(u), ..Sample::default() };
            let estimate = observer.update(&context(&par, &motor), &sample);
            let psi_r = observer.psi_r(&motor, estimate.axis);
            assert!((psi_r.d() - motor.psi_M).abs() > 1e-4 && psi_r.q().abs() > 1e-4, "{psi_r:?}");
            let v = Axis::<Estimated>::at(estimate.theta + 0.5 * T_S * estimate.w).from_stator(observer.v);
            let expected = DqHat::new(-40.0 * (psi_r.d() - motor.psi_M), -7.0 * psi_r.q());
            assert!((v - expected).magnitude() < 1e-12, "{v:?}, not {expected:?} at {w} rad/s");
        }
    }
}
