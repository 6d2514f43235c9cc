//! Settings of a run: tolerance, steps, jumps of inputs, results before an error.

use crate::workshop::{Workshop, array};
use fmu_import::Fmu;
use fmu_system::cosimulation::{
    CoarseSteps, Crossing, Integration, Method, Schedule, Sequence, Settings, Sine, Solver, System, Transformation,
    Units,
};
use model_description::Conversion;
use std::ops::ControlFlow;

/// The last value of `variable` of a plant, the last time, and the notes.
fn ran(system: System, fmu: &Fmu, variable: &str, stop: f64) -> Result<(f64, f64, Vec<String>), fmu_import::Error> {
    let mut system = system;
    system.add("p", fmu, false)?;
    system.record(&format!("p.{variable}"))?;
    let settings = Settings { start: 0.0, stop, step: 0.1, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(())))?;
    let (value, time) = (recording.columns[0].values.last().unwrap(), recording.time.last().unwrap());
    Ok((*value, *time, system.take_notes()))
}

#[test]
fn the_tolerance_of_the_description_or_of_the_user_reaches_the_fmu() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let fmu = workshop.plain("plant", version);
        let received = |system| ran(system, &fmu, "tolerance", 0.2).unwrap().0;
        let exchange = |solver| System::new(Method::ModelExchange(Integration { solver, ..Integration::default() }));
        assert_eq!(received(System::default()), 1e-5);
        assert_eq!(received(System::default().with_tolerance(Some(1e-3))), 1e-3);
        assert_eq!(received(exchange(Solver::Dopri { rtol: 1e-8 })), 1e-8);
        assert_eq!(received(exchange(Solver::Rk4)), -1.0);
    }
}

#[test]
fn an_fmu_that_cannot_vary_its_step_gets_no_shorter_one() {
    let workshop = Workshop::new();
    let with = |attribute: &str| {
        let xml = |xml: String| xml.replace("canHandleVariableCommunicationStepSize='true'", attribute);
        workshop.fmu("plant", 2, &[], xml)
    };
    let varies = workshop.plain("plant", 2);
    assert!(matches!(ran(System::default(), &varies, "x", 0.95).unwrap(), (_, 0.95, notes) if notes.is_empty()));
    for fmu in [with(""), with("canHandleVariableCommunicationStepSize='false'")] {
        let (_, end, notes) = ran(System::default(), &fmu, "x", 0.95).unwrap();
        assert!((end - 0.9).abs() < 1e-12, "{end}");
        let [note] = &notes[..] else { panic!("{notes:?}") };
        assert!(
            note.starts_with("p cannot vary its step") && note.contains("ends with the last whole step, at 0.9"),
            "{note}"
        );
        assert!(ran(System::default(), &fmu, "x", 1.0).unwrap().2.is_empty());
        let error = ran(System::default(), &fmu, "x", 0.05).unwrap_err().to_string();
        assert!(error.contains("shorter than one step of 0.1 s"), "{error}");
    }
    let internal = workshop.fmu("plant", 3, &[], |xml| {
        xml.replace(
            "canHandleVariableCommunicationStepSize='true'",
            "canHandleVariableCommunicationStepSize='true' fixedInternalStepSize='0.03'",
        )
    });
    let notes = ran(System::default(), &internal, "x", 0.2).unwrap().2;
    assert!(
        notes[0].contains("its fixedInternalStepSize is 0.03 s, and the step of 0.1 s is not a multiple"),
        "{notes:?}"
    );
}

