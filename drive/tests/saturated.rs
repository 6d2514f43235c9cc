//! A current loop at the limit of its voltage: the steady state of the algebra beside the means of a settled `PmsmDrive`.

use crate::machines::{self, Machine};
use crate::random_machines;
use drive::estimator::Kind;
use drive::frame::Dq;
use drive::overmodulation::ModulationMode;
use drive::plant::tables::PlantParameters;
use drive::steady::{Condition, Steady};
use drive::{PmsmDrive, PmsmDriveMean};
use fmu_core::draw::Draw;
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Step, Warns};

/// A machine with a sensor, without field weakening and without losses but those of the copper.
fn bare(machine: &Machine) -> Steady {
    let mut plant = PlantParameters { motor: machine.motor.clone(), ..PlantParameters::default() };
    (plant.mechanics.B, plant.mechanics.tau_coulomb, plant.mechanics.imposed) = (0.0, 0.0, true);
    let mut controller = machine.parameters();
    (controller.weakening.used, controller.estimator, controller.speed_loop.torque_mode) =
        (false, Kind::Sensored, true);
    Steady::new(plant, controller)
}

/// Mean torque (N.m) and current (A) over 0.2 s of a drive that has settled, at this speed (rad/s) with this reference (N.m).
fn settled(drive: &Steady, u_dc: f64, speed: f64, tau: f64) -> (f64, Dq) {
    let mut block = Block::<PmsmDrive>::default();
    block.model.pair.plant.model.parameters = drive.plant.clone();
    block.model.pair.controller.model.parameters = drive.controller.clone();
    let inputs = &mut block.model.inputs;
    (inputs.speed_shaft, inputs.u_dc, inputs.tau_ref) = (speed, u_dc, tau);
    block.initialize();
    let (mut now, mut sum, mut count) = (Elapsed::ZERO, (0.0, Dq::ZERO), 0.0);
    for k in 0..10_000 {
        block.model.inputs.angle_shaft = speed * now.seconds();
        let step = Step { start: now, h: 1e-4 };
        block.step(&step).unwrap();
        now = step.end();
        if k >= 8000 {
            let out = &block.out;
            sum.0 += out.plant.tau_e;
            sum.1 += Dq::new(out.plant.i_d, out.plant.i_q);
            count += 1.0;
        }
    }
    (sum.0 / count, sum.1 * (1.0 / count))
}

/// Below the current limit, torque and current are those of the algebra, to 1.3 % of their maxima; at the limit, with the harmonics of a
/// voltage on the hexagon, to 13 % and 17 %.
#[test]
fn the_current_of_a_saturated_loop() {
    let (mut saturated, mut limited) = (0, 0);
    for machine in [machines::a(), machines::b(), machines::c(240.0)] {
        let drive = bare(&machine);
        let base = 1.05 * machine.U(1.0) / machine.motor.psi_M / f64::from(machine.motor.n_p);
        for share in [0.6, 0.8, 0.95, 1.1] {
            let temperatures = drive.start_temperatures();
            let at = drive.at(&Condition { speed: share * base, u_dc: machine.u_dc, temperatures });
            let [low, high] = at.limits();
            for tau in [high, 0.5 * high, 0.5 * low, low] {
                let (tau_e, i) = settled(&drive, machine.u_dc, share * base, tau);
                let point = at.by_loop(tau);
                let off = [(tau_e - point.tau_e) / high, (i - point.i).magnitude() / machine.i];
                let at_limit = point.i.magnitude() > 0.999 * machine.i;
                let fitting = at.by_reference(tau).tau_e;
                println!(
                    "{share} {tau:8.3} N.m: {tau_e:8.3} N.m, {i:.3?} A, {:8.3}, {:.3?}, {off:.4?}; a sinusoid: {fitting:8.3}",
                    point.tau_e, point.i
                );
                let allowed = if at_limit && point.u_share > 1.0 { [0.13, 0.17] } else { [0.013; 2] };
                let is_near = off.iter().zip(allowed).all(|(x, allowed)| x.abs() < allowed);
                assert!(is_near, "{:?}, {share}, {tau} N.m: {off:?}", machine.motor);
                (saturated, limited) =
                    (saturated + i32::from(point.u_share > 1.0), limited + i32::from(allowed[0] > 0.1));
                assert!(drive.fits(&at.by_reference(tau)) || share > 1.0, "a sinusoid fits at a lower torque");
            }
        }
    }
    println!("{saturated} saturated, {limited} of them at the current limit");
    assert!(saturated - limited > 15 && limited > 10);
}

/// Overmodulation uses more than the voltage of a sinusoid, and `PmsmDriveMean` does not take that for a current that it cannot hold.
#[test]
fn overmodulation_is_not_reported_as_a_lost_current() {
    for mode in [ModulationMode::MinimumPhase, ModulationMode::MinimumMagnitude, ModulationMode::SixStep] {
        let mut block = Block::<PmsmDriveMean>::default();
        let controller = &mut block.model.drive.controller;
        (controller.modulation.mode, controller.weakening.used) = (mode, true);
        (block.model.inputs.speed_ref, block.model.inputs.tau_load) = (500.0, 0.5);
        block.initialize();
        let (mut now, mut said, mut most) = (Elapsed::ZERO, Vec::new(), 0.0_f64);
        for _ in 0..300 {
            let step = Step { start: now, h: 0.01 };
            block.step(&step).unwrap();
            now = step.end();
            block.model.warn(&mut Warnings::to(&mut |(_, key, text)| said.push((key, text()))));
            most = most.max(block.out.drive.controller.u_share);
        }
        println!("{mode:?}: u_share up to {most}");
        assert!(
            said.is_empty() && most > 0.99 && (block.out.drive.plant.speed - 500.0).abs() < 0.1,
            "{mode:?}: {said:?}"
        );
    }
}

/// The same for random machines, from half of the speed at which the EMF takes the whole voltage to 1.1 times that speed.
#[test]
fn random_machines_beside_the_drive() {
    let (mut random, mut errors) = (Draw(7), Vec::new());
    for machine in random_machines::all() {
        let (drive, share) = (bare(&machine), random.between(0.5, 1.1));
        let speed = share * machine.U(1.049) / machine.motor.psi_M / f64::from(machine.motor.n_p);
        let at = drive.at(&Condition { speed, u_dc: machine.u_dc, temperatures: drive.start_temperatures() });
        let [low, high] = at.limits();
        let tau = random.between(low, high);
        let point = at.by_loop(tau);
        if drive.fits(&point) {
            continue;
        }
        let (tau_e, i) = settled(&drive, machine.u_dc, speed, tau);
        let off = ((tau_e - point.tau_e) / high).abs().max((i - point.i).magnitude() / machine.i);
        let allowed = if point.i.magnitude() > 0.999 * machine.i { 0.16 } else { 0.04 };
        assert!(off < allowed, "{:?}, {share}, {tau} N.m: {tau_e} N.m, {i:?} A, not {point:?}", machine.motor);
        errors.push(off);
    }
    errors.sort_by(f64::total_cmp);
    println!("{} saturated: {errors:.4?}", errors.len());
    assert!(errors.len() > 60 && errors[errors.len() / 2] < 0.005 && errors[errors.len() * 9 / 10] < 0.02);
}
