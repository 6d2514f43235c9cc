//! The packed FMUs in a foreign importer: FMPy validates and co-simulates them, and a misuse suite calls their C interface
//! through ctypes. The tests themselves are in `tests/fmpy/`; this runs them with pytest.
#![allow(missing_docs)]

mod common;

use common::python::{pytest, scratch};
use drive::PmsmDrive;
use drive::control::commission::CommissionState;
use drive::control::commissioning::CommissionMode;
use fmu_core::{Block, Constant, Elapsed, Model, Slot, Step};
use std::path::Path;
use std::process::Command;
use std::{fs, process};

#[test]
fn fmpy_validates_and_cosimulates() {
    let files = [
        "test_validate.py",
        "test_controller.py",
        "test_cosimulation.py",
        "test_simulate_fmu.py",
        "test_weakening.py",
        "test_documents.py",
    ];
    pytest("fmpy", "fmpy", &files, &[]);
}

/// The example for Python, as a script and as a notebook.
#[test]
fn the_example_for_python() {
    pytest("fmpy", "example", &["test_drive_example.py"], &[]);
}

#[test]
fn losses_and_temperatures() {
    pytest("fmpy", "losses", &["test_losses_and_temperature.py", "test_drive_cycle.py"], &[]);
}

#[test]
fn links_limits_and_faults() {
    pytest("fmpy", "protection", &["test_protection.py"], &[]);
}

#[test]
fn drive_trains() {
    pytest("fmpy", "trains", &["test_drive_train.py"], &[]);
}

/// The examples of docs/drive-train.md, which compute a map, and a flux map from a table.
#[test]
fn examples_of_drive_trains_and_flux_maps() {
    let command = Path::new(env!("CARGO_BIN_EXE_fmu"));
    let files = ["test_drive_train_examples.py", "test_flux_map.py"];
    pytest("fmpy", "drive-train", &files, &[("FMU_COMMAND", command)]);
}

/// The schemas of both standards, against which FMPy validates.
#[test]
fn the_checker_and_the_schemas() {
    pytest("fmpy", "schema", &["test_schema.py"], &[("FMU_COMMAND", Path::new(env!("CARGO_BIN_EXE_fmu")))]);
}

#[test]
fn model_exchange_and_events() {
    pytest("fmpy", "exchange", &["test_model_exchange.py", "test_casadi.py"], &[]);
}

#[test]
fn tuning_a_running_drive() {
    pytest("fmpy", "tuning", &["test_tuning.py"], &[]);
}

