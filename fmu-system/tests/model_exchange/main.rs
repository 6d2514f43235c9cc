//! Model Exchange, event mode and early return with two models in C whose solutions are known (`fmu.c`), in both standards.
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]
#![allow(clippy::float_cmp)] // Counts, and numbers that nothing rounds.

mod description;
mod settings;
mod ssp;
mod workshop;

use fmu_import::{Fmu, Kind};
use fmu_system::cosimulation::{
    CommunicationPoint, Integration, Method, Recording, Schedule, Settings, Solver, System,
};
use model_description::FmiVersion;
use std::f64::consts::LN_2;
use std::ops::ControlFlow;
use workshop::{Workshop, array};

/// Sample period of the sampler in s, unless a test sets another.
const T: f64 = 0.1;

fn settings(stop: f64, step: f64) -> Settings {
    Settings { start: 0.0, stop, step, sequential: false }
}

fn exchange(solver: Solver) -> Method {
    Method::ModelExchange(Integration { solver, ..Integration::default() })
}

const SOLVERS: [Solver; 2] = [Solver::Rk4, Solver::Dopri { rtol: 1e-9 }];

/// Plant and sampler in a loop.
fn pair(plant: &Fmu, sampler: &Fmu, method: Method) -> System {
    let mut system = System::new(method);
    system.add("p", plant, false).unwrap();
    system.add("s", sampler, false).unwrap();
    system.connect("s.y", "p.u").unwrap();
    system.connect("p.x", "s.i").unwrap();
    system.record("p.x").unwrap();
    system.record("s.y").unwrap();
    system.record("s.count").unwrap();
    system
}

fn run(system: &mut System, settings: &Settings) -> Recording {
    system.run(settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

fn refused(system: &mut System, settings: &Settings) -> String {
    system.run(settings, |_| Ok(ControlFlow::Continue(()))).unwrap_err().to_string()
}

/// One FMU, recorded.
fn single(fmu: &Fmu, method: Method, records: &[&str]) -> System {
    let mut system = System::new(method);
    system.add("p", fmu, false).unwrap();
    for name in records {
        system.record(name).unwrap();
    }
    system
}

/// State, output and number of samples at k T, after the event.
fn solution(samples: u32) -> Vec<(f64, f64, f64)> {
    let (mut x, mut computed, mut rows) = (1.0, 0.0, Vec::new());
    for count in 1..=samples + 1 {
        let y = computed;
        rows.push((x, y, f64::from(count)));
        computed = 1.0 - 2.0 * x;
        x = y + (x - y) * (-T).exp();
    }
    rows
}

#[track_caller]
fn assert_solution(recording: &Recording, tolerance: f64) {
    let rows = solution(20);
    assert_eq!(recording.time.len(), rows.len());
    for (k, (x, y, count)) in rows.iter().enumerate() {
        let found = [0, 1, 2].map(|column| recording.columns[column].values[k]);
        let error = (found[0] - x).abs().max((found[1] - y).abs());
        assert!(error < tolerance && found[2] == *count, "{k}: {found:?}, expected {x} {y} {count}");
    }
}

#[test]
fn a_sampled_loop_has_its_solution_in_every_order_of_exchange() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let (plant, sampler) = (workshop.plain("plant", version), workshop.plain("sampler", version));
        for solver in SOLVERS {
            let plain = Integration { solver, ..Integration::default() };
            let foreign = vec![1e-3, 0.1 - 1e-5, 0.25, 0.9];
            let tolerance = if solver == Solver::Rk4 { 1e-6 } else { 1e-8 };
            for (integration, tolerance) in [
                (plain.clone(), tolerance),
                (Integration { reversed: true, ..plain.clone() }, tolerance),
                (Integration { extra_events: foreign.clone(), ..plain.clone() }, tolerance),
                (Integration { reversed: true, extra_events: foreign, ..plain.clone() }, tolerance),
            ] {
                let recording = run(&mut pair(&plant, &sampler, Method::ModelExchange(integration)), &settings(2.0, T));
                assert_solution(&recording, tolerance);
            }
            // A late sample reads a later input and acts later.
            let late = Method::ModelExchange(Integration { late: 1e-5, ..plain });
            let recording = run(&mut pair(&plant, &sampler, late), &settings(2.05, 2.05));
            let (x, y) = (recording.columns[0].values[1], recording.columns[1].values[1]);
            let expected = solution(20)[20];
            let at_stop = expected.1 + (expected.0 - expected.1) * (-0.05_f64).exp();
            assert!((x - at_stop).abs() < 1e-4 && (y - expected.1).abs() < 1e-4, "late: {x} {y}");
            assert_eq!(recording.columns[2].values[1], 21.0, "no sample is lost or doubled");
        }
    }
}

