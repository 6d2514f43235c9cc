//! Every machine in motors/ with the values of `fmu tune`: no chatter, and a balanced power.
#![allow(missing_docs, non_snake_case)]

use drive::plant::power::Powers;
use drive::plant::signals::PlantOutputs;
use drive::plant::tables::PlantParameters;
use drive::{Pair, PmsmDrive};
use drive_tools::tune::{self, motor::MotorFile, setting::Tuned};
use fmu_core::{Block, Elapsed, Step};
use std::collections::VecDeque;
use std::path::Path;

/// A machine: its values, rated speed (rad/s) and torque (N.m).
struct Machine {
    tuned: Tuned,
    speed: f64,
    torque: f64,
}

impl Machine {
    fn u_dc(&self) -> f64 {
        self.tuned.pair().plant.model.inputs.u_dc
    }
}

fn machines() -> Vec<Machine> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("motors");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 5, "{files:?}");
    let read = |path: &Path| {
        let rating = MotorFile::parse(&std::fs::read_to_string(path).unwrap(), path).unwrap().data.rating;
        let (speed, torque) = (*rating.speed.get_ref(), *rating.torque.get_ref());
        Machine { tuned: tune::tune(path).unwrap(), speed, torque }
    };
    files.iter().map(|path| read(path)).collect()
}

/// Maximum number of samples within 10 ms at which a voltage changes by more than a tenth of u_dc: a jump of a reference causes
/// some, an oscillating loop never stops.
fn most_jumps(machine: &Machine, theta_e: f64) -> usize {
    let (mut pair, u_dc) = (machine.tuned.pair(), machine.u_dc());
    pair.plant.model.parameters.initial.theta_e = theta_e;
    pair.start().unwrap();
    let (mut last, mut window, mut most) = (pair.controller.out.u, VecDeque::from([false; 100]), 0);
    let T_s = pair.controller.model.parameters.T_s;
    let mut k = 0_u32;
    while f64::from(k) * T_s < 3.0 {
        pair.set_inputs(if f64::from(k) * T_s < 0.6 { 0.0 } else { 0.5 * machine.speed }, 0.0, u_dc);
        pair.step(T_s).unwrap();
        let u = pair.controller.out.u;
        let change = (u.a - last.a).abs().max((u.b - last.b).abs()).max((u.c - last.c).abs());
        window.pop_front();
        window.push_back(change > 0.1 * u_dc);
        (last, most) = (u, most.max(window.iter().filter(|&&jump| jump).count()));
        k += 1;
    }
    let speed = pair.plant.out.speed;
    assert!((speed / (0.5 * machine.speed) - 1.0).abs() < 0.02, "{}: {speed} rad/s", machine.tuned.name);
    most
}

#[test]
fn no_voltage_chatters() {
    for machine in machines() {
        let most = [0.0, 1.0, 2.5, -2.0].map(|theta_e| most_jumps(&machine, theta_e));
        println!("{}: at most {most:?} jumps of the voltage within 10 ms", machine.tuned.name);
        assert!(most.iter().all(|&n| n <= 20), "{}: {most:?}", machine.tuned.name);
    }
}

/// Mean of p_in (W), and of its difference from p_mech + p_loss and the change of the stored energy (W), from 4 s on, for one
/// second.
struct Balance {
    p_in: f64,
    missing: f64,
}

/// The machine at rated load and 0.7 of the rated speed, which all reach without field weakening; steps of `h` (s).
fn balance(machine: &Machine, h: f64, step: &mut impl FnMut(f64, f64) -> PlantOutputs) -> Balance {
    let (mut sum, mut n, mut k) = (Balance { p_in: 0.0, missing: 0.0 }, 0.0, 0_u32);
    let PlantParameters { motor, mechanics, .. } = machine.tuned.pair().plant.model.parameters;
    let mut stored = 0.0;
    while f64::from(k) * h < 5.0 {
        let t = f64::from(k) * h;
        let out = step(
            0.7 * machine.speed * ((t - 0.6) / 1.5).clamp(0.0, 1.0),
            machine.torque * ((t - 2.5) / 0.5).clamp(0.0, 1.0),
        );
        let (Powers { p_in, p_mech, p_loss, .. }, before) = (out.powers, stored);
        let magnetic = 0.75 * (motor.L_d * out.i_d * out.i_d + motor.L_q * out.i_q * out.i_q);
        stored = magnetic + 0.5 * mechanics.J * out.speed * out.speed;
        if t > 4.0 {
            let missing = p_in - p_mech - p_loss - (stored - before) / h;
            sum = Balance { p_in: sum.p_in + p_in, missing: sum.missing + missing };
            n += 1.0;
        }
        k += 1;
    }
    Balance { p_in: sum.p_in / n, missing: sum.missing / n }
}

#[test]
fn mean_power_is_balanced_at_any_step() {
    for machine in machines() {
        let T_s = machine.tuned.pair().controller.model.parameters.T_s;
        for h in [T_s, 10.0 * T_s, 0.37 * T_s] {
            let mut drive = Block::<PmsmDrive>::default();
            drive.model.pair = machine.tuned.pair();
            (drive.model.inputs.u_dc, drive.model.pair.plant.model.inputs.u_dc) = (machine.u_dc(), machine.u_dc());
            drive.initialize();
            let mut now = Elapsed::ZERO;
            let of_drive = balance(&machine, h, &mut |speed_ref, tau_load| {
                (drive.model.inputs.speed_ref, drive.model.inputs.tau_load) = (speed_ref, tau_load);
                let step = Step { start: now, h };
                drive.step(&step).unwrap();
                now = step.end();
                drive.out.plant.clone()
            });
            check(&machine, h, "drive", &of_drive);
            let (mut pair, u_dc): (Pair, f64) = (machine.tuned.pair(), machine.u_dc());
            if h <= T_s {
                pair.start().unwrap();
                let of_pair = balance(&machine, h, &mut |speed_ref, tau_load| {
                    pair.set_inputs(speed_ref, tau_load, u_dc);
                    pair.step(h).unwrap();
                    pair.plant.out.clone()
                });
                check(&machine, h, "pair", &of_pair);
            }
        }
    }
}

fn check(machine: &Machine, h: f64, who: &str, balance: &Balance) {
    let (name, Balance { p_in, missing }) = (&machine.tuned.name, balance);
    println!("{name}, {who} in steps of {h} s: mean p_in {p_in:.1} W, of which {missing:.3} W are not accounted for");
    assert!(*p_in > 0.7 * machine.speed * machine.torque, "{name} is loaded: {p_in} W");
    assert!(missing.abs() <= 1e-5 * p_in, "{name}, {who} in steps of {h} s: {missing} W of {p_in} W are missing");
}
