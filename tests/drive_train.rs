//! The packed FMUs in a drive train, in both standards: the integrated torque equals the counted energies, Model Exchange
//! agrees with Co-Simulation, and a diverging coupling ends with an error that names the cause.
#![allow(missing_docs)]

mod common;

use fmu_import::Fmu;
use fmu_system::cosimulation::{Integration, Method, Recording, Schedule, Settings, Solver, System};
use std::f64::consts::PI;
use std::ops::ControlFlow;

const RPM: f64 = PI / 30.0;
const T_S: f64 = 1e-4;

/// A traction drive in torque mode on an imposed shaft, 100 N.m.
const TRACTION: [(&str, &str); 20] = [
    ("plant.motor.n_p", "6"),
    ("plant.motor.R_s", "5.5e-3"),
    ("plant.motor.L_d", "0.09e-3"),
    ("plant.motor.L_q", "0.25e-3"),
    ("plant.motor.psi_M", "0.038"),
    ("controller.motor.n_p", "6"),
    ("controller.motor.R_s", "5.5e-3"),
    ("controller.motor.L_d", "0.09e-3"),
    ("controller.motor.L_q", "0.25e-3"),
    ("controller.motor.psi_M", "0.038"),
    ("plant.mechanics.imposed", "true"),
    ("controller.estimator", "Sensored"),
    ("controller.limit.i", "450"),
    ("controller.limit.i_q", "450"),
    ("controller.limit.tau", "1000"),
    ("controller.current.mtpa", "true"),
    ("controller.weakening.use", "true"),
    ("controller.speed_loop.torque_mode", "true"),
    ("tau_ref", "100"),
    ("u_dc", "360"),
];

const MEANS: [&str; 4] = ["p_in_mean", "p_mech_mean", "p_loss_mean", "tau_shaft_mean"];
const SHOWN: [&str; 4] = ["p_in", "p_mech", "p_loss", "tau_shaft"];
const ENERGIES: [&str; 3] = ["energy_in", "energy_mech", "energy_loss"];

fn open(standard: &str, name: &str) -> Fmu {
    Fmu::open(common::archives().join(standard).join(name).with_extension("fmu")).unwrap()
}

fn exchange() -> Method {
    Method::ModelExchange(Integration { solver: Solver::Dopri { rtol: 1e-8 }, ..Integration::default() })
}

fn run(mut system: System, stop: f64, step: f64) -> Recording {
    for name in [&MEANS[..], &SHOWN, &ENERGIES].concat() {
        system.record_as(&format!("d.{name}"), name).unwrap();
    }
    let settings = Settings { start: 0.0, stop, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

/// The traction drive on a shaft at the `speed` (rad/s) over 0.3 s in steps of `h` (s).
fn traction(standard: &str, method: Method, speed: f64, h: f64) -> Recording {
    let (mut system, stop) = (System::new(method), 0.3);
    system.add("d", &open(standard, "PmsmDrive"), false).unwrap();
    for (name, value) in TRACTION {
        system.set(&format!("d.{name}"), value).unwrap();
    }
    system.set("d.speed_shaft", &speed.to_string()).unwrap();
    system.input("d.angle_shaft", Schedule::lines(vec![(0.0, 0.0), (stop, speed * stop)]).unwrap()).unwrap();
    run(system, stop, h)
}

fn column<'a>(run: &'a Recording, name: &str) -> &'a [f64] {
    &run.column(name).unwrap().values
}

#[test]
fn the_torque_of_an_imposed_shaft_does_the_work_that_the_energy_counts() {
    for standard in ["fmi2", "fmi3"] {
        for rpm in [3000.0, 9000.0, 11_400.0] {
            for h in [1e-4, 3.7e-4, 1e-3, 1e-2] {
                let run = traction(standard, Method::default(), rpm * RPM, h);
                let (time, tau, energy) = (&run.time, column(&run, "tau_shaft"), column(&run, "energy_mech"));
                let first = time.partition_point(|t| *t < 0.2);
                let steps = first..time.len() - 1;
                let work: f64 = steps.map(|k| tau[k + 1] * rpm * RPM * (time[k + 1] - time[k])).sum();
                let counted = energy[energy.len() - 1] - energy[first];
                let off = work / counted - 1.0;
                println!("{standard}, {rpm} rpm, h = {h} s: {work} J of {counted} J, {:+.4} %", 100.0 * off);
                assert!(counted > 1e3 && off.abs() < 1e-3, "{standard}, {rpm} rpm, h = {h} s: {work} J, {counted} J");
            }
        }
    }
}

