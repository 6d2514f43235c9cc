//! The importer on our own FMUs: state, reset, values of every type, several instances.
#![allow(missing_docs, clippy::float_cmp)]

#[path = "../fmu-import/examples/co_simulation.rs"]
#[allow(dead_code, reason = "its main function")]
mod co_simulation;
mod common;
#[path = "../fmu-sweep/examples/sweep.rs"]
#[allow(dead_code, reason = "its main function")]
mod sweep;
#[path = "../fmu-system/examples/two_fmus.rs"]
#[allow(dead_code, reason = "its main function")]
mod two_fmus;

use fmu_import::{Error, Fmu, Instance, Values};
use fmu_system::cosimulation::{Integration, Method, Settings, System, Units};
use std::ops::ControlFlow;

fn open(standard: &str, name: &str) -> Fmu {
    Fmu::open(common::archives().join(standard).join(name).with_extension("fmu")).unwrap()
}

/// Runs `f` with each standard.
fn in_both(name: &str, f: impl Fn(&Fmu)) {
    for standard in ["fmi2", "fmi3"] {
        f(&open(standard, name));
    }
}

fn started(fmu: &Fmu) -> Result<Instance, Error> {
    let mut plant = fmu.instantiate("plant", false)?;
    plant.setup(0.0, None)?;
    plant.enter_initialization()?;
    plant.exit_initialization()?;
    Ok(plant)
}

/// Steps with a torque on the shaft; returns speed and angle.
fn steps(plant: &mut Instance, from: u32, to: u32) -> Result<[f64; 2], Error> {
    plant.set("tau_load", Values::Reals(vec![-1.0]))?;
    for k in from..to {
        assert!(plant.do_step(f64::from(k) * 1e-4, 1e-4)?.is_continue());
    }
    let references = [plant.variable("speed")?.value_reference, plant.variable("angle")?.value_reference];
    let mut values = [0.0; 2];
    plant.get_reals(&references, &mut values)?;
    Ok(values)
}

#[test]
fn a_saved_state_comes_back_in_the_same_and_in_another_instance() {
    in_both("PmsmPlant", |fmu| {
        let mut plant = started(fmu).unwrap();
        let _ = steps(&mut plant, 0, 50).unwrap();
        let state = plant.get_state().unwrap();
        let bytes = plant.serialize_state(state).unwrap();
        let there = steps(&mut plant, 50, 100).unwrap();
        plant.set_state(state).unwrap();
        assert_eq!(steps(&mut plant, 50, 100).unwrap(), there);
        plant.free_state(state).unwrap();
        assert!(plant.set_state(state).unwrap_err().to_string().contains("the state was freed"));

        let mut other = started(fmu).unwrap();
        let state = other.deserialize_state(&bytes).unwrap();
        other.set_state(state).unwrap();
        assert_eq!(steps(&mut other, 50, 100).unwrap(), there);
    });
}

#[test]
fn a_reset_instance_is_a_new_one() {
    in_both("PmsmPlant", |fmu| {
        let mut plant = started(fmu).unwrap();
        let first = steps(&mut plant, 0, 100).unwrap();
        plant.terminate().unwrap();
        plant.reset().unwrap();
        plant.setup(0.0, None).unwrap();
        plant.enter_initialization().unwrap();
        plant.exit_initialization().unwrap();
        assert_eq!(steps(&mut plant, 0, 100).unwrap(), first);
    });
}

#[test]
fn values_of_every_type() {
    in_both("SensorlessController", |fmu| {
        let mut controller = fmu.instantiate("controller", false).unwrap();
        for (name, text) in
            [("T_s", "0.0002"), ("motor.n_p", "4"), ("current.active_resistance", "true"), ("estimator", "Sensored")]
        {
            controller.set_text(name, text).unwrap();
        }
        controller.setup(0.0, None).unwrap();
        controller.enter_initialization().unwrap();
        assert_eq!(controller.get("T_s").unwrap(), Values::Reals(vec![2e-4]));
        assert_eq!(controller.get("motor.n_p").unwrap(), Values::Integers(vec![4]));
        assert_eq!(controller.get("current.active_resistance").unwrap(), Values::Booleans(vec![true]));
        assert_eq!(controller.get("estimator").unwrap(), Values::Integers(vec![13]));
        let wrong = controller.set("T_s", true).unwrap_err();
        assert_eq!(wrong.to_string(), "controller: true is not a value of the type Float64");
    });
}

#[test]
fn values_have_the_types_of_rust() {
    in_both("SensorlessController", |fmu| {
        let mut controller = fmu.instantiate("controller", false).unwrap();
        controller.set("T_s", 2e-4).unwrap();
        controller.set("motor.n_p", 4).unwrap();
        controller.set("current.active_resistance", true).unwrap();
        controller.set("estimator", 13_i64).unwrap();
        controller.setup(0.0, None).unwrap();
        controller.enter_initialization().unwrap();
        assert_eq!(controller.get_as("T_s"), Ok(2e-4));
        assert_eq!(controller.get_as("motor.n_p"), Ok(4_u16));
        assert_eq!(controller.get_as("current.active_resistance"), Ok(true));
        assert_eq!(controller.get_as("estimator"), Ok(13_i32));
        let wrong = controller.get_as::<bool>("T_s").unwrap_err();
        assert_eq!(wrong.to_string(), "controller: T_s = 0.0002 is not one Boolean");
    });
}

