//! Gates off: the machine coasts without current, above the DC link's voltage it generates through the diodes, and the
//! drive starts again.
#![allow(missing_docs)]
#![allow(non_snake_case, reason = "the papers' symbols")]

mod common;

use common::{SteppedPlant, T_S};
use drive::control::start::StartMode;
use drive::estimator::Kind;
use drive::frame::{AlphaBeta, Phases};
use drive::plant::tables::PlantParameters;
use drive::{Pair, PmsmDrive, SensorlessController};
use drive_study::runner;
use fmu_core::{Block, Elapsed, Model, Step};
use std::f64::consts::FRAC_PI_2;

/// A plant with its gates off.
fn off(set: impl FnOnce(&mut PlantParameters)) -> SteppedPlant {
    let mut off = SteppedPlant::new(set);
    off.block.model.inputs.enable = false;
    // The controller's request has no effect.
    off.block.model.inputs.u.a = 100.0;
    off.block.initialize();
    off
}

impl SteppedPlant {
    /// One step of a shaft that is imposed at `speed` (rad/s).
    fn turn(&mut self, speed: f64, h: f64) {
        let angle = self.block.out.angle;
        let inputs = &mut self.block.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft) = (speed, angle);
        self.step(h);
    }
}

#[test]
fn no_current_below_the_voltage_of_the_link() {
    // 395 rad/s: the line-to-line EMF of 308 V stays below 325 V. Only friction slows the rotor down.
    let (w_0, t) = (395.0, 0.5);
    let mut off = off(|par| par.initial.speed = w_0);
    for _ in 0..5000 {
        off.step(1e-4);
        let out = &off.block.out;
        assert!(out.i.a == 0.0 && out.i.b == 0.0 && out.i.c == 0.0 && out.tau_e == 0.0, "{out:?}");
        assert!(out.powers.i_dc == 0.0 && out.powers.p_in == 0.0);
    }
    let mechanics = &off.block.model.parameters.mechanics;
    let rest = mechanics.tau_coulomb / mechanics.B;
    let expected = (w_0 + rest) * (-mechanics.B * t / mechanics.J).exp() - rest;
    assert!((off.block.out.speed - expected).abs() < 1e-9, "{} {expected}", off.block.out.speed);
}

#[test]
fn a_current_decays_into_the_link_and_stays_away() {
    let mut off = off(|par| par.mechanics.imposed = true);
    (off.block.model.inputs.enable, off.block.model.inputs.u) = (true, Phases::default());
    for _ in 0..100 {
        off.turn(100.0, T_S);
    }
    assert!(off.block.out.i.a.abs() > 1.0, "{:?}", off.block.out.i);
    let stored = |off: &SteppedPlant| {
        let out = &off.block.out;
        0.75 * 6e-3 * (out.i_d * out.i_d + out.i_q * out.i_q)
    };
    off.block.model.inputs.enable = false;
    let (mut h_left, before, first) = (0.0, stored(&off), off.block.out.energy);
    for k in 0..2000 {
        off.turn(100.0, 1e-6);
        assert!(off.block.out.powers.p_in <= 0.0, "diodes only feed");
        if off.block.out.i.a.abs() + off.block.out.i.b.abs() == 0.0 {
            h_left = f64::from(k) * 1e-6;
            break;
        }
    }
    assert!(h_left > 1e-5 && h_left < 1e-3, "the current was gone after {h_left} s");
    // Energy left when the diodes block counts as loss.
    let last = off.block.out.energy;
    let balance = last.r#in - first.r#in - (last.mech - first.mech) - (last.loss - first.loss) + before;
    assert!(before > 5e-3 && balance.abs() < 1e-6 * before, "{balance} J of {before} J unaccounted for");
}

/// Power in W from a link of 325 V into the reference motor at the electrical speed `w` (rad/s) through ideal diodes: each
/// leg at the rail that its current chooses, in stator axes, by Euler's method in small steps, mean of three periods after 10 ms.
fn rectified(w: f64) -> f64 {
    let (r_s, l, psi, u_dc, h) = (2.0, 6e-3, 0.15, 325.0, 1e-7);
    let (mut i, mut p, mut n) = (AlphaBeta::ZERO, 0.0, 0.0);
    for k in 0..204_720_u32 {
        let (sin, cos) = (w * h * f64::from(k)).sin_cos();
        let emf = AlphaBeta::new(-w * psi * sin, w * psi * cos);
        let legs = Phases::from_stator(i);
        let rail = |i: f64| if i > 0.0 { -0.5 * u_dc } else { 0.5 * u_dc };
        let u = Phases { a: rail(legs.a), b: rail(legs.b), c: rail(legs.c) };
        if k >= 100_000 {
            (p, n) = (p + u.a * legs.a + u.b * legs.b + u.c * legs.c, n + 1.0);
        }
        i += (u.to_stator() - i * r_s - emf) * (h / l);
    }
    p / n
}