/// An input that jumps in the middle of one long step: the integrator hits the jump exactly and does not use it earlier.
#[test]
fn inputs_jump_at_their_time() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let plant = workshop.plain("plant", version);
        for (points, expected) in [
            // x = e^-t up to 0.3, then it goes towards 5.
            ("0:0,0.3:5", 5.0 + ((-0.3_f64).exp() - 5.0) * (-0.7_f64).exp()),
            // u = t up to 0.5, then constant.
            ("0:0~0.5:0.5", 0.5 + (-1.0 + 2.0 * (-0.5_f64).exp()) * (-0.5_f64).exp()),
        ] {
            let mut system = single(&plant, exchange(Solver::Dopri { rtol: 1e-10 }), &["p.x"]);
            system.input("p.u", Schedule::parse(points).unwrap()).unwrap();
            // Up to 0.5: x' = t - x has x = t - 1 + 2 e^-t.
            let x = run(&mut system, &settings(1.0, 1.0)).columns[0].values[1];
            assert!((x - expected).abs() < 1e-9, "{points}: {x}, expected {expected}");
        }
    }
}

#[test]
fn state_events_are_located_and_step_events_handled() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let plant = workshop.plain("plant", version);
        for (solver, tolerance) in [(Solver::Rk4, 1e-7), (Solver::Dopri { rtol: 1e-10 }, 1e-9)] {
            let mut system = single(&plant, exchange(solver), &["p.y", "p.count"]);
            system.set("p.level", "0.5").unwrap();
            let recording = run(&mut system, &settings(1.0, 0.05));
            let (time, count) = (recording.columns[0].values[20], recording.columns[1].values[20]);
            assert!((time - LN_2).abs() < tolerance && count == 1.0, "{solver:?}: {time} {count}");
        }
        let mut system = single(&plant, exchange(Solver::Rk4), &["p.count"]);
        system.set("p.fault", "7").unwrap();
        assert_eq!(run(&mut system, &settings(1.0, 0.05)).columns[0].values[20], 20.0, "one for each step");
    }
}

/// With event mode, early return or both, the sampler samples at k T for any communication step.
#[test]
fn events_of_cosimulation_come_at_their_time() {
    let workshop = Workshop::new();
    let sampler = workshop.plain("sampler", 3);
    let ramp = || Schedule::parse("0:0~10:7").unwrap();
    let recording = |event_mode, early_return, step| {
        let mut system = single(&sampler, Method::CoSimulation { event_mode, early_return }, &["p.y", "p.count"]);
        system.input("p.i", ramp()).unwrap();
        run(&mut system, &settings(2.0, step))
    };
    let reference = recording(false, false, T);
    let at = |recording: &Recording, t: f64, column: usize| {
        let row = recording.time.iter().position(|x| (x - t).abs() < 1e-9).unwrap();
        recording.columns[column].values[row]
    };
    for (event_mode, early_return) in [(true, false), (false, true), (true, true)] {
        for step in [T, 0.7 * T, 0.4, 0.25, 2.0] {
            let recording = recording(event_mode, early_return, step);
            for k in 1..=20 {
                let t = T * f64::from(k);
                if recording.time.iter().any(|x| (x - t).abs() < 1e-9) {
                    let (y, expected) = (at(&recording, t, 0), at(&reference, t, 0));
                    assert_eq!(
                        y.to_bits(),
                        expected.to_bits(),
                        "{event_mode} {early_return} {step}: {t} {y} {expected}"
                    );
                }
            }
            // With event mode, the sample of the last instant is taken at that instant.
            assert_eq!(
                at(&recording, 2.0, 1),
                20.0 + f64::from(u8::from(event_mode)),
                "{event_mode} {early_return} {step}"
            );
        }
    }
    assert_ne!(
        at(&recording(false, false, 0.4), 2.0, 0).to_bits(),
        at(&reference, 2.0, 0).to_bits(),
        "a hold of 4 T shows"
    );
}