/// An input that jumps between two communication points is met by a step that ends there, if all FMUs can vary their steps.
#[test]
fn a_jump_between_two_communication_points_is_met_or_acts_late_with_a_note() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let fmu = workshop.plain("plant", version);
        let rigid = |xml: String| xml.replace("canHandleVariableCommunicationStepSize='true'", "");
        let rigid = workshop.fmu("plant", version, &[], rigid);
        let run = |fmu: &Fmu, points: &str, method| {
            let mut system = System::new(method);
            system.add("p", fmu, false).unwrap();
            system.input("p.u", Schedule::parse(points).unwrap()).unwrap();
            system.record("p.x").unwrap();
            let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
            let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
            assert_eq!(recording.time.len(), 11);
            (recording.columns[0].values[10], system.take_notes())
        };
        let exact = Method::ModelExchange(Integration::default());
        for (points, method) in
            [("0:0,0.3:1,2.05:3", Method::default()), ("0:0~0.25:1", Method::default()), ("0:0,0.25:1", exact)]
        {
            assert_eq!(run(&fmu, points, method).1, [""; 0], "{points}");
        }
        // A time in ms.
        assert_eq!(
            run(&fmu, "0:0,300:1", Method::default()).1,
            ["p.u: its value first changes at 300 s, after the stop time of 1 s"]
        );
        // x' = u - x from 1: u is 1 until 0.25 s, then 3.
        let solved = |t: f64| 3.0 - 2.0 * f64::exp(-(1.0 - t));
        let (x, notes) = run(&fmu, "0:1,0.25:3", Method::default());
        assert!((x - solved(0.25)).abs() < 1e-12, "{x}");
        let expected = "p.u: the value at 0.25 s lies between two communication points: a step ends there";
        assert_eq!(notes, [expected]);
        let (x, notes) = run(&rigid, "0:1,0.25:3", Method::default());
        assert!((x - solved(0.3)).abs() < 1e-12, "{x}");
        assert!(notes[0].ends_with(" and acts from 0.30000000000000004 s on: p cannot vary its step"), "{notes:?}");
    }
}

/// A step that is too long for an FMU with states is taken in halves; without states the run ends before it.
#[test]
fn a_discarded_step_is_taken_in_halves() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let states = if version == 2 { "canGetAndSetFMUstate='true'" } else { "canGetAndSetFMUState='true'" };
        for with_states in [true, false] {
            let fmu = workshop.fmu("plant", version, &["-DLONGEST=0.03"], |xml| {
                let has = if with_states { states } else { "" };
                xml.replace("<CoSimulation ", &format!("<CoSimulation {has} "))
            });
            let mut system = System::default();
            system.add("p", &fmu, false).unwrap();
            system.set("p.u", "2").unwrap();
            for name in ["p.x", "p.y"] {
                system.record(name).unwrap();
            }
            let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
            let mut points = 0;
            let (recording, outcome) = system.run_keeping(&settings, |_| {
                points += 1;
                Ok(ControlFlow::Continue(()))
            });
            let last = |column: usize| *recording.columns[column].values.last().unwrap();
            // Three whole steps, then four quarters each of the other seven.
            assert_eq!((last(1), points), if with_states { (3.0 + 28.0, 11) } else { (3.0, 4) }, "{version}");
            if with_states {
                outcome.unwrap();
                let solved = 2.0 - f64::exp(-1.0);
                assert!((last(0) - solved).abs() < 1e-12, "{}", last(0));
                let expected = "an FMU refused the step after 0.30000000000000004 s as too long: it took shorter ones";
                assert_eq!(system.take_notes(), [expected]);
            } else {
                assert!(outcome.unwrap_err().is_discard());
            }
        }
    }
}

#[test]
fn what_was_recorded_before_an_error_is_kept() {
    let workshop = Workshop::new();
    let mut system = System::default();
    system.add("p", &workshop.plain("plant", 2), false).unwrap();
    system.record("p.x").unwrap();
    system.record_text_as("p.x", "text").unwrap_err();
    let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
    let (recording, outcome) = system.run_keeping(&settings, |point| {
        let error = || fmu_import::Error::usage("p", "stops here");
        if point.index < 3 { Ok(ControlFlow::Continue(())) } else { Err(error()) }
    });
    assert!(outcome.unwrap_err().to_string().contains("stops here"));
    assert_eq!((recording.time.len(), recording.columns[0].values.len()), (4, 4));
}

/// z = 1 - 2 u in a loop with a connection that transmits 4 z + c: a = 1 - 2 b, b = 4 + c - 8 a, so a = (7 + 2 c) / 15. The derivatives
/// of the FMU count with the factor of the connection, and the residual relative to the inputs.
#[test]
fn a_loop_through_a_conversion_is_solved() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let name = if version == 2 { "providesDirectionalDerivative" } else { "providesDirectionalDerivatives" };
        for (flag, offset) in [(String::new(), 3.0), (format!("{name}='true' "), 3.0), (String::new(), 3e6)] {
            let xml = |xml: String| xml.replace("<ModelExchange ", &format!("<ModelExchange {flag}"));
            let fmu = workshop.fmu("plant", version, &[], xml);
            let mut system = System::new(Method::ModelExchange(Integration::default()));
            for name in ["a", "b"] {
                system.add(name, &fmu, false).unwrap();
                system.record(&format!("{name}.u")).unwrap();
            }
            let transformation = Some(Transformation::Linear(Conversion { factor: 4.0, offset }));
            system.connect_by("a.z", "b.u", &Crossing { transformation, ..Crossing::default() }).unwrap();
            system.connect("b.z", "a.u").unwrap();
            let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
            let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
            let last: Vec<f64> = recording.columns.iter().map(|column| *column.values.last().unwrap()).collect();
            let a = (7.0 + 2.0 * offset) / 15.0;
            let near = |(x, y): (&f64, f64)| (x - y).abs() < 1e-9 * offset;
            assert!(last.iter().zip([a, 0.5 - 0.5 * a]).all(near), "FMI {version}, {flag}: {last:?}");
        }
    }
}

