//! Every estimator on every machine, tuned by the rules: held, refused with the reason, or announced by the trial.
//!
//! `METHODS_MACHINES=hub-36v,reference` and `METHODS_KINDS=Hybrid` select some; `METHODS_FOLDER=DIR` adds the machines of a folder.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned};
use drive_tools::tune::trial::{self, Trial};
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// A machine with a method.
enum Cell {
    Held(Box<Tuned>, Vec<Trial>),
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
            if trials.iter().all(|trial| trial.starts() && trial.holds()) {
                return Cell::Held(tuned, trials);
            }
            Cell::Announced(trials.into_iter().filter(|trial| !(trial.starts() && trial.holds())).collect())
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
    let (mut held, mut refused, mut announced, mut silent, mut alarmed) = (0, 0, 0, 0, 0);
    for path in files {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if !chosen("METHODS_MACHINES", &name) {
            continue;
        }
        let motor = match MotorFile::read(&path) {
            Ok(motor) => motor,
            Err(error) => {
                println!("{name}: the file is refused: {error}");
                continue;
            }
        };
        for &kind in Kind::ALL.iter().filter(|kind| chosen("METHODS_KINDS", kind.name())) {
            if let Err(error) = rules::suited(&motor, kind) {
                println!("{name}: the file is refused: {error}");
                break;
            }
            let text = match cell(&motor, kind, 6) {
                Cell::Held(_, trials) => {
                    held += 1;
                    let alarms: u32 = trials.iter().map(|trial| trial.alarmed).sum();
                    alarmed += alarms;
                    if alarms > 0 { format!("held, {alarms} runs with lock_lost") } else { "held".into() }
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
    println!(
        "{held} held, {refused} refused, {announced} announced; {silent} failed runs without lock_lost or a limit; {alarmed} held runs with lock_lost"
    );
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
                Cell::Held(tuned, _) => assert_eq!(tuned.estimator, kind),
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
        ("traction-80kw", Kind::VoltageModel, ["= 1190 rad/s per rad", "4.5 times the gain 264 rad/s"]),
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
    let mut slow = read("wind-5kw");
    assert!(!notes(&slow).contains("I-f start takes"), "2 s with more than 0.3 of the torque: {}", notes(&slow));
    *slow.data.mechanics.J.get_mut() *= 4.0;
    let slow = notes(&slow);
    assert!(slow.contains("the I-f start takes 4.2 s: 2 x 0.82 s of alignment"), "{slow}");
    let mut weak = read("servo-48v");
    let quick = notes(&weak);
    assert!(!quick.contains("I-f start takes") && !quick.contains("maximum current gives"), "{quick}");
    *weak.data.rating.current.get_mut() *= 0.45;
    let weak = notes(&weak);
    assert!(weak.contains("in the I-f start, 1.1"), "{weak}");
}

/// A PM-assisted reluctance machine: the I-f start aligns with little current, accelerates with that of the torque, and takes 2 s. The
/// noted `s_2` gives a start by injection that holds the rated torque from rest on.
#[test]
fn a_reluctance_machine_starts_with_full_torque_by_injection() {
    let mut text = "name = \"r\"\nsource = \"t\"\n[machine]\nn_p = 2\nR_s = 0.42\nL_d = 10e-3\nL_q = 48e-3\npsi_M = 0.25\n[mechanics]\nJ = 0.05\n\
        [rating]\nspeed = 157.08\ntorque = 70.0\ncurrent = 50.0\n[dc_link]\nu_dc = 560.0\n"
        .to_owned();
    let suited = |text: &str, kind| {
        let motor = MotorFile::parse(text, Path::new("r.toml")).unwrap();
        match rules::suited(&motor, kind).unwrap() {
            Suited::Tuned(tuned) => tuned,
            Suited::Refused(refusal) => panic!("{}", refusal.reason),
        }
    };
    let notes = suited(&text, Kind::SquareWaveInjection).notes.join("\n");
    for part in [
        "3.29 A, which hold up to 2.47 N.m, 0.04 of the rated torque; then 36.95 A carry up to 98.00 N.m",
        "from s_2 = 21.000 A/Wb2 on",
    ] {
        assert!(notes.contains(part), "{notes}");
    }
    let extended = suited(&text, Kind::ExtendedEmf);
    let value = |name: &str| extended.real(name).unwrap();
    let start =
        2.0 * value("start.t_align") + value("start.speed") / value("start.acceleration") + value("start.settle");
    assert!((0.5..2.0).contains(&start) && (value("current.bandwidth") / TAU - 84.5).abs() < 1.0, "{start} s");
    for kind in [Kind::ExtendedEmf, Kind::Hybrid] {
        for trial in trial::all(&suited(&text, kind), 2) {
            assert!(trial.starts() && trial.holds(), "{}: {trial:?}", kind.name());
        }
    }
    text += "[saturation]\ns_2 = 21.1\n";
    let tuned = suited(&text, Kind::SquareWaveInjection);
    assert!(!tuned.notes.join("\n").contains("I-f start"), "{:?}", tuned.notes);
    for trial in trial::all(&tuned, 2) {
        assert!(trial.starts() && trial.holds(), "{trial:?}");
    }
}