/// In event mode, an input that jumps between two communication points is met as an event, once.
#[test]
fn inputs_jump_at_their_time_in_event_mode() {
    let workshop = Workshop::new();
    let sampler = workshop.plain("sampler", 3);
    let method = Method::CoSimulation { event_mode: true, early_return: false };
    let mut system = single(&sampler, method, &["p.y", "p.u"]);
    system.set("p.T", "0.5").unwrap();
    system.input("p.u", Schedule::parse("0:1,0.3:2,0.6:3").unwrap()).unwrap();
    let mut seen = Vec::new();
    let hook = |point: &mut CommunicationPoint<'_>| {
        seen.push(point.instance("p").unwrap().get("u").unwrap().number().unwrap());
        Ok(ControlFlow::Continue(()))
    };
    system.run(&settings(1.0, 0.25), hook).unwrap();
    assert_eq!(seen, [1.0, 1.0, 2.0, 3.0, 3.0]);
}

#[test]
fn the_hook_ends_a_run() {
    let workshop = Workshop::new();
    let sampler = workshop.plain("sampler", 3);
    let stepping = |event_mode, early_return| Method::CoSimulation { event_mode, early_return };
    for method in [stepping(false, false), stepping(true, false), stepping(false, true), exchange(SOLVERS[0])] {
        let mut system = single(&sampler, method.clone(), &["p.y"]);
        let hook = |point: &mut CommunicationPoint<'_>| {
            Ok(if point.index < 2 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) })
        };
        let recording = system.run(&settings(1.0, 0.25), hook).unwrap();
        assert_eq!(recording.time, [0.0, 0.25, 0.5], "{method:?}");
    }
}

/// Without a sample after the first, the hook at the last point sees the inputs of the last step.
#[test]
fn no_input_is_set_at_the_end() {
    let workshop = Workshop::new();
    let sampler = workshop.plain("sampler", 3);
    for (event_mode, early_return) in [(false, false), (true, false), (false, true)] {
        let mut system = single(&sampler, Method::CoSimulation { event_mode, early_return }, &[]);
        system.set("p.T", "2").unwrap();
        system.input("p.u", Schedule::parse("0:0~1:1").unwrap()).unwrap();
        let mut last = f64::NAN;
        let hook = |point: &mut CommunicationPoint<'_>| {
            last = point.instance("p").unwrap().get("u").unwrap().number().unwrap();
            Ok(ControlFlow::Continue(()))
        };
        system.run(&settings(1.0, 0.25), hook).unwrap();
        assert_eq!(last, 0.75, "{event_mode} {early_return}");
    }
}

#[test]
fn a_loop_with_events_has_its_solution_at_any_step() {
    let workshop = Workshop::new();
    let (plant, sampler) = (workshop.plain("plant", 3), workshop.plain("sampler", 3));
    for (event_mode, early_return) in [(true, false), (false, true), (true, true)] {
        for step in [T, 0.7 * T, 0.73, 2.0] {
            let method = Method::CoSimulation { event_mode, early_return };
            let recording = run(&mut pair(&plant, &sampler, method), &settings(2.0, step));
            let (x, y, _) = solution(20)[20];
            let last = |column: usize| *recording.columns[column].values.last().unwrap();
            let error = (last(0) - x).abs().max((last(1) - y).abs());
            assert!(error < 1e-12, "{event_mode} {early_return} {step}: {error}");
        }
    }
}

