//! Errors of the current sensors against closed forms, for a machine without saliency at a speed well within the bandwidth of
//! the current loop: an offset d of phase a gives a torque ripple n_p psi_M d at the electrical speed w, a gain error g of one
//! phase a ripple g tau / 3 at 2 w and the mean -g tau / 3.
#![allow(missing_docs, non_snake_case)]

#[path = "../control/tests/machines/mod.rs"]
mod machines;

use drive::PmsmDrive;
use drive::control::position::PositionSensor;
use drive::control::sensor::Sensor;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
use drive::estimator::Kind;
use fmu_core::{Block, ContinuousTime, Elapsed, Model, Step, integrate};
use machines::b;
use std::f64::consts::TAU;

const T_S: f64 = 1e-4;

/// Mean and amplitudes at w and 2 w of the torque (N.m) for the reference `tau` (N.m), with the sensor errors of `set`.
fn torque(tau: f64, exchange: bool, set: impl FnOnce(&mut Sensor)) -> [f64; 3] {
    with_sensors(tau, exchange, |par| set(&mut par.sensor))
}

/// [`torque`] with other parameters of the controller.
fn with_sensors(tau: f64, exchange: bool, set: impl FnOnce(&mut ControllerParameters)) -> [f64; 3] {
    let machine = b();
    let mut drive = Block::<PmsmDrive>::default();
    let plant = &mut drive.model.pair.plant.model.parameters;
    (plant.motor, plant.mechanics.imposed) = (machine.motor.clone(), true);
    let par = &mut drive.model.pair.controller.model.parameters;
    *par = machine.parameters();
    par.speed_loop.torque_mode = true;
    set(par);
    // 5 Hz, far below the 200 Hz of the current loop.
    let w = TAU * 5.0;
    let inputs = &mut drive.model.inputs;
    (inputs.speed_shaft, inputs.tau_ref) = (w / 3.0, tau);
    drive.initialize();
    let (mut now, mut sums, periods) = (Elapsed::ZERO, [0.0; 5], 2);
    let settle = 1000;
    let count = 2000 * periods;
    for k in 0..settle + count {
        drive.model.inputs.angle_shaft = w / 3.0 * now.seconds();
        let step = Step { start: now, h: T_S };
        if exchange {
            integrate::hybrid::<PmsmDrive, 5>(&mut drive.model, &step, T_S).unwrap();
            let Block { model, out } = &mut drive;
            model.observe(step.end(), out);
        } else {
            drive.step(&step).unwrap();
        }
        now = step.end();
        if k >= settle {
            let theta = w * now.seconds();
            let waves = [1.0, theta.cos(), theta.sin(), (2.0 * theta).cos(), (2.0 * theta).sin()];
            for (sum, wave) in sums.iter_mut().zip(waves) {
                *sum += drive.out.plant.tau_e * wave / f64::from(count);
            }
        }
    }
    [sums[0], 2.0 * sums[1].hypot(sums[2]), 2.0 * sums[3].hypot(sums[4])]
}

#[test]
fn an_offset_makes_a_torque_at_the_electrical_speed() {
    let motor = b().motor;
    let (d, tau) = (0.2, 2.0);
    let expected = f64::from(motor.n_p) * motor.psi_M * d;
    for exchange in [false, true] {
        let [mean, at_w, at_2w] = torque(tau, exchange, |sensor| sensor.offset.a = d);
        println!("{mean} N.m, {at_w} N.m, not {expected} N.m, {at_2w} N.m");
        assert!((at_w / expected - 1.0).abs() < 0.01, "{at_w} N.m, not {expected} N.m");
        assert!((mean / tau - 1.0).abs() < 1e-3 && at_2w < 0.01 * expected, "{mean} N.m, {at_2w} N.m");
    }
}

#[test]
fn a_gain_error_makes_a_torque_at_twice_the_electrical_speed() {
    let (g, tau) = (0.03, 2.5);
    let expected = g * tau / 3.0;
    for exchange in [false, true] {
        for set in [|s: &mut Sensor| s.gain.a = 1.03, |s: &mut Sensor| s.gain.b = 1.03] {
            let [mean, at_w, at_2w] = torque(tau, exchange, set);
            println!("{mean} N.m, {at_w} N.m, {at_2w} N.m, not {expected} N.m");
            // The second order, from the division by 1 + g / 3 in the loop, is 2 %.
            assert!((at_2w / expected - 1.0).abs() < 0.025, "{at_2w} N.m, not {expected} N.m");
            assert!(((mean - tau) / -expected - 1.0).abs() < 0.025, "{} N.m, not {expected} N.m", mean - tau);
            assert!(at_w < 0.01 * expected, "{at_w} N.m");
        }
    }
}

/// A position sensor mounted with the error d: the d-axis current is 0 in its frame, and i_q cos d makes torque.
#[test]
fn a_mounting_error_costs_its_cosine() {
    for exchange in [false, true] {
        for d in [0.3, -0.3_f64] {
            let [mean, at_w, _] = with_sensors(2.0, exchange, |par| {
                (par.estimator, par.position.angle_offset) = (Kind::Sensored, d);
                (par.start.mode, par.current.mtpa) = (StartMode::Direct, false);
            });
            assert!((mean / (2.0 * d.cos()) - 1.0).abs() < 1e-3 && at_w < 1e-3, "{d}: {mean} N.m, {at_w} N.m");
        }
    }
}

/// From rest at any angle to 60 rad/s, then a load: every position sensor holds the speed.
#[test]
fn every_position_sensor_starts_and_holds_the_drive() {
    for (kind, allowed) in [
        (PositionSensor::Ideal, 1e-4),
        (PositionSensor::Encoder, 0.01),
        (PositionSensor::Hall, 1e-3),
        (PositionSensor::Resolver, 0.01),
    ] {
        for theta_e in [0.1, 1.6, 3.0, -2.0] {
            let machine = b();
            let mut drive = Block::<PmsmDrive>::default();
            let plant = &mut drive.model.pair.plant.model.parameters;
            (plant.motor, plant.mechanics.J, plant.initial.theta_e) = (machine.motor.clone(), machine.J, theta_e);
            let par = &mut drive.model.pair.controller.model.parameters;
            *par = machine.parameters();
            (par.estimator, par.position.kind, par.start.mode) = (Kind::Sensored, kind, StartMode::Direct);
            drive.model.inputs.speed_ref = 60.0;
            drive.model.validate().unwrap();
            drive.initialize();
            let (mut now, mut most) = (Elapsed::ZERO, 0.0_f64);
            for k in 0..12_000 {
                if k == 6000 {
                    drive.model.inputs.tau_load = 1.5;
                }
                let step = Step { start: now, h: T_S };
                drive.step(&step).unwrap();
                now = step.end();
                if (5000..6000).contains(&k) || k > 11_000 {
                    most = most.max((drive.out.plant.speed - 60.0).abs());
                }
            }
            println!("{kind:?} from {theta_e}: within {most} rad/s");
            assert!(most < allowed, "{kind:?} from {theta_e}: {most} rad/s");
        }
    }
}
