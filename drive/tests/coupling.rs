//! A diverging coupling: the work of a step stays bounded, and the error names the remedy.

use drive::{PmsmDrive, PmsmPlant};
use fmu_core::log::Warnings;
use fmu_core::{Block, CompletedSteps, ContinuousTime, Elapsed, Model, Step, Warns};

const REMEDY: &str = "the coupling is unstable; shorten the communication step";

/// The mechanical speed in rad/s in an error message.
fn speed_in(message: &str) -> f64 {
    message.split("turns at ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap()
}

/// Steps of `h` (s) on a shaft of 50 N.m/rad with 0.01 kg.m2 at its end, until one is refused: its number and the message.
/// The importer exchanges angle and torque at the communication points.
fn compliant(h: f64, set: impl Fn(&mut PmsmDrive)) -> (u32, String) {
    let mut drive = Block::<PmsmDrive>::default();
    drive.model.inputs.speed_ref = 100.0;
    set(&mut drive.model);
    drive.initialize();
    let (mut now, mut speed, mut angle) = (Elapsed::ZERO, 0.0, 0.0);
    for k in 0..2000 {
        let tau = 50.0 * (drive.out.plant.angle - angle);
        drive.model.inputs.tau_load = tau;
        let step = Step { start: now, h };
        let before = drive.model.pair.plant.clone();
        if let Err(fault) = drive.step(&step) {
            // The plant is in the state at the end of its last step.
            assert!(drive.out.plant.speed.abs() < 1e6 && before.out == drive.out.plant);
            return (k, fault.message().to_owned());
        }
        now = step.end();
        speed += tau / 0.01 * h;
        angle += speed * h;
    }
    (2000, String::new())
}

#[test]
fn a_diverging_coupling_ends_with_its_cause() {
    for (h, losses) in [(5e-3, false), (1e-2, false), (1e-2, true)] {
        let (k, message) = compliant(h, |drive| {
            if losses {
                drive.pair.plant.model.parameters.iron.G_e = 1.3e-4;
                drive.pair.plant.model.parameters.inverter.devices.r_transistor = 0.08;
            }
        });
        println!("h = {h} s: step {k}: {message}");
        assert!((10..200).contains(&k) && message.contains(REMEDY) && message.contains("use mechanics.imposed"));
        assert!(speed_in(&message).abs() < 1e7, "well before 1e9 rad/s: {message}");
    }
    // The same shaft is stable at 1 ms.
    let (k, message) = compliant(1e-3, |_| ());
    assert_eq!((k, message.as_str()), (2000, ""));
}

/// A name and a change.
type Kind = (&'static str, fn(&mut PmsmPlant));

const KINDS: [Kind; 5] = [
    ("linear", |_| ()),
    ("saturated", |plant| plant.parameters.saturation.s_2 = 40.0),
    ("dead time", |plant| plant.parameters.inverter.dead_time = 2e-6),
    ("losses", |plant| plant.parameters.iron.G_e = 1.3e-4),
    ("gates off", |plant| plant.inputs.enable = false),
];

#[test]
fn an_absurd_load_is_refused_at_once() {
    for (name, set) in KINDS {
        for (tau_load, h) in [(1e7, 1e-2), (-1e7, 1e-4), (1e12, 1e-2), (1e300, 1.0)] {
            let mut plant = Block::<PmsmPlant>::default();
            set(&mut plant.model);
            plant.initialize();
            plant.model.inputs.tau_load = tau_load;
            let before = plant.clone();
            let mut done = 0;
            let fault = loop {
                match plant.step(&Step { start: Elapsed::ZERO, h }) {
                    Ok(()) => done += 1,
                    Err(fault) => break fault,
                }
                assert!(done < 2, "{name}, {tau_load} N.m: {:?}", plant.out);
            };
            assert!(fault.message().contains(REMEDY) || tau_load > 1e200, "{name}, {tau_load} N.m: {fault}");
            plant.model.output(Elapsed::ZERO, &mut plant.out);
            assert!(done > 0 || plant.out == before.out, "a refused step changes nothing");
        }
    }
}

#[test]
fn an_imposed_speed_beyond_any_machine_is_refused() {
    for (name, set) in KINDS {
        for speed in [4e5, -1e9, 1e300] {
            let mut plant = Block::<PmsmPlant>::default();
            set(&mut plant.model);
            plant.model.parameters.mechanics.imposed = true;
            plant.initialize();
            plant.model.inputs.speed_shaft = speed;
            for h in [1e-12, 1e-4, 1e-2] {
                let fault = plant.step(&Step { start: Elapsed::ZERO, h }).unwrap_err();
                let message = fault.message();
                assert!(message.contains(REMEDY) && !message.contains("imposed"), "{name}, {h} s: {message}");
                assert_eq!(speed_in(message).to_bits(), f64::to_bits(speed));
            }
        }
    }
}

#[test]
fn the_fastest_machines_run() {
    // A million rpm with one pole pair, and 30 000 rpm with 20.
    for (n_p, speed) in [(1, 1.05e5), (20, 3142.0)] {
        let mut plant = Block::<PmsmPlant>::default();
        let parameters = &mut plant.model.parameters;
        (parameters.motor.n_p, parameters.initial.speed) = (n_p, speed);
        plant.model.validate().unwrap();
        plant.initialize();
        plant.step(&Step { start: Elapsed::ZERO, h: 1e-3 }).unwrap();
    }
    let mut plant = PmsmPlant::default();
    plant.parameters.initial.speed = -4e5;
    let fault = plant.validate().unwrap_err();
    assert!(fault.message().starts_with("initial.speed = -400000 rad/s is not allowed: at most 333333"), "{fault}");
}

#[test]
fn model_exchange_has_no_derivatives_there() {
    let mut plant = PmsmPlant::default();
    plant.initialize();
    *PmsmPlant::STATES[2].at(&mut plant) = 1e6;
    let fault = plant.derivatives(Elapsed::ZERO, &mut [0.0; 4]).unwrap_err();
    assert!(fault.message().starts_with("the shaft turns at 1000000 rad/s, beyond the 333333"), "{fault}");
    *PmsmPlant::STATES[2].at(&mut plant) = 1e5;
    plant.derivatives(Elapsed::ZERO, &mut [0.0; 4]).unwrap();
}

#[test]
fn a_lost_rotor_at_speed_is_not_blamed_on_the_resistance() {
    let mut drive = Block::<PmsmDrive>::default();
    drive.model.inputs.speed_ref = 100.0;
    drive.initialize();
    let mut logged = Vec::new();
    let (mut now, mut speed, mut angle) = (Elapsed::ZERO, 0.0, 0.0);
    let mut result = Ok(());
    while result.is_ok() {
        let tau = 50.0 * (drive.out.plant.angle - angle);
        drive.model.inputs.tau_load = tau;
        let step = Step { start: now, h: 5e-3 };
        result = drive.step(&step);
        now = step.end();
        speed += tau / 0.01 * step.h;
        angle += speed * step.h;
        let mut sink = |(_, key, text): fmu_core::log::Said<'_>| logged.push((key, text()));
        drive.model.warn(&mut Warnings::to(&mut sink));
    }
    println!("{:?} {:?}", logged.first(), logged.last());
    let keys: Vec<_> = logged.iter().map(|(key, _)| *key).collect();
    assert!(keys.contains(&"lock_lost") && keys.contains(&"driven"), "{keys:?}");
    assert!(logged.iter().all(|(_, text)| !text.contains("R_s")), "{logged:?}");
    let driven: Vec<_> = logged.iter().filter(|(key, _)| *key == "driven").collect();
    assert!(driven.iter().all(|(_, text)| text.contains("shorten the communication step")), "{driven:?}");
}

/// Whether a model with an imposed shaft at 100 rad/s, in steps of this length (s), reports that its angle does not follow, within
/// 0.2 s.
macro_rules! reports {
    ($model:ty, $plant:ident => $parameters:expr, $h:expr, $angle:expr) => {{
        let mut block = Block::<$model>::default();
        let $plant = &mut block.model;
        $parameters.mechanics.imposed = true;
        block.model.inputs.speed_shaft = 100.0;
        block.model.inputs.angle_shaft = $angle(0.0);
        block.initialize();
        let (mut now, mut said) = (Elapsed::ZERO, String::new());
        while now.seconds() < 0.2 {
            block.model.inputs.angle_shaft = $angle(100.0 * now.seconds());
            let step = Step { start: now, h: $h };
            block.step(&step).unwrap();
            now = step.end();
            block.model.warn(&mut Warnings::to(&mut |(_, key, text)| {
                if key == "angle_shaft" {
                    said = text();
                }
            }));
        }
        assert!(said.is_empty() || said.contains("does not follow speed_shaft = 100 rad/s"), "{said}");
        !said.is_empty()
    }};
}

#[test]
fn an_angle_that_does_not_follow_the_speed_is_reported() {
    use std::f64::consts::TAU;
    let wrong: [fn(f64) -> f64; 3] = [|_| 0.0, f64::to_degrees, |angle| -angle];
    let right: [fn(f64) -> f64; 2] = [|angle| angle, |angle| angle.rem_euclid(TAU)];
    for h in [1e-4, 1e-3, 4e-3] {
        for (of, expected) in wrong.into_iter().map(|of| (of, true)).chain(right.map(|of| (of, false))) {
            let at = of(1.0);
            assert_eq!(
                reports!(PmsmPlant, plant => plant.parameters, h, of),
                expected,
                "PmsmPlant, {h} s, 1 rad: {at}"
            );
            let drive = reports!(PmsmDrive, drive => drive.pair.plant.model.parameters, h, of);
            assert_eq!(drive, expected, "PmsmDrive, {h} s, 1 rad: {at}");
        }
    }
}

/// In Model Exchange, where the importer's solver chooses its points.
#[test]
fn model_exchange_reports_such_an_angle() {
    for (share, expected) in [(0.0, true), (1.0, false)] {
        let mut block = Block::<PmsmPlant>::default();
        block.model.parameters.mechanics.imposed = true;
        block.initialize();
        let mut said = false;
        for k in 1..100_u32 {
            let t = 1e-3 * f64::from(k);
            let inputs = &mut block.model.inputs;
            (inputs.speed_shaft, inputs.angle_shaft) = (1000.0 * t, share * 500.0 * t * t);
            block.model.complete(Elapsed::between(0.0, t)).unwrap();
            block.model.warn(&mut Warnings::to(&mut |(_, key, _)| said |= key == "angle_shaft"));
        }
        assert_eq!(said, expected, "{share}");
    }
}
