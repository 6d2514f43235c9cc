//! FMUs with clocks in our importer, which makes their ticks: Co-Simulation with Event Mode and Model Exchange.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_import::Fmu;
use fmu_import::cosimulation::{Integration, Method, Recording, Schedule, Settings, Solver, System};
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

/// The plant sees the same commands at the same instants, whether the controller has a grid of its own or a clock.
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