#[test]
fn the_means_of_both_interfaces_agree() {
    for standard in ["fmi2", "fmi3"] {
        for rpm in [3000.0, 4000.0, 9000.0, 11_400.0] {
            let stepped = traction(standard, Method::default(), rpm * RPM, T_S);
            for h in [T_S, 7.3e-3] {
                let exchanged = traction(standard, exchange(), rpm * RPM, h);
                let last = |run: &Recording, name: &str| *column(run, name).last().unwrap();
                for name in [&MEANS[..], &ENERGIES].concat() {
                    let (a, b) = (last(&exchanged, name), last(&stepped, name));
                    let allowed = 1e-3 * b.abs();
                    assert!((a - b).abs() < allowed && b != 0.0, "{standard}, {rpm} rpm, h = {h} s: {name} {a}, {b}");
                    assert!(!MEANS.contains(&name) || column(&exchanged, name)[0] == 0.0, "before a period is over");
                }
                let of = |run: &Recording, names: &[&str]| names.iter().map(|name| last(run, name)).collect::<Vec<_>>();
                let [mean, theirs] = [&exchanged, &stepped].map(|run| of(run, &MEANS));
                let instant = of(&exchanged, &SHOWN);
                println!(
                    "{standard}, {rpm} rpm, h = {h} s: {mean:.2?} in Model Exchange, {theirs:.2?} in Co-Simulation, \
                     {instant:.2?} at the instant; efficiency {:.4}, {:.4}, {:.4}",
                    mean[1] / mean[0],
                    theirs[1] / theirs[0],
                    instant[1] / instant[0],
                );
            }
        }
    }
}

/// From rest to 1500 rpm, and a load step: the energies follow the whole way.
#[test]
fn the_energies_of_a_start_agree() {
    let start = |standard: &str, method: Method, h: f64| {
        let mut system = System::new(method);
        system.add("d", &open(standard, "PmsmDrive"), false).unwrap();
        system.input("d.speed_ref", Schedule::steps(vec![(0.0, 0.0), (0.05, 1500.0 * RPM)]).unwrap()).unwrap();
        system.input("d.tau_load", Schedule::steps(vec![(0.0, 0.0), (0.3, 1.0)]).unwrap()).unwrap();
        run(system, 0.5, h)
    };
    for standard in ["fmi2", "fmi3"] {
        let (stepped, exchanged) = (start(standard, Method::default(), T_S), start(standard, exchange(), 1e-3));
        for name in ENERGIES {
            let (ours, theirs) = (column(&exchanged, name), column(&stepped, name));
            let mut worst = 0.0_f64;
            let mut common = 0;
            for (t, a) in exchanged.time.iter().zip(ours) {
                let k = stepped.time.partition_point(|time| *time < t - 1e-9);
                if stepped.time.get(k).is_some_and(|time| (time - t).abs() < 1e-9) {
                    (worst, common) = (worst.max((a - theirs[k]).abs()), common + 1);
                }
            }
            let end = theirs[theirs.len() - 1];
            println!("{standard}: {name} {end} J, at most {worst:e} J apart at {common} times");
            assert!(common > 400 && worst < 1e-4 * end && end > 1.0, "{standard}: {name} {worst} J apart of {end} J");
        }
    }
}

/// Only the plant, with commands from the controller's FMU: its events coincide with the controller's.
#[test]
fn the_plant_of_a_pair_counts_too() {
    let pair = |standard: &str, method: Method, h: f64| {
        let mut system = System::new(method);
        system.add("p", &open(standard, "PmsmPlant"), false).unwrap();
        system.add("c", &open(standard, "SensorlessController"), false).unwrap();
        for phase in ["a", "b", "c"] {
            system.connect(&format!("p.i_{phase}"), &format!("c.i_{phase}")).unwrap();
            system.connect(&format!("c.u_{phase}"), &format!("p.u_{phase}")).unwrap();
        }
        system.set("c.speed_ref", "100").unwrap();
        system.set("p.tau_load", "0.5").unwrap();
        for name in ENERGIES {
            system.record_as(&format!("p.{name}"), name).unwrap();
        }
        let settings = Settings { start: 0.0, stop: 0.4, step: h, sequential: false };
        system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
    };
    for standard in ["fmi2", "fmi3"] {
        let (stepped, exchanged) = (pair(standard, Method::default(), T_S), pair(standard, exchange(), 1e-3));
        for name in ENERGIES {
            let [a, b] = [&exchanged, &stepped].map(|run| *column(run, name).last().unwrap());
            println!("{standard}: {name} {a} J in Model Exchange, {b} J in Co-Simulation");
            assert!((a - b).abs() < 1e-4 * b.abs() && b > 1.0, "{standard}: {name} {a} J, {b} J");
        }
    }
}

#[test]
fn a_diverging_coupling_is_an_error() {
    // 1e7 N.m on the shaft, as from a coupling that has just diverged.
    let run = |standard: &str, name: &str, method: Method| {
        let mut system = System::new(method);
        system.add("d", &open(standard, name), true).unwrap();
        system.set("d.tau_load", "1e7").unwrap();
        system.record_as("d.speed", "speed").unwrap();
        let settings = Settings { start: 0.0, stop: 1.0, step: 1e-2, sequential: false };
        system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap_err().to_string()
    };
    for standard in ["fmi2", "fmi3"] {
        for name in ["PmsmPlant", "PmsmDrive"] {
            let message = run(standard, name, Method::default());
            println!("{standard}, {name}: {message}");
            let remedy = "the coupling is unstable; shorten the communication step or use mechanics.imposed";
            assert!(message.contains("the shaft turns at -") && message.contains(remedy), "{message}");
            let message = run(standard, name, exchange());
            println!("{standard}, {name}, Model Exchange: {message}");
            assert!(message.contains("beyond the 333333.3333333333 rad/s of any machine"), "{message}");
        }
    }
}
