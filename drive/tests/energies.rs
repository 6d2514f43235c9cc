//! Torque of an imposed shaft and energies: the work that a drive train integrates equals the counted energy, in
//! Co-Simulation and in Model Exchange.
#![allow(clippy::float_cmp)]

use crate::importer::Importer;
use drive::control::current::CurrentLoop;
use drive::control::limits::Limits;
use drive::estimator::Kind as Estimator;
use drive::frame::{AlphaBeta, Phases};
use drive::motor::Motor;
use drive::plant::power::Energy;
use drive::plant::tables::PlantParameters;
use drive::pmsm_drive::Means;
use drive::{PmsmDrive, PmsmPlant};
use fmu_core::{Block, CompletedSteps, ContinuousTime, Elapsed, Events, Step};

const RPM: f64 = std::f64::consts::PI / 30.0;

/// A traction drive in torque mode on an imposed shaft.
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

/// Work in J of `tau_shaft` on the shaft at the `speed` (rad/s) over 0.1 s of steady state in steps of `h` (s), and the change
/// of `energy_mech`.
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

/// A plant after `set`, under a voltage that drives some current at 150 rad/s.
fn plant(set: impl Fn(&mut PmsmPlant)) -> Block<PmsmPlant> {
    let mut plant = Block::<PmsmPlant>::default();
    plant.model.parameters.mechanics.imposed = true;
    set(&mut plant.model);
    plant.initialize();
    plant
}