/// If two FMUs return early, the one that went further goes back.
#[test]
fn who_stepped_too_far_goes_back() {
    let workshop = Workshop::new();
    let sampler = workshop.plain("sampler", 3);
    let method = || Method::CoSimulation { event_mode: false, early_return: true };
    let system = |sampler: &Fmu| {
        let mut system = System::new(method());
        for (name, period) in [("a", "0.1"), ("b", "0.07"), ("c", "0.03")] {
            system.add(name, sampler, false).unwrap();
            system.set(&format!("{name}.T"), period).unwrap();
            system.input(&format!("{name}.i"), Schedule::parse("0:0~10:7").unwrap()).unwrap();
            system.record(&format!("{name}.y")).unwrap();
            system.record(&format!("{name}.count")).unwrap();
        }
        system
    };
    let recording = run(&mut system(&sampler), &settings(1.005, 1.005));
    for (i, period) in [0.1, 0.07, 0.03].into_iter().enumerate() {
        let samples = (1.005_f64 / period).floor() + 1.0;
        let [y, count] = [2 * i, 2 * i + 1].map(|column| recording.columns[column].values[1]);
        // Shown is the sample before the last.
        let expected = 1.0 - 2.0 * 0.7 * period * (samples - 2.0);
        assert!(
            (y - expected).abs() < 1e-12 && count == samples,
            "{period}: {y} {count}, expected {expected} {samples}"
        );
    }
    let stuck = workshop.fmu("sampler", 3, &[], |xml| xml.replace("canGetAndSetFMUState='true'", ""));
    let error = refused(&mut system(&stuck), &settings(1.005, 1.005));
    assert!(error.contains("without canGetAndSetFMUState it cannot go back"), "{error}");
}

#[test]
fn faults_are_named() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let (plant, sampler) = (workshop.plain("plant", version), workshop.plain("sampler", version));
        let discarded = if version == 2 { "p: fmi2GetDerivatives" } else { "p: fmi3GetContinuousStateDerivatives" };
        for (fmu, fault, part, causes) in [
            (&plant, 1, "p: needs more than 100 updates of its discrete states at t = 0 s", ""),
            (&plant, 2, "every step from t = 0.5", "the derivative of state x is NaN at t = 0.5"),
            (&plant, 3, discarded, "Derivatives returned Discard: every step from t = 0.69314"),
            (&plant, 4, "p: the nominal of state x is 0, must be positive and finite", ""),
            (&sampler, 5, "p: more than 100 events at t = 0 s; the next event time is 0 s", ""),
            (&plant, 6, "Derivatives returned Error", if version == 3 { "the plant has failed" } else { "" }),
            (&plant, 10, "p: state x is NaN at t = 0.69314", ""),
            // Nominal values that an event has changed are read again.
            (&plant, 11, "p: the nominal of state x is 0, must be positive and finite", ""),
        ] {
            for solver in SOLVERS {
                let mut system = single(fmu, exchange(solver), &["p.x"]);
                system.set("p.level", "0.5").unwrap();
                system.set("p.fault", &fault.to_string()).unwrap();
                let error = refused(&mut system, &settings(1.0, 0.1));
                assert!(error.contains(part) && error.contains(causes), "{fault} {solver:?}: {error}");
            }
        }
        let mut system = single(&sampler, exchange(Solver::Rk4), &["p.x"]);
        system.set("p.fault", "8").unwrap();
        let recording = run(&mut system, &settings(1.0, 0.1));
        // Five points, and that at which the FMU ends the simulation.
        let times = &recording.time;
        assert_eq!((recording.ended_by.as_deref(), times.len()), (Some("p"), 6), "{times:?}");
        assert!(times[5] > times[4] && times[5] <= 0.5, "{times:?}");

        // Outputs that change with every update of the other FMU: connected to each other, they never settle.
        let restless = |sampler: &Fmu| {
            let mut system = System::new(exchange(Solver::Rk4));
            for name in ["a", "b"] {
                system.add(name, sampler, false).unwrap();
                system.set(&format!("{name}.fault"), "9").unwrap();
            }
            system.connect("a.y", "b.i").unwrap();
            system.connect("b.y", "a.i").unwrap();
            let error = refused(&mut system, &settings(1.0, 0.1));
            assert!(error.contains("discrete inputs still change after 100 updates at t = 0 s"), "{error}");
        };
        restless(&sampler);
        if version == 3 {
            restless(&workshop.fmu("sampler", 3, &[], |xml| array(&array(&xml, "i"), "y")));
        }
    }

    // An early return before the step began.
    let sampler = workshop.plain("sampler", 3);
    let mut system = single(&sampler, Method::CoSimulation { event_mode: false, early_return: true }, &["p.y"]);
    system.set("p.fault", "13").unwrap();
    let error = refused(&mut system, &settings(1.0, 0.25));
    assert!(error.contains("a step from 0 s returned early at -0.25 s, before its beginning"), "{error}");

    // Co-Simulation with event mode: the next event is always now.
    let sampler = workshop.plain("sampler", 3);
    let mut system = single(&sampler, Method::CoSimulation { event_mode: true, early_return: false }, &["p.y"]);
    system.set("p.fault", "5").unwrap();
    let error = refused(&mut system, &settings(1.0, 0.1));
    assert!(error.contains("events or early returns at t = 0 s"), "{error}");
}