#[test]
fn a_wrong_name_comes_with_those_that_resemble_it() {
    in_both("PmsmPlant", |fmu| {
        let mut plant = fmu.instantiate("plant", false).unwrap();
        let error = plant.set("motor.R", 2.0).unwrap_err();
        assert_eq!(error.to_string(), "plant: has no variable motor.R; did you mean motor.R_s?");
        let Error::Variable { instance, name, similar } = error else { panic!("another error") };
        assert_eq!((instance.as_str(), name.as_str(), similar), ("plant", "motor.R", vec!["motor.R_s".to_owned()]));
    });
    let missing = Fmu::open("missing.fmu").err().unwrap();
    let source = std::error::Error::source(&missing).and_then(|source| source.downcast_ref::<std::io::Error>());
    assert_eq!(source.map(std::io::Error::kind), Some(std::io::ErrorKind::NotFound), "{missing}");
}

#[test]
fn the_examples_run() {
    let fmi3 = common::archives().join("fmi3");
    let drive = fmi3.join("PmsmDrive.fmu");
    let speed = co_simulation::run(&drive).unwrap();
    assert!((speed - 500.0 * std::f64::consts::PI / 30.0).abs() < 1.0, "{speed}");
    let pair = two_fmus::run(&fmi3).unwrap();
    let (t, speed) = *pair.last().unwrap();
    assert!(pair.len() == 5001 && (t - 0.5).abs() < 1e-9 && (speed - 52.36).abs() < 1.0, "{t} {speed}");
    let lowest = sweep::run(&drive, &[0.0, 2.0]).unwrap();
    assert!(lowest[0].0 == 0.0 && lowest[1].0 == 2.0 && lowest[1].1 < lowest[0].1, "{lowest:?}");
}

#[test]
fn a_refused_call_tells_function_status_and_reason() {
    in_both("PmsmPlant", |fmu| {
        let mut plant = started(fmu).unwrap();
        let Error::Call { instance, function, status, message } = plant.do_step(0.5, 1e-4).unwrap_err() else {
            panic!("another error");
        };
        assert!(function.ends_with("DoStep") && instance == "plant" && status == "Error", "{function} {status}");
        assert!(message.is_some_and(|m| !m.is_empty()));
        assert!(!plant.take_messages().is_empty());
    });
}

#[test]
fn instances_and_standards_do_not_disturb_each_other() {
    let (two, three) = (open("fmi2", "PmsmPlant"), open("fmi3", "PmsmPlant"));
    let alone = steps(&mut started(&two).unwrap(), 0, 100).unwrap();
    let mut all: Vec<Instance> = [&two, &three, &two].iter().map(|fmu| started(fmu).unwrap()).collect();
    for part in 0..10 {
        for plant in &mut all {
            let _ = steps(plant, 10 * part, 10 * (part + 1)).unwrap();
        }
    }
    // Instances keep the binary: the FMUs may go first.
    drop((two, three));
    assert!(all.iter_mut().all(|plant| steps(plant, 100, 100).unwrap() == alone));
}

/// The controller, whose unit rad/s has another BaseUnit.
fn controller_with(base: &str) -> Fmu {
    let file = common::python::scratch().join(format!("units-{}.fmu", base.len()));
    common::rewrite(&common::archives().join("fmi2/SensorlessController.fmu"), &file, |name, bytes| {
        let text = |bytes| String::from_utf8(bytes).unwrap().replacen("<BaseUnit s=\"-1\" rad=\"1\"/>", base, 1);
        Some(if name == "modelDescription.xml" { text(bytes).into_bytes() } else { bytes })
    });
    Fmu::open(&file).unwrap()
}

/// The last speed of the plant, and the speed received by the controller.
fn passed(base: &str, units: Units, method: Method) -> Result<([f64; 2], Vec<String>), Error> {
    let mut system = System::new(method).with_units(units);
    system.add("p", &open("fmi2", "PmsmPlant"), false)?;
    system.add("c", &controller_with(base), false)?;
    system.set("p.initial.speed", "30")?;
    system.connect("p.speed", "c.speed_meas")?;
    ["p.speed", "c.speed_meas"].iter().try_for_each(|port| system.record(port))?;
    let notes = system.take_notes();
    let settings = Settings { start: 0.0, stop: 1e-3, step: 1e-4, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(())))?;
    let last = |name: &str| *recording.column(name).unwrap().values.last().unwrap();
    Ok(([last("p.speed"), last("c.speed_meas")], notes))
}

#[test]
fn connected_numbers_are_converted_by_their_base_units() {
    const HALF: &str = "<BaseUnit s=\"-1\" rad=\"1\" factor=\"0.5\"/>";
    for method in [Method::default(), Method::ModelExchange(Integration::default())] {
        let ([speed, arrived], notes) = passed(HALF, Units::Convert, method.clone()).unwrap();
        assert!(speed > 20.0 && arrived == 2.0 * speed, "{speed}, {arrived}");
        assert!(notes.is_empty(), "{notes:?}");
        let ([speed, arrived], _) = passed(HALF, Units::PassOn, method.clone()).unwrap();
        assert_eq!(speed, arrived);
        let ([speed, arrived], notes) =
            passed("<BaseUnit s=\"-1\" rad=\"1\"/>", Units::Convert, method.clone()).unwrap();
        assert!(speed == arrived && notes.is_empty(), "{notes:?}");
        let ([speed, arrived], _) =
            passed("<BaseUnit s=\"-1\" rad=\"1\" offset=\"5\"/>", Units::Convert, method).unwrap();
        assert_eq!(speed - 5.0, arrived);
    }
    let radian = passed("<BaseUnit s=\"-1\"/>", Units::Convert, Method::default()).unwrap_err().to_string();
    assert!(radian.contains("c.speed_meas") && radian.contains("counts the radian as a base unit"), "{radian}");
    let force = passed("<BaseUnit kg=\"1\" m=\"1\" s=\"-2\"/>", Units::Convert, Method::default()).unwrap_err();
    assert!(force.to_string().contains("rad/s = s-1.rad, the target in rad/s = kg.m.s-2"), "{force}");
}
