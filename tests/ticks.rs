//! FMUs with clocks in our importer, which makes their ticks: Co-Simulation with Event Mode and Model Exchange.
#![allow(missing_docs, clippy::float_cmp)]

use fmu::commands::build::{self, Build};
use fmu_import::cosimulation::{Integration, Method, Recording, Schedule, Settings, Solver, System};
use fmu_import::{Fmu, Kind, Values};
use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

const PACKAGES: [&str; 4] = ["pmsm-plant", "sensorless-controller", "sensorless-controller-clocked", "clocks"];

/// The archive of FMI 3.0 of a package, with its library as Cargo's tests are built.
fn archive(package: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let scratch = Path::new(env!("CARGO_TARGET_TMPDIR"));
        let target = scratch.parent().unwrap();
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--quiet", "--locked", "--target-dir"]).arg(target);
        for package in PACKAGES {
            cargo.args(["--package", package]);
        }
        let profile = if cfg!(debug_assertions) { "debug" } else { "release" };
        if profile == "release" {
            cargo.arg("--release");
        }
        assert!(cargo.current_dir(env!("CARGO_MANIFEST_DIR")).status().unwrap().success());
        let folder = scratch.join("ticks");
        for package in PACKAGES {
            let library = target.join(profile).join(format!("{DLL_PREFIX}{}{DLL_SUFFIX}", package.replace('-', "_")));
            let library = vec![library.display().to_string()];
            let fmi = Some("3".into());
            build::run(&Build { library, fmi, out: Some(folder.join(package)), ..Build::default() }).unwrap();
        }
        folder
    });
    let mut files = std::fs::read_dir(folder.join(package).join("fmi3")).unwrap();
    files.next().unwrap().unwrap().path()
}

fn exchange() -> Method {
    Method::ModelExchange(Integration { solver: Solver::Rk4, ..Integration::default() })
}

const EVENTS: Method = Method::CoSimulation { event_mode: true, early_return: false };

/// The pair with a start and a load step, recorded at every sample.
fn pair(method: Method, controller: &Path, step: f64) -> Recording {
    let mut system = System::new(method);
    system.add("p", &Fmu::open(archive("pmsm-plant")).unwrap(), false).unwrap();
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
    let (plain, clocked) = (archive("sensorless-controller"), archive("sensorless-controller-clocked"));
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

/// `inClock1` ticks by itself, `inClock3` when it asks for it, `inClock2` when the test does; the output clock at totals of 5.
#[test]
fn clocks_tick_by_their_kinds() {
    for kind in [Kind::CoSimulation { event_mode: true, early_return: false }, Kind::ModelExchange] {
        let fmu = Fmu::open(archive("clocks")).unwrap();
        let mut it = fmu.instantiate_as(kind, "it", false).unwrap();
        let number = |it: &mut fmu_import::Instance, name: &str| it.get(name).unwrap().number().unwrap();
        it.setup(0.0, None).unwrap();
        it.enter_initialization().unwrap();
        it.exit_initialization().unwrap();
        let mut rows = Vec::new();
        for k in 0..10_u32 {
            let t = f64::from(k);
            let mut trips = false;
            for second in [false, true] {
                if second && ![0, 1, 8, 9].contains(&k) {
                    continue;
                }
                if second {
                    it.set("inClock2", &Values::Booleans(vec![true])).unwrap();
                }
                loop {
                    trips |= it.get("outClock").unwrap() == Values::Booleans(vec![true]);
                    let total = number(&mut it, "totalInClockTicks");
                    let update = it.update_discrete_states().unwrap();
                    assert!(total > 0.0 && update.next_event_time == Some(if update.again { t } else { t + 1.0 }));
                    if !update.again {
                        break;
                    }
                }
            }
            rows.push((number(&mut it, "totalInClockTicks"), trips));
            match kind {
                Kind::ModelExchange => {
                    it.enter_continuous_time_mode().unwrap();
                    it.set_time(t + 1.0).unwrap();
                }
                Kind::CoSimulation { .. } => {
                    it.enter_step_mode().unwrap();
                    let _ = it.advance(t, 1.0).unwrap();
                }
            }
            it.enter_event_mode().unwrap();
        }
        let expected = [(2, false), (4, false), (5, true), (6, false), (8, false), (9, false), (10, true), (11, false)];
        let expected = expected.iter().chain(&[(13, false), (15, true)]).map(|&(n, trips)| (f64::from(n), trips));
        assert_eq!(rows, expected.collect::<Vec<_>>(), "{kind:?}");
    }
}
