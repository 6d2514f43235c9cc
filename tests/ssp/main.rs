//! The closed loop as an SSP file: written by `fmu ssp`, run by `fmu simulate`, and the messages about wrong files.
#![allow(missing_docs)]

#[path = "../common/mod.rs"]
mod common;
mod importers;
mod wrong;

use fmu_core::description::VariableKind;
use model_description::{BaseType, Element, ModelDescription};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).env("SOURCE_DATE_EPOCH", "1700000000").output().unwrap()
}

fn done(arguments: &[&str]) -> String {
    let output = fmu(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The arguments fail with this status and one line that has all the parts; before it the compiler may report that it is done.
fn fails(arguments: &[&str], status: i32, parts: &[&str]) {
    let output = fmu(arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    let (compiler, error): (Vec<&str>, Vec<&str>) =
        said.lines().partition(|line| ["   ", "note: "].iter().any(|start| line.starts_with(start)));
    assert_eq!((output.status.code(), error.len()), (Some(status), 1), "{arguments:?}: {compiler:?} {error:?}");
    let error = error[0];
    for part in parts {
        assert!(error.contains(part), "{part:?} is not in {error}");
    }
}

/// `fmu ssp` with the packed FMUs: it compiles nothing.
fn packed(arguments: &[&str]) {
    done(&[&["ssp", "--fmus", common::archives().to_str().unwrap()], arguments].concat());
}

/// A folder with `fmi2.ssp`, from the sources, and `fmi3.ssp` without values, and `motor.ssp` of FMI 2.0 with a machine's values.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("ssp-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        done(&["ssp", "--out", &path("fmi2.ssp")]);
        packed(&["--fmi", "3", "--out", &path("fmi3.ssp")]);
        let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
        packed(&["--motor", motor, "--out", &path("motor.ssp")]);
        folder
    })
}

fn ssp(name: &str) -> String {
    folder().join(name).to_str().unwrap().to_owned()
}

/// An entry of an archive as text.
fn entry(path: &str, name: &str) -> String {
    let mut text = String::new();
    zip::ZipArchive::new(File::open(path).unwrap()).unwrap().by_name(name).unwrap().read_to_string(&mut text).unwrap();
    text
}

/// The system runs as the pair connected by hand, in both standards, bit for bit.
#[test]
fn simulate_runs_it_as_the_pair() {
    for standard in ["fmi2", "fmi3"] {
        let archive =
            |name: &str| common::archives().join(standard).join(name).with_extension("fmu").display().to_string();
        let (p, c) = (format!("p={}", archive("PmsmPlant")), format!("c={}", archive("SensorlessController")));
        let time = ["--stop", "0.3", "--csv", "-"];
        let pair = ["simulate", &p, &c, "--terminal", "p.phases=c.phases", "--terminal", "p.sensor=c.sensor"];
        let pair_inputs = ["--input", "c.speed_ref=0:0,0.02:52.36", "--input", "p.tau_load=0:0,0.15:1"];
        let record = ["--record", "p.speed,c.speed_est,p.i_d,c.i_d,c.u_a"];
        let by_hand = done(&[&pair[..], &pair_inputs, &time, &record].concat());
        let system = ["simulate", &ssp(&format!("{standard}.ssp"))];
        let inputs = ["--input", "speed_ref=0:0,0.02:52.36", "--input", "tau_load=0:0,0.15:1"];
        let record = ["--record", "speed,speed_est,i_d,i_d_est,u_a"];
        let by_ssp = done(&[&system[..], &inputs, &time, &record].concat());
        assert_eq!(by_ssp.lines().next(), Some("time,speed,speed_est,i_d,i_d_est,u_a"));
        assert!(by_ssp.lines().skip(1).eq(by_hand.lines().skip(1)), "{standard}");
        assert_eq!(by_ssp.lines().count(), 3002);
        // Inner names work too, and without --record all outputs of the system are written.
        let inner = [&system[..], &["--set", "plant.motor.R_s=3", "--set", "u_dc=300"], &time].concat();
        let all = done(&inner);
        assert!(all.starts_with("time,u_a,"), "{}", all.lines().next().unwrap());
    }
}

/// The description of an FMU in an SSP.
fn component_description(path: &str, source: &str) -> ModelDescription {
    let mut bytes = Vec::new();
    let mut ssp = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    ssp.by_name(source).unwrap().read_to_end(&mut bytes).unwrap();
    let mut fmu = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut xml = Vec::new();
    fmu.by_name("modelDescription.xml").unwrap().read_to_end(&mut xml).unwrap();
    model_description::read(&xml).unwrap()
}

