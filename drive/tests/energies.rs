//! Torque of an imposed shaft and energies: what a drive train integrates is what the energies count, in Co-Simulation and in
//! Model Exchange.
#![allow(missing_docs)]
#![allow(non_snake_case, reason = "the papers' symbols")]

use drive::control::current::CurrentLoop;
use drive::control::tables::Limits;
use drive::estimator::Kind as Estimator;
use drive::frame::{AlphaBeta, Phases};
use drive::motor::Motor;
use drive::{PmsmDrive, PmsmPlant};
use fmu_core::{Block, Elapsed, Step};

const RPM: f64 = std::f64::consts::PI / 30.0;

/// A traction drive in torque mode on a shaft that is imposed.
fn traction() -> PmsmDrive {
    let motor = Motor { n_p: 6, R_s: 5.5e-3, L_d: 0.09e-3, L_q: 0.25e-3, psi_M: 0.038 };
    let mut drive = PmsmDrive::default();
    let plant = &mut drive.pair.plant.model.parameters;
    (plant.motor, plant.mechanics.imposed) = (motor.clone(), true);
    let controller = &mut drive.pair.controller.model.parameters;
    (controller.motor, controller.estimator) = (motor, Estimator::Sensored);
    controller.limit = Limits { i: 450.0, i_q: 450.0, tau: 1e3 };
    controller.current = CurrentLoop { mtpa: true, ..controller.current.clone() };
    (controller.weakening.used, controller.speed_loop.torque_mode) = (true, true);
    (drive.inputs.tau_ref, drive.inputs.u_dc) = (100.0, 360.0);
    drive
}

/// Work in J of `tau_shaft` on the shaft at the `speed` (rad/s) over 0.1 s of steady state in steps of `h` (s), and what
/// `energy_mech` counted.
fn work(speed: f64, h: f64) -> (f64, f64) {
    let mut drive = Block::<PmsmDrive> { model: traction(), ..Block::default() };
    drive.model.inputs.speed_shaft = speed;
    drive.initialize();
    let (mut now, mut work, mut before) = (Elapsed::ZERO, 0.0, 0.0);
    while now.seconds() < 0.3 {
        if now.seconds() < 0.2 {
            (work, before) = (0.0, drive.out.plant.energy.mech);
        }
        drive.model.inputs.angle_shaft = speed * now.seconds();
        let step = Step { start: now, h };
        drive.step(&step).unwrap();
        now = step.end();
        work += drive.out.plant.powers.tau_shaft * speed * h;
    }
    (work, drive.out.plant.energy.mech - before)
}

#[test]
fn the_torque_of_the_shaft_does_the_work_that_the_energy_counts() {
    for rpm in [3000.0, 9000.0, 11_400.0] {
        for h in [1e-4, 3.7e-4, 1e-3, 1e-2] {
            let (work, energy) = work(rpm * RPM, h);
            let off = work / energy - 1.0;
            println!("{rpm} rpm, h = {h} s: {work} J of {energy} J, {:+.4} %", 100.0 * off);
            assert!(energy > 1e3 && off.abs() < 1e-3, "{rpm} rpm, h = {h} s: {:+.3} %", 100.0 * off);
        }
    }
}

/// A plant with what `set` changes, under a voltage that holds some current at 150 rad/s.
fn plant(set: impl Fn(&mut PmsmPlant)) -> Block<PmsmPlant> {
    let mut plant = Block::<PmsmPlant>::default();
    plant.model.parameters.mechanics.imposed = true;
    set(&mut plant.model);
    plant.initialize();
    plant
}

