//! The packed motor FMUs in our own importer, in Model Exchange and with Event Mode, against co-simulation at T_s: the
//! reference for events, regardless of other actions around them.
#![allow(missing_docs)]

mod common;

use fmu_import::Fmu;
use fmu_system::cosimulation::{Integration, Method, Recording, Schedule, Settings, Solver, System};
use std::f64::consts::PI;
use std::ops::ControlFlow;

const T_S: f64 = 1e-4;
const STOP: f64 = 0.6;
/// 1500 rpm in rad/s.
const SPEED: f64 = 1500.0 * PI / 30.0;

fn open(standard: &str, name: &str) -> Fmu {
    Fmu::open(common::archives().join(standard).join(name).with_extension("fmu")).unwrap()
}

fn exchange(change: impl FnOnce(&mut Integration)) -> Method {
    let mut integration = Integration { solver: Solver::Dopri { rtol: 1e-9 }, ..Integration::default() };
    change(&mut integration);
    Method::ModelExchange(integration)
}

fn run(mut system: System, step: f64) -> Recording {
    let settings = Settings { start: 0.0, stop: STOP, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

/// From 180 deg to 1500 rpm, then half of the rated load: the pair.
fn pair(standard: &str, method: Method, step: f64) -> Recording {
    let mut system = System::new(method);
    system.add("p", &open(standard, "PmsmPlant"), false).unwrap();
    system.add("c", &open(standard, "SensorlessController"), false).unwrap();
    for phase in ["a", "b", "c"] {
        system.connect(&format!("p.i_{phase}"), &format!("c.i_{phase}")).unwrap();
        system.connect(&format!("c.u_{phase}"), &format!("p.u_{phase}")).unwrap();
    }
    system.set("p.initial.theta_e", &PI.to_string()).unwrap();
    system.input("c.speed_ref", Schedule::steps(vec![(0.0, 0.0), (0.05, SPEED)]).unwrap()).unwrap();
    system.input("p.tau_load", Schedule::steps(vec![(0.0, 0.0), (0.45, 1.0)]).unwrap()).unwrap();
    for name in ["p.i_a", "p.i_d", "p.i_q", "p.speed", "c.u_a", "c.theta_est"] {
        system.record_as(name, &name[2..]).unwrap();
    }
    run(system, step)
}

/// The same as one FMU.
fn drive(standard: &str, method: Method, step: f64) -> Recording {
    let mut system = System::new(method);
    system.add("d", &open(standard, "PmsmDrive"), false).unwrap();
    system.set("d.plant.initial.theta_e", &PI.to_string()).unwrap();
    system.input("d.speed_ref", Schedule::steps(vec![(0.0, 0.0), (0.05, SPEED)]).unwrap()).unwrap();
    system.input("d.tau_load", Schedule::steps(vec![(0.0, 0.0), (0.45, 1.0)]).unwrap()).unwrap();
    for name in ["d.i_a", "d.i_d", "d.i_q", "d.speed", "d.u_a", "d.theta_est"] {
        system.record_as(name, &name[2..]).unwrap();
    }
    run(system, step)
}

/// The largest difference in a column at common times.
fn apart(one: &Recording, reference: &Recording, name: &str) -> f64 {
    let (times, column) = (&one.time, &one.column(name).unwrap().values);
    let (all, other) = (&reference.time, &reference.column(name).unwrap().values);
    let mut common = 0;
    let differences = times.iter().zip(column).filter_map(|(t, x)| {
        let k = all.partition_point(|time| *time < t - 1e-9);
        let same = all.get(k).is_some_and(|time| (time - t).abs() < 1e-9);
        common += usize::from(same);
        same.then(|| (x - other[k]).abs())
    });
    let greatest = differences.fold(0.0, f64::max);
    assert!(common > 50, "{common} common times");
    greatest
}

/// Currents in A and speed in rad/s against a reference; the commands follow the currents by the gains of the loops.
fn assert_same(what: &str, one: &Recording, reference: &Recording) {
    for name in ["i_a", "i_d", "i_q"] {
        let apart = apart(one, reference, name);
        assert!(apart < 1e-5, "{what}: {name} {apart} A");
    }
    let apart = apart(one, reference, "speed");
    assert!(apart < 1e-4, "{what}: {apart} rad/s");
}

#[test]
fn pair_and_drive_in_model_exchange() {
    let reference = pair("fmi3", Method::default(), T_S);
    let end = *reference.column("speed").unwrap().values.last().unwrap();
    assert!((end - SPEED).abs() < 0.02 * SPEED, "{end}");
    for standard in ["fmi2", "fmi3"] {
        for step in [T_S, 7.3e-3] {
            let what = format!("{standard}, communication step {step}");
            assert_same(&format!("pair, {what}"), &pair(standard, exchange(|_| {}), step), &reference);
            assert_same(&format!("drive, {what}"), &drive(standard, exchange(|_| {}), step), &reference);
        }
    }
}

/// Results do not depend on the order of updates, late event handling by the importer, or events requested by another FMU.
#[test]
fn events_in_any_order_late_and_between_others() {
    let reference = pair("fmi3", Method::default(), T_S);
    let others: Vec<f64> = (0..500).map(|k| 1.13e-3 * f64::from(k) + 3.7e-5).collect();
    let cases: [(&str, Method); 3] = [
        ("reversed", exchange(|i| i.reversed = true)),
        // Within the width of an instant, 1e-5 T_s, as after rounding.
        ("late", exchange(|i| i.late = 0.5e-9)),
        ("events of others", exchange(|i| i.extra_events.clone_from(&others))),
    ];
    for (what, method) in cases {
        for standard in ["fmi2", "fmi3"] {
            assert_same(&format!("pair, {standard}, {what}"), &pair(standard, method.clone(), 1e-3), &reference);
            assert_same(&format!("drive, {standard}, {what}"), &drive(standard, method.clone(), 1e-3), &reference);
        }
    }
}

/// A fixed step unrelated to T_s and to the communication points also hits the events.
#[test]
fn a_fixed_step_lands_on_events() {
    let reference = pair("fmi3", Method::default(), T_S);
    let fixed = pair("fmi2", exchange(|i| i.solver = Solver::Rk4), 0.7e-4);
    assert_same("RK4 at 70 us", &fixed, &reference);
}

/// The controller alone, with ramps sampled at their own instants.
fn controller(method: Method, step: f64) -> Recording {
    let mut system = System::new(method);
    system.add("c", &open("fmi3", "SensorlessController"), false).unwrap();
    for (input, slope) in [("c.i_a", 3.0), ("c.i_b", -1.3), ("c.speed_ref", 60.0)] {
        system.input(input, Schedule::lines(vec![(0.0, 0.0), (STOP, slope * STOP)]).unwrap()).unwrap();
    }
    for name in ["c.u_a", "c.theta_est", "c.speed_est", "c.i_q_ref"] {
        system.record_as(name, &name[2..]).unwrap();
    }
    run(system, step)
}

#[test]
fn the_controller_with_event_mode_is_the_controller_at_its_period() {
    let reference = controller(Method::default(), T_S);
    let columns = ["u_a", "theta_est", "speed_est", "i_q_ref"];
    // Without Event Mode, samples inside a step read the values set before it.
    let plain = controller(Method::default(), 1e-3);
    assert!(columns.iter().any(|name| held(&plain, &reference, name) > 0), "the ramps show nothing");
    for step in [0.7 * T_S, T_S, 1e-3, 7.3e-3] {
        for method in [Method::CoSimulation { event_mode: true, early_return: true }, exchange(|_| {})] {
            let run = controller(method.clone(), step);
            for name in columns {
                assert_eq!(held(&run, &reference, name), 0, "{name}, communication step {step}, {method:?}");
            }
        }
    }
}

/// Number of rows that differ in a bit from the reference at their time.
fn held(one: &Recording, reference: &Recording, name: &str) -> usize {
    let (times, column) = (&one.time, &one.column(name).unwrap().values);
    let (all, other) = (&reference.time, &reference.column(name).unwrap().values);
    let differs = |(t, x): &(&f64, &f64)| {
        let k = all.partition_point(|time| *time < *t + 1e-9) - 1;
        x.to_bits() != other[k].to_bits()
    };
    assert!(times.len() > 50);
    times.iter().zip(column).filter(differs).count()
}

/// With Event Mode or early return, the pair takes any communication step: the plant's steps are cut at the samples.
#[test]
fn the_pair_at_any_step() {
    let reference = pair("fmi3", Method::default(), T_S);
    for (event_mode, early_return) in [(true, true), (false, true)] {
        for step in [0.7 * T_S, T_S, 1e-3, 7.3e-3] {
            let run = pair("fmi3", Method::CoSimulation { event_mode, early_return }, step);
            assert_same(&format!("event mode {event_mode}, step {step}"), &run, &reference);
        }
    }
}