/// The system has the inputs and the outputs of the drive that is one FMU.
#[test]
fn its_connectors_are_those_of_pmsm_drive() {
    let text = entry(&ssp("fmi3.ssp"), "SystemStructure.ssd");
    let head = text.split_once("<ssd:Elements>").unwrap().0;
    let of_kind = |kind: &str| {
        let connectors = head.split("<ssd:Connector ").filter(|c| c.contains(&format!("kind=\"{kind}\"")));
        let mut names: Vec<_> = connectors.map(|c| c.split('"').nth(1).unwrap().to_owned()).collect();
        names.sort();
        names
    };
    let drive = fmu_core::Description::of::<drive::PmsmDrive>().unwrap();
    let parts = [
        fmu_core::Description::of::<drive::PmsmPlant>().unwrap(),
        fmu_core::Description::of::<drive::SensorlessController>().unwrap(),
    ];
    for (kind, causality) in [("input", fmu_core::Causality::Input), ("output", fmu_core::Causality::Output)] {
        // Switches are not connectors and keep their start values; means over T_s and the DC link exist only in the drive; an
        // enumeration has no connector.
        let shared = |v: &fmu_core::description::Variable| match v.kind {
            VariableKind::Boolean if causality == fmu_core::Causality::Input => false,
            VariableKind::Enumeration { .. } => false,
            _ => v.name.ends_with("_est") || parts.iter().any(|part| part.variable(&v.name).is_some()),
        };
        let outside = |v: &&fmu_core::description::Variable| v.causality == causality && shared(v);
        let mut expected: Vec<_> = drive.variables.iter().filter(outside).map(|v| v.name.clone()).collect();
        expected.sort();
        assert_eq!(of_kind(kind), expected, "{kind}");
    }
}

/// A machine's values are in the file and in the behavior of the system.
#[test]
fn a_motor_comes_with_it() {
    let path = ssp("motor.ssp");
    assert!(entry(&path, "resources/plant.ssv").contains("\"motor.R_s\"><ssv:Real value=\"3.6\"/>"));
    assert!(entry(&path, "resources/SensorlessDrive.ssv").contains("\"u_dc\"><ssv:Real value=\"540\"/>"));
    let run = ["simulate", &path, "--input", "speed_ref=0:0,0.6:78.5", "--stop", "3", "--csv", "-", "--record"];
    let csv = done(&[&run[..], &["speed,speed_est"]].concat());
    let last: Vec<f64> = csv.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
    assert!((last[1] / 78.5 - 1.0).abs() < 0.02 && (last[2] / last[1] - 1.0).abs() < 0.02, "{last:?}");
}

#[test]
fn the_same_sources_give_the_same_bytes() {
    let again = folder().join("again.ssp");
    done(&["ssp", "--out", again.to_str().unwrap()]);
    assert!(std::fs::read(again).unwrap() == std::fs::read(ssp("fmi2.ssp")).unwrap(), "two SSPs differ");
}

/// A copy of an SSP with one text of one file changed.
fn changed(from: &str, name: &str, old: &str, new: &str) -> (tempfile::TempDir, String) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.ssp");
    common::rewrite(Path::new(from), &path, |entry, bytes| {
        if entry != name {
            return Some(bytes);
        }
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.contains(old), "{old} is not in {name}");
        Some(text.replacen(old, new, 1).into_bytes())
    });
    (dir, path.to_str().unwrap().to_owned())
}

/// Without sources: a folder with the FMUs suffices, and one line names the expected files and folders.
#[test]
fn packed_fmus_are_enough_outside_a_checkout() {
    let dir = tempfile::tempdir().unwrap();
    let outside = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).current_dir(dir.path()).output().unwrap()
    };
    let archives = common::archives().to_str().unwrap();
    let both = format!("{archives}/fmi2");
    for (fmi, fmus) in [("2", archives), ("3", archives), ("2", &both)] {
        let made = outside(&["ssp", "--fmus", fmus, "--fmi", fmi, "--out", "drive.ssp"]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let run = outside(&["simulate", "drive.ssp", "--input", "speed_ref=10", "--stop", "0.01"]);
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    }
    let refused = |arguments: &[&str], parts: &[&str]| {
        let output = outside(arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(2) && said.lines().count() == 1, "{said}");
        for part in parts {
            assert!(said.contains(part), "{part}: {said}");
        }
    };
    let missing = "expected SensorlessController.fmu and PmsmPlant.fmu there or in its folder fmi2, as fmu build --out writes them";
    refused(&["ssp", "--fmus", ".", "--out", "none.ssp"], &["error: --fmus .: ", missing]);
    refused(&["ssp", "--out", "none.ssp"], &["--fmus DIR takes FMUs from a folder", "no Cargo package here"]);
    refused(&["reproduce"], &["no Cargo package here"]);
    assert!(!dir.path().join("none.ssp").exists());
}
