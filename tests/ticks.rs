//! FMUs with clocks in our importer, which generates their ticks: Co-Simulation with Event Mode and Model Exchange.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_import::{Fmu, Values};
use fmu_system::cosimulation::{Integration, Method, Recording, Schedule, Settings, Solver, System};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

mod common;

fn archive(name: &str) -> PathBuf {
    common::archives().join("fmi3").join(name).with_extension("fmu")
}

fn exchange() -> Method {
    Method::ModelExchange(Integration { solver: Solver::Rk4, ..Integration::default() })
}

const EVENTS: Method = Method::CoSimulation { event_mode: true, early_return: false };

/// The pair with a start and a load step, recorded at every sample.
fn pair(method: Method, controller: &Path, step: f64) -> Recording {
    let mut system = System::new(method);
    system.add("p", &Fmu::open(archive("PmsmPlant")).unwrap(), false).unwrap();
    system.add("c", &Fmu::open(controller).unwrap(), false).unwrap();
    system.connect_by_name().unwrap();
    system.connect("c.enabled", "p.enable").unwrap();
    system.input("c.speed_ref", Schedule::parse("0:0,0.01:80").unwrap()).unwrap();
    system.input("p.tau_load", Schedule::parse("0:0,0.1:1").unwrap()).unwrap();
    for input in ["p.u_dc", "c.u_dc"] {
        system.input(input, Schedule::parse("325").unwrap()).unwrap();
    }
    for name in ["p.i_a", "p.i_b", "p.speed", "c.u_a"] {
        system.record(name).unwrap();
    }
    let settings = Settings { start: 0.0, stop: 0.2, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

fn bits(recording: &Recording, name: &str) -> Vec<u64> {
    recording.column(name).unwrap().values.iter().map(|x| x.to_bits()).collect()
}

/// The plant receives the same commands at the same instants, whether the controller has its own grid or a clock.
#[test]
fn the_clocked_pair_is_the_pair() {
    let (plain, clocked) = (archive("SensorlessController"), archive("SensorlessControllerClocked"));
    for method in [EVENTS, exchange()] {
        let (ours, theirs) = (pair(method.clone(), &clocked, 1e-4), pair(method.clone(), &plain, 1e-4));
        assert!(theirs.column("p.speed").unwrap().values.last().unwrap() > &50.0);
        for name in ["p.i_a", "p.i_b", "p.speed", "c.u_a"] {
            assert_eq!(bits(&ours, name), bits(&theirs, name), "{name}, {method:?}");
        }
    }
    // Without events, the master exchanges at every sample: today's pair.
    let (ours, jacobi) = (pair(Method::default(), &clocked, 1e-4), pair(Method::default(), &plain, 1e-4));
    for name in ["p.i_a", "p.speed"] {
        assert_eq!(bits(&ours, name), bits(&jacobi, name), "{name}");
    }
}

/// Runs two instances of an FMU with a clock of every kind, in this order; `a` triggers `b`; for each clock of both, the
/// times (s) of its ticks from the start.
fn ticks(fmu: &Fmu, method: &Method, order: [&str; 2], step: f64) -> [Vec<Vec<f64>>; 2] {
    let mut system = System::new(method.clone());
    for name in order {
        system.add(name, fmu, false).unwrap();
    }
    system.connect("a.trip", "b.triggered").unwrap();
    let mut times = [(); 2].map(|()| Vec::new());
    let settings = Settings { start: 2.0, stop: 3.15, step, sequential: false };
    let _ = system
        .run(&settings, |point| {
            for (name, times) in ["a", "b"].into_iter().zip(&mut times) {
                let Values::Reals(all) = point.instance(name).unwrap().get("times")? else { unreachable!() };
                let of = |row: &[f64]| row.iter().copied().take_while(|t| *t >= 0.0).collect();
                *times = all.chunks(8).map(of).collect();
            }
            Ok(ControlFlow::Continue(()))
        })
        .unwrap();
    times
}

/// Clocks with a period and a shift, changing clocks, countdowns, and an output clock of one FMU that ticks the triggered clock of
/// another. At 0.3 s five clocks tick, whose times are rounded differently.
#[test]
fn every_kind_ticks_at_its_times() {
    let files = common::packed::packed("tests/ticks", "ticks-fmu", &common::python::scratch().join("ticks"));
    // Only the fraction determines when its clock ticks.
    let file = files[0].with_file_name("fractions.fmu");
    let decimals = r#" intervalDecimal="0.3333333333333333" shiftDecimal="0.3333333333333333""#;
    common::rewrite(&files[0], &file, |name, bytes| {
        if name != "modelDescription.xml" {
            return Some(bytes);
        }
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(text.matches(decimals).count(), 1, "{text}");
        Some(text.replace(decimals, "").into_bytes())
    });
    let fmu = Fmu::open(&file).unwrap();
    let names = ["constant", "fraction", "fixed", "tunable", "changing", "countdown", "triggered"];
    let own: [&[f64]; 5] = [
        &[0.05, 0.3, 0.55, 0.8, 1.05],
        &[1.0 / 3.0, 2.0 / 3.0, 1.0],
        &[0.1, 0.3, 0.5, 0.7, 0.9, 1.1],
        &[0.0, 0.3, 0.6, 0.9],
        &[0.1, 0.3, 0.6, 1.0],
    ];
    let triggered: [[&[f64]; 2]; 2] = [[&[], &[]], [&[0.325, 0.825], &[0.3, 0.8]]];
    for method in [EVENTS, exchange()] {
        for (order, step) in [(["a", "b"], 0.1), (["b", "a"], 0.07)] {
            let (found, mut most) = (ticks(&fmu, &method, order, step), 0.0);
            for ((instance, found), last) in ["a", "b"].iter().zip(&found).zip(triggered) {
                for ((name, found), expected) in names.iter().zip(found).zip(own.into_iter().chain(last)) {
                    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    let place = format!("{instance}.{name}, {method:?}, step {step} s");
                    assert!(found.len() == expected.len() && off < 1e-12, "{place}: {found:?}, not {expected:?}");
                    most = off.max(most);
                }
            }
            println!("{order:?}, step {step} s: off by {most:e} s");
        }
    }
}
