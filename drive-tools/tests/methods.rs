//! Every estimator on every machine, tuned by the rules: held, refused with the reason, or announced by the trial.
//!
//! `METHODS_MACHINES=hub-36v,reference` and `METHODS_KINDS=Hybrid` select some; `METHODS_FOLDER=DIR` adds the machines of a folder.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned};
use drive_tools::tune::trial::{self, Trial};
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

/// A start that takes long, or that the maximum current limits, has a note with the figure.
#[test]
fn a_slow_or_a_weak_start_has_a_note() {
    let notes = |motor: &MotorFile| match rules::suited(motor, Kind::ExtendedEmf).unwrap() {
        Suited::Tuned(tuned) => tuned.notes.join("\n"),
        Suited::Refused(refusal) => panic!("{}", refusal.reason),
    };
    let slow = notes(&read("wind-5kw"));
    assert!(slow.contains("the I-f start takes 2.1 s: the swing of the rotor"), "{slow}");
    let mut weak = read("servo-48v");
    let quick = notes(&weak);
    assert!(!quick.contains("I-f start takes") && !quick.contains("maximum current gives"), "{quick}");
    *weak.data.rating.current.get_mut() *= 0.45;
    let weak = notes(&weak);
    assert!(weak.contains("in the I-f start, 1.1"), "{weak}");
}