#[test]
fn algebraic_loops_are_solved_or_named() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let plant = workshop.plain("plant", version);
        for (fault, solver) in [("0", SOLVERS[0]), ("0", SOLVERS[1]), ("12", SOLVERS[1])] {
            let mut system = System::new(exchange(solver));
            for name in ["a", "b"] {
                system.add(name, &plant, false).unwrap();
                system.set(&format!("{name}.fault"), fault).unwrap();
                system.record(&format!("{name}.x")).unwrap();
            }
            system.connect("a.z", "b.u").unwrap();
            system.connect("b.z", "a.u").unwrap();
            if fault == "0" {
                // u = 1 - 2 u: passing it on would diverge. x' = 1/3 - x.
                let recording = run(&mut system, &settings(1.0, 0.1));
                let expected = 1.0 / 3.0 + 2.0 / 3.0 * (-1.0_f64).exp();
                assert!((recording.columns[0].values[10] - expected).abs() < 1e-6, "{:?}", recording.columns[0].values);
            } else {
                let said = refused(&mut system, &settings(1.0, 0.1));
                let expected = "a.u, b.u: the algebraic loop of these inputs does not converge at t = 0 s";
                assert!(said.starts_with(expected), "{said}");
            }
        }
    }
}

/// An array that is passed on as well, and that stays as it is, is no part of the loop.
#[test]
fn a_loop_beside_an_array_is_solved() {
    let workshop = Workshop::new();
    let plant = workshop.fmu("plant", 3, &[], |xml| array(&array(&xml, "i"), "y"));
    let mut system = System::new(exchange(SOLVERS[1]));
    for name in ["a", "b"] {
        system.add(name, &plant, false).unwrap();
    }
    for (from, to) in [("a.z", "b.u"), ("b.z", "a.u"), ("a.y", "b.i")] {
        system.connect(from, to).unwrap();
    }
    system.record("a.u").unwrap();
    let recording = run(&mut system, &settings(1.0, 0.1));
    assert!(recording.columns[0].values.iter().skip(1).all(|u| (u - 1.0 / 3.0).abs() < 1e-9), "{recording:?}");
}

