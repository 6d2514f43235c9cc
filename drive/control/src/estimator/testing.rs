//! Runs an estimator next to a machine at constant speed, for the estimators' unit tests: no control, no noise.

use crate::estimator::{Context, Estimating, EstimatorParameters, Injection, Sample};
use drive_base::frame::{AlphaBeta, Axis, Dq, Estimated, Rotor};
use drive_base::math::wrap;
use drive_base::motor::Motor;
use drive_plant::machine::flux;

/// The salient machine used in the tests.
pub(crate) fn salient() -> Motor {
    Motor::IPMSM_2_2_KW
}

/// Angle error theta - theta^ (rad) and speed error (rad/s) after `n` samples of 0.1 ms next to a machine that has the
/// current `i` (A, rotor frame) and turns at `w` (rad/s, electrical). The estimate starts `theta_tilde` (rad) behind
/// with the correct speed; `hat` contains its machine values. The voltage of each interval is the exact mean; its
/// resistive part uses the trapezoid that every estimator assumes between samples.
pub(crate) fn beside<E: Estimating<EstimatorParameters>>(
    par: &EstimatorParameters,
    hat: &Motor,
    (w, i): (f64, Dq),
    theta_tilde: f64,
    n: u32,
) -> (f64, f64) {
    let (motor, T_s) = (salient(), 1e-4);
    let context = Context { par, motor: hat, J: 15e-3, T_s };
    let at = |theta: f64, v: Dq| -> AlphaBeta { Axis::<Rotor>::at(theta).to_stator(v) };
    let tau_ref = motor.torque(i.d(), i.q());
    let mut theta = 0.3;
    let first = Sample { i: at(theta, i), i_last: at(theta - w * T_s, i), tau_ref, ..Sample::default() };
    let (mut estimator, mut estimate) = E::start(&context, &first, theta - theta_tilde, w);
    for k in 0..n {
        let next = theta + w * T_s;
        let resistive = (at(theta, i) + at(next, i)) * (0.5 * motor.R_s);
        let u = (at(next, flux(&motor, i)) - at(theta, flux(&motor, i))) * (1.0 / T_s) + resistive;
        let (i_last, i_now) = (at(theta, i), at(next, i));
        theta = next;
        let sample = Sample { k: u64::from(k) + 1, i: i_now, i_last, u, tau_ref, ..Sample::default() };
        estimate = estimator.update(&context, &sample);
    }
    (wrap(theta - estimate.theta), w - estimate.w)
}

/// Starts 20 degrees off on either side, in both directions, loaded: the estimate must converge, slowest at `slowest`
/// (rad/s).
pub(crate) fn comes_to_the_rotor<E: Estimating<EstimatorParameters>>(slowest: f64) {
    let par = EstimatorParameters::default();
    for w in [slowest, 235.0, 471.0, -235.0] {
        for i_q in [-5.59, 5.59] {
            for degrees in [-20.0_f64, 20.0] {
                let point = (w, Dq::new(-0.84, i_q));
                let (angle, speed) = beside::<E>(&par, &salient(), point, degrees.to_radians(), 10_000);
                assert!(angle.abs().to_degrees() < 0.02, "{w} rad/s, {i_q} A: {} deg off", angle.to_degrees());
                assert!(speed.abs() < 0.02, "{w} rad/s, {i_q} A: {speed} rad/s off");
            }
        }
    }
}

/// Angle error in degrees at w = 235 rad/s and the rated point with L_q^ = `factor` L_q.
pub(crate) fn with_L_q<E: Estimating<EstimatorParameters>>(factor: f64) -> f64 {
    let hat = Motor { L_q: factor * salient().L_q, ..salient() };
    let point = (235.0, Dq::new(-0.84, 5.59));
    beside::<E>(&EstimatorParameters::default(), &hat, point, 0.0, 10_000).0.to_degrees()
}

/// Angle error theta - theta^ (rad) after `n` samples of 0.1 ms next to the machine `plant`, which turns at `w` (rad/s,
/// electrical). Its only current comes from the estimator's injection, `delay` samples later. The estimate starts
/// `theta_tilde` (rad) behind with the correct speed and the values of [`salient`]; `each` receives it after every
/// sample.
pub(crate) fn injected<E: Estimating<EstimatorParameters>>(
    par: &EstimatorParameters,
    plant: &Motor,
    w: f64,
    theta_tilde: f64,
    delay: usize,
    n: u32,
    mut each: impl FnMut(&E),
) -> f64 {
    const PARTS: u32 = 20;
    let (hat, T_s) = (salient(), 1e-4);
    let lead = [0.5, 1.5, 2.5][delay];
    let context = Context { par, motor: &hat, J: 15e-3, T_s };
    let rotor = |theta: f64| Axis::<Rotor>::at(theta);
    let (mut theta, mut psi, mut i_last) = (0.3_f64, Dq::ZERO, AlphaBeta::ZERO);
    let first = Sample { k: 0, ..Sample::default() };
    let (mut estimator, mut estimate) = E::start(&context, &first, theta - theta_tilde, w);
    // The voltages requested at the last samples, the newest first.
    let mut asked = [AlphaBeta::ZERO; 3];
    for k in 1..=n {
        let acting = Axis::<Estimated>::at(estimate.theta + lead * T_s * estimate.w);
        let newest = match estimate.injection {
            Injection::None => AlphaBeta::ZERO,
            Injection::Stator(u) => u,
            Injection::Estimated(u) => acting.to_stator(u),
        };
        asked = [newest, asked[0], asked[1]];
        let u = asked[delay];
        // The injected flux linkage in stator axes: d psi/dt = u - R i, by Heun's method.
        let h = T_s / f64::from(PARTS);
        let current = |theta: f64, psi: AlphaBeta| {
            let psi = rotor(theta).from_stator(psi);
            rotor(theta).to_stator(Dq::new(psi.d() / plant.L_d, psi.q() / plant.L_q))
        };
        let mut flux = rotor(theta).to_stator(psi);
        for _ in 0..PARTS {
            let slope = u - current(theta, flux) * plant.R_s;
            theta += w * h;
            let end = u - current(theta, flux + slope * h) * plant.R_s;
            flux += (slope + end) * (0.5 * h);
        }
        psi = rotor(theta).from_stator(flux);
        let i = current(theta, flux);
        let sample = Sample { k: u64::from(k), i, i_last, u, u_injected: u, ..Sample::default() };
        i_last = i;
        estimate = estimator.update(&context, &sample);
        each(&estimator);
    }
    wrap(theta - estimate.theta)
}

/// Starts 40 degrees off on either side, at standstill and turning, with every delay: the estimate must converge to the
/// rotor within `tolerance` (deg). From 130 degrees it must converge to the opposite pole.
pub(crate) fn finds_the_rotor<E: Estimating<EstimatorParameters>>(par: &EstimatorParameters, tolerance: f64) {
    for delay in [0, 1, 2] {
        for w in [0.0, 47.0, -47.0] {
            for (from, to) in [(40.0_f64, 0.0), (-40.0, 0.0), (130.0, 180.0)] {
                let error = injected::<E>(par, &salient(), w, from.to_radians(), delay, 3000, |_| ()).to_degrees();
                let off = wrap((error - to).to_radians()).to_degrees();
                assert!(off.abs() < tolerance, "delay {delay}, {w} rad/s, from {from} deg: {error} deg, not {to}");
            }
        }
    }
}
