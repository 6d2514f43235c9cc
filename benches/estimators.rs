//! One update of each estimator with the 2.2 kW machine at its rated point, including its injection.
//!
//! Goals: 150 ns for Rasmussen and those on the EMF, 250 ns for injection, 1 us for the Kalman filter.
#![allow(missing_docs, non_snake_case)]

use criterion::{Criterion, criterion_group, criterion_main};
use drive::estimator::{Context, Estimator, Injection, Kind, Sample};
use drive::frame::{AlphaBeta, Axis, Dq, DqHat, Rotor};

use drive::plant::machine::{self, Magnetics, flux};
use drive_study::runner;
use std::f64::consts::TAU;
use std::hint::black_box;

const T_S: f64 = 1e-4;
/// Electrical speed in rad/s: a turn in 1000 samples, 10 Hz.
const W: f64 = TAU * 10.0;
/// Samples of six turns: whole periods of every carrier.
const N: usize = 6000;

fn context(par: &drive::control::tables::ControllerParameters) -> Context<'_> {
    Context { par: &par.estimators, motor: &par.motor, J: par.J, T_s: T_S }
}

/// Samples of a machine that turns steadily at its rated current, with the injection of its estimator delayed by one sample.
fn record(kind: Kind, context: &Context) -> Vec<Sample> {
    let (motor, i) = (runner::machine(), Dq::new(-0.84, 5.59));
    let at = |theta: f64, v: Dq| -> AlphaBeta { Axis::<Rotor>::at(theta).to_stator(v) };
    let current = |theta: f64, injected: AlphaBeta| {
        let axis = Axis::<Rotor>::at(theta);
        let psi = flux(&motor, i) + axis.from_stator(injected);
        axis.to_stator(machine::current(&motor, Magnetics::Linear, psi))
    };
    let tau_ref = motor.torque(i.d(), i.q());
    let first = Sample { i: at(0.0, i), i_last: at(-W * T_S, i), tau_ref, u_dc: 540.0, w_meas: W, ..Sample::default() };
    let (mut estimator, mut estimate) = Estimator::start(kind, context, &first, 0.0, W);
    let (mut psi, mut acting, mut i_last, mut theta) = (AlphaBeta::ZERO, AlphaBeta::ZERO, first.i, 0.0);
    let mut samples = Vec::new();
    for k in 1..=2 * N as u64 {
        let injected = acting;
        acting = match estimate.injection {
            Injection::None => AlphaBeta::ZERO,
            Injection::Stator(u) => u,
            Injection::Estimated(u) => turned(estimate.theta + 1.5 * T_S * estimate.w, u),
        };
        let next = theta + W * T_S;
        let emf = (at(next, flux(&motor, i)) - at(theta, flux(&motor, i))) * (1.0 / T_S);
        theta = next;
        psi += injected * T_S;
        let i_now = current(theta, psi);
        let u = emf + (i_last + i_now) * (0.5 * motor.R_s) + injected;
        let sample = Sample { k, i: i_now, i_last, u, u_injected: injected, theta_meas: theta, ..first };
        estimate = estimator.update(context, &sample);
        i_last = i_now;
        samples.push(sample);
    }
    assert!((estimate.w - W).abs() < 0.1 * W, "{} follows: {} rad/s", kind.name(), estimate.w);
    samples.split_off(N)
}

fn turned(theta: f64, u: DqHat) -> AlphaBeta {
    Axis::at(theta).to_stator(u)
}

fn update(c: &mut Criterion) {
    for &kind in Kind::ALL {
        let pair = runner::drive(kind);
        let context = context(&pair.controller.model.parameters);
        let samples = record(kind, &context);
        let (mut estimator, _) = Estimator::start(kind, &context, &samples[N - 1], 0.0, W);
        let mut k = 0;
        c.bench_function(&format!("estimator/{}", kind.name()), |b| {
            b.iter(|| {
                let estimate = estimator.update(black_box(&context), black_box(&samples[k]));
                k = if k + 1 == N { 0 } else { k + 1 };
                estimate
            });
        });
    }
}

criterion_group!(benches, update);
criterion_main!(benches);
