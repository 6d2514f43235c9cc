//! Machines as data: every file in motors/ gives parameter values with which the packed FMUs start and run.
#![allow(missing_docs, non_snake_case)]

mod common;

use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::setting::{Setting, Value};
use drive_tools::tune::{self, rules};
use fmu::ssv;
use fmu_system::ssp::ssv::{Parameter, read};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn motors() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("motors");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 5, "{files:?}");
    files
}

fn fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap()
}

#[test]
fn every_machine_starts_and_reaches_its_speed() {
    let dir = tempfile::tempdir().unwrap();
    for (k, motor) in motors().iter().enumerate() {
        // Both standards in turn.
        let archives = common::archives().join(if k % 2 == 0 { "fmi2" } else { "fmi3" });
        let tuned = fmu(&["tune", motor.to_str().unwrap(), "--out", dir.path().to_str().unwrap()]);
        let table = String::from_utf8(tuned.stdout).unwrap();
        assert!(tuned.status.success(), "{}", String::from_utf8_lossy(&tuned.stderr));
        let files: Vec<&str> = table.lines().rev().take(3).collect();
        let text = std::fs::read_to_string(motor).unwrap();
        let data = MotorFile::parse(&text, motor).unwrap().data;
        let speed = 0.5 * data.rating.speed.get_ref();
        let load = 0.2 * data.rating.torque.get_ref();

        let instance = |name: &str| format!("{name}={}", archives.join(name).with_extension("fmu").display());
        let (plant, controller) = (instance("PmsmPlant"), instance("SensorlessController"));
        let parameters = [format!("PmsmPlant={}", files[1]), format!("SensorlessController={}", files[0])];
        let speed_ref = format!("SensorlessController.speed_ref=0:0,0.6:{speed}");
        let load = format!("PmsmPlant.tau_load=0:0,3:{load}");
        let T_s = tune::tune(motor).unwrap().pair().controller.model.parameters.T_s.to_string();
        let output = fmu(&[
            "simulate",
            &plant,
            &controller,
            "--auto-connect",
            "--parameters",
            &parameters[0],
            "--parameters",
            &parameters[1],
            "--set",
            "PmsmPlant.initial.theta_e=2.5",
            "--input",
            &speed_ref,
            "--input",
            &load,
            "--step",
            &T_s,
            "--stop",
            "4",
            "--record",
            "PmsmPlant.speed,SensorlessController.speed_est",
            "--csv",
            "-",
        ]);
        let csv = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{}: {}", motor.display(), String::from_utf8_lossy(&output.stderr));
        let last: Vec<f64> = csv.lines().last().unwrap().split(',').map(|x| x.parse().unwrap()).collect();
        assert!((last[1] / speed - 1.0).abs() < 0.02, "{}: {} rad/s, not {speed}", motor.display(), last[1]);
        assert!((last[2] / last[1] - 1.0).abs() < 0.02, "{}: estimated {} rad/s", motor.display(), last[2]);
    }
}

/// The parameters in examples/drive-train are those that `fmu tune` writes today; `UPDATE_GOLDEN=1 cargo test --test tune`
/// accepts others.
#[test]
fn the_examples_have_the_parameters_of_today() {
    let dir = tempfile::tempdir().unwrap();
    let vehicle = ["--estimator", "Sensored", "--control", "torque", "--shaft", "imposed"];
    for (machine, more) in [("traction-100kw", &vehicle[..]), ("ipmsm-2.2kw", &[]), ("servo-6.6kw", &[])] {
        let motor = motors().into_iter().find(|p| p.file_stem().unwrap() == machine).unwrap();
        let words = ["tune", motor.to_str().unwrap(), "--integers", "--out", dir.path().to_str().unwrap()];
        let tuned = fmu(&[&words[..], more].concat());
        assert!(tuned.status.success(), "{}", String::from_utf8_lossy(&tuned.stderr));
        let name = format!("{machine}.PmsmDrive.ssv");
        let written = std::fs::read_to_string(dir.path().join(&name)).unwrap();
        let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/drive-train").join(&name);
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            std::fs::write(&kept, &written).unwrap();
        }
        assert_eq!(written, std::fs::read_to_string(&kept).unwrap(), "{}", kept.display());
    }
}