/// PmsmDrive with the values of `fmu tune`.
#[test]
fn tuned_machines() {
    let folder = scratch().join(format!("tuned-{}", process::id()));
    for name in ["drone-22v", "ipmsm-2.2kw"] {
        let motor = format!("{}/motors/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let mut tune = Command::new(env!("CARGO_BIN_EXE_fmu"));
        tune.args(["tune", &motor, "--integers", "--out"]).arg(&folder);
        assert!(tune.output().unwrap().status.success(), "{name}");
    }
    pytest("fmpy", "tuned", &["test_tuned_drive.py"], &[("FMU_TUNED", &folder)]);
    fs::remove_dir_all(&folder).unwrap();
}

/// The efficiency map of a machine in NumPy.
#[test]
fn maps() {
    let folder = scratch().join(format!("map-{}", process::id()));
    let motor = format!("{}/motors/traction-63kw.toml", env!("CARGO_MANIFEST_DIR"));
    let mut map = Command::new(env!("CARGO_BIN_EXE_fmu"));
    map.args(["map", &motor, "--u-dc", "350,400", "--grid", "11x11", "--out"]).arg(&folder);
    assert!(map.output().unwrap().status.success());
    pytest("fmpy", "map", &["test_map.py"], &[("FMU_MAP", &folder)]);
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn misuse_of_the_c_interface() {
    pytest("fmpy", "misuse", &["test_misuse.py"], &[]);
}

/// The same with libraries that AddressSanitizer watches. `FMU_ONLY=fmi3-PmsmPlant` names one archive.
#[test]
#[ignore = "opt-in: cargo test --test fmpy under_asan -- --ignored (Linux, gcc; four minutes)"]
fn misuse_under_asan() {
    let libasan = Command::new("gcc").arg("-print-file-name=libasan.so").output().expect("gcc, for its libasan");
    let libasan = fs::canonicalize(String::from_utf8_lossy(&libasan.stdout).trim()).expect("libasan.so of gcc");
    let (target, triple) = (scratch().join("asan"), fmu_pack::target::host_triple().unwrap());
    let (libraries, archives) = (target.join(&triple).join("release"), target.join("fmu"));
    let fmus = ["mapped-drive", "pmsm-drive", "pmsm-drive-mean", "pmsm-plant", "sensorless-controller"];
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--locked", "--release", "--target", &triple, "--target-dir"]).arg(&target);
    build.args(fmus.iter().flat_map(|name| ["--package", name]));
    // A flag for nightly compilers, which a stable one takes with this variable.
    build.env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", "-Zsanitizer=address");
    assert!(build.status().unwrap().success());
    for name in fmus {
        let library = libraries.join(format!("lib{}.so", name.replace('-', "_")));
        let watched = fs::read(&library).unwrap().windows(13).any(|bytes| bytes == b"__asan_report");
        assert!(watched, "{} was not compiled with AddressSanitizer", library.display());
        let mut pack = Command::new(env!("CARGO_BIN_EXE_fmu"));
        // AddressSanitizer reserves terabytes.
        pack.args(["build", "--memory", "0", "--library"]).arg(library).arg("--out").arg(&archives);
        pack.env("LD_PRELOAD", &libasan).env("ASAN_OPTIONS", "detect_leaks=0");
        assert!(pack.status().unwrap().success());
    }
    pytest("fmpy", "asan", &["test_misuse.py"], &[("FMU_ASAN", &libasan), ("FMU_ARCHIVES", &archives)]);
}

#[test]
fn every_estimator_as_natively() {
    // The file with the estimators' experiments and their native results.
    let file = scratch().join(format!("estimators-{}.json", process::id()));
    fs::write(&file, common::estimators::experiments().to_string()).expect("a file below the target folder");
    pytest("fmpy", "estimators", &["test_estimators.py"], &[("FMU_ESTIMATORS", &file)]);
}

/// Systems as SSP files, and the results of `fmu simulate` when their inputs come one step late.
#[test]
fn the_closed_loop_as_an_ssp() {
    let folder = scratch().join(format!("fmpy-ssp-{}", process::id()));
    fs::create_dir_all(&folder).expect("a folder below the target folder");
    let fmu = |arguments: &[&str]| {
        let output = process::Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().expect("fmu");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let path = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let archives = common::archives().to_str().expect("UTF-8");
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    for (name, more, u_dc) in
        [("fmi2", &[][..], 325), ("fmi3", &["--fmi", "3"], 325), ("motor", &["--motor", motor], 540)]
    {
        let ssp = path(&format!("{name}.ssp"));
        fmu(&[&["ssp", "--fmus", archives, "--out", &ssp], more].concat());
        let inputs = ["speed_ref=0:0,0.1001:50", "tau_load=0:0,0.4001:1", &format!("u_dc=0:0,0.0001:{u_dc}")];
        let inputs: Vec<&str> = inputs.into_iter().flat_map(|input| ["--input", input]).collect();
        fmu(&[&["simulate", &ssp, "--stop", "0.6", "--csv", &path(&format!("{name}.csv"))], &inputs[..]].concat());
    }
    pytest("fmpy", "ssp", &["test_ssp.py"], &[("FMU_SSP", &folder)]);
}

/// A drive commissions itself at standstill, then turning, natively: the bits expected from the packed drive.
#[test]
fn self_commissioning() {
    let modes = [CommissionMode::Standstill, CommissionMode::Spin];
    let native: serde_json::Map<_, _> =
        modes.into_iter().map(|mode| (mode.name().into(), commissioned(mode).into())).collect();
    let file = scratch().join(format!("commissioning-{}.json", process::id()));
    fs::write(&file, serde_json::to_string(&native).unwrap()).unwrap();
    pytest("fmpy", "commissioning", &["test_commissioning.py"], &[("FMU_COMMISSIONING", &file)]);
    fs::remove_file(file).unwrap();
}

/// The number of steps of 5 ms, and the results as hexadecimal numbers.
fn commissioned(mode: CommissionMode) -> serde_json::Map<String, serde_json::Value> {
    let mut drive = Block::<PmsmDrive>::default();
    let commission = &mut drive.model.pair.controller.model.parameters.commission;
    (commission.mode, commission.i, commission.speed) = (mode, 7.5, 314.0);
    let plant = &mut drive.model.pair.plant.model.parameters;
    (plant.inverter.dead_time, plant.initial.theta_e) = (2e-6, 0.7);
    drive.model.inputs.commission_start = true;
    drive.initialize();
    let (mut now, mut steps) = (Elapsed::ZERO, 0);
    while drive.out.controller.commission_state != CommissionState::Done {
        let step = Step { start: now, h: 5e-3 };
        drive.step(&step).unwrap();
        (now, steps) = (step.end(), steps + 1);
        assert!(steps < 10_000, "{mode:?}: {:?}", drive.out.controller.commission_fault);
    }
    let table = PmsmDrive::TABLE;
    let mut native = serde_json::Map::new();
    for index in 0..table.len() {
        let name = table.locate(index).unwrap().0;
        if let Some((_, Slot::Constant(Constant::Real(x)))) = table.entry(&mut drive, index) {
            native.insert(name, hexadecimal(x).into());
        }
    }
    assert!(native.len() >= 30 && native["identified_R_s"] != hexadecimal(0.0), "{native:?}");
    native.insert("steps".into(), steps.into());
    native
}

/// A number as Python's `float.fromhex` reads it.
fn hexadecimal(x: f64) -> String {
    let (bits, sign) = (x.to_bits(), if x.is_sign_negative() { "-" } else { "" });
    let (exponent, fraction) = ((bits >> 52) & 0x7ff, bits & ((1 << 52) - 1));
    match exponent {
        0 => format!("{sign}0x0.{fraction:013x}p-1022"),
        _ => format!("{sign}0x1.{fraction:013x}p{}", i64::try_from(exponent).unwrap() - 1023),
    }
}
