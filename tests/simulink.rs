//! `fmu simulink`: the scripts around our FMUs, the Reference-FMUs and an FMU of awkward names, parsed; and its refusals.
#![allow(missing_docs)]

mod common;

use common::python::{pytest, scratch};
use fmu::commands::simulink::{self, Simulink};
use std::path::{Path, PathBuf};
use std::{fs, process};

fn archive(standard: &str, name: &str) -> PathBuf {
    common::archives().join(standard).join(name).with_extension("fmu")
}

fn request(file: PathBuf, out: &Path) -> Simulink {
    Simulink { file, step: None, out: out.into() }
}

/// A folder for one test, not yet existing.
fn fresh(name: &str) -> PathBuf {
    let folder = scratch().join(format!("simulink-{name}-{}", process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

fn why(args: &Simulink) -> String {
    format!("{:#}", simulink::run(args).unwrap_err())
}

/// A copy of an archive with another description.
fn described(from: &Path, to: &Path, change: impl Fn(String) -> String) -> PathBuf {
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    common::rewrite(from, to, |name, bytes| {
        Some(if name == "modelDescription.xml" {
            change(String::from_utf8(bytes).unwrap()).into_bytes()
        } else {
            bytes
        })
    });
    to.into()
}

#[test]
fn a_parser_takes_every_script() {
    let folder = fresh("scripts");
    for standard in ["fmi2", "fmi3"] {
        for entry in fs::read_dir(common::archives().join(standard)).unwrap() {
            let file = entry.unwrap().path();
            let name = file.file_stem().unwrap().to_string_lossy().into_owned();
            if file.extension().is_some_and(|e| e == "fmu") && !name.ends_with("Clocked") {
                simulink::run(&request(file, &folder.join(format!("{name}-{standard}")))).unwrap();
            }
        }
    }
    let awkward = described(&archive("fmi2", "PmsmPlant"), &fresh("awkward").join("Awkward.fmu"), |text| {
        text.replace("\"motor.R_s\"", "\"end\"")
            .replace("\"motor.L_d\"", "\"motor_L_q\"")
            .replace("\"motor.psi_M\"", &format!("\"{}\"", "long.".repeat(20)))
            .replace("Stator resistance", "Stator&apos;s &quot;R&quot; % of 100 {it}")
    });
    let out = folder.join("Awkward");
    simulink::run(&request(awkward, &out)).unwrap();
    let values = fs::read_to_string(out.join("PmsmPlant_parameters.m")).unwrap();
    for wanted in
        ["\np.xend = ", "\np.motor_L_q = ", "\np.motor_L_q_2 = ", "names of at most 55 characters:\n% long.long."]
    {
        assert!(values.contains(wanted), "{wanted}: {values}");
    }
    pytest("simulink", "simulink", &["test_scripts.py"], &[("SIMULINK_FOLDERS", &folder)]);
}

#[test]
fn the_drive_has_buses_a_flange_and_a_step_that_divides() {
    let out = fresh("drive");
    let said = simulink::run(&request(archive("fmi3", "PmsmDrive"), &out)).unwrap();
    assert!(said.contains("build_PmsmDrive") && said.contains("Checked as text, not run"), "{said}");
    let build = fs::read_to_string(out.join("build_PmsmDrive.m")).unwrap();
    for wanted in [
        "'FixedStep', '0.001'",
        "set_param(fmu, 'FMUSampleTime', '0.001');",
        "bus_out(model, 'PmsmDrive', 'torque_request_out', 'PmsmDrive_torque_request_out', ",
        // MathWorks: the torque acts from C to R of the source, the sensor measures w_R - w_C. A swapped port is a wrong sign.
        "simscape.addConnection([block '/torque_source'], 'C', [block '/housing'], 'W');",
        "simscape.addConnection([block '/torque_source'], 'R', [block '/motion_sensor'], 'R');",
        "simscape.addConnection([block '/motion_sensor'], 'C', [block '/housing'], 'W');",
        "simscape.addConnection([block '/torque_source'], 'R', [block '/flange'], 'port');",
        "simscape.addConnection([block '/torque_source'], 'R', [block '/rotor'], 'I');",
        "set_param([block '/rotor'], 'inertia', 'p.plant_mechanics_J');",
        "'LocalSolverSampleTime', '0.001'",
        "choose Co-Simulation",
    ] {
        assert!(build.contains(wanted), "{wanted}");
    }
    let values = fs::read_to_string(out.join("PmsmDrive_parameters.m")).unwrap();
    assert!(values.contains("plant.motor.R_s in Ohm: Stator resistance\np.plant_motor_R_s = "), "{values}");
    assert!(
        values.contains("p.plant_mechanics_imposed = true;")
            && values.contains("p.controller_estimator = 'Rasmussen';")
    );
    let finer = Simulink { step: Some(1e-4), ..request(archive("fmi2", "PmsmDrive"), &fresh("finer")) };
    simulink::run(&finer).unwrap();
    let build = fs::read_to_string(finer.out.join("build_PmsmDrive.m")).unwrap();
    assert!(build.contains("'FMUSampleTime', '0.0001'") && build.contains("'FixedStep', '0.0001'"));
    let controller = fresh("controller");
    simulink::run(&request(archive("fmi2", "SensorlessController"), &controller)).unwrap();
    let build = fs::read_to_string(controller.join("build_SensorlessController.m")).unwrap();
    assert!(
        !build.contains("simscape.") && build.contains("bus_in(model, 'SensorlessController', 'phases_in'"),
        "{build}"
    );
}

#[test]
fn what_is_wrong_is_named_and_nothing_is_written() {
    let out = fresh("wrong");
    let drive = archive("fmi2", "PmsmDrive");
    for step in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let bad = why(&Simulink { step: Some(step), ..request(drive.clone(), &out) });
        assert!(bad.contains("--step") && bad.contains("expected a positive number of seconds"), "{bad}");
    }
    let inner = described(&archive("fmi3", "PmsmDrive"), &fresh("inner").join("Inner.fmu"), |text| {
        text.replace("<CoSimulation ", "<CoSimulation fixedInternalStepSize=\"0.0004\" ")
    });
    let bad = why(&Simulink { step: Some(1e-3), ..request(inner.clone(), &out) });
    assert!(bad.contains("multiple of the FMU's internal step, fixedInternalStepSize = 0.0004 s"), "{bad}");
    let rounded = fresh("rounded");
    simulink::run(&request(inner, &rounded)).unwrap();
    let build = fs::read_to_string(rounded.join("build_PmsmDrive.m")).unwrap();
    assert!(build.contains("'FMUSampleTime', '0.0012"), "the next multiple of 0.4 ms: {build}");
    let clocked = why(&request(archive("fmi3", "SensorlessControllerClocked"), &out));
    assert!(clocked.contains("has no clocks in its documentation"), "{clocked}");
    let missing = why(&request("nothing.fmu".into(), &out));
    assert!(missing.contains("nothing.fmu"), "{missing}");
    assert!(!out.exists());
    fs::create_dir_all(&out).unwrap();
    fs::write(out.join("mine"), "").unwrap();
    let full = why(&request(drive, &out));
    assert!(full.contains("the folder is not empty"), "{full}");
}