/// A name and a change.
type Kind = (&'static str, fn(&mut PmsmPlant));

/// Machines and inverters of every kind with separate equations.
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

/// The voltage of a command that rotates 1.7 rad ahead of the shaft, which is at the `angle` (rad).
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
    // The angle of the drive train advances by more than the constant speed gives; so does the energy.
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

#[test]
fn the_plant_counts_the_same_in_model_exchange() {
    // The importer's steps are fine; it reports each, every tenth, or only the events at T_s.
    let T_s = 1e-4;
    for (name, set) in KINDS {
        for imposed in [false, true] {
            let model = || {
                let mut plant = plant(set).model;
                (plant.parameters.mechanics.imposed, plant.parameters.initial.speed) = (imposed, 150.0);
                plant.inputs.tau_load = 0.7;
                plant
            };
            for reported in [1, 10, 0] {
                let mut stepped = Block { model: model(), ..Block::default() };
                voltage(&mut stepped.model, 0.0, 150.0);
                stepped.initialize();
                let mut exchanged = Importer::new(stepped.model.clone(), 2e-6, reported);
                for k in 0..300 {
                    let t = T_s * f64::from(k);
                    let ahead = |t: f64| 150.0 * t;
                    voltage(&mut stepped.model, ahead(t), 150.0);
                    exchanged.event(|plant| voltage(plant, ahead(t), 150.0));
                    let step = Step { start: exchanged.now, h: T_s };
                    stepped.step(&step).unwrap();
                    exchanged.run(T_s, |plant, t| plant.inputs.angle_shaft = ahead(t));
                }
                exchanged.event(|_| ());
                exchanged.block.model.observe(exchanged.now, &mut exchanged.block.out);
                let (ours, theirs) = (exchanged.block.out.energy, stepped.out.energy);
                let passed = theirs.r#in.abs().max(theirs.loss).max(theirs.mech.abs());
                let off = [ours.r#in - theirs.r#in, ours.mech - theirs.mech, ours.loss - theirs.loss];
                println!("{name}, imposed {imposed}, reported {reported}: {off:?} J of {theirs:?}");
                let allowed = if name == "dead time" || name == "losses" { 1e-4 } else { 1e-6 };
                assert!(
                    off.iter().all(|x| x.abs() < allowed * passed),
                    "{name} {imposed} {reported}: {off:?} J of {theirs:?}"
                );
            }
        }
    }
}

/// Energies in J of a free plant after 20 ms in Model Exchange under the input `u` (V) of the time (s), with every
/// `reported`th integration step of 2 us reported.
fn counted(reported: u32, u: impl Fn(f64) -> AlphaBeta) -> [f64; 3] {
    let mut model = plant(|_| ()).model;
    (model.parameters.mechanics.imposed, model.parameters.initial.speed) = (false, 150.0);
    model.inputs.u = Phases::from_stator(u(0.0));
    let mut importer = Importer::new(model, 2e-6, reported);
    importer.run(0.02, |plant, t| plant.inputs.u = Phases::from_stator(u(t)));
    importer.event(|_| ());
    importer.block.model.observe(importer.now, &mut importer.block.out);
    let Energy { r#in, mech, loss } = importer.block.out.energy;
    [r#in, mech, loss]
}

#[test]
fn inputs_between_completed_steps_are_straight_lines() {
    let turning = |t: f64| AlphaBeta::new(75.0 * (450.0 * t + 1.7).cos(), 75.0 * (450.0 * t + 1.7).sin());
    let apart = |reported: u32, u: &dyn Fn(f64) -> AlphaBeta| {
        let (ours, fine) = (counted(reported, u), counted(1, u));
        assert!(fine[0].abs() > 1.0, "{fine:?}");
        ours.iter().zip(fine).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / fine[0].abs()
    };
    // Straight lines: as exact in one step of 20 ms as in 10 000 of 2 us.
    let line = |t: f64| AlphaBeta::new(20.0 - 3000.0 * t, 60.0 + 2000.0 * t);
    let held = |_: f64| AlphaBeta::new(5.0, 60.0);
    for u in [&line as &dyn Fn(f64) -> AlphaBeta, &held] {
        let off = apart(10_000, u);
        assert!(off < 1e-6, "{off}");
    }
    // With curved inputs, the error is of second order in the step for the power, of third order for the current.
    let [coarse, fine] = [20, 10].map(|reported| apart(reported, &turning));
    println!("curved inputs: {coarse} at 40 us, {fine} at 20 us");
    assert!((3.9..8.1).contains(&(coarse / fine)), "{coarse}, {fine}");
    assert!(fine < 2.0 * (450.0_f64 * 2e-5).powi(2) / 12.0, "{fine}");
}

#[test]
fn what_a_solver_tries_is_not_counted() {
    let mut importer = Importer::new(plant(|_| ()).model, 2e-6, 1);
    voltage(&mut importer.block.model, 0.0, 150.0);
    importer.run(1e-3, |plant, t| plant.inputs.angle_shaft = 150.0 * t);
    let mut tried = importer.block.clone();
    // Other states, inputs and times, and back: as for a rejected step or the search for an event.
    let (before, inputs) = (tried.model.clone(), tried.model.inputs.clone());
    for k in 1..50 {
        *PmsmPlant::STATES[0].at(&mut tried.model) = 0.01 * f64::from(k);
        *PmsmPlant::STATES[2].at(&mut tried.model) = 7.0 * f64::from(k);
        tried.model.settle();
        (tried.model.inputs.u.a, tried.model.inputs.u_dc) = (300.0, 500.0);
        tried.model.derivatives(importer.now.plus(1e-5 * f64::from(k)), &mut [0.0; 4]).unwrap();
        tried.model.observe(importer.now, &mut tried.out);
        assert_eq!(tried.out.energy, importer.block.out.energy);
    }
    for (i, state) in PmsmPlant::STATES.iter().enumerate() {
        *state.at(&mut tried.model) = *PmsmPlant::STATES[i].at(&mut before.clone());
    }
    tried.model.settle();
    tried.model.inputs = inputs;
    assert_eq!(tried.model, before);
    // A point that is reported twice counts once.
    tried.model.complete(importer.now).unwrap();
    tried.model.complete(importer.now).unwrap();
    assert_eq!(tried.model, before);
}

#[test]
fn blocking_diodes_lose_what_remains() {
    // 2 A at 20 rad/s when the gates open: the stored energy returns to the link, and the rest is lost in the event.
    let run = |reported: u32| {
        let mut model = plant(|_| ()).model;
        (model.parameters.mechanics.imposed, model.parameters.initial.speed) = (false, 20.0);
        model.inputs.u = Phases { a: 30.0, b: 20.0, c: -50.0 };
        let mut importer = Importer::new(model, 1e-7, reported);
        importer.run(1e-3, |_, _| ());
        importer.event(|plant| plant.inputs.enable = false);
        let mut z = [0.0; 2];
        while {
            importer.block.model.indicators(importer.now, &mut z);
            z.iter().any(|z| *z > 0.0)
        } {
            importer.run(1e-6, |_, _| ());
        }
        importer.event(|_| ());
        importer.run(1e-3, |_, _| ());
        importer.event(|_| ());
        importer.block.model.observe(importer.now, &mut importer.block.out);
        importer.block
    };
    for reported in [1, 10, 0] {
        let block = run(reported);
        let PlantParameters { mechanics, .. } = &block.model.parameters;
        let Energy { r#in, mech, loss } = block.out.energy;
        let kinetic = 0.5 * mechanics.J * (block.out.speed * block.out.speed - 400.0);
        assert!(block.out.i == Phases::default(), "{:?}", block.out.i);
        let rest = r#in - mech - loss - kinetic;
        println!("reported {reported}: {rest} J of {in} J, {loss} J lost");
        assert!(rest.abs() < 2e-6 * r#in && loss > 1e-3, "reported {reported}: {rest} J of {in} J, {loss} J lost");
    }
}

/// The means, and the powers and the torque of the outputs.
fn shown(drive: &Block<PmsmDrive>) -> ([f64; 4], [f64; 4]) {
    let (Means { p_in, p_mech, p_loss, tau_shaft }, now) = (drive.out.means, &drive.out.plant.powers);
    ([p_in, p_mech, p_loss, tau_shaft], [now.p_in, now.p_mech, now.p_loss, now.tau_shaft])
}

#[test]
fn the_means_of_both_interfaces_agree() {
    let T_s = 1e-4;
    for rpm in [3000.0, 9000.0, 11_400.0] {
        let speed = rpm * RPM;
        let mut stepped = Block { model: traction(), ..Block::default() };
        stepped.model.inputs.speed_shaft = speed;
        stepped.initialize();
        let exchanged = [1, 0].map(|reported| Importer::new(stepped.model.clone(), 12.5e-6, reported));
        let mut exchanged = exchanged;
        assert_eq!(shown(&stepped).0, [0.0; 4], "before the end of the first period");
        let mut now = Elapsed::ZERO;
        let mut ripple = 0.0_f64;
        for k in 0..3000 {
            stepped.model.inputs.angle_shaft = speed * T_s * f64::from(k);
            let step = Step { start: now, h: T_s };
            stepped.step(&step).unwrap();
            now = step.end();
            let (theirs, held) = shown(&stepped);
            assert_eq!(theirs, held, "in Co-Simulation, the powers are means over T_s");
            for importer in &mut exchanged {
                importer.block.model.observe(importer.now, &mut importer.block.out);
                let early = shown(&importer.block).0;
                assert!(k > 0 || early == [0.0; 4], "before the end of the first period: {early:?}");
                importer.run(T_s, |drive, t| drive.inputs.angle_shaft = speed * t);
                let (ours, instant) = shown(&importer.block);
                for (a, b) in ours.iter().zip(theirs) {
                    assert!((a - b).abs() < 1e-3 * b.abs() || k < 2000, "{rpm} rpm, period {k}: {ours:?}, {theirs:?}");
                }
                ripple = ripple.max((instant[0] / ours[0] - 1.0).abs());
                if k == 2999 {
                    println!(
                        "{rpm} rpm: {ours:?} in Model Exchange, {theirs:?} in Co-Simulation, {instant:?} at the instant"
                    );
                }
            }
        }
        for importer in &exchanged {
            let (ours, theirs) = (importer.block.out.plant.energy, stepped.out.plant.energy);
            for (a, b) in [(ours.r#in, theirs.r#in), (ours.mech, theirs.mech), (ours.loss, theirs.loss)] {
                assert!((a / b - 1.0).abs() < 1e-3, "{rpm} rpm: {ours:?}, {theirs:?}");
            }
        }
    }
}
