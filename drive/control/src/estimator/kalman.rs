//! Extended Kalman filter for stator flux, speed and angle: Kim & Sul name it in section II.A; derived here.
//!
//! The state is x = (psi_d, psi_q, w, theta), with the flux in the rotor frame. Because the state contains the flux instead of
//! the current, the prediction does not depend on the saliency. It is exact for a voltage held in stator axes:
//!
//! ```text
//! psi[k]   = e^{-j theta[k]} (e^{j theta[k-1]} psi[k-1] + T_s (u - R (i[k-1] + i[k]) / 2))
//! w[k]     = w[k-1]
//! theta[k] = theta[k-1] + T_s w[k-1]
//! ```
//!
//! The measurement is the current, i = e^{j theta} L^-1 (psi - psi_M), L = diag(L_d, L_q);
//! the innovation, in the estimated frame, is r = e^{-j theta^} i - L^-1 (psi^ - psi_M).
//!
//! The rotor frame is essential: in it, only the constants 1/L and the current divide the measurement between flux and
//! angle. With the usual flux in stator axes, the unobservable direction turns with the noise of theta^. The filter
//! then mistakes noise for information, and the angle error is 0.18 deg at 0.1 of the rated speed with 10 mA of noise,
//! fifteen times as much as here.
//!
//! The noise is given as spectral densities, so that the filter is the same at every T_s: voltage S_d on the d-axis and
//! S_q on the q-axis, acceleration S_a, current S_i. The EMF then shows the angle with the density S_d / (w psi_M)^2
//! and, on the q-axis, the speed with S_q / psi_M^2. Where the angle information dominates (S_q >> S_d), the poles are
//! those of a PLL with w_0^2 = |w| psi_M sqrt(S_a / S_d) and the damping 1/sqrt(2): the bandwidth grows with the square
//! root of the speed.
//!
//! [`KalmanParameters::new`] sets S_i = sigma^2 T_s from the sensors and S_d = (1 V)^2 1 ms, the residual error of a
//! good inverter. It sets S_q = 1000 S_d, because errors of R, psi_M and dead time lie along the current and the EMF
//! and must not shift the angle (with S_q = 100 S_d, R + 20 % at 0.1 of the rated speed shifts it by 1.5 deg instead of
//! 1.3). S_a sets w_0 to the requested bandwidth at one speed: 2 pi 20 rad/s at 0.05 of the rated speed.
//!
//! The covariance update uses Joseph's form and keeps the matrix symmetric. At standstill the angle is unobservable and
//! its variance would grow without bound: above (1 rad)^2 the filter scales it back, together with its covariances.
//!
//! A filter with a wrong state can diverge. No voltage changes the flux by psi_M within one sample: if the innovation
//! implies such a change, the filter restarts at its current angle.
//!
//! Limits: the angle requires an EMF. It holds rated load down to 0.010 of the rated speed, 0.010 with a compensated dead
//! time. An error in L_q shifts the angle, as in every back-EMF method.

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample};
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::sin_cos;
use drive_base::motor::Motor;
use fmu_core::unit::{Exponents, Quantity, Unit};
use fmu_core::{Row, Table, table};
use nalgebra::{Matrix2, Matrix2x4, Matrix4, Vector2, Vector4};
use serde::{Deserialize, Serialize};

/// Spectral density of a voltage.
const V2_S: Quantity = Quantity::new("VoltageNoiseDensity", Unit::si("V2.s", Exponents::mechanical(2, 4, -5, -2)));
/// Spectral density of a current.
const A2_S: Quantity = Quantity::new("CurrentNoiseDensity", Unit::si("A2.s", Exponents::mechanical(0, 0, 1, 2)));
/// Spectral density of an acceleration.
const RAD2_PER_S3: Quantity =
    Quantity::new("AccelerationNoiseDensity", Unit::si("rad2/s3", Exponents::mechanical(0, 0, -3, 0).with_rad(2)));

