//! Flying start (`start.catch`) of tuned drives: caught, started from rest, or refused.
//!
//! `CATCH_MACHINES=hub-36v,reference` and `CATCH_KINDS=Hybrid` select some, `CATCH_SPEEDS=0.02,1.5` other speeds;
//! `CATCH_FOLDER=DIR` adds the machines of a folder.
#![allow(missing_docs, non_snake_case)]

use drive::control::start::StartState;
use drive::estimator::Kind;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// Speeds in units of the rated speed.
const SPEEDS: [f64; 9] = [-1.0, -0.5, -0.2, -0.05, 0.05, 0.1, 0.2, 0.5, 1.0];

/// Time in s after which a rotor is not caught.
const WAIT: f64 = 4.0;

#[derive(Debug)]
struct Run {
    /// Time in s until the controller works, angle error (rad) and speed error (share) then.
    caught: Option<(f64, f64, f64)>,
    /// Whether the start sequence ran.
    started: bool,
    /// Maximum phase current with gates on until 0.2 s after that, in units of `limit.i`.
    peak: f64,
    /// Speed at the end in units of the reference.
    end: f64,
    /// Maximum torque before the controller works, in units of the rated one.
    torque: f64,
}

/// One start at `speed` (rad/s) with the rotor at `theta` (rad, electrical).
fn run(tuned: &Tuned, rated: (f64, f64), speed: f64, theta: f64) -> Run {
    let mut pair = tuned.pair();
    pair.controller.model.parameters.start.catch = true;
    pair.plant.model.parameters.initial.speed = speed;
    pair.plant.model.parameters.initial.theta_e = theta;
    pair.start().unwrap();
    let (T_s, u_dc) = (pair.controller.model.parameters.T_s, pair.plant.model.inputs.u_dc);
    let torque_mode = pair.controller.model.parameters.speed_loop.torque_mode;
    let limit = pair.controller.model.parameters.limit.i;
    let mut run = Run { caught: None, started: false, peak: 0.0, end: 0.0, torque: 0.0 };
    let (mut k, mut end) = (0_u32, WAIT);
    while f64::from(k) * T_s < end {
        pair.set_inputs(if torque_mode { 0.0 } else { speed }, 0.0, u_dc);
        pair.step(T_s).unwrap();
        k += 1;
        let (out, plant) = (&pair.controller.out, &pair.plant.out);
        let t = f64::from(k) * T_s;
        run.started |= matches!(out.start_state, StartState::Aligning | StartState::Ramping);
        if out.start_state == StartState::Running && run.caught.is_none() {
            let error = (out.theta_est - plant.theta_e + TAU + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
            run.caught = Some((t, error, (out.speed_est - plant.speed) / plant.speed.abs().max(1e-3 * rated.0)));
            end = t + 1.0;
        }
        if run.caught.is_none_or(|(at, ..)| t < at + 0.2) {
            let i = [plant.i.a, plant.i.b, plant.i.c].into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            run.peak = run.peak.max(i / limit);
        }
        if run.caught.is_none() {
            run.torque = run.torque.max((plant.tau_e / rated.1).abs());
        }
        run.end = plant.speed / speed;
    }
    run
}

fn machines() -> Vec<(String, MotorFile)> {
    let chosen =
        |name: &str| std::env::var("CATCH_MACHINES").map_or(true, |only| only.split(',').any(|one| one == name));
    let motors = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors");
    let mut files = Vec::new();
    for folder in std::iter::once(motors).chain(std::env::var("CATCH_FOLDER").map(PathBuf::from)) {
        files.extend(std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    }
    files.sort();
    files
        .into_iter()
        .filter_map(|path| Some((path.file_stem()?.to_str()?.to_owned(), MotorFile::read(&path).ok()?)))
        .filter(|(name, _)| chosen(name))
        .collect()
}

/// The machine with its estimator; none if it is refused.
fn tuned(motor: &MotorFile, kind: Kind) -> Option<Box<Tuned>> {
    let Ok(Suited::Tuned(tuned)) = rules::suited(motor, kind) else { return None };
    Some(tuned)
}

fn rated(motor: &MotorFile) -> (f64, f64) {
    (*motor.data.rating.speed.get_ref(), *motor.data.rating.torque.get_ref())
}

/// `cargo test --release -p drive-tools --test catch -- --ignored --nocapture`
#[test]
#[ignore = "a quarter of an hour: every estimator on every machine at 9 speeds and 24 angles"]
fn every_method_catches_every_machine() {
    let angles: u32 = std::env::var("CATCH_ANGLES").map_or(24, |n| n.parse().unwrap());
    let speeds: Vec<f64> = std::env::var("CATCH_SPEEDS")
        .map_or(SPEEDS.to_vec(), |list| list.split(',').map(|one| one.parse().unwrap()).collect());
    let (mut caught, mut ramped, mut refused) = (0, 0, 0);
    for (name, motor) in machines() {
        let chosen = |kind: &Kind| {
            std::env::var("CATCH_KINDS").map_or(true, |only| only.split(',').any(|one| one == kind.name()))
        };
        for &kind in Kind::ALL.iter().filter(|kind| chosen(kind)) {
            let Some(tuned) = tuned(&motor, kind) else { continue };
            let mut pair = tuned.pair();
            pair.controller.model.parameters.start.catch = true;
            if let Err(fault) = pair.start() {
                println!("{name:16} {:20} {fault}", kind.name());
                refused += speeds.len() * angles as usize;
                continue;
            }
            for &speed in &speeds {
                let at = |k| TAU * f64::from(k) / f64::from(angles);
                let runs: Vec<_> =
                    (0..angles).map(|k| run(&tuned, rated(&motor), speed * rated(&motor).0, at(k))).collect();
                let count = |of: &dyn Fn(&Run) -> bool| runs.iter().filter(|run| of(run)).count();
                let most = |of: &dyn Fn(&Run) -> f64| runs.iter().map(of).fold(0.0, f64::max);
                let counts = [
                    count(&|run| run.caught.is_some() && !run.started),
                    count(&|run| run.caught.is_some() && run.started),
                    count(&|run| run.caught.is_none()),
                ];
                (caught, ramped, refused) = (caught + counts[0], ramped + counts[1], refused + counts[2]);
                println!(
                    "{name:16} {:20} {speed:5.2} pu: {} caught, {} by the ramp, {} refused; {} hold; at most {:.4} s, {:.1} deg, {:.3} of the \
                     speed, i {:.2}, torque {:.3}",
                    kind.name(),
                    counts[0],
                    counts[1],
                    counts[2],
                    count(&|run| (run.end - 1.0).abs() < 0.1),
                    most(&|run| run.caught.map_or(0.0, |found| found.0)),
                    most(&|run| run.caught.map_or(0.0, |found| found.1.abs().to_degrees())),
                    most(&|run| run.caught.map_or(0.0, |found| found.2.abs())),
                    most(&|run| run.peak),
                    most(&|run| run.torque)
                );
            }
        }
    }
    println!("{caught} caught, {ramped} by the ramp of the I-f start, {refused} refused");
}

/// A machine of each kind with a method of each family: the rotor is found in time, with little current and torque.
#[test]
fn a_turning_rotor_is_caught() {
    for (name, kind) in [
        ("reference", Kind::Rasmussen),
        ("ipmsm-2.2kw", Kind::Hybrid),
        ("pmsyrm-5.5kw", Kind::Sensored),
        ("pmsyrm-5.5kw", Kind::KalmanFilter),
        ("spindle-40krpm", Kind::ExtendedEmf),
        ("spindle-40krpm", Kind::VoltageModel),
        ("drone-22v", Kind::CurrentModel),
        ("traction-100kw", Kind::KalmanFilter),
    ] {
        let (_, motor) = machines().into_iter().find(|(one, _)| one == name).unwrap();
        let tuned = tuned(&motor, kind).unwrap();
        let data = &motor.data;
        for speed in [-1.0, -0.2, 0.1, 0.5] {
            for theta in [0.3, 2.4, -1.6] {
                let w = speed * rated(&motor).0;
                let run = run(&tuned, rated(&motor), w, theta);
                println!("{name}, {} at {speed} pu, {theta} rad: {run:?}", kind.name());
                let (time, angle, off) = run.caught.unwrap();
                let quarter = 0.25 * TAU / (f64::from(*data.machine.n_p.get_ref()) * w.abs());
                assert!(!run.started && time <= quarter.max(0.05), "{time} s");
                assert!(angle.abs() < 0.12 && off.abs() < 0.1, "{angle} rad, {off} of the speed");
                assert!(
                    run.peak < 1.1 && (run.end - 1.0).abs() < 0.05,
                    "{} of the limit, {} of the reference",
                    run.peak,
                    run.end
                );
            }
        }
    }
}

/// A heavy rotor turns against the reference: it is braked, and the I-f start takes it through standstill, where the EMF would be lost.
#[test]
fn a_heavy_rotor_is_turned_back() {
    for (name, J, kind) in [
        ("ipmsm-2.2kw", 1.5, Kind::ExtendedEmf),
        ("reference", 0.05, Kind::VoltageModel),
        ("servo-6.6kw", 0.2, Kind::KalmanFilter),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors").join(format!("{name}.toml"));
        let text = std::fs::read_to_string(&path).unwrap();
        let light = text.lines().find(|line| line.starts_with("J = ")).unwrap();
        let motor = MotorFile::parse(&text.replace(light, &format!("J = {J}")), &path).unwrap();
        let mut pair = tuned(&motor, kind).unwrap().pair();
        let speed = rated(&motor).0;
        pair.controller.model.parameters.start.catch = true;
        pair.plant.model.parameters.initial.speed = -0.3 * speed;
        pair.start().unwrap();
        let (T_s, u_dc) = (pair.controller.model.parameters.T_s, pair.plant.model.inputs.u_dc);
        let (limit, mut peak) = (pair.controller.model.parameters.limit.i, 0.0_f64);
        let (mut now, mut ramps) = (0.0, false);
        while now < 20.0 {
            pair.set_inputs(0.4 * speed, 0.0, u_dc);
            pair.step(T_s).unwrap();
            now += T_s;
            let (out, plant) = (&pair.controller.out, &pair.plant.out);
            ramps |= out.start_state == StartState::Ramping && plant.speed < 0.0;
            peak = [plant.i.a, plant.i.b, plant.i.c].into_iter().fold(peak, |most, x| most.max(x.abs() / limit));
        }
        let end = pair.plant.out.speed / speed;
        println!("{name}, {}: ends at {end} pu, i {peak}", kind.name());
        assert!(ramps && (end - 0.4).abs() < 2e-3 && peak < 1.1, "{end} pu, {peak}");
    }
}

/// A rotor at rest goes on to its start sequence; a method that does not work at the speed of the rotor waits with gates off.
#[test]
fn a_rotor_at_rest_starts_and_one_too_fast_is_waited_for() {
    let (_, motor) = machines().into_iter().find(|(one, _)| one == "ipmsm-2.2kw").unwrap();
    let rest = run(&tuned(&motor, Kind::ExtendedEmf).unwrap(), rated(&motor), 1e-9, 1.0);
    assert!(rest.started && rest.caught.is_some() && rest.peak < 1.1, "{rest:?}");
    for (name, kind, speed) in [
        ("ipmsm-2.2kw", Kind::SquareWaveInjection, 1.0),
        ("traction-63kw", Kind::VoltageFeedback, 1.0),
        ("traction-60kw", Kind::RotatingInjection, 0.45),
    ] {
        let (_, motor) = machines().into_iter().find(|(one, _)| one == name).unwrap();
        let fast = run(&tuned(&motor, kind).unwrap(), rated(&motor), speed * rated(&motor).0, 1.0);
        let waits = fast.caught.is_none_or(|(t, ..)| t > 1.0);
        assert!(!fast.started && waits && fast.peak < 0.2, "{name}, {}: {fast:?}", kind.name());
    }
}