/// The integrated plant and a sampler that steps itself, and the other way round.
#[test]
fn some_step_themselves() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let (plant, sampler) = (workshop.plain("plant", version), workshop.plain("sampler", version));
        for stepping in ["s", "p"] {
            let integration = Integration { stepping: vec![stepping.into()], ..Integration::default() };
            let method = Method::ModelExchange(Integration { solver: SOLVERS[1], ..integration });
            let found = run(&mut pair(&plant, &sampler, method), &settings(2.0, T));
            let both = run(&mut pair(&plant, &sampler, Method::default()), &settings(2.0, T));
            for (a, b) in found.columns[0].values.iter().zip(&both.columns[0].values) {
                assert!((a - b).abs() < 1e-8, "{stepping} steps itself: {a}, both do: {b}");
            }
            // The last step of 0.05 s from 1 s on: x goes towards the output of the sampler.
            let integration = Integration { stepping: vec![stepping.into()], ..Integration::default() };
            let method = Method::ModelExchange(Integration { solver: SOLVERS[1], ..integration });
            let short = run(&mut pair(&plant, &sampler, method), &settings(1.05, T));
            let [x, y] = [0, 1].map(|column| short.columns[column].values[10]);
            let (end, expected) = (short.columns[0].values[11], y + (x - y) * f64::exp(-0.05));
            assert!((end - expected).abs() < 1e-8, "{stepping} steps itself: {end}, expected {expected}");
        }
    }
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let workshop = Workshop::new();
    let (plant, sampler) = (workshop.plain("plant", 3), workshop.plain("sampler", 3));
    let method = |event_mode, early_return| Method::CoSimulation { event_mode, early_return };
    for (fmu, method, part) in [
        (&plant, method(true, false), "no FMU has event mode"),
        (&plant, method(false, true), "no FMU returns early"),
        (&sampler, method(true, true), "only in plain Co-Simulation"),
        (&sampler, exchange(Solver::Rk4), "only in plain Co-Simulation"),
        (&sampler, exchange(Solver::Dopri { rtol: 0.0 }), "the relative tolerance 0 must be between 1e-14 and 0.1"),
        (&sampler, exchange(Solver::Dopri { rtol: f64::NAN }), "the relative tolerance NaN must be"),
    ] {
        let error = refused(&mut single(fmu, method, &["p.x"]), &Settings { sequential: true, ..settings(1.0, 0.1) });
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn what_an_fmu_lacks_is_named() {
    let workshop = Workshop::new();
    let without = |element: &'static str| {
        move |xml: String| {
            let begin = xml.find(element).unwrap();
            let end = begin + xml[begin..].find("/>").unwrap() + 2;
            format!("{}{}", &xml[..begin], &xml[end..])
        }
    };
    let fmu = workshop.fmu("sampler", 3, &[], without("<ModelExchange"));
    let error = fmu.instantiate_as(Kind::ModelExchange, "a", false).err().unwrap().to_string();
    assert_eq!(error, "a: has no Model Exchange; it has Co-Simulation with event mode (FMI 3.0)");
    let fmu = workshop.fmu("plant", 2, &[], without("<CoSimulation"));
    let error = fmu.instantiate("a", false).err().unwrap().to_string();
    assert_eq!(error, "a: has no Co-Simulation; it has Model Exchange (FMI 2.0)");
    let fmu = workshop.plain("plant", 3);
    let error = fmu.instantiate_as(Kind::CoSimulation { event_mode: true, early_return: false }, "a", false);
    let error = error.err().unwrap().to_string();
    assert_eq!(error, "a: has no event mode; it has Co-Simulation and Model Exchange (FMI 3.0)");
    // A missing function of the description: the other interface still runs.
    let fmu = workshop.fmu("plant", 3, &["-DWITHOUT_EXCHANGE"], |xml| xml);
    assert!(fmu.instantiate("a", false).is_ok());
    let error = fmu.instantiate_as(Kind::ModelExchange, "a", false).err().unwrap().to_string();
    assert_eq!(error, "a: the function fmi3InstantiateModelExchange is missing");
    let path = workshop.archive("plant", 3, &["-DWITHOUT_EXCHANGE"], without("<CoSimulation"));
    let error = Fmu::open(path).err().unwrap().to_string();
    assert!(error.ends_with("plant.fmu: the function fmi3InstantiateModelExchange is missing"), "{error}");
}

#[test]
fn calls_of_an_instance() {
    let workshop = Workshop::new();
    for version in [2, 3] {
        let fmu = workshop.plain("plant", version);
        let mut p = fmu.instantiate_as(Kind::ModelExchange, "p", false).unwrap();
        p.setup(0.0, Some(1.0)).unwrap();
        p.enter_initialization().unwrap();
        p.exit_initialization().unwrap();
        assert_eq!(p.state_and_indicator_counts().unwrap(), (1, 1));
        let update = p.update_discrete_states().unwrap();
        assert_eq!((update.again, update.next_event_time), (false, None));
        p.enter_continuous_time_mode().unwrap();
        p.set_time(0.25).unwrap();
        p.set_continuous_states(&[0.75]).unwrap();
        let mut one = [0.0];
        p.get_derivatives(&mut one).unwrap();
        assert_eq!(one, [-0.75]);
        p.get_event_indicators(&mut one).unwrap();
        assert_eq!(one, [1.75]);
        p.get_continuous_states(&mut one).unwrap();
        assert_eq!(one, [0.75]);
        p.directional_derivative(&[3], &[2, 1], &[2.0, 5.0], &mut one).unwrap();
        assert_eq!(one, [3.0]);
        assert!(p.directional_derivative(&[3], &[2, 1], &[2.0], &mut one).is_err(), "a seed of the wrong length");
        let error = p.adjoint_derivative(&[3], &[2], &[1.0], &mut one).unwrap_err().to_string();
        let cause = if version == 2 { "FMI 2.0 has no adjoint" } else { "fmi3GetAdjointDerivative is missing" };
        assert!(error.contains(cause), "{error}");
    }
}

