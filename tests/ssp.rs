//! The closed loop as an SSP file: written by `fmu ssp`, run by `fmu simulate`, and the messages about wrong files.
#![allow(missing_docs)]

mod common;

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

/// A folder with `fmi2.ssp` and `fmi3.ssp` without values, and `motor.ssp` of FMI 2.0 with those of a machine.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("ssp-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
        done(&["ssp", "--out", &path("fmi2.ssp")]);
        done(&["ssp", "--fmi", "3", "--out", &path("fmi3.ssp")]);
        let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
        done(&["ssp", "--motor", motor, "--out", &path("motor.ssp")]);
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

/// Features that some importers refuse are written only on demand, and the file contains the stepping method for OMSimulator.
#[test]
fn what_not_every_importer_takes_is_an_option() {
    let folder = folder();
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    done(&["ssp", "--motor", motor, "--names", "--gates", "--geometry", "--out", &path("all.ssp")]);
    let (plain, all) = (ssp("motor.ssp"), ssp("all.ssp"));
    let structure = |path: &str| entry(path, "SystemStructure.ssd");
    for part in ["<ssd:SystemGeometry ", "startConnector=\"enabled\" endElement=\"plant\" endConnector=\"enable\""] {
        assert!(!structure(&plain).contains(part) && structure(&all).contains(part), "{part}");
    }
    let master = "<oms:FixedStepMaster description=\"oms-ma\" stepSize=\"0.0001\" relativeTolerance=\"0.0001\"/>";
    let python = "<oms:SimulationInformation name=\"oms_ma_default\" method=\"oms_ma\" fixedStepSize=\"0.0001\">";
    assert!(structure(&plain).contains("<ssc:Annotation type=\"org.openmodelica\">"));
    assert!(structure(&plain).contains(python));
    assert!(structure(&plain).contains(master), "the step is T_s");
    let values = |path: &str| entry(path, "resources/controller.ssv");
    assert!(values(&all).contains("<ssv:Parameter name=\"estimator\"><ssv:Enumeration value=\"ExtendedEmf\"/>"));
    assert!(values(&plain).contains("<ssv:Parameter name=\"estimator\"><ssv:Integer value=\"4\"/>"));
    done(&["ssp", "--motor", motor, "--integers", "--out", &path("integers.ssp")]);
    assert!(values(&path("integers.ssp")) == values(&plain), "the default");
    // None of it changes the results.
    let run = |path: &str| {
        let time = ["--input", "speed_ref=0:0,0.02:52.36", "--stop", "0.3", "--csv", "-"];
        done(&[&["simulate", path][..], &time].concat())
    };
    assert!(run(&plain) == run(&all));
    let slower = std::fs::read_to_string(motor).unwrap().replace("[control]\n", "[control]\nT_s = 2e-4\n");
    let slower = if slower.contains("T_s") { slower } else { slower + "\n[control]\nT_s = 2e-4\n" };
    std::fs::write(folder.join("slower.toml"), slower).unwrap();
    done(&["ssp", "--motor", &path("slower.toml"), "--out", &path("slower.ssp")]);
    assert!(structure(&ssp("slower.ssp")).contains("stepSize=\"0.0002\""));
}

