//! Every estimator on every machine, tuned by the rules: held, refused with the reason, or announced by the trial.
//!
//! `METHODS_MACHINES=hub-36v,reference` and `METHODS_KINDS=Hybrid` select some; `METHODS_FOLDER=DIR` adds the machines of a folder.
#![allow(missing_docs)]

use drive::control::start::StartState;
use drive::estimator::Kind;
use drive::math::wrap;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned};
use drive_tools::tune::trial::{self, Trial};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// A machine with a method.
enum Cell {
    Held(Box<Tuned>),
    Refused(String),
    /// The trials that fail, which the command announces.
    Announced(Vec<Trial>),
}

fn cell(motor: &MotorFile, kind: Kind, angles: u32) -> Cell {
    match rules::suited(motor, kind).unwrap() {
        Suited::Refused(refusal) => {
            assert_eq!(refusal.estimator, kind);
            Cell::Refused(refusal.reason)
        }
        Suited::Tuned(tuned) => {
            let trials = trial::all(&tuned, angles);
            let failed: Vec<Trial> = trials.into_iter().filter(|trial| !(trial.starts() && trial.holds())).collect();
            if failed.is_empty() { Cell::Held(tuned) } else { Cell::Announced(failed) }
        }
    }
}

fn motors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors")
}

fn read(name: &str) -> MotorFile {
    MotorFile::read(&motors().join(format!("{name}.toml"))).unwrap()
}

/// `cargo test -p drive-tools --test methods -- --ignored --nocapture`
#[test]
#[ignore = "a quarter of an hour: every estimator on every machine"]
fn every_method_on_every_machine() {
    let chosen = |variable: &str, name: &str| {
        std::env::var(variable).map_or(true, |only| only.split(',').any(|one| one == name))
    };
    let mut files = Vec::new();
    for folder in std::iter::once(motors()).chain(std::env::var("METHODS_FOLDER").map(PathBuf::from)) {
        let found = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        files.extend(found.filter(|path| path.extension().is_some_and(|e| e == "toml")));
    }
    files.sort();
    let (mut held, mut refused, mut announced, mut silent) = (0, 0, 0, 0);
    for path in files {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if !chosen("METHODS_MACHINES", &name) {
            continue;
        }
        let motor = MotorFile::read(&path).unwrap();
        for &kind in Kind::ALL.iter().filter(|kind| chosen("METHODS_KINDS", kind.name())) {
            if let Err(error) = rules::suited(&motor, kind) {
                println!("{name}: the file is refused: {error}");
                break;
            }
            let text = match cell(&motor, kind, 6) {
                Cell::Held(_) => {
                    held += 1;
                    "held".into()
                }
                Cell::Refused(reason) => {
                    refused += 1;
                    format!("refused: {reason}")
                }
                Cell::Announced(failed) => {
                    announced += 1;
                    let of = |trial: &Trial| {
                        silent += trial.silent;
                        let Trial { task, angles, started, held, silent, .. } = trial;
                        format!(
                            "{:.2} pu: {started}/{angles} start, {held}/{started} hold, {silent} silent",
                            task.level
                        )
                    };
                    format!("announced: {}", failed.iter().map(of).collect::<Vec<_>>().join("; "))
                }
            };
            println!("{name:16} {:20} {text}", kind.name());
        }
    }
    println!("{held} held, {refused} refused, {announced} announced; {silent} lost runs without lock_lost");
}

/// A machine of each kind with a method of each family.
#[test]
fn methods_of_every_family_hold_their_machines() {
    for (name, kinds) in [
        ("reference", &[Kind::VoltageModel, Kind::EmfObserver][..]),
        (
            "ipmsm-2.2kw",
            &[Kind::KalmanFilter, Kind::SlidingMode, Kind::SquareWaveInjection, Kind::Hybrid, Kind::Sensored],
        ),
    ] {
        for &kind in kinds {
            match cell(&read(name), kind, 2) {
                Cell::Held(tuned) => assert_eq!(tuned.estimator, kind),
                Cell::Refused(reason) => panic!("{name}, {}: {reason}", kind.name()),
                Cell::Announced(failed) => panic!("{name}, {}: {failed:?}", kind.name()),
            }
        }
    }
}

