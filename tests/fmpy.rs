//! The packed FMUs in a foreign importer: FMPy validates and co-simulates them, and a suite of host sins calls their C
//! interface through ctypes. The tests themselves are in `tests/fmpy/`; this runs them with pytest.
#![allow(missing_docs)]

mod common;

use common::python::{pytest, scratch};
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

#[test]
fn every_estimator_as_natively() {
    // The file with the estimators' experiments and what came out natively.
    let file = scratch().join(format!("estimators-{}.json", process::id()));
    fs::write(&file, common::estimators::experiments().to_string()).expect("a file below the target folder");
    pytest("fmpy", "estimators", &["test_estimators.py"], &[("FMU_ESTIMATORS", &file)]);
}