/// The input that OMSimulator accepts, from its sources: it stops at any other element, at a name that is not an identifier and
/// at a connector without a type, and it ignores a value whose type differs from the variable's.
#[test]
fn omsimulator_runs_it_as_it_is() {
    let folder = folder();
    let tuned = folder.join("tuned");
    let motor = concat!(env!("CARGO_MANIFEST_DIR"), "/motors/ipmsm-2.2kw.toml");
    done(&["tune", motor, "--out", tuned.to_str().unwrap()]);
    let of = |component: &str, fmu: &str| format!("{component}={}/ipmsm-2.2kw.{fmu}.ssv", tuned.display());
    let given = [of("plant", "PmsmPlant"), of("controller", "SensorlessController")];
    let (bound, geometry) = (folder.join("bound.ssp"), folder.join("geometry.ssp"));
    done(&["ssp", "--parameters", &given[0], "--parameters", &given[1], "--out", bound.to_str().unwrap()]);
    done(&["ssp", "--geometry", "--out", geometry.to_str().unwrap()]);
    for name in ["fmi2.ssp", "fmi3.ssp", "motor.ssp", "bound.ssp"] {
        assert_eq!(refusals(&ssp(name)), Vec::<String>::new(), "{name}");
    }
    assert_eq!(refusals(&ssp("geometry.ssp")), ["System.cpp: ssd:SystemGeometry in ssd:System"]);
    // The values of a motor are the same by every route.
    for component in ["plant", "controller"] {
        let file = format!("resources/{component}.ssv");
        assert!(entry(&ssp("motor.ssp"), &file) == entry(&ssp("bound.ssp"), &file), "{component}");
    }
    // Each name that OMSimulator refuses is found.
    for (old, new, expected) in [
        (
            "name=\"tau_load\" kind=\"input\"",
            "name=\"tau.load\" kind=\"input\"",
            "ComRef.cpp: tau.load is no identifier",
        ),
        ("<ssc:Boolean/>", "", "Connector.cpp: voltage_limited has no type"),
        ("oms-ma", "oms-mav", "SystemWC.cpp: the master oms-mav"),
    ] {
        let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, new);
        assert!(refusals(&path).iter().any(|found| found == expected), "{expected}: {:?}", refusals(&path));
    }
    let (old, new) = ("<ssv:Integer value=\"4\"/>", "<ssv:Enumeration value=\"ExtendedEmf\"/>");
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/controller.ssv", old, new);
    assert_eq!(refusals(&path), ["Values.cpp: controller.estimator is ssv:Enumeration, not ssv:Integer"]);
}

/// Parts of an SSP that OMSimulator refuses or ignores, with the source file.
fn refusals(path: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut refuse = |file: &str, what: String| found.push(format!("{file}: {what}"));
    let root = Element::parse(&entry(path, "SystemStructure.ssd")).unwrap();
    let mut only = |file: &str, parent: &Element, names: &[&str]| {
        for child in parent.children.iter().filter(|child| !names.contains(&child.name.as_str())) {
            refuse(file, format!("{} in {}", child.name, parent.name));
        }
    };
    let (system, experiment) = (root.child("ssd:System").unwrap(), root.child("ssd:DefaultExperiment").unwrap());
    let element = ["ssd:Connectors", "ssd:ElementGeometry", "ssd:ParameterBindings"];
    only("Model.cpp", &root, &["ssd:System", "ssd:Units", "ssd:Enumerations", "ssd:DefaultExperiment"]);
    only("System.cpp", system, &[&element[..], &["ssd:Elements", "ssd:Connections", "ssd:Annotations"]].concat());
    let components: Vec<&Element> = system.child("ssd:Elements").unwrap().all("ssd:Component").collect();
    for component in &components {
        only("ComponentFMUCS.cpp", component, &element);
    }
    let is_identifier = |name: &str| {
        name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
    };
    let mut base = BTreeMap::new();
    for owner in components.iter().copied().chain([system]) {
        let owned = owner.get("name").unwrap();
        let connectors: Vec<&Element> = owner.child("ssd:Connectors").unwrap().children.iter().collect();
        let names = connectors.iter().map(|c| c.get("name").unwrap()).chain([owned]);
        for name in names.filter(|name| !is_identifier(name)) {
            refuse("ComRef.cpp", format!("{name} is no identifier"));
        }
        for connector in connectors {
            let name = connector.get("name").unwrap();
            assert!(["input", "output"].contains(&connector.get("kind").unwrap()), "{name}");
            if !["ssc:Real", "ssc:Integer", "ssc:Boolean"].iter().any(|base| connector.child(base).is_some()) {
                refuse("Connector.cpp", format!("{name} has no type"));
            }
        }
        for binding in owner.child("ssd:ParameterBindings").into_iter().flat_map(|all| &all.children) {
            assert!(binding.attributes.iter().all(|(name, _)| name == "source"), "Values.cpp knows no prefix");
            let values = Element::parse(&entry(path, binding.get("source").unwrap())).unwrap();
            for parameter in &values.child("ssv:Parameters").unwrap().children {
                let port = format!("{owned}.{}", parameter.get("name").unwrap());
                assert!(base.insert(port, parameter.children[0].name.clone()).is_none());
            }
        }
        if let Some(source) = owner.get("source") {
            let description = component_description(path, source);
            for v in &description.variables {
                let expected = match v.base {
                    BaseType::Float64 => "ssv:Real",
                    BaseType::Boolean => "ssv:Boolean",
                    _ => "ssv:Integer",
                };
                let port = format!("{owned}.{}", v.name);
                if let Some(given) = base.get(&port).filter(|given| *given != expected) {
                    refuse("Values.cpp", format!("{port} is {given}, not {expected}"));
                }
            }
        }
    }
    // Both annotations are there, one of its type and one with its element.
    let own = |parent: &'_ Element| {
        let annotation = parent.child("ssd:Annotations")?.child("ssc:Annotation")?.clone();
        let is_own = annotation.get("type") == Some("org.openmodelica");
        annotation.child("oms:Annotations")?.child("oms:SimulationInformation").filter(|_| is_own).cloned()
    };
    if own(experiment).is_none() {
        refuse("Model.cpp", "deprecated content".into());
    }
    let master = own(system).unwrap().child("oms:FixedStepMaster").unwrap().get("description").unwrap().to_owned();
    if master != "oms-ma" {
        refuse("SystemWC.cpp", format!("the master {master}"));
    }
    found
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

