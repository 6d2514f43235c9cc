//! A lost rotor: every output stays finite, regardless of the estimator, and `lock_lost` separates lost from found.
#![allow(missing_docs, non_snake_case)]

use drive::estimator::Kind;
use drive::{Pair, SensorlessController};
use drive_study::runner::{self, RATED_SPEED, RATED_TORQUE, rotor_ahead, turning, with_dead_time};
use fmu_core::{Block, Elapsed, Model, Step};
use std::f64::consts::PI;

const RPM: f64 = PI / 30.0;
const T_S: f64 = 1e-4;

/// A run in which every output must be finite: the maximum of `lock_lost` from `from` (s) on. If the angle error stayed above 60
/// deg for 0.2 s with a sufficient EMF, `lock_lost` must be above 1; if it stayed below 20 deg, below 1.
fn watch(what: &str, pair: &mut Pair, (duration, from): (f64, f64), mut each: impl FnMut(f64, &mut Pair)) -> f64 {
    let (mut peak, mut right, mut wrong, mut end) = (0.0_f64, 0.0, 0.0, 0.0);
    let motor = pair.plant.model.parameters.motor.clone();
    let doubt = 2.0 * pair.controller.model.parameters.lock.u;
    runner::run(pair, duration, |t, p| {
        each(t, p);
        end = t;
        let (plant, out) = (&p.plant.out, &p.controller.out);
        let all = [out.u.a, out.u.b, out.u.c, out.i.d, out.i.q, out.i_ref.d, out.i_ref.q, out.speed_est, out.theta_est];
        assert!(all.iter().all(|x| x.is_finite()), "{what}, {t} s: {out:?}");
        assert!((0.0..=10.0).contains(&out.lock_lost) && out.theta_est.abs() <= PI, "{what}, {t} s: {out:?}");
        let (error, emf) = (rotor_ahead(p).abs(), f64::from(motor.n_p) * plant.speed.abs() * motor.psi_M);
        right = if error < 20.0 { right + T_S } else { 0.0 };
        wrong = if error > 60.0 && emf > doubt { wrong + T_S } else { 0.0 };
        assert!(right < 0.2 || out.lock_lost < 1.0, "{what}, {t} s: {} at {error} deg", out.lock_lost);
        assert!(wrong < 0.2 || out.lock_lost > 1.0, "{what}, {t} s: {} at {error} deg", out.lock_lost);
        if t >= from {
            peak = peak.max(out.lock_lost);
        }
    });
    assert!((end - duration).abs() < T_S, "{what}: a step failed at {end} s");
    peak
}

fn preset(kind: Kind) -> Pair {
    let speed = if kind.name().ends_with("Injection") { 0.1 } else { 0.5 };
    turning(runner::drive(kind), speed)
}

/// Kinds whose estimate cannot lose the rotor, or recovers within a sample or two after an overload.
const SURE: [Kind; 6] = [
    Kind::Sensored,
    Kind::Rasmussen,
    Kind::CurrentModel,
    Kind::KalmanFilter,
    Kind::FluxObserver,
    Kind::GradientObserver,
];

#[test]
fn a_load_beyond_every_torque() {
    for &kind in Kind::ALL {
        let peak = watch(kind.name(), &mut preset(kind), (1.5, 0.0), |t, p| {
            p.plant.model.inputs.tau_load = if t > 0.3 { 4.0 * RATED_TORQUE } else { 0.0 };
        });
        assert!(peak > 1.0 || SURE.contains(&kind), "{} is lost: {peak}", kind.name());
    }
}

#[test]
fn a_wrong_start() {
    for &kind in Kind::ALL {
        let mut pair = preset(kind);
        pair.plant.model.parameters.initial.theta_e = 0.9 * PI;
        watch(kind.name(), &mut pair, (1.0, 0.0), |_, _| {});
        let mut pair = preset(kind);
        pair.controller.model.parameters.speed_est = -2.0 * RATED_SPEED;
        watch(kind.name(), &mut pair, (1.0, 0.0), |_, _| {});
    }
}

#[test]
fn machine_values_far_off() {
    for &kind in Kind::ALL {
        for (r, l) in [(1.2, 1.0), (3.0, 1.0), (1.0, 0.3), (1.0, 2.0)] {
            let mut pair = runner::drive(kind);
            let motor = &mut pair.controller.model.parameters.motor;
            (motor.R_s, motor.L_q) = (r * motor.R_s, l * motor.L_q);
            if pair.start().is_err() {
                continue; // L_q^ < L_d^: injection says that it cannot work.
            }
            let (mut worst, mut end) = (0.0_f64, 0.0);
            runner::run(&mut pair, 1.5, |t, p| {
                p.controller.model.inputs.speed_ref = 0.3 * RATED_SPEED * (t / 0.5).min(1.0);
                p.plant.model.inputs.tau_load = if t > 0.8 { RATED_TORQUE } else { 0.0 };
                let out = &p.controller.out;
                worst = worst.max(out.lock_lost);
                assert!(out.lock_lost.is_finite() && out.speed_est.is_finite() && out.u.a.is_finite(), "{out:?}");
                end = t;
            });
            assert!(end > 1.4999, "{} with {r} R, {l} L_q: a step failed at {end} s", kind.name());
        }
    }
}