/// Largest variance of the angle in rad2.
const MAX_VARIANCE: f64 = 1.0;
/// Standard deviation of the angle at the start in rad.
const THETA_DEVIATION: f64 = 0.3;
/// Assumed time in s of random speed drift before the start.
const WANDERING_TIME: f64 = 0.05;

/// Parameters: spectral densities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KalmanParameters {
    /// Density of the estimated d-axis voltage in V2.s, > 0.
    pub voltage_d: f64,
    /// Density of the estimated q-axis voltage in V2.s, > 0.
    pub voltage_q: f64,
    /// Density of the electrical acceleration in rad2/s3, > 0.
    pub acceleration: f64,
    /// Density of the measured current in A2.s, > 0.
    pub current: f64,
}

impl Default for KalmanParameters {
    /// For the reference motor at 1500 rpm, with 10 mA of noise at 10 kHz: [`KalmanParameters::new`].
    fn default() -> Self {
        Self { voltage_d: 1e-3, voltage_q: 1.0, acceleration: 2e4, current: 1e-8 }
    }
}

impl KalmanParameters {
    /// Inputs: the filter's natural frequency `w_0` (rad/s) at the electrical speed `w` (rad/s), the permanent-magnet
    /// flux linkage `psi_M` (Wb), and the sensors' standard deviation `sigma` (A) at each sample of `T_s` (s).
    pub fn new(psi_M: f64, w_0: f64, w: f64, sigma: f64, T_s: f64) -> Self {
        let voltage_d = 1e-3;
        let ratio = w_0 * w_0 / (w * psi_M);
        Self {
            voltage_d,
            voltage_q: 1e3 * voltage_d,
            acceleration: voltage_d * ratio * ratio,
            current: sigma * sigma * T_s,
        }
    }
}

/// State at a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Kalman {
    /// Stator flux linkage in the rotor frame in Wb.
    psi: DqHat,
    /// Electrical speed in rad/s.
    w: f64,
    /// Electrical angle in rad, not wrapped.
    theta: f64,
    /// Covariance of (psi_d, psi_q, w, theta).
    P: Matrix4<f64>,
}

impl Kalman {
    /// The Jacobian of the prediction that gave `self`, where `gain` (Wb) is the flux change in the new frame.
    #[inline]
    fn F(&self, gain: DqHat, T_s: f64) -> Matrix4<f64> {
        let (sin, cos) = sin_cos(T_s * self.w);
        #[rustfmt::skip]
        let F = Matrix4::new(
            cos, sin, T_s * self.psi.q(), gain.q(),
            -sin, cos, -T_s * self.psi.d(), -gain.d(),
            0.0, 0.0, 1.0, 0.0,
            0.0, 0.0, T_s, 1.0,
        );
        F
    }

    /// Advances to the next sample with the model; returns the Jacobian.
    #[inline]
    fn predict(&mut self, motor: &Motor, sample: &Sample, T_s: f64) -> Matrix4<f64> {
        let gain = (sample.u - (sample.i_last + sample.i) * (0.5 * motor.R_s)) * T_s;
        let psi = Axis::<Estimated>::at(self.theta).to_stator(self.psi) + gain;
        self.theta += T_s * self.w;
        let axis = Axis::<Estimated>::at(self.theta);
        self.psi = axis.from_stator(psi);
        self.F(axis.from_stator(gain), T_s)
    }

    /// The covariance at the next sample.
    #[inline]
    fn spread(&mut self, F: &Matrix4<f64>, noise: &KalmanParameters, T_s: f64) {
        let Q = Vector4::new(noise.voltage_d, noise.voltage_q, noise.acceleration, 0.0) * T_s;
        self.P = F * self.P * F.transpose() + Matrix4::from_diagonal(&Q);
        let P = &mut self.P;
        if P[(3, 3)] > MAX_VARIANCE {
            let scale = (MAX_VARIANCE / P[(3, 3)]).sqrt();
            for k in 0..4 {
                P[(3, k)] *= scale;
                P[(k, 3)] *= scale;
            }
        }
    }