/// A name, and what it changes.
type Kind = (&'static str, fn(&mut PmsmPlant));

/// Machines and inverters of every kind that has equations of its own.
const KINDS: [Kind; 5] = [
    ("linear", |_| ()),
    ("saturated", |plant| {
        let saturation = &mut plant.parameters.saturation;
        (saturation.s_2, saturation.s_3, saturation.s_dq) = (40.0, 40.0, 7.0);
    }),
    ("dead time", |plant| plant.parameters.inverter.dead_time = 2e-6),
    ("losses", |plant| {
        (plant.parameters.iron.G_e, plant.parameters.iron.G_h) = (1.3e-4, 0.12);
        let devices = &mut plant.parameters.inverter.devices;
        (devices.u_diode, devices.r_diode, devices.u_transistor, devices.r_transistor) = (0.8, 0.08, 0.8, 0.08);
        plant.parameters.mechanics.k_w = 2e-7;
    }),
    ("gates off", |plant| (plant.inputs.enable, plant.parameters.iron.G_e) = (false, 1.3e-4)),
];

/// The voltage of a command that turns with the shaft at the `angle` (rad), 1.7 rad ahead of it.
fn voltage(plant: &mut PmsmPlant, angle: f64, speed: f64) {
    let (u, theta) = (0.45 * speed + 8.0, 3.0 * angle + 1.7);
    plant.inputs.u = Phases::from_stator(AlphaBeta::new(u * theta.cos(), u * theta.sin()));
    (plant.inputs.angle_shaft, plant.inputs.speed_shaft) = (angle, speed);
}

#[test]
fn the_torque_of_every_kind_of_machine_is_the_mean() {
    for (name, set) in KINDS {
        for speed in [-150.0, 0.0, 150.0, 500.0] {
            let mut coarse = plant(set);
            let (mut now, h, parts) = (Elapsed::ZERO, 1e-3, 1000);
            for k in 0..20 {
                let angle = speed * h * f64::from(k);
                let mut mean = 0.0;
                voltage(&mut coarse.model, angle, speed);
                let mut fine = coarse.clone();
                let before = coarse.out.energy.mech;
                coarse.step(&Step { start: now, h }).unwrap();
                for _ in 0..parts {
                    let step = Step { start: now, h: h / f64::from(parts) };
                    let tau = fine.out.tau_e;
                    fine.step(&step).unwrap();
                    fine.model.inputs.angle_shaft += speed * step.h;
                    mean += 0.5 * (tau + fine.out.tau_e) - fine.model.parameters.mechanics.friction(speed);
                    now = step.end();
                }
                let (tau, work) = (coarse.out.powers.tau_shaft, coarse.out.energy.mech - before);
                let off = tau - mean / f64::from(parts);
                // Kinks of the dead time, and of diodes that begin to block.
                assert!(
                    off.abs() < 1e-3 * tau.abs().max(1.0),
                    "{name}, {speed} rad/s, step {k}: {tau} N.m, {off} N.m off"
                );
                assert!((tau * speed * h - work).abs() < 1e-9 * work.abs().max(1.0), "{name}, {speed} rad/s: {work} J");
            }
            let tau = coarse.out.powers.tau_shaft;
            assert!(tau.abs() > 0.02 || speed == 0.0, "{name}, {speed} rad/s: {tau} N.m is not trivial");
        }
    }
}

#[test]
fn a_shaft_that_accelerates_receives_the_energy() {
    // The angle of the drive train goes on by more than the held speed says; so does the energy.
    let (mut now, mut angle, mut work, h) = (Elapsed::ZERO, 0.0, 0.0, 1e-3);
    let mut plant = plant(|_| ());
    for k in 0..200 {
        let speed = 50.0 + 1.5 * f64::from(k);
        voltage(&mut plant.model, angle, speed);
        let step = Step { start: now, h };
        plant.step(&step).unwrap();
        now = step.end();
        let turn = (speed + 0.75) * h;
        (angle, work) = (angle + turn, work + plant.out.powers.tau_shaft * turn);
    }
    let energy = plant.out.energy.mech;
    assert!(energy.abs() > 20.0 && (work / energy - 1.0).abs() < 1e-3, "{work} J of {energy} J");
}

#[test]
fn a_free_shaft_has_the_torque_of_the_load() {
    let mut drive = Block::<PmsmDrive>::default();
    drive.initialize();
    for k in 0..20 {
        drive.model.inputs.tau_load = 0.3 * f64::from(k % 4);
        let step = Step { start: Elapsed::ZERO.plus(1e-3 * f64::from(k)), h: 1e-3 };
        drive.step(&step).unwrap();
        assert_eq!(drive.out.plant.powers.tau_shaft.to_bits(), drive.model.inputs.tau_load.to_bits());
    }
}