/// The start values are the paper's, with R^ = 0.9 R; `fmu tune` lets the observer measure R^ instead, from R = 2 Ohm.
#[test]
fn the_reference_motor_gives_the_start_values_of_the_controller() {
    let path = motors().into_iter().find(|p| p.ends_with("reference.toml")).unwrap();
    let (adapting, tuned) = (tune::tune(&path).unwrap(), rules::fixed(&MotorFile::read(&path).unwrap()).unwrap());
    let other = |setting: &&Setting| !tuned.controller.contains(setting);
    let names: Vec<_> = adapting.controller.iter().filter(other).map(|setting| setting.name).collect();
    let adaptation = ["resistance", "start", "bandwidth", "i"].map(|name| format!("adaptation.{name}"));
    assert!(names[0] == "motor.R_s" && names[1..] == adaptation, "{names:?}");
    assert_eq!(adapting.real("motor.R_s"), Some(2.0));
    let description = fmu_core::Description::of::<drive::SensorlessController>().unwrap();
    let mut compared = 0;
    for setting in &tuned.controller {
        let start = &description.variable(setting.name).unwrap().start.as_ref().unwrap()[0];
        if let (Value::Real(x), fmu_core::description::Value::Real(start)) = (&setting.value, start) {
            assert!((x - start).abs() <= 1e-6 * start.abs(), "{}: {x}, start value {start}", setting.name);
            compared += 1;
        }
    }
    assert!(compared > 15, "{compared} values");
}

#[test]
fn values_are_those_of_the_rules() {
    let path = motors().into_iter().find(|p| p.ends_with("ipmsm-2.2kw.toml")).unwrap();
    let tuned = tune::tune(&path).unwrap();
    let text = ssv::text("x", &tuned.controller);
    for (name, value) in [
        ("motor.R_s", "3.24"),
        ("estimator", "ExtendedEmf"),
        ("start.mode", "CurrentFrequency"),
        ("current.mtpa", "true"),
    ] {
        let parameter = read(&text).unwrap().into_iter().find(|p| p.name == name).unwrap();
        let same = parameter.value == value
            || (parameter.value.parse::<f64>().unwrap() - value.parse::<f64>().unwrap()).abs() < 1e-12;
        assert!(same, "{parameter:?}");
    }
}