    /// The current in A from the flux, in the rotor frame, and its Jacobian in a stationary frame.
    #[inline]
    fn current(&self, motor: &Motor) -> (DqHat, Matrix2x4<f64>) {
        let (g_d, g_q) = (1.0 / motor.L_d, 1.0 / motor.L_q);
        let i = DqHat::new(g_d * (self.psi.d() - motor.psi_M), g_q * self.psi.q());
        (i, Matrix2x4::new(g_d, 0.0, 0.0, -i.q(), 0.0, g_q, 0.0, i.d()))
    }

    /// Corrects the state with the measured current; returns the innovation in A.
    #[inline]
    fn correct(&mut self, motor: &Motor, i: AlphaBeta, variance: f64) -> DqHat {
        let (i_hat, H) = self.current(motor);
        let r = Axis::<Estimated>::at(self.theta).from_stator(i) - i_hat;
        let PHt = self.P * H.transpose();
        let S = H * PHt + Matrix2::identity() * variance;
        let determinant = S[(0, 0)] * S[(1, 1)] - S[(0, 1)] * S[(1, 0)];
        let inverse = Matrix2::new(S[(1, 1)], -S[(0, 1)], -S[(1, 0)], S[(0, 0)]) * (1.0 / determinant);
        let K = PHt * inverse;
        let dx: Vector4<f64> = K * Vector2::new(r.d(), r.q());
        self.psi += DqHat::new(dx[0], dx[1]);
        self.w += dx[2];
        self.theta += dx[3];
        let A = Matrix4::identity() - K * H;
        let P = A * self.P * A.transpose() + K * K.transpose() * variance;
        self.P = (P + P.transpose()) * 0.5;
        r
    }
}

impl<All: AsRef<KalmanParameters>> Estimating<All> for Kalman {
    /// The flux is uncertain only by the noise of the current sensors; angle and speed are uncertain.
    fn start(context: &ContextOf<All>, sample: &Sample, theta: f64, w: f64) -> (Self, Estimate) {
        let ContextOf { motor, T_s, .. } = *context;
        let i = Axis::<Estimated>::at(theta).from_stator(sample.i);
        let psi = DqHat::new(motor.L_d * i.d() + motor.psi_M, motor.L_q * i.q());
        // Flux derivative with respect to the angle at the measured current: -j i converted to flux.
        let v = Vector4::new(motor.L_d * i.q(), -motor.L_q * i.d(), 0.0, 1.0) * THETA_DEVIATION;
        let flux = context.of::<KalmanParameters>().current / T_s;
        let own = Vector4::new(
            motor.L_d * motor.L_d * flux,
            motor.L_q * motor.L_q * flux,
            WANDERING_TIME * context.of::<KalmanParameters>().acceleration,
            0.0,
        );
        (Self { psi, w, theta, P: v * v.transpose() + Matrix4::from_diagonal(&own) }, Estimate::new(theta, w, sample))
    }

    #[inline]
    fn update(&mut self, context: &ContextOf<All>, sample: &Sample) -> Estimate {
        let ContextOf { motor, T_s, .. } = *context;
        let F = self.predict(motor, sample, T_s);
        self.spread(&F, context.of::<KalmanParameters>(), T_s);
        let r = self.correct(motor, sample.i, context.of::<KalmanParameters>().current / T_s);
        let innovation = DqHat::new(motor.L_d * r.d(), motor.L_q * r.q());
        if innovation.dot(innovation) > motor.psi_M * motor.psi_M {
            *self = Self::start(context, sample, self.theta, 0.0).0;
        }
        Estimate::new(self.theta, self.w, sample)
    }
}

type P = Row<KalmanParameters>;