/// Load, dead time, every estimator in its range: found all the time.
#[test]
fn healthy_drives_are_not_lost() {
    for &kind in Kind::ALL {
        for compensated in [true, false] {
            let mut pair = with_dead_time(preset(kind), compensated);
            let peak = watch(kind.name(), &mut pair, (1.0, 0.0), |t, p| {
                p.plant.model.inputs.tau_load = 0.5 * RATED_TORQUE * (t / 0.3).min(1.0);
            });
            assert!(peak < 0.8, "{}: {peak}", kind.name());
        }
    }
}

/// The figures of Rasmussen's paper: starts (including the one from 180 deg), speed steps, loads, reversals.
#[test]
fn the_figures_of_the_paper_are_not_lost() {
    let figure = |what: &str, theta: f64, speed: f64, load: f64, reversal: f64| {
        let mut pair = Pair::default();
        pair.plant.model.parameters.initial.theta_e = theta.to_radians();
        let mut peak = 0.0_f64;
        runner::run(&mut pair, 2.5, |t, p| {
            let n = if t < 0.1 - 1e-9 { 0.0 } else { speed } * if t < reversal { RPM } else { -RPM };
            p.set_inputs(n, if t > 0.7 { load } else { 0.0 }, 325.0);
            peak = peak.max(p.controller.out.lock_lost);
        });
        assert!(peak < 0.8, "{what}: {peak}");
    };
    for theta in [180.0, 90.0, -60.0, 0.0] {
        figure("start", theta, 500.0, 0.0, 9.0);
    }
    for speed in [20.0, 1000.0, 1500.0] {
        figure("speed step", 0.0, speed, 0.0, 9.0);
    }
    for speed in [0.0, 1000.0] {
        figure("load", 0.0, speed, 2.0, 9.0);
    }
    for speed in [100.0, 500.0, 1500.0] {
        figure("reversal", 0.0, speed, 0.0, 1.0);
    }
}

/// Rasmussen with R^ = 1.2 R runs away at standstill, and (16) without its own gains is lost at 500 rpm.
#[test]
fn run_away() {
    for speed in [0.0, 20.0] {
        let mut pair = Pair::default();
        pair.controller.model.parameters.motor.R_s = 2.4;
        watch("R^ = 1.2 R", &mut pair, (5.0, 0.0), |t, p| {
            p.set_inputs(speed * RPM, if t > 0.5 { 2.0 } else { 0.0 }, 325.0);
        });
    }
    let mut pair = Pair::default();
    pair.controller.model.parameters.estimators.rasmussen.zeta = 0.0;
    let peak = watch("(16)", &mut pair, (2.0, 0.5), |_, p| p.set_inputs(500.0 * RPM, 0.0, 325.0));
    assert!(peak > 1.0, "{peak}");
}

/// Absurdly large but finite inputs: the outputs stay finite, the loss is reported, and afterwards the controller works again.
#[test]
fn finite_inputs_give_finite_outputs() {
    for &kind in Kind::ALL {
        let mut block = Block::<SensorlessController>::default();
        block.model.parameters = runner::drive(kind).controller.model.parameters;
        block.initialize();
        block.model.validate().unwrap();
        let (mut now, mut lost) = (Elapsed::ZERO, 0.0_f64);
        for k in 0..600_u32 {
            let size = [0.0, 1e3, 1e30, 1e160, f64::MAX, 0.0][usize::try_from(k / 100).unwrap()];
            let inputs = &mut block.model.inputs;
            let side = if k % 2 == 0 { 1.0 } else { -0.7 };
            (inputs.i.a, inputs.i.b, inputs.i.c) = (side * size, -size, 0.3 * size);
            (inputs.speed_ref, inputs.u_dc) = (side * size, if size > 0.0 { size } else { 540.0 });
            (inputs.theta_meas, inputs.speed_meas) = (size, side * size);
            let step = Step { start: now, h: T_S };
            block.step(&step).unwrap();
            now = step.end();
            let out = &block.out;
            let all = [out.u.a, out.u.b, out.u.c, out.i.d, out.i.q, out.i_ref.d, out.i_ref.q, out.speed_est];
            assert!(all.iter().all(|x| x.is_finite()), "{}, sample {k}: {out:?}", kind.name());
            assert!(out.theta_est.abs() <= PI && (0.0..=10.0).contains(&out.lock_lost), "{}: {out:?}", kind.name());
            lost = lost.max(out.lock_lost);
        }
        assert!(lost > 1.0, "{}: {lost}", kind.name());
        assert!(block.out.speed_est.abs() < 10.0 * RATED_SPEED, "{}: {:?}", kind.name(), block.out);
        block.model.inputs.i.a = f64::NAN;
        assert!(block.step(&Step { start: now, h: T_S }).is_err());
    }
}