#[test]
fn a_machine_above_the_link_generates_through_the_diodes() {
    // 600 rad/s, 468 V line to line. The zone near zero costs accuracy in proportion to its width.
    let expected = rectified(1800.0);
    for (i_zero, tolerance) in [(0.1, 0.015), (0.06, 0.009)] {
        let mut off = off(|par| (par.mechanics.imposed, par.inverter.i_zero) = (true, i_zero));
        let (mut p_in, mut balance) = (0.0, 0.0);
        // Three electrical periods of 3.49 ms after 10 ms.
        for k in 0..20_472_u32 {
            off.turn(600.0, 1e-6);
            if k >= 10_000 {
                let p = &off.block.out.powers;
                p_in += p.p_in / 10_472.0;
                balance += (p.p_in - p.p_loss - p.p_mech) / 10_472.0;
                assert!((p.p_in - 325.0 * p.i_dc).abs() < 1e-9 && p.p_in < 0.0);
            }
        }
        assert!((p_in / expected - 1.0).abs() < tolerance, "{p_in} W into the link, by ideal diodes {expected} W");
        assert!(balance.abs() < 2e-3 * p_in.abs(), "{balance} W of {p_in} W");
    }
    let mut off = off(|par| par.mechanics.imposed = true);
    for _ in 0..100 {
        off.turn(600.0, T_S);
    }
    assert!(off.block.out.powers.p_mech < -3000.0, "{:?}", off.block.out.powers);
    // The link rises above the EMF: the current ends.
    off.block.model.inputs.u_dc = 500.0;
    for _ in 0..100 {
        off.turn(600.0, T_S);
    }
    assert_eq!(off.block.out.i.a.to_bits() << 1, 0, "{:?}", off.block.out.i);
}

#[test]
fn without_a_link_the_diodes_short_the_machine() {
    let mut off = off(|par| par.initial.speed = 100.0);
    off.block.model.inputs.u_dc = 0.0;
    off.step(2e-3);
    let out = &off.block.out;
    assert!(out.tau_e < -0.1 && out.powers.p_in == 0.0 && out.powers.i_dc < 0.0, "{out:?}");
}

#[test]
fn a_narrow_zone_does_not_take_for_ever() {
    let mut off = off(|par| (par.initial.speed, par.inverter.i_zero) = (600.0, 1e-12));
    // At most a hundred substeps per period for any i_zero; otherwise this one would be refused.
    off.step(5.0);
    assert!(off.block.out.i.a == 0.0 && off.block.out.speed < 420.0, "{:?}", off.block.out);
}

/// A controller with an ideal sensor, enabled from the sample `from` on; at rest until the sample `step` after that.
fn enabled_at(kind: Kind, from: u32, samples: u32) -> Vec<(Vec<u64>, bool)> {
    let mut pair = runner::drive(kind);
    let par = &mut pair.controller.model.parameters;
    par.sensor.noise = 0.0;
    if !kind.holds_standstill() {
        par.start.mode = StartMode::CurrentFrequency;
        (par.start.t_align, par.start.settle) = (0.05, 0.05);
    }
    pair.plant.model.parameters.initial.theta_e = 0.4;
    pair.start().unwrap();
    let mut all = Vec::new();
    for k in 0..from + samples {
        pair.controller.model.inputs.enable = k >= from;
        let speed_ref = if k < from + 500 { 0.0 } else { 0.2 * runner::RATED_SPEED };
        pair.set_inputs(speed_ref, 0.0, 540.0);
        pair.step(T_S).unwrap();
        let out = &pair.controller.out;
        if k < from {
            assert!(out.u.a == 0.0 && out.u.b == 0.0 && out.speed_est == 0.0 && !out.enabled, "{out:?}");
            assert!(pair.plant.out.i.a == 0.0);
        } else {
            let bits = [out.u.a, out.u.b, out.u.c, out.theta_est, out.speed_est, pair.plant.out.speed];
            all.push((bits.map(f64::to_bits).to_vec(), out.enabled));
        }
    }
    all
}