/// The filter's variables; their owner adds the prefix `kalman.`.
pub const KALMAN: &Table<KalmanParameters> = table![
    P::parameter("voltage_d", &V2_S, "Noise density of the estimated d-axis voltage", |p| &mut p.voltage_d)
        .above(0.0)
        .tunable(),
    P::parameter("voltage_q", &V2_S, "Noise density of the estimated q-axis voltage", |p| &mut p.voltage_q)
        .above(0.0)
        .tunable(),
    P::parameter("acceleration", &RAD2_PER_S3, "Noise density of the electrical acceleration", |p| {
        &mut p.acceleration
    })
    .above(0.0)
    .tunable(),
    P::parameter("current", &A2_S, "Noise density of the measured current: its variance times T_s", |p| {
        &mut p.current
    })
    .above(0.0)
    .tunable(),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::EstimatorParameters;
    use crate::estimator::testing::{comes_to_the_rotor, salient, with_L_q};
    use drive_base::frame::{Dq, Rotor};
    use drive_base::integrate::rk4;
    use drive_plant::machine;
    use drive_plant::machine::Magnetics;

    const T_S: f64 = 1e-4;

    #[test]
    fn comes_to_the_rotor_without_bias() {
        comes_to_the_rotor::<Kalman>(47.0);
    }

    #[test]
    fn a_wrong_l_q_turns_it() {
        let (more, less) = (with_L_q::<Kalman>(1.2), with_L_q::<Kalman>(0.8));
        assert!((more - 5.78).abs() < 0.3 && (less + 5.91).abs() < 0.3, "{more} {less} deg");
    }

    #[test]
    fn the_start_values_follow_the_rule() {
        let (rule, start) = (KalmanParameters::new(0.15, 125.66, 0.05 * 471.2, 0.01, T_S), KalmanParameters::default());
        for (a, b) in [
            (rule.voltage_d, start.voltage_d),
            (rule.voltage_q, start.voltage_q),
            (rule.acceleration, start.acceleration),
            (rule.current, start.current),
        ] {
            assert!((a / b - 1.0).abs() < 0.01, "{a} {b}");
        }
    }

    /// A filter in an arbitrary state of the machine.
    fn at(k: u32) -> Kalman {
        let wave = |rate: f64, size: f64| size * (rate * f64::from(k) + 0.3).sin();
        let (motor, i) = (salient(), Dq::new(wave(0.7, 8.0), wave(1.3, 9.0)));
        let psi = machine::flux(&motor, i);
        Kalman { psi: DqHat::new(psi.d(), psi.q()), w: wave(0.9, 471.0), theta: wave(1.7, 3.0), ..Kalman::default() }
    }

    fn sample(k: u32) -> Sample {
        let wave = |rate: f64, size: f64| size * (rate * f64::from(k) + 0.8).sin();
        Sample {
            i_last: AlphaBeta::new(wave(0.3, 8.0), wave(1.1, 8.0)),
            i: AlphaBeta::new(wave(2.3, 8.0), wave(1.9, 8.0)),
            u: AlphaBeta::new(wave(0.4, 300.0), wave(1.7, 300.0)),
            ..Sample::default()
        }
    }

    /// Derivative with respect to component `k` of the state, by central differences of `f`.
    fn slope<const N: usize>(
        filter: &Kalman,
        k: usize,
        f: impl Fn(&Kalman) -> nalgebra::SVector<f64, N>,
    ) -> nalgebra::SVector<f64, N> {
        let h = [1e-5, 1e-5, 1e-2, 1e-5][k];
        let moved = |by: f64| {
            let mut x = *filter;
            match k {
                0 => x.psi += DqHat::new(by, 0.0),
                1 => x.psi += DqHat::new(0.0, by),
                2 => x.w += by,
                _ => x.theta += by,
            }
            f(&x)
        };
        (moved(h) - moved(-h)) / (2.0 * h)
    }

    #[test]
    fn the_jacobians_are_those_of_the_model() {
        let motor = salient();
        for n in 0..50 {
            let filter = at(n);
            let F = filter.clone().predict(&motor, &sample(n), T_S);
            let frame = Axis::<Estimated>::at(filter.theta);
            let (_, H) = filter.current(&motor);
            for k in 0..4 {
                let by = slope(&filter, k, |x| {
                    let mut next = *x;
                    let _ = next.predict(&motor, &sample(n), T_S);
                    Vector4::new(next.psi.d(), next.psi.q(), next.w, next.theta)
                });
                assert!((by - F.column(k)).norm() < 1e-8, "F, column {k}: {by} {}", F.column(k));
                let by = slope(&filter, k, |x| {
                    let i = frame.from_stator(Axis::<Estimated>::at(x.theta).to_stator(x.current(&motor).0));
                    Vector2::new(i.d(), i.q())
                });
                assert!((by - H.column(k)).norm() < 1e-7, "H, column {k}: {by} {}", H.column(k));
            }
        }
    }

    /// The innovation (A) after `T_s` (s) of the machine's own equations, starting from a correct filter state.
    fn residual(n: u32, T_s: f64) -> f64 {
        let (motor, before) = (salient(), at(n));
        let current = |psi: Dq| machine::current(&motor, Magnetics::Linear, psi);
        let u = sample(n).u;
        let w = before.w;
        let mut x = Vector4::new(before.psi.d(), before.psi.q(), before.theta, 0.0);
        let i_last = Axis::<Rotor>::at(x[2]).to_stator(current(Dq::new(x[0], x[1])));
        for _ in 0..20 {
            x = rk4(x, T_s / 20.0, |x| {
                let psi = Dq::new(x[0], x[1]);
                let seen = Axis::<Rotor>::at(x[2]).from_stator(u);
                let d = seen - current(psi) * motor.R_s - psi.turned() * w;
                Vector4::new(d.d(), d.q(), w, 0.0)
            });
        }
        let i = Axis::<Rotor>::at(x[2]).to_stator(current(Dq::new(x[0], x[1])));
        let mut filter = before;
        let _ = filter.predict(&motor, &Sample { i, i_last, u, ..Sample::default() }, T_s);
        filter.correct(&motor, i, 1.0).magnitude()
    }

    /// The only remaining difference from the plant's equations is the third-order trapezoid error of R i.
    #[test]
    fn the_model_is_the_plant() {
        for n in 0..50 {
            let (coarse, fine) = (residual(n, T_S), residual(n, 0.5 * T_S));
            assert!(coarse < 2e-3, "{n}: {coarse} A");
            assert!(coarse < 1e-9 || coarse / fine > 6.0, "{n}: {coarse} A, {fine} A at half the period");
        }
    }

    #[test]
    fn the_covariance_stays_symmetric_and_positive() {
        let (motor, par) = (salient(), EstimatorParameters::default());
        let context = ContextOf { par: &par, motor: &motor, J: 15e-3, T_s: T_S };
        // Standstill, noise, and inconsistent voltages: the worst case for a drive that has lost synchronism.
        for size in [0.0, 1e-2, 1.0] {
            let mut last = AlphaBeta::ZERO;
            let (mut filter, _) = Kalman::start(&context, &Sample::default(), 0.3, 0.0);
            for n in 0..50_000 {
                let sample = Sample { i: sample(n).i * size, i_last: last, u: sample(n).u * size, ..Sample::default() };
                last = sample.i;
                let estimate = filter.update(&context, &sample);
                assert!(estimate.theta.is_finite() && estimate.w.is_finite());
                assert!((filter.P - filter.P.transpose()).norm() == 0.0);
                // Positive definite in any units: this tests the correlations, independent of the size of the
                // variances.
                let scale = filter.P.diagonal().map(|x| 1.0 / x.sqrt());
                let correlation = Matrix4::from_fn(|r, c| filter.P[(r, c)] * scale[r] * scale[c]);
                let least = correlation.symmetric_eigenvalues().min();
                assert!(least > -1e-12 && filter.P[(3, 3)] <= MAX_VARIANCE, "{size}, {n}: {least} {filter:?}");
            }
        }
    }

    /// In a sample, each variance grows by its density of noise times T_s.
    #[test]
    fn the_variances_grow_with_the_noise() {
        let (mut filter, noise) = (Kalman::default(), KalmanParameters::default());
        filter.spread(&Matrix4::identity(), &noise, T_S);
        let expected = Matrix4::from_diagonal(&Vector4::new(1e-7, 1e-4, 2.0, 0.0));
        assert!((filter.P - expected).abs().max() < 1e-12, "{:?}", filter.P);
    }
}
