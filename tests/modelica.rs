//! `fmu modelica`: the package around our FMUs, in two Modelica compilers, and its refusals.
#![allow(missing_docs)]

mod common;

use common::python::{pytest, scratch};
use fmu::commands::modelica::{self, Modelica};
use std::path::{Path, PathBuf};
use std::{fs, process};

fn archive(standard: &str, name: &str) -> PathBuf {
    common::archives().join(standard).join(name).with_extension("fmu")
}

fn request(file: PathBuf, out: &Path) -> Modelica {
    Modelica { file, name: None, block: None, motor: Vec::new(), out: out.into() }
}

/// A machine of plain values, and one with a flux map.
fn few() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("motors");
    ["ipmsm-2.2kw.toml", "pmsyrm-5.5kw.toml"].map(|name| folder.join(name)).into()
}

/// A folder for one test, not yet existing.
fn fresh(name: &str) -> PathBuf {
    let folder = scratch().join(format!("modelica-{name}-{}", process::id()));
    let _ = fs::remove_dir_all(&folder);
    folder
}

fn why(args: &Modelica) -> String {
    format!("{:#}", modelica::run(args).unwrap_err())
}

#[test]
fn two_compilers_take_every_package_and_run_its_examples() {
    let folder = fresh("packages");
    for name in ["PmsmDrive", "PmsmDriveMean", "PmsmPlant"] {
        let motor = few();
        let args = Modelica { motor, ..request(archive("fmi2", name), &folder.join(name)) };
        modelica::run(&args).unwrap();
    }
    let (drive, block, out) = (archive("fmi3", "PmsmDrive"), Some("FMUs.PmsmDrive".into()), folder.join("OtherImport"));
    modelica::run(&Modelica { block, motor: few(), ..request(drive.clone(), &out) }).unwrap();
    fs::copy(drive, out.join("PmsmDrive.fmu")).unwrap();
    pytest("modelica", "modelica", &["test_judges.py"], &[("MODELICA_PACKAGES", &folder)]);
}

#[test]
fn the_package_has_what_the_import_lacks() {
    let out = fresh("drive");
    let said = modelica::run(&Modelica { motor: few(), ..request(archive("fmi2", "PmsmDrive"), &out) }).unwrap();
    assert!(said.contains("PmsmDriveLib") && said.contains("omc import.mos"), "{said}");
    let read = |name: &str| fs::read_to_string(out.join("PmsmDriveLib").join(name)).unwrap();
    let base = read("Base.mo");
    for wanted in [
        "parameter Real plant_motor_R_s(unit=\"Ohm\", min=0) = machine.plant_motor_R_s\n    \"Stator resistance\"\n    \
         annotation(Dialog(tab=\"Plant\", group=\"motor\"));",
        "final plant_flux_map_w_46_=plant_flux_map_w[46]",
        "parameter Boolean enable_constant = true",
        "parameter Real u_dc_constant(unit=\"V\"",
        "Modelica.Blocks.Interfaces.RealInput speed_ref(unit=\"rad/s\") if use_speed_ref",
        "displayUnit=\"rev/min\"",
        "heat_winding(final T=fmu.T_winding_imposed, final Q_flow=-fmu.Q_winding) if use_heat_winding",
        "dc_n(final v=v_n, final i=-fmu.i_dc) if use_dc_link",
        "assert(controller_estimator == Types.Estimator.Rasmussen,",
        "fileName=\"modelica://PmsmDriveLib/Resources/Images/icon.png\"",
    ] {
        assert!(base.contains(wanted), "{wanted}");
    }
    assert!(fs::read(out.join("PmsmDriveLib/Resources/Images/icon.png")).unwrap().starts_with(b"\x89PNG"));
    let machine = read("Machines.mo");
    assert!(machine.contains("record ipmsm_2_2kw\n") && machine.contains("plant_motor_R_s=3.6,"), "{machine}");
    assert!(machine.contains("controller_motor_R_s=3.24,"));
    let script = fs::read_to_string(out.join("import.mos")).unwrap();
    for wanted in [
        "importFMU(\"PmsmDrive.fmu\", \"PmsmDrive_me_FMU\")",
        "--allowNonStandardModelica=reinitInAlgorithms",
        "PmsmDriveLib.Examples.TwoInertias",
    ] {
        assert!(script.contains(wanted), "{script}");
    }
    assert_eq!(fs::read(out.join("PmsmDrive.fmu")).unwrap(), fs::read(archive("fmi2", "PmsmDrive")).unwrap());
    // The load overshoots before its torque steps, because the speed loop is tuned only for the rotor, and settles at the end.
    let figures: Vec<[f64; 3]> = script.lines().filter_map(figure).collect();
    assert_eq!(figures.len(), 4, "{script}");
    let [_, before, _, end] = figures[..] else { unreachable!() };
    assert!((before[1] - 104.72).abs() < 5.0 && before[2].abs() < 0.2, "{before:?}");
    assert!((end[1] - 104.72).abs() < 0.5 && (end[2] - 1.0).abs() < 0.05, "{end:?}");
}

