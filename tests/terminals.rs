//! Terminals of the packed FMUs: the pair connected only by them, and the messages about incompatible ones.
#![allow(missing_docs)]

mod common;

use fmu_import::Fmu;
use fmu_system::cosimulation::{Recording, Schedule, Settings, System};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

fn archive(standard: &str, name: &str) -> PathBuf {
    common::archives().join(standard).join(name).with_extension("fmu")
}

fn system(standard: &str) -> System {
    let mut system = System::default();
    for (name, file) in [("p", "PmsmPlant"), ("c", "SensorlessController")] {
        system.add(name, &Fmu::open(archive(standard, file)).unwrap(), false).unwrap();
    }
    system
}

/// A start with the sensor, so that every member of every terminal matters, and a load step.
fn run(mut system: System) -> Recording {
    system.set("c.estimator", "Sensored").unwrap();
    system.input("c.speed_ref", Schedule::parse("0:0,0.02:52.36").unwrap()).unwrap();
    system.input("p.tau_load", Schedule::parse("0:0,0.15:1").unwrap()).unwrap();
    system.record_outputs().unwrap();
    let settings = Settings { start: 0.0, stop: 0.3, step: 1e-4, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

#[test]
fn the_pair_connected_by_terminals_alone_is_the_one_wired_by_hand() {
    for standard in ["fmi2", "fmi3"] {
        let mut by_hand = system(standard);
        for (from, to) in [
            ("c.u_a", "p.u_a"),
            ("c.u_b", "p.u_b"),
            ("c.u_c", "p.u_c"),
            ("c.enabled", "p.enable"),
            ("c.short_circuit", "p.asc"),
            ("p.i_a", "c.i_a"),
            ("p.i_b", "c.i_b"),
            ("p.i_c", "c.i_c"),
            ("p.speed", "c.speed_meas"),
            ("p.theta_e", "c.theta_meas"),
        ] {
            by_hand.connect(from, to).unwrap();
        }
        let mut by_terminals = system(standard);
        // Either side may come first.
        assert_eq!(by_terminals.connect_terminals("p.phases", "c.phases").unwrap().len(), 8);
        assert_eq!(by_terminals.connect_terminals("c.sensor", "p.sensor").unwrap().len(), 2);
        let (by_hand, by_terminals) = (run(by_hand), run(by_terminals));
        assert_eq!(by_hand.columns.len(), by_terminals.columns.len());
        for (a, b) in by_hand.columns.iter().zip(&by_terminals.columns) {
            let same = a.values.iter().zip(&b.values).all(|(x, y)| x.to_bits() == y.to_bits());
            assert!(same && a.name == b.name && a.values.len() == 3001, "{standard}: {}", a.name);
        }
        let speed = by_hand.column("p.speed").unwrap().values.last().copied().unwrap();
        assert!((speed - 52.36).abs() < 10.0, "{standard}: the drive turns, {speed} rad/s");
    }
}

/// Every way to connect terminals wrongly, on the command line.
#[test]
fn what_does_not_fit_is_told_in_one_line() {
    let [plant, controller, drive] = ["PmsmPlant", "SensorlessController", "PmsmDrive"].map(|n| archive("fmi3", n));
    let dir = tempfile::tempdir().unwrap();
    let bare = dir.path().join("bare.fmu");
    strip(&plant, &bare, "terminalsAndIcons/");
    let broken = dir.path().join("broken.fmu");
    common::rewrite(&plant, &broken, |name, bytes| {
        if name.ends_with("terminalsAndIcons.xml") { Some(b"<a/>".into()) } else { Some(bytes) }
    });
    let instance = |name: &str, path: &Path| format!("{name}={}", path.display());
    let given = [
        instance("p", &plant),
        instance("q", &plant),
        instance("c", &controller),
        instance("d", &drive),
        instance("bare", &bare),
        instance("broken", &broken),
    ];
    for (connection, parts) in [
        ("p.phases", &["p.phases: is not --terminal INSTANCE.TERMINAL=INSTANCE.TERMINAL"][..]),
        ("p.phases=r.phases", &["r.phases: is not INSTANCE.TERMINAL; the instances are p, q, c, d, bare, broken"]),
        ("p.phases=c.phase", &["c: has no terminal phase; it has phases, sensor"]),
        (
            "p.phases=c.sensor",
            &["p.phases: does not fit c.sensor: phases is a plug, and its member u_a is missing in sensor"],
        ),
        ("p.shaft=d.shaft", &["member tau is an outflow on both sides, which takes a change of sign"]),
        ("p.dc_link=d.dc_link", &["member i_dc is an inflow on both sides"]),
        (
            "p.sensor=q.sensor",
            &["member speed is output p.speed here and output q.speed there, expected an output and an input"],
        ),
        ("bare.phases=c.phases", &["bare: has no terminal phases; its FMU has no terminals: connect its variables"]),
        (
            "broken.phases=c.phases",
            &["broken.fmu: terminalsAndIcons/terminalsAndIcons.xml: line 1: the root element is <a>"],
        ),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fmu"));
        let output = command.arg("simulate").args(&given).args(["--terminal", connection]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), error.lines().count()), (Some(2), 1), "{connection}: {error}");
        assert!(parts.iter().all(|part| error.contains(part)), "{connection}: {error}");
    }
}

/// Without the folder, and even with a broken one, the FMU behaves the same.
#[test]
fn terminals_are_for_wiring_only() {
    let dir = tempfile::tempdir().unwrap();
    for standard in ["fmi2", "fmi3"] {
        let csv = |plant: &Path| {
            let (p, c) = (
                format!("p={}", plant.display()),
                format!("c={}", archive(standard, "SensorlessController").display()),
            );
            let more = ["--auto-connect", "--input", "c.speed_ref=50", "--stop", "0.05", "--csv", "-"];
            let output =
                Command::new(env!("CARGO_BIN_EXE_fmu")).args(["simulate", &p, &c]).args(more).output().unwrap();
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            String::from_utf8(output.stdout).unwrap()
        };
        let (whole, bare) = (archive(standard, "PmsmPlant"), dir.path().join("bare.fmu"));
        strip(&whole, &bare, "terminalsAndIcons/");
        assert_eq!(csv(&whole), csv(&bare), "{standard}");
    }
}

/// All models have their folder, and FMI 2.0 its old picture.
#[test]
fn the_files_are_in_the_archives() {
    let names = |path: &Path| {
        let zip = zip::ZipArchive::new(std::fs::File::open(path).unwrap()).unwrap();
        zip.file_names().map(|n| n.unwrap().into_owned()).collect::<Vec<_>>()
    };
    for standard in ["fmi2", "fmi3"] {
        for name in ["PmsmPlant", "SensorlessController", "PmsmDrive", "PmsmDriveMean", "MappedDrive"] {
            let names = names(&archive(standard, name));
            for file in ["terminalsAndIcons.xml", "icon.svg", "icon.png"] {
                assert!(names.contains(&format!("terminalsAndIcons/{file}")), "{standard} {name}: {file}");
            }
            assert_eq!(names.contains(&"model.png".to_owned()), standard == "fmi2");
        }
    }
}

/// Copies an archive without a folder.
fn strip(from: &Path, to: &Path, folder: &str) {
    common::rewrite(from, to, |name, bytes| (!name.starts_with(folder)).then_some(bytes));
}