#[test]
fn a_refusal_has_numbers() {
    for (name, kind, parts) in [
        ("reference", Kind::SquareWaveInjection, ["|L_q - L_d| / (L_q + L_d) = 0.000", "L_q = 0.006 H"]),
        ("hub-36v", Kind::Hybrid, ["= 0.000 with L_d = 0.00045 H", "needs 0.03"]),
    ] {
        let Suited::Refused(refusal) = rules::suited(&read(name), kind).unwrap() else {
            panic!("{name} is not refused")
        };
        assert!(parts.iter().all(|part| refusal.reason.contains(part)), "{}", refusal.reason);
    }
}

/// 11 kW with L_q = 4.8 L_d, whose magnet alone carries 12 N.m of the 70 N.m at the psi_M / (2 dL) of the plain start.
const RELUCTANT: &str = r#"
name = "reluctant"
source = "a PM-assisted synchronous reluctance machine"
machine = { n_p = 2, R_s = 0.42, L_d = 10e-3, L_q = 48e-3, psi_M = 0.25 }
mechanics = { J = 0.03 }
rating = { speed = 157.08, torque = 70.0, current = 50.0 }
dc_link = { u_dc = 540.0 }
"#;

/// The start counts the reluctance torque, and `start_state` shows its stages: from every angle, the estimator leads within 1.5 s and
/// knows the pole.
#[test]
fn a_machine_with_much_reluctance_starts_by_it() {
    let motor = MotorFile::parse(RELUCTANT, Path::new("m.toml")).unwrap();
    let Suited::Tuned(tuned) = rules::suited(&motor, Kind::ExtendedEmf).unwrap() else { panic!("refused") };
    assert!((tuned.real("start.i").unwrap() - 36.95).abs() < 0.01);
    assert!((tuned.real("current.bandwidth").unwrap() / TAU - 200.0).abs() < 1e-6);
    for k in 0..6 {
        let mut pair = tuned.pair();
        pair.plant.model.parameters.initial.theta_e = f64::from(k) * TAU / 6.0;
        pair.start().unwrap();
        let mut states = vec![pair.controller.out.start_state];
        for _ in 0..15_000 {
            pair.set_inputs(0.5 * tuned.speed, 0.0, 540.0);
            pair.step(1e-4).unwrap();
            let state = pair.controller.out.start_state;
            if states.last() != Some(&state) {
                states.push(state);
            }
        }
        assert_eq!(states, [StartState::Idle, StartState::Aligning, StartState::Ramping, StartState::Running], "{k}");
        let off = wrap(pair.plant.out.theta_e - pair.controller.out.theta_est);
        assert!(off.abs() < 0.05, "{k}: {off} rad");
    }
}

/// A drive that measures its resistance is still starting; one without a sequence runs at once; one that is off is idle.
#[test]
fn the_state_of_the_start_is_shown_for_every_method() {
    let state = |tuned: &Tuned, enable: bool| {
        let mut pair = tuned.pair();
        pair.controller.model.inputs.enable = enable;
        pair.start().unwrap();
        for _ in 0..5 {
            pair.step(pair.controller.model.parameters.T_s).unwrap();
        }
        pair.controller.out.start_state
    };
    let of = |kind| match rules::suited(&read("reference"), kind).unwrap() {
        Suited::Tuned(tuned) => *tuned,
        Suited::Refused(refusal) => panic!("{}", refusal.reason),
    };
    assert_eq!(state(&of(Kind::Rasmussen), true), StartState::Aligning);
    let sensored = of(Kind::Sensored);
    assert_eq!((state(&sensored, true), state(&sensored, false)), (StartState::Running, StartState::Idle));
}