fn figure(line: &str) -> Option<[f64; 3]> {
    let numbers: Vec<f64> =
        line.strip_prefix("// ")?.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}

#[test]
fn another_import_and_another_name_are_taken() {
    let out = fresh("another");
    let args = Modelica {
        name: Some("Drives".into()),
        block: Some("FMUs.PmsmDrive".into()),
        ..request(archive("fmi3", "PmsmDrive"), &out)
    };
    modelica::run(&args).unwrap();
    let block = fs::read_to_string(out.join("Drives/Block.mo")).unwrap();
    assert!(block.contains("model Block = FMUs.PmsmDrive\n"), "{block}");
    let base = fs::read_to_string(out.join("Drives/Base.mo")).unwrap();
    assert!(base.contains("final plant_flux_map_w=plant_flux_map_w,"), "an array of FMI 3.0 is one parameter");
    assert!(!out.join("import.mos").exists() && !out.join("Drives/Machines.mo").exists());
}

#[test]
fn what_is_wrong_is_named_and_nothing_is_written() {
    let out = fresh("wrong");
    let drive = archive("fmi2", "PmsmDrive");
    let no_shaft = why(&request(archive("fmi2", "SensorlessController"), &out));
    assert!(no_shaft.contains("SensorlessController.fmu: has no shaft for a flange"), "{no_shaft}");
    assert!(no_shaft.contains("it has the terminals phases, sensor"), "{no_shaft}");
    let three = why(&request(archive("fmi3", "PmsmDrive"), &out));
    assert!(three.contains("PmsmDrive.fmu: OpenModelica imports FMI 2.0"), "{three}");
    let missing = why(&request("nothing.fmu".into(), &out));
    assert!(missing.contains("nothing.fmu"), "{missing}");
    let no_fmu = why(&request(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"), &out));
    assert!(no_fmu.contains("Cargo.toml"), "{no_fmu}");
    for name in ["2x", "model", "a-b", ""] {
        let bad = why(&Modelica { name: Some(name.into()), ..request(drive.clone(), &out) });
        assert!(bad.contains(&format!("--name {name}: expected a Modelica name")), "{bad}");
        let bad = why(&Modelica { block: Some(format!("A.{name}")), ..request(drive.clone(), &out) });
        assert!(bad.contains(&format!("--block {name}: expected a Modelica name")), "{bad}");
    }
    let motor = few().swap_remove(0);
    let twice = why(&Modelica { motor: vec![motor.clone(), motor], ..request(drive.clone(), &out) });
    assert!(twice.contains("another machine is named ipmsm_2_2kw"), "{twice}");
    assert!(!out.exists());
    fs::create_dir_all(&out).unwrap();
    fs::write(out.join("mine"), "").unwrap();
    let full = why(&request(drive.clone(), &out));
    assert!(full.contains("the folder is not empty"), "{full}");
    let file = why(&request(drive, &out.join("mine")));
    assert!(file.contains("--out") && file.contains("mine"), "{file}");
    assert_eq!(fs::read_dir(&out).unwrap().count(), 1);
}