/// Exactly the values that differ from the start values are written; enumerations as integers on demand.
#[test]
fn files_have_what_differs_from_the_start_values() {
    let starts = [
        fmu_core::Description::of::<drive::PmsmPlant>().unwrap(),
        fmu_core::Description::of::<drive::SensorlessController>().unwrap(),
    ];
    let start = |description: &fmu_core::Description, name: &str| {
        use fmu_core::description::{Value, VariableKind};
        let variable = description.variable(name).unwrap();
        let item = |i: i128| match &variable.kind {
            VariableKind::Enumeration { items, .. } => {
                items.iter().find(|(value, ..)| i128::from(*value) == i).unwrap().1.clone()
            }
            _ => i.to_string(),
        };
        match &variable.start.as_ref().unwrap()[0] {
            Value::Real(x) => x.to_string(),
            Value::Integer(i) => item(*i),
            Value::Boolean(b) => b.to_string(),
            Value::Text(text) => text.clone(),
            Value::Binary(_) => unreachable!("the drive has no bytes"),
        }
    };
    for path in motors() {
        let tuned = rules::fixed(&MotorFile::read(&path).unwrap()).unwrap();
        let (plant, controller) = tune::needed(&tuned, false).unwrap();
        for ((description, all), needed) in
            starts.iter().zip([&tuned.plant, &tuned.controller]).zip([plant, controller])
        {
            let written = |settings| read(&ssv::text("x", settings)).unwrap();
            let differs = |p: &Parameter| start(description, &p.name) != p.value;
            let values =
                |parameters: Vec<Parameter>| -> Vec<_> { parameters.into_iter().map(|p| (p.name, p.value)).collect() };
            let expected = written(all).into_iter().filter(differs).collect();
            assert_eq!(values(written(&needed)), values(expected), "{}: {}", path.display(), description.name);
        }
    }
    let salient = motors().into_iter().find(|p| p.ends_with("ipmsm-2.2kw.toml")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let tuned = fmu(&["tune", salient.to_str().unwrap(), "--integers", "--out", dir.path().to_str().unwrap()]);
    assert!(tuned.status.success(), "{}", String::from_utf8_lossy(&tuned.stderr));
    let text = std::fs::read_to_string(dir.path().join("ipmsm-2.2kw.SensorlessController.ssv")).unwrap();
    for parameter in ["\"estimator\"><ssv:Integer value=\"4\"/>", "\"start.mode\"><ssv:Integer value=\"2\"/>"] {
        assert!(text.contains(parameter), "{parameter} is not in {text}");
    }
    assert!(!text.contains("\"motor.n_p\""), "3 pole pairs are the start value");
}

/// The reference motor with one line changed.
fn changed(from: &str, to: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("motors/reference.toml");
    let text = std::fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{from}");
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("m.toml");
    std::fs::write(&file, text.replacen(from, to, 1)).unwrap();
    format!("{:#}", tune::tune(&file).map(|_| ()).expect_err("must be refused"))
}

#[test]
fn a_wrong_file_is_told_with_place_and_remedy() {
    let refused = |from: &str, to: &str, parts: &[&str]| {
        let error = changed(from, to);
        for part in parts {
            assert!(error.contains(part), "{part:?} is not in {error}");
        }
        assert_eq!(error.lines().count(), 1, "{error}");
    };
    refused("R_s = 2.0", "R = 2.0", &["m.toml:7:1", "unknown field `R`", "R_s"]);
    refused("L_q = 6e-3     # H\n", "", &["m.toml:5:1", "missing field `L_q`", "reference.toml"]);
    refused("L_q = 6e-3", "L_q = \"6 mH\"", &["m.toml:9:7", "invalid type", "f64"]);
    refused("n_p = 3 ", "n_p = 2.5 ", &["m.toml:6:7", "invalid type", "i32"]);
    refused("n_p = 3 ", "n_p = 0 ", &["m.toml:6:7", "motor.n_p", "at least 1"]);
    refused("R_s = 2.0", "R_s = -2.0", &["m.toml:7:7", "motor.R_s of PmsmPlant = -2", "greater than 0"]);
    refused("J = 1.5e-3", "J = nan", &["m.toml:13:5", "mechanics.J"]);
    refused("torque = 2.5", "torque = -1", &["m.toml:20:10", "rating.torque", "greater than 0"]);
    refused("speed = 80.0", "speed = 180.0", &["m.toml:28:", "a third of bandwidth.observer", "lower the former"]);
    refused(
        "current = 7.5",
        "current = 4.0",
        &["rating.current", "the maximum current", "K = 1.5 n_p psi_M", "raise it"],
    );
    refused("observer = 300.0", "observer = 100.0", &["bandwidth"]);
    refused("speed = 314.159265", "speed = 3141.59", &["rating.speed", "u_dc"]);
    refused(
        "[bandwidth]",
        "[control]\nestimator = \"Luenberger\"\n[bandwidth]",
        &["Luenberger", "choose one of Rasmussen, DirectEmf"],
    );
    refused("[bandwidth]", "[bandwidth", &["m.toml:26:"]);
}

/// The estimator of the command line is used in the files, and with `--json`; an unknown name is refused before anything is
/// written.
#[test]
fn the_estimator_of_the_command_line_counts() {
    let motor = Path::new(env!("CARGO_MANIFEST_DIR")).join("motors/reference.toml");
    let (motor, dir) = (motor.to_str().unwrap(), tempfile::tempdir().unwrap());
    let out = dir.path().join("out");
    let folder = ["--out", out.to_str().unwrap()];
    for (name, by) in [("ExtendedEmf", &folder[..]), ("Rasmussen", &folder), ("ExtendedEmf", &["--json"])] {
        let tuned = fmu(&[&["tune", motor, "--estimator", name], by].concat());
        assert!(tuned.status.success(), "{}", String::from_utf8_lossy(&tuned.stderr));
        let written = std::fs::read_to_string(out.join("reference.SensorlessController.ssv")).unwrap_or_default();
        let json = String::from_utf8(tuned.stdout).unwrap();
        let start = if by == folder { written.contains("start.mode") } else { json.contains("\"start.mode\"") };
        assert_eq!(start, name == "ExtendedEmf", "{name} {by:?}");
    }
    std::fs::remove_dir_all(&out).unwrap();
    for by in [&folder[..], &["--json"]] {
        let refused = fmu(&[&["tune", motor, "--estimator", "Luenberger"], by].concat());
        let said = String::from_utf8(refused.stderr).unwrap();
        assert_eq!(refused.status.code(), Some(2), "{said}");
        assert!(
            said.contains("estimator Luenberger: is not an estimator; choose one of Rasmussen, DirectEmf, EmfObserver"),
            "{said}"
        );
        assert!(!out.exists() && refused.stdout.is_empty());
    }
}

#[test]
fn the_check_prints_what_holds_and_what_was_announced() {
    let motor = motors().into_iter().find(|p| p.ends_with("ipmsm-2.2kw.toml")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().to_str().unwrap();
    // A slow speed loop: a step of the rated torque takes more than the speed at 0.1 pu.
    let light = dir.path().join("light.toml");
    let given = Path::new(env!("CARGO_MANIFEST_DIR")).join("drive-tools/tests/verdicts/machines/light-24v.toml");
    std::fs::write(&light, std::fs::read_to_string(given).unwrap() + "[bandwidth]\nspeed = 60.0\n").unwrap();
    let checked = |motor: &Path, ends: [&str; 3]| {
        let checked = fmu(&["tune", motor.to_str().unwrap(), "--check", "--out", out]);
        let text = String::from_utf8(checked.stdout).unwrap();
        assert_eq!(checked.status.code(), Some(0), "{text}");
        let rows: Vec<_> = text.lines().filter(|line| line.contains(" pu  24 of 24 ")).collect();
        let rest = text.lines().find(|line| line.starts_with("under the rated torque from rest: 0.5 pu reached from "));
        let carried = rest.expect("the start under a load").ends_with("from 24 of 24 angles");
        assert_ne!(
            carried,
            text.contains("note: under the rated torque from rest, the drive gets to 0.5 pu from "),
            "{text}"
        );
        assert!(rows.len() == 3 && rows.iter().zip(ends).all(|(row, end)| row.ends_with(end)), "{text}");
        text
    };
    let text = checked(&motor, ["deg   holds"; 3]);
    assert!(!text.contains("will not hold") && text.contains("K = 1.5 n_p psi_M = 2.4525 N.m/A"), "{text}");
    let lost = "does not hold: see the note";
    let text = checked(&light, [lost, lost, "deg   holds"]);
    for printed in
        ["note: will not hold LOAD at 0.1 pu: a step of the rated torque", "; let the load rise over at least 0.27 s"]
    {
        assert!(text.contains(printed), "{printed:?} is not in {text}");
    }
    // Without --check the notes are the same.
    let printed = fmu(&["tune", light.to_str().unwrap(), "--out", out]);
    let plain = String::from_utf8(printed.stdout).unwrap();
    let notes =
        |text: &str| text.lines().filter(|line| line.starts_with("note:")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(notes(&plain), notes(&text));
    // A wrong unit, in one line.
    let absurd = dir.path().join("m.toml");
    let given = std::fs::read_to_string(&motor).unwrap();
    std::fs::write(&absurd, given.replacen("L_d = 36e-3", "L_d = 36.0", 1)).unwrap();
    let refused = fmu(&["tune", absurd.to_str().unwrap(), "--out", out]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{said}");
    assert!(said.contains("L_d = 36 H") && said.contains("36 mH would fit") && said.lines().count() == 1, "{said}");
}

/// The file of `PmsmDrive` has the values of both others.
#[test]
fn the_drive_has_the_values_of_plant_and_controller() {
    let description = fmu_core::Description::of::<drive::PmsmDrive>().unwrap();
    for path in motors() {
        let tuned = rules::fixed(&MotorFile::read(&path).unwrap()).unwrap();
        let (plant, controller) = tune::needed(&tuned, false).unwrap();
        let drive = tune::of_drive(&tuned, false).unwrap();
        for (name, value) in &drive {
            assert!(description.variable(name).is_some(), "PmsmDrive has no {name}");
            let (settings, own) = match name.split_once('.') {
                Some(("controller", own)) => (&controller, own),
                Some(("plant", own)) => (&plant, own),
                _ => (&plant, name.as_str()),
            };
            assert_eq!(settings.iter().find(|s| s.name == own).map(|s| &s.value), Some(value), "{name}");
        }
        let shared = plant.iter().chain(&controller).filter(|s| s.name == "u_dc").count();
        assert_eq!(drive.len() + shared.saturating_sub(1), plant.len() + controller.len(), "{}", path.display());
    }
}

/// Without a checkout: the example's file is in the command, and the values go to the current folder.
#[test]
fn a_motor_file_is_enough_outside_a_checkout() {
    let dir = tempfile::tempdir().unwrap();
    let outside = |arguments: &[&str]| {
        Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).current_dir(dir.path()).output().unwrap()
    };
    let example = outside(&["tune", "--example"]);
    assert!(example.status.success());
    std::fs::write(dir.path().join("motor.toml"), &example.stdout).unwrap();
    let tuned = outside(&["tune", "motor.toml"]);
    let said = String::from_utf8(tuned.stdout).unwrap();
    assert!(tuned.status.success() && said.ends_with("tune/ipmsm-2.2kw.SensorlessController.ssv\n"), "{said}");
    assert!(dir.path().join("tune/ipmsm-2.2kw.PmsmDrive.ssv").is_file());
    let refused = outside(&["tune", "none.toml"]);
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(refused.status.code() == Some(2) && said.lines().count() == 1 && said.contains("none.toml"), "{said}");
}

/// docs/identify.md: the commands from a record to a running drive, and from a motor on the table, exactly as printed. `fmu
/// build` has run and written its archive.
#[test]
fn a_record_and_a_commissioning_become_running_drives() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = tempfile::tempdir().unwrap();
    let copy = |from: &Path, to: &str| {
        let to = dir.path().join(to);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(from, to).unwrap();
    };
    copy(&root.join("examples/bench.csv"), "examples/bench.csv");
    copy(&common::archives().join("fmi3/PmsmDrive.fmu"), "target/fmu/fmi3/PmsmDrive.fmu");
    let page = std::fs::read_to_string(root.join("docs/identify.md")).unwrap();
    let (record, table) = page.split_once("## A motor on the table").unwrap();
    // A commissioning of the example does not separate B from the Coulomb friction.
    for (section, name, status) in [(record, "bench", 0), (table, "table", 1)] {
        let block =
            |language: &str| section.split_once(&format!("```{language}\n")).unwrap().1.split_once("\n```").unwrap().0;
        let mut last = String::new();
        for line in block("sh").lines() {
            let words: Vec<_> = line.split_whitespace().collect();
            if words[..2] == ["fmu", "build"] {
                assert_eq!(words[2..], ["PmsmDrive", "--fmi", "3"]);
                continue;
            }
            let command =
                Command::new(env!("CARGO_BIN_EXE_fmu")).args(&words[1..]).current_dir(dir.path()).output().unwrap();
            let identifies = words[1] == "identify";
            let expected = if identifies { status } else { 0 };
            let said = String::from_utf8_lossy(&command.stderr);
            assert_eq!(command.status.code(), Some(expected), "{line}: {said}");
            last = String::from_utf8(command.stdout).unwrap();
            if identifies {
                let values: Vec<_> = last.lines().take_while(|line| !line.is_empty()).collect();
                assert_eq!(values.join("\n"), block("text"), "docs/identify.md shows other values");
            }
        }
        // 78.5 rad/s are 749.6 rpm.
        assert!(last.contains("speed_ref 749.6 rpm"), "{last}");
        let speed = last.split_once("speed ").unwrap().1.split_once(" rpm").unwrap().0;
        assert!((speed.parse::<f64>().unwrap() / 749.6 - 1.0).abs() < 0.005, "{last}");
        let files = ["NAME.toml", "NAME.html", "tune/NAME.PmsmDrive.ssv", "run.html"];
        for file in files.map(|file| file.replace("NAME", name)) {
            assert!(dir.path().join("target").join(&file).metadata().unwrap().len() > 500, "{file}");
        }
    }
}

/// `fmu identify`: 1 and a file with a comment where a value is refused; 2, one line and no file for a wrong record.
#[test]
fn a_refusal_and_a_wrong_record_have_their_exit_status() {
    let dir = tempfile::tempdir().unwrap();
    let record = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/bench.csv")).unwrap();
    let run = |text: &str, name: &str| {
        let (csv, out) = (dir.path().join(name).with_extension("csv"), dir.path().join(name).with_extension("toml"));
        std::fs::write(&csv, text).unwrap();
        let (csv, file) = (csv.to_str().unwrap(), out.to_str().unwrap());
        let given = ["--n-p", "3", "--current", "15", "--delay", "0", "--every", "5", "--json", "--out"];
        (fmu(&[&["identify", csv], &given[..], &[file]].concat()), out)
    };
    let (unloaded, out) = run(&record.replace("tau_load", "note"), "unloaded");
    assert_eq!(unloaded.status.code(), Some(1));
    let text = std::fs::read_to_string(out).unwrap();
    assert!(text.contains("refused: the load is unknown: add tau_load or tau_shaft, or give --load none"), "{text}");
    let json: serde_json::Value = serde_json::from_slice(&unloaded.stdout).unwrap();
    assert!(json["values"]["J"]["value"].is_null() && json["values"]["R_s"]["refused"].is_null(), "{json}");
    let (wrong, out) = run(&record.replace("u_ab [V]", "u_ab [mA]"), "wrong");
    let message = String::from_utf8(wrong.stderr).unwrap();
    assert_eq!(wrong.status.code(), Some(2), "{message}");
    assert!(message.contains("u_ab [mA]: the unit is not known") && message.lines().count() == 1, "{message}");
    assert!(!out.exists() && wrong.stdout.is_empty());
}