#[test]
fn an_enabled_controller_starts_like_at_t_0() {
    for &kind in Kind::ALL {
        let (now, later) = (enabled_at(kind, 0, 3000), enabled_at(kind, 777, 3000));
        let apart = now.iter().zip(&later).position(|(a, b)| a != b);
        assert_eq!(apart, None, "{}: sample", kind.name());
        assert!(now[2999].1 && f64::from_bits(now[2999].0[5]).abs() > 0.0, "{}: it moves", kind.name());
    }
}

/// Bits of the controller's commands and estimates over 400 samples of prescribed inputs.
fn commands(controller: &mut Block<SensorlessController>, now: &mut Elapsed) -> Vec<[u64; 5]> {
    let sample = |k: u32| {
        let (sin, cos) = (0.02 * f64::from(k)).sin_cos();
        let inputs = &mut controller.model.inputs;
        inputs.i = Phases { a: 2.0 * cos, b: 2.0 * sin - cos, c: -2.0 * sin - cos };
        (inputs.speed_ref, inputs.theta_meas, inputs.speed_meas) = (20.0, 0.02 * f64::from(k % 100), 66.0);
        let step = Step { start: *now, h: T_S };
        controller.step(&step).unwrap();
        *now = step.end();
        let out = &controller.out;
        [out.u.a, out.u.b, out.u.c, out.theta_est, out.speed_est].map(f64::to_bits)
    };
    (0..400).map(sample).collect()
}

#[test]
fn a_controller_that_ran_and_was_off_begins_anew() {
    for &kind in Kind::ALL {
        let mut new = runner::drive(kind).controller;
        new.model.parameters.sensor.noise = 0.0;
        let (mut fresh, mut used) = (new.clone(), new);
        fresh.initialize();
        used.initialize();
        let mut now = Elapsed::ZERO;
        let first = commands(&mut used, &mut now);
        used.model.inputs.enable = false;
        commands(&mut used, &mut now);
        used.model.inputs.enable = true;
        let again = commands(&mut used, &mut now);
        assert!(first == commands(&mut fresh, &mut { Elapsed::ZERO }), "{}: the same at first", kind.name());
        let apart = again.iter().zip(&first).position(|(a, b)| a != b);
        assert_eq!(apart, None, "{}: sample", kind.name());
        assert!(first.iter().any(|out| f64::from_bits(out[0]).abs() > 1.0), "{}: a voltage", kind.name());
    }
}

#[test]
fn a_running_drive_coasts_and_starts_again() {
    let mut drive = Block::<PmsmDrive>::default();
    drive.initialize();
    drive.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    let mut run = |drive: &mut Block<PmsmDrive>, enable: bool, ms: u32| {
        drive.model.inputs.enable = enable;
        for _ in 0..ms {
            drive.model.inputs.speed_ref = 50.0;
            let step = Step { start: now, h: 1e-3 };
            drive.step(&step).unwrap();
            now = step.end();
        }
    };
    assert!(drive.out.controller.enabled);
    run(&mut drive, true, 500);
    assert!((drive.out.plant.speed - 50.0).abs() < 0.5 && drive.out.controller.enabled);
    let speed = drive.out.plant.speed;
    run(&mut drive, false, 100);
    let out = &drive.out;
    assert!(!out.controller.enabled && out.plant.i.a == 0.0 && out.controller.u.a == 0.0, "{out:?}");
    assert!(out.plant.speed < speed - 2.0 && out.plant.speed > 40.0, "it coasts: {}", out.plant.speed);
    run(&mut drive, false, 3000);
    assert!(drive.out.plant.speed.abs() < 0.1);
    run(&mut drive, true, 600);
    assert!((drive.out.plant.speed - 50.0).abs() < 0.5 && drive.out.controller.enabled, "{:?}", drive.out.plant);
}

#[test]
fn a_drive_is_the_pair_with_enabled_on_the_gates() {
    let (mut pair, mut drive) = (Pair::default(), Block::<PmsmDrive>::default());
    pair.start().unwrap();
    drive.initialize();
    let mut now = Elapsed::ZERO;
    for k in 0..300_u32 {
        let enable = !(100..200).contains(&k);
        let inputs = &mut drive.model.inputs;
        (inputs.speed_ref, inputs.enable) = (FRAC_PI_2, enable);
        let step = Step { start: now, h: 1e-3 };
        drive.step(&step).unwrap();
        now = step.end();
        for _ in 0..10 {
            pair.set_inputs(FRAC_PI_2, 0.0, 325.0);
            pair.controller.model.inputs.enable = enable;
            pair.step(T_S).unwrap();
        }
        assert_eq!((&drive.out.plant, &drive.out.controller), (&pair.plant.out, &pair.controller.out), "{k} ms");
    }
}
