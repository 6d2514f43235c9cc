//! Settings of a run: tolerance, steps, jumps of inputs, results before an error.

use crate::workshop::Workshop;
use fmu_import::Fmu;
use fmu_system::cosimulation::{Crossing, Integration, Method, Schedule, Settings, Solver, System, Transformation};
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

/// z = 1 - 2 u in a loop with a connection that transmits 4 z + 3: a = 1 - 2 b, b = 7 - 8 a, so a = 13/15 and b = 1/15. The
/// derivatives of the FMU count with the factor of the connection.
#[test]
fn a_loop_through_a_conversion_is_solved() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let name = if version == 2 { "providesDirectionalDerivative" } else { "providesDirectionalDerivatives" };
        for flag in [String::new(), format!("{name}='true' ")] {
            let xml = |xml: String| xml.replace("<ModelExchange ", &format!("<ModelExchange {flag}"));
            let fmu = workshop.fmu("plant", version, &[], xml);
            let mut system = System::new(Method::ModelExchange(Integration::default()));
            for name in ["a", "b"] {
                system.add(name, &fmu, false).unwrap();
                system.record(&format!("{name}.u")).unwrap();
            }
            let transformation = Some(Transformation::Linear(Conversion { factor: 4.0, offset: 3.0 }));
            system.connect_by("a.z", "b.u", &Crossing { transformation, ..Crossing::default() }).unwrap();
            system.connect("b.z", "a.u").unwrap();
            let settings = Settings { start: 0.0, stop: 0.2, step: 0.1, sequential: false };
            let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap();
            let last: Vec<f64> = recording.columns.iter().map(|column| *column.values.last().unwrap()).collect();
            let expected = [13.0 / 15.0, 1.0 / 15.0];
            assert!(last.iter().zip(expected).all(|(x, y)| (x - y).abs() < 1e-9), "FMI {version}, {flag}: {last:?}");
        }
    }
}