/// SSPs of other tools: a connection has no direction, a prefix is added to names, and the times of the system override those of
/// its parts.
#[test]
fn what_other_tools_write_runs_too() {
    let run = |path: &str, stop: &[&str]| {
        let arguments = ["simulate", path, "--input", "speed_ref=0:0,0.01:50", "--csv", "-"];
        done(&[&arguments[..], stop].concat())
    };
    let (structure, until) = ("SystemStructure.ssd", ["--stop", "0.05"]);
    let expected = run(&ssp("motor.ssp"), &until);
    let (_dir, turned) = changed(
        &ssp("motor.ssp"),
        structure,
        "startElement=\"controller\" startConnector=\"u_a\" endElement=\"plant\"",
        "startElement=\"plant\" startConnector=\"u_a\" endElement=\"controller\"",
    );
    assert!(run(&turned, &until) == expected, "a connection from its input to its output");
    // The plant's values are bound to the system, with the plant's name before theirs.
    let inner = "<ssd:ParameterBinding source=\"resources/plant.ssv\"/>";
    let outer = "<ssd:ParameterBinding source=\"resources/SensorlessDrive.ssv\"/>";
    let both = format!("{outer}{}", inner.replace(" source=", " prefix=\"plant.\" source="));
    let (_dir, without) = changed(&ssp("motor.ssp"), structure, inner, &outer.replace("SensorlessDrive", "none"));
    let (_dir_too, prefixed) = changed(&without, structure, outer, &both);
    let none = "<ssd:ParameterBinding source=\"resources/none.ssv\"/>";
    let (_dir_three, prefixed) = changed(&prefixed, structure, none, "");
    assert!(run(&prefixed, &until) == expected, "values with a prefix");
    let (_dir, late) =
        changed(&ssp("motor.ssp"), structure, "startTime=\"0\" stopTime=\"1\"", "startTime=\"0.5\" stopTime=\"0.7\"");
    let csv = run(&late, &[]);
    let times: Vec<&str> = csv.lines().skip(1).map(|line| line.split(',').next().unwrap()).collect();
    assert_eq!((times[0], times[times.len() - 1]), ("0.5", "0.7"));
}

