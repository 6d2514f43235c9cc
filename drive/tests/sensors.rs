//! Errors of the current sensors against closed forms, for a machine without saliency at a speed well within the bandwidth of
//! the current loop: an offset d of phase a gives a torque ripple n_p psi_M d at the electrical speed w, a gain error g of one
//! phase a ripple g tau / 3 at 2 w and the mean -g tau / 3.
#![allow(missing_docs, non_snake_case)]

#[path = "../control/tests/machines/mod.rs"]
mod machines;

use drive::PmsmDrive;
use drive::control::sensor::Sensor;
use fmu_core::{Block, ContinuousTime, Elapsed, Step, integrate};
use machines::b;
use std::f64::consts::TAU;

const T_S: f64 = 1e-4;

/// Mean and amplitudes at w and 2 w of the torque (N.m) for the reference `tau` (N.m), with the sensor errors of `set`.
fn torque(tau: f64, exchange: bool, set: impl FnOnce(&mut Sensor)) -> [f64; 3] {
    let machine = b();
    let mut drive = Block::<PmsmDrive>::default();
    let plant = &mut drive.model.pair.plant.model.parameters;
    (plant.motor, plant.mechanics.imposed) = (machine.motor.clone(), true);
    let par = &mut drive.model.pair.controller.model.parameters;
    *par = machine.parameters();
    par.speed_loop.torque_mode = true;
    set(&mut par.sensor);
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