/// The same calls one by one, as in the checker.
#[test]
fn raw_calls() {
    use fmu_import::Status;
    use fmu_import::raw::{Arguments, Count, Interface, Raw, Sensitivity, SensitivityArguments, Simple, Vector};
    let workshop = Workshop::new();
    for (number, version) in [(2, FmiVersion::V2), (3, FmiVersion::V3)] {
        let archive = workshop.archive("plant", number, &[], |xml| xml);
        let raw = Raw::open(&archive.with_file_name("x.so"), version).unwrap();
        let arguments = Arguments {
            name: Some(c"p".into()),
            token: Some(c"g".into()),
            resources: None,
            interface: Interface::ModelExchange,
            logger: true,
            callbacks: true,
            memory: true,
            lasting: true,
            logging: false,
            event_mode: false,
            early_return: false,
            environment: 0,
            intermediate: None,
            locks: false,
        };
        let p = raw.instantiate(&arguments).unwrap().unwrap();
        let ok = |status: Option<Status>| assert_eq!(status, Some(Status::OK));
        ok(raw.experiment(p, None, 0.5, None));
        ok(raw.simple(Simple::ExitInitializationMode, p));
        let (status, updated) = raw.update_discrete_states(p, false).unwrap();
        assert_eq!((status, updated.again, updated.next_event_time_defined), (Status::OK, 0, 0));
        ok(raw.simple(Simple::EnterContinuousTimeMode, p));
        assert_eq!(raw.update_discrete_states(p, false).unwrap().0, Status::ERROR, "not in event mode");
        ok(raw.set_time(p, 0.75));
        let mut one = [0.25];
        ok(raw.vector(Vector::SetContinuousStates, p, Some(&mut one), 1));
        let derivatives = if number == 2 { Vector::GetDerivatives } else { Vector::GetContinuousStateDerivatives };
        ok(raw.vector(derivatives, p, Some(&mut one), 1));
        assert_eq!(one, [-0.25]);
        assert_eq!(raw.completed_integrator_step(p, true, false), Some((Status::OK, [0, 0])));
        let count = raw.count(Count::GetNumberOfContinuousStates, p, false);
        assert_eq!(count, (number == 3).then_some((Status::OK, 1)));
        let seed = SensitivityArguments {
            unknowns: (Some(&[3]), 1),
            knowns: (Some(&[2, 1]), 2),
            seed: (Some(&[2.0, 5.0]), 2),
        };
        ok(raw.sensitivity(Sensitivity::GetDirectionalDerivative, p, seed, Some(&mut one), 1));
        assert_eq!(one, [3.0]);
        assert_eq!(raw.sensitivity(Sensitivity::GetAdjointDerivative, p, seed, Some(&mut one), 1), None, "missing");
        assert_eq!(raw.input_derivatives(p, Some(&[1]), 1, Some(&[1]), Some(&[0.0])), None, "missing");
        raw.free(p).unwrap();
    }
}

/// Runs of a plan have the same bits, one after the other.
#[test]
fn a_plan_integrates_too() {
    let workshop = Workshop::new();
    let (plant, sampler) = (workshop.plain("plant", 3), workshop.plain("sampler", 3));
    let system = pair(&plant, &sampler, exchange(Solver::default()));
    let plan = std::sync::Arc::new(system.into_plan(&settings(2.0, T)).unwrap());
    let mut worker = plan.worker().unwrap();
    let first = worker.record([]).unwrap();
    assert_eq!(worker.record([]).unwrap(), first);
    assert_solution(&first, 1e-6);
}
