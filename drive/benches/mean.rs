//! Compares PmsmDriveMean with PmsmDrive, natively: ns per step of 1 and 10 ms, and their ratio; and the driving cycle of
//! `examples/vehicle` in steps of 10 ms.
//!
//! The two models run alternately, for less than a millisecond each; the figures are the minimum over many runs, free of other
//! load.
#![allow(missing_docs, non_snake_case)]

#[path = "../plant/tests/lossy/mod.rs"]
mod lossy;
#[path = "../control/tests/machines/mod.rs"]
mod machines;
#[path = "../tests/vehicle/mod.rs"]
mod vehicle;

use drive::pmsm_drive::DriveInputs;
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::tables::ControllerParameters;
use drive_plant::tables::PlantParameters;
use fmu_core::{Block, Elapsed, Step};
use machines::RPM;
use std::time::Instant;

const TURNS: usize = 200;

/// A case: its name, both sets of parameters, and speed reference or speed in rad/s with the torque in N.m.
type Case = (&'static str, PlantParameters, ControllerParameters, [f64; 2]);

fn cases() -> [Case; 4] {
    let default = (PlantParameters::default(), ControllerParameters::default());
    let mut imposed = default.clone();
    (imposed.0.mechanics.imposed, imposed.1.speed_loop.torque_mode) = (true, true);
    imposed.1.estimator = drive::estimator::Kind::Sensored;
    let mut traction = (lossy::c().par, machines::c(240.0).parameters());
    traction.1.speed_loop.torque_mode = true;
    let (plant, controller) = traction.clone();
    [
        ("default, speed control", default.0, default.1, [100.0, 1.0]),
        ("imposed shaft, torque control", imposed.0, imposed.1, [100.0, 1.0]),
        ("traction, 2000 rpm", plant, controller, [2000.0 * RPM, 30.0]),
        ("traction, 8000 rpm", traction.0, traction.1, [8000.0 * RPM, 30.0]),
    ]
}

/// Steps of `h` (s), `count` at a time: the time of one in ns.
macro_rules! turns {
    ($block:expr, $inputs:ident, $h:expr, $count:expr) => {{
        let (mut block, mut now) = ($block, Elapsed::ZERO);
        block.initialize();
        move || {
            let start = Instant::now();
            for _ in 0..$count {
                let inputs: &mut DriveInputs = &mut block.model.$inputs;
                inputs.angle_shaft = inputs.speed_shaft * now.seconds();
                let step = Step { start: now, h: $h };
                block.step(&step).unwrap();
                now = step.end();
            }
            1e9 * start.elapsed().as_secs_f64() / f64::from($count)
        }
    }};
}

fn set(inputs: &mut DriveInputs, [speed, torque]: [f64; 2], u_dc: f64) {
    (inputs.speed_ref, inputs.speed_shaft, inputs.u_dc) = (speed, speed, u_dc);
    (inputs.tau_ref, inputs.tau_load) = (torque, torque);
}

fn least(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

fn main() {
    println!("{:<32}{:>8}{:>12}{:>16}{:>8}", "", "h in ms", "PmsmDrive", "PmsmDriveMean", "ratio");
    for (name, plant, controller, point) in cases() {
        for h in [1e-3, 1e-2] {
            let u_dc = if plant.motor.psi_M < 0.1 { 400.0 } else { 325.0 };
            let mut whole = Block::<PmsmDrive>::default();
            whole.model.pair.plant.model.parameters = plant.clone();
            whole.model.pair.controller.model.parameters = controller.clone();
            set(&mut whole.model.inputs, point, u_dc);
            let mut mean = Block::<PmsmDriveMean>::default();
            (mean.model.drive.plant, mean.model.drive.controller) = (plant.clone(), controller.clone());
            set(&mut mean.model.inputs, point, u_dc);
            let (mut one, mut other) =
                (turns!(whole, inputs, h, if h < 2e-3 { 100_u32 } else { 10 }), turns!(mean, inputs, h, 1000_u32));
            let (mut theirs, mut ours) = (Vec::new(), Vec::new());
            for turn in 0..TURNS + 5 {
                let times = (one(), other());
                // The first turns start the drives and warm the caches.
                if turn >= 5 {
                    theirs.push(times.0);
                    ours.push(times.1);
                }
            }
            let (theirs, ours) = (least(&theirs), least(&ours));
            println!("{name:<32}{:>8}{theirs:>12.0}{ours:>16.0}{:>8.1}", 1e3 * h, theirs / ours);
        }
    }
    cycle();
}

/// The cycle three times, 1830 s.
fn cycle() {
    let (plant, mut controller) = (lossy::c().par, machines::c(240.0).parameters());
    controller.speed_loop.torque_mode = true;
    let (vehicle, h) = (vehicle::Vehicle::new(), 1e-2);
    let mut rows = Vec::new();
    let mut t = 0.5 * h;
    while t < vehicle.end() {
        rows.push(vehicle.at(t));
        t += h;
    }
    let mut times = Vec::new();
    for _ in 0..TURNS / 10 {
        let mut block = Block::<PmsmDriveMean>::default();
        (block.model.drive.plant, block.model.drive.controller) = (plant.clone(), controller.clone());
        block.model.inputs.u_dc = 400.0;
        block.initialize();
        let (start, mut now) = (Instant::now(), Elapsed::ZERO);
        for &[speed, tau] in rows.iter().cycle().take(3 * rows.len()) {
            (block.model.inputs.speed_shaft, block.model.inputs.tau_ref) = (speed, tau);
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        times.push(start.elapsed().as_secs_f64());
    }
    println!("\nthree cycles, {:.0} s in steps of 10 ms: {:.1} ms", 3.0 * vehicle.end(), 1e3 * least(&times));
}