/// Whether the FMUs of a plan follow another communication step, and take any.
#[test]
fn a_plan_knows_the_steps_that_its_fmus_take() {
    let workshop = Workshop::new();
    let can = "canHandleVariableCommunicationStepSize='true'";
    for (flags, expected) in [
        (can, (true, true)),
        ("", (false, true)),
        ("canHandleVariableCommunicationStepSize='true' fixedInternalStepSize='0.1'", (true, false)),
    ] {
        let mut system = System::default();
        system.add("p", &workshop.plain("plant", 3), false).unwrap();
        system.add("q", &workshop.fmu("plant", 3, &[], |xml| xml.replace(can, flags)), false).unwrap();
        let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
        assert_eq!(system.into_plan(&settings).unwrap().varies_steps(), expected, "{flags}");
    }
}

#[test]
fn only_real_inputs_and_tunable_parameters_follow_a_sine() {
    let workshop = Workshop::new();
    let tunable = |xml: String| {
        xml.replace(
            "name='level' valueReference='7' causality='parameter' variability='fixed'",
            "name='level' valueReference='7' causality='parameter' variability='tunable'",
        )
    };
    let mut system = System::default();
    system.add("p", &workshop.fmu("plant", 3, &[], tunable), false).unwrap();
    let settings = Settings { start: 0.0, stop: 1.0, step: 0.1, sequential: false };
    let plan = system.into_plan(&settings).unwrap();
    let sine = Sine { amplitude: 1.0, frequency: 1.0, zero: 0.0 };
    let excited = |name: &str| plan.excited(name, sine, &settings, CoarseSteps::default()).map(drop);
    assert!(["p.u", "p.i", "p.level"].into_iter().all(|name| excited(name).is_ok()));
    for name in ["p.x", "p.T"] {
        let error = excited(name).unwrap_err().to_string();
        assert_eq!(error, format!("{name}: cannot follow a sine: it is not a real input or tunable parameter"));
    }
}

/// Texts over time are lines for a real input; an array is recorded as a text, a number is not.
#[test]
fn texts_are_lines_and_arrays_are_texts() {
    let workshop = Workshop::new();
    let mut system = System::default();
    system.add("p", &workshop.fmu("plant", 3, &[], |xml| array(&xml, "y")), false).unwrap();
    let texts = Sequence::parse("0:1,0.5:2").unwrap();
    let lines = system.lines("p.u", &texts).unwrap().unwrap();
    assert_eq!([lines.at(0.25), lines.at(0.5)], [1.5, 2.0]);
    system.sequence("p.u", &texts).unwrap();
    system.record("p.u").unwrap();
    system.record_text_as("p.y", "array").unwrap();
    let error = system.record_text_as("p.x", "number").unwrap_err().to_string();
    assert_eq!(error, "p.x: is one number, or a clock");
    let settings = Settings { start: 0.0, stop: 0.5, step: 0.25, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
    assert_eq!((&recording.columns[0].values[..2], recording.texts[0].values[0].as_str()), (&[1.0, 1.5][..], "0"));
}

#[test]
fn a_system_knows_what_its_connections_do_with_units() {
    assert_eq!(
        [System::default().units(), System::default().with_units(Units::PassOn).units()],
        [Units::Convert, Units::PassOn]
    );
}

#[test]
fn a_table_of_values_is_not_for_real_numbers() {
    let workshop = Workshop::new();
    let mut system = System::default();
    for name in ["a", "b"] {
        system.add(name, &workshop.plain("plant", 3), false).unwrap();
    }
    let transformation = Some(Transformation::Table([("1".into(), "2".into())].into()));
    let error = system.connect_by("a.z", "b.u", &Crossing { transformation, ..Crossing::default() }).unwrap_err();
    let expected = "a.z: is a real number: a table of values needs an integer, a Boolean or an item";
    assert_eq!(error.to_string(), expected);
}