#[test]
fn a_wrong_structure_is_told_with_file_line_and_remedy() {
    let connection = |to: &str| {
        format!("startElement=\"controller\" startConnector=\"u_a\" endElement=\"plant\" endConnector=\"{to}\"")
    };
    let good = connection("u_a");
    for (old, new, parts) in [
        (&*good, connection("u_x"), &["plant has no connector u_x; it has u_a, u_b"][..]),
        (
            &*good,
            connection("i_a"),
            &["connects controller.u_a (output) with plant.i_a (output): expected an output and an input"],
        ),
        (&*good, connection("u_b"), &["plant.u_b is fed twice: remove one of the connections"]),
        (
            "startConnector=\"enabled\" endConnector=\"enabled\"",
            "startConnector=\"enabled\" endConnector=\"lock_lost\"".into(),
            &["the output lock_lost is connected twice: remove one of the connections"],
        ),
        (
            &*good,
            good.replace("\"plant\"", "\"motor\""),
            &["there is no component motor; available: controller, plant"],
        ),
        (
            "source=\"resources/PmsmPlant.fmu\"",
            "source=\"resources/Motor.fmu\"".into(),
            &["has no resources/Motor.fmu"],
        ),
    ] {
        let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, &new);
        let place = if new.contains("Motor.fmu") { "x.ssp: " } else { "x.ssp: SystemStructure.ssd: line " };
        fails(&["simulate", &path], 2, &[&[path.as_str(), place], parts].concat());
    }
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", "</ssd:System>", "</ssd:Systm>");
    fails(&["simulate", &path], 2, &["x.ssp: SystemStructure.ssd: line", "not well-formed XML"]);
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", "unit=\"rad/s\"", "unit=\"rpm\"");
    let output = fmu(&["simulate", &path, "--stop", "0.001"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("and rpm has no BaseUnit: the number passes unchanged"), "{said}");
    for (base, cause) in
        [("rad=\"1\" s=\"-1\" factor=\"0.1047\"", ""), ("m=\"1\"", "the source is in rpm = m, the target in rad/s")]
    {
        let units =
            format!("</ssd:System><ssd:Units><ssc:Unit name=\"rpm\"><ssc:BaseUnit {base}/></ssc:Unit></ssd:Units>");
        let (_defined, path) = changed(&path, "SystemStructure.ssd", "</ssd:System>", &units);
        if cause.is_empty() {
            done(&["simulate", &path, "--stop", "0.001"]);
        } else {
            fails(&["simulate", &path], 2, &["x.ssp: ", ": line ", cause]);
        }
    }
    let (old, new) = ("implementation=\"CoSimulation\"", "implementation=\"ModelExchange\"");
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, new);
    fails(
        &["simulate", &path],
        2,
        &["x.ssp: SystemStructure.ssd: line", "is not Co-Simulation: simulate it with --me"],
    );
    let plain = folder().join("plain.ssp");
    std::fs::write(&plain, "hello").unwrap();
    fails(&["simulate", plain.to_str().unwrap()], 2, &["plain.ssp: not a ZIP archive"]);
    let fmu = common::archives().join("fmi2/PmsmPlant.fmu").display().to_string();
    fails(&["simulate", &ssp("fmi2.ssp"), &fmu], 2, &["fmi2.ssp: an SSP is simulated alone"]);
    fails(
        &["simulate", &ssp("fmi2.ssp"), "--input", "speed_rev=1"],
        2,
        &["--input speed_rev=1: is not an input of the system", "speed_ref"],
    );
}

