//! The packed FMUs in a foreign importer: FMPy validates and co-simulates them, and a suite of host sins calls their C
//! interface through ctypes. The tests themselves are in `tests/fmpy/`; this runs them with pytest.
#![allow(missing_docs)]

mod common;

use common::python::{pytest, scratch};
use std::path::Path;
use std::process::Command;
use std::{fs, process};

#[test]
fn fmpy_validates_and_cosimulates() {
    let files = ["test_validate.py", "test_controller.py", "test_cosimulation.py", "test_simulate_fmu.py"];
    pytest("fmpy", "fmpy", &files, &[]);
}

#[test]
fn tuning_a_running_drive() {
    pytest("fmpy", "tuning", &["test_tuning.py"], &[]);
}

#[test]
fn misuse_of_the_c_interface() {
    pytest("fmpy", "misuse", &["test_misuse.py"], &[]);
}

/// `FMU_ONLY=fmi3-PmsmPlant` names one archive; all of them take hours.
#[test]
#[ignore = "opt-in: cargo test --test fmpy under_valgrind -- --ignored"]
fn misuse_under_valgrind() {
    let there = Command::new("valgrind").arg("--version").output().is_ok_and(|output| output.status.success());
    assert!(there, "valgrind is not installed (on Debian: package valgrind)");
    pytest("fmpy", "valgrind", &["test_misuse.py"], &[("FMU_UNDER", Path::new("valgrind"))]);
}

#[test]
fn every_estimator_as_natively() {
    // The file with the estimators' experiments and what came out natively.
    let file = scratch().join(format!("estimators-{}.json", process::id()));
    fs::write(&file, common::estimators::experiments().to_string()).expect("a file below the target folder");
    pytest("fmpy", "estimators", &["test_estimators.py"], &[("FMU_ESTIMATORS", &file)]);
}

/// Systems as SSP files, and what `fmu simulate` makes of them when their inputs come one step late.
#[test]
fn the_closed_loop_as_an_ssp() {
    let folder = scratch().join(format!("fmpy-ssp-{}", process::id()));
    fs::create_dir_all(&folder).expect("a folder below the target folder");
    let fmu = |arguments: &[&str]| {
        let output = process::Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().expect("fmu");
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    };
    let path = |name: &str| folder.join(name).to_str().expect("UTF-8").to_owned();
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    for (name, more, u_dc) in
        [("fmi2", &[][..], 325), ("fmi3", &["--fmi", "3"], 325), ("motor", &["--motor", motor], 540)]
    {
        let ssp = path(&format!("{name}.ssp"));
        fmu(&[&["ssp", "--out", &ssp], more].concat());
        let inputs = ["speed_ref=0:0,0.1001:50", "tau_load=0:0,0.4001:1", &format!("u_dc=0:0,0.0001:{u_dc}")];
        let inputs: Vec<&str> = inputs.into_iter().flat_map(|input| ["--input", input]).collect();
        fmu(&[&["simulate", &ssp, "--stop", "0.6", "--csv", &path(&format!("{name}.csv"))], &inputs[..]].concat());
    }
    pytest("fmpy", "ssp", &["test_ssp.py"], &[("FMU_SSP", &folder)]);
}