#[test]
fn wrong_values_are_told_with_file_line_and_remedy() {
    let parameters = |old: &str, new: &str| {
        let text = entry(&ssp("motor.ssp"), "resources/plant.ssv");
        assert!(text.contains(old), "{old}");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.ssv");
        std::fs::write(&path, text.replacen(old, new, 1)).unwrap();
        (dir, path.to_str().unwrap().to_owned())
    };
    let out = folder().join("never.ssp");
    let out = out.to_str().unwrap();
    for (old, new, status, part) in [
        ("motor.R_s", "motor.R", 2, "PmsmPlant has no variable motor.R: correct the name, or remove the parameter"),
        ("value=\"3.6\"", "value=\"3.6\" unit=\"mOhm\"", 2, "motor.R_s is given in mOhm, but PmsmPlant has it in Ohm"),
        ("value=\"3.6\"", "value=\"much\"", 2, "motor.R_s = much"),
        ("value=\"3.6\"", "value=\"-1\"", 1, "motor.R_s = -1 is not allowed"),
    ] {
        let (_dir, path) = parameters(old, new);
        fails(&["ssp", "--parameters", &format!("plant={path}"), "--out", out], status, &["p.ssv: line ", part]);
    }
    let (_dir, path) = parameters("motor.R_s", "motor.R_s");
    fails(
        &["ssp", "--parameters", &format!("p={path}"), "--out", out],
        2,
        &["no component p; available: controller, plant"],
    );
    fails(&["ssp", "--parameters", "plant=nothing.ssv", "--out", out], 2, &["nothing.ssv: No such file"]);
    let dir = tempfile::tempdir().unwrap();
    let motor = dir.path().join("m.toml");
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/motors/reference.toml")).unwrap();
    std::fs::write(&motor, text.replacen("R_s", "R", 1)).unwrap();
    fails(&["ssp", "--motor", motor.to_str().unwrap(), "--out", out], 2, &["m.toml:7:1: unknown field `R`", "R_s"]);
    assert!(!Path::new(out).exists());
    // In an SSP a value for an unknown name is ignored (SSP 1.0) with a note; a wrong value is an error.
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/plant.ssv", "motor.R_s", "motor.R");
    let output = fmu(&["simulate", &path, "--stop", "0.001"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success()
            && said.contains("resources/plant.ssv: line ")
            && said.contains("there is no plant.motor.R; the value is ignored"),
        "{said}"
    );
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/plant.ssv", "value=\"3.6\"", "value=\"-1\"");
    fails(
        &["simulate", &path, "--stop", "0.001"],
        1,
        &["x.ssp: resources/plant.ssv: line ", "motor.R_s = -1 is not allowed"],
    );
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
    refused(&["ssp", "--out", "none.ssp"], &["--fmus DIR takes those of a folder", "no Cargo package here"]);
    refused(&["reproduce"], &["no Cargo package here"]);
    assert!(!dir.path().join("none.ssp").exists());
}

/// A thing that a message names twice, as in `--record x: x: is no variable`.
fn repeated(message: &str) -> Option<&str> {
    let parts: Vec<&str> = message.split(": ").collect();
    let ends = |before: &str, name: &str| {
        let last = before.rsplit(' ').next().unwrap_or(before);
        before == name || last == name || last.split('=').next() == Some(name)
    };
    parts.windows(2).find(|pair| ends(pair[0], pair[1])).map(|pair| pair[1])
}

/// Bad input of every kind, in commands that name variables, files and lines.
#[test]
fn no_message_names_a_thing_twice() {
    assert_eq!(repeated("error: --record x: x: is no variable"), Some("x"));
    assert_eq!(repeated("error: --input x=0:1: x: is fed twice"), Some("x"));
    assert_eq!(repeated("error: a.ssp: line 3: b: is no a"), None);
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let plant = common::archives().join("fmi3/PmsmPlant.fmu").display().to_string();
    let system = ssp("fmi3.ssp");
    let csv = |name: &str, text: &str| file(name, text);
    let sweep = |name: &str, rest: &str| file(name, &format!("fmus = [{plant:?}]\nstop = 0.001\n{rest}"));
    let measure = "[measure]\na = { of = 'speed', is = 'final' }\n";
    let unknown_column = csv("unknown.csv", "time,speedy\n0,1\n");
    let wrong_cell = csv("cell.csv", "time,u_dc\n0,much\n");
    let no_time = csv("time.csv", "speed\n1\n");
    let values = csv(
        "values.ssv",
        "<ParameterSet><Parameters><Parameter name='no'><Real value='1'/></Parameter></Parameters></ParameterSet>",
    );
    let nothing = dir.path().join("nothing.fmu").display().to_string();
    let out = dir.path().join("out").display().to_string();
    let plain = file("plain.fmu", "hello");
    let table: Vec<(Vec<String>, &str)> = [
        (vec!["simulate", &plant, "--record", "speedy"], "speedy"),
        (vec!["simulate", &plant, "--record", "PmsmPlant.speedy"], "speedy"),
        (vec!["simulate", &plant, "--record", "q*"], "q*"),
        (vec!["simulate", &plant, "--input", "speedy=1"], "speedy"),
        (vec!["simulate", &plant, "--input", "speed=1"], "is not an input"),
        (vec!["simulate", &plant, "--input", "u_dc=much"], "much"),
        (vec!["simulate", &plant, "--input", "u_dc=0:1", "--input", "u_dc=0:2"], "is fed twice"),
        (vec!["simulate", &plant, "--input", &unknown_column], "speedy"),
        (vec!["simulate", &plant, "--input", &wrong_cell], "much"),
        (vec!["simulate", &plant, "--input", &no_time], "time.csv"),
        (vec!["simulate", &plant, "--set", "speedy=1"], "speedy"),
        (vec!["simulate", &plant, "--set", "motor.R_s=much"], "motor.R_s"),
        (vec!["simulate", &plant, "--set", "motor.R_s=-1"], "motor.R_s"),
        (vec!["simulate", &plant, "--connect", "speed=speedy"], "speedy"),
        (vec!["simulate", &plant, "--connect", "u_dc=u_a"], "is not an output"),
        (vec!["simulate", &plant, "--terminal", "a.b=c.d"], "a.b"),
        (vec!["simulate", &plant, "--parameters", &format!("PmsmPlant={values}")], "values.ssv"),
        (vec!["simulate", &nothing], "nothing.fmu"),
        (vec!["simulate", &plain], "plain.fmu"),
        (vec!["simulate", &system, "--record", "speedy"], "speedy"),
        (vec!["simulate", &system, "--record", "plant.speedy"], "speedy"),
        (vec!["simulate", &system, "--input", "speedy=1"], "speedy"),
        (vec!["simulate", &system, "--set", "u_dc=much"], "much"),
        (vec!["simulate", &format!("{system}#B.ssd")], "B.ssd"),
        (
            vec![
                "sweep",
                &sweep(
                    "a.toml",
                    &format!("design = {{ kind = 'grid' }}\n[vary]\nspeedy = {{ values = [1] }}\n{measure}"),
                ),
            ],
            "speedy",
        ),
        (
            vec![
                "sweep",
                &sweep(
                    "b.toml",
                    &format!("design = {{ kind = 'grid' }}\n[vary]\nspeed = {{ values = [1] }}\n{measure}"),
                ),
            ],
            "speed",
        ),
        (vec!["sweep", &sweep("c.toml", &format!("[input]\nspeedy = '1'\n{measure}"))], "speedy"),
        (vec!["sweep", &sweep("d.toml", "[measure]\na = { of = 'speedy', is = 'final' }\n")], "speedy"),
        (vec!["sweep", &sweep("e.toml", &format!("[set]\nspeedy = 1\n{measure}"))], "speedy"),
        (vec!["sweep", &sweep("f.toml", &format!("[set]\n'motor.R_s' = -1\n{measure}"))], "motor.R_s"),
        (vec!["sweep", &sweep("g.toml", &format!("conect = []\n{measure}"))], "conect"),
        (vec!["sweep", &nothing], "nothing.fmu"),
        (vec!["ssp", "--parameters", "plant=nothing.ssv", "--out", "x.ssp"], "nothing.ssv"),
        (vec!["ssp", "--fmus", "nothing", "--out", "x.ssp"], "nothing"),
        (vec!["check", &nothing], "nothing.fmu"),
        (vec!["check", &plant, "--only", "Q99"], "Q99"),
    ]
    .into_iter()
    .map(|(arguments, part)| (arguments.into_iter().map(str::to_owned).collect(), part))
    .collect();
    for (arguments, part) in table {
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        if arguments[0] == "sweep" {
            arguments.extend(["--out", &out]);
        }
        let output = fmu(&arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{arguments:?} succeeds");
        assert!(said.contains(part), "{arguments:?}: {part:?} is not in {said}");
        for line in said.lines() {
            assert_eq!(repeated(line), None, "{arguments:?}: {line}");
        }
    }
}
