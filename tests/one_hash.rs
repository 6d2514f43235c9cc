//! One number for each FMU and interface: the bits of all its outputs at every point of the default experiment. Both standards give it,
//! on any number of threads, with states saved and restored, in shorter communication steps, optimized and not.
//!
//! The steps of the integration end at the communication points. Shorter ones give the same bits where those are fixed otherwise: in a
//! controller always, in `PmsmDrive` if they end at its samples.
#![allow(missing_docs)]

mod common;

use fmu_core::draw::{Draw, mix};
use fmu_import::{Fmu, contents};
use fmu_system::cosimulation::{CommunicationPoint, Integration, Method, Sequence, Settings, Solver, System};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// FMU; hashes in Co-Simulation and in Model Exchange with RK4; parts of a communication step that change nothing.
const HASHES: [(&str, [u64; 2], &[u32]); 6] = [
    ("MappedDrive", [0x4bfe_f7ba_907a_c7fd, 0x8366_b239_9da2_5d71], &[]),
    ("PmsmDrive", [0xa692_8df2_f686_2ed7, 0x11d4_55aa_0b88_e758], &[2, 5, 10]),
    ("PmsmDriveMean", [0x4006_60e7_b0cd_b9a4, 0x6a54_ba47_8884_bda7], &[]),
    ("PmsmPlant", [0xca63_3d0c_87cc_61e9, 0x7133_1bb5_dbbd_8b42], &[]),
    ("SensorlessController", [0xd825_86e8_4ec4_8ced, 0xd825_86e8_4ec4_8ced], &[3, 7]),
    ("SensorlessControllerClocked", [0xd825_86e8_4ec4_8ced, 0xd825_86e8_4ec4_8ced], &[3]),
];

/// An FMU in one interface.
struct Case {
    fmu: Fmu,
    method: Method,
    expected: u64,
    parts: &'static [u32],
    feed: Vec<(String, Sequence)>,
}

/// All cases, of the archives that `open` returns for a standard and a name.
fn cases(open: impl Fn(&str, &str) -> Fmu) -> Vec<Case> {
    let mut cases = Vec::new();
    for (name, expected, parts) in HASHES {
        let clocked = name.ends_with("Clocked");
        let standards: &[&str] = if clocked { &["fmi3"] } else { &["fmi2", "fmi3"] };
        let methods = [
            Method::CoSimulation { event_mode: clocked, early_return: false },
            Method::ModelExchange(Integration { solver: Solver::Rk4, ..Integration::default() }),
        ];
        for standard in standards {
            for (method, expected) in methods.iter().zip(expected) {
                let fmu = open(standard, name);
                cases.push(Case { fmu, method: method.clone(), expected, parts, feed: feed(name) });
            }
        }
    }
    cases
}

fn packed() -> Vec<Case> {
    cases(|standard, name| Fmu::open(common::archives().join(standard).join(name).with_extension("fmu")).unwrap())
}

/// The inputs of the default experiment, held over its steps; both controllers have the same.
fn feed(name: &str) -> Vec<(String, Sequence)> {
    let name = name.trim_end_matches("Clocked");
    let (md, files) = contents(&common::archives().join("fmi3").join(name).with_extension("fmu")).unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&file, &files[&format!("{}{name}_in.csv", fmu_pack::reference::FOLDER)]).unwrap();
    Sequence::read_csv(file.path(), |name| md.variable(name).is_some()).unwrap()
}

/// Checks the hash of a run in communication steps of 1/`parts` of the default step, at the points of the default step. With
/// `save`, the instance is stored, reset and restored at random points.
fn check(case: &Case, parts: u32, mut save: Option<Draw>) {
    let mut system = System::new(case.method.clone());
    system.add("fmu", &case.fmu, false).unwrap();
    system.record_outputs().unwrap();
    for (input, texts) in &case.feed {
        system.sequence(&format!("fmu.{input}"), texts).unwrap();
    }
    let experiment = &case.fmu.description().default_experiment;
    let (start, stop, step) = (experiment.start.unwrap(), experiment.stop.unwrap(), experiment.step.unwrap());
    let settings = Settings { start, stop, step: step / f64::from(parts), sequential: false };
    let (mut hash, mut saved) = (0, 0);
    let each = |point: &mut CommunicationPoint<'_>| {
        if point.index.is_multiple_of(parts) {
            hash = point.values.iter().fold(hash, |hash, x| mix(hash ^ x.real().to_bits()));
        }
        if save.as_mut().is_some_and(|draw| draw.below(10) == 0) {
            let it = point.instance("fmu").unwrap();
            let state = it.get_state()?;
            let bytes = it.serialize_state(state)?;
            it.free_state(state)?;
            it.reset()?;
            let state = it.deserialize_state(&bytes)?;
            it.set_state(state)?;
            it.free_state(state)?;
            saved += 1;
        }
        Ok(ControlFlow::Continue(()))
    };
    system.run(&settings, each).unwrap();
    assert!(save.is_none() || saved > 5, "{saved} states");
    let Case { fmu, method, expected, .. } = case;
    let version = fmu.description().version;
    let place = format!("{}, FMI {version}, {method:?}, 1/{parts} of a step, {saved} states", fmu.path().display());
    assert_eq!(hash, *expected, "{place}: {hash:#x}, not {expected:#x}");
}

/// A thread takes the next run; the instances of an FMU share its library.
#[test]
fn on_any_number_of_threads() {
    let cases = packed();
    for threads in [1, 2, 4, 8, 16, 32] {
        let (next, runs) = (AtomicUsize::new(0), cases.len().max(threads));
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    while let Some(run) = Some(next.fetch_add(1, Relaxed)).filter(|run| *run < runs) {
                        check(&cases[run % cases.len()], 1, None);
                    }
                });
            }
        });
    }
}

#[test]
fn saved_and_restored() {
    for (seed, case) in packed().iter().enumerate() {
        check(case, 1, Some(Draw(seed as u64)));
    }
}

#[test]
fn in_parts_of_a_step() {
    for case in packed() {
        for parts in case.parts {
            check(&case, *parts, None);
        }
    }
}

/// The FMUs of Cargo's profile `dev`: our libraries for development in the archives of the release.
#[test]
#[ignore = "compiles six libraries, in minutes"]
fn in_a_build_for_development() {
    let dir = tempfile::tempdir().unwrap();
    let cases = cases(|standard, name| {
        let package = name.chars().fold(String::new(), |text, c| {
            let dash = if c.is_uppercase() && !text.is_empty() { "-" } else { "" };
            text + dash + &c.to_lowercase().to_string()
        });
        let library = std::fs::read(common::packed::library(&package)).unwrap();
        let from = common::archives().join(standard).join(name).with_extension("fmu");
        let to = dir.path().join(format!("{standard}-{name}.fmu"));
        common::rewrite(&from, &to, |entry, bytes| {
            Some(if entry.starts_with("binaries/") { library.clone() } else { bytes })
        });
        Fmu::open(&to).unwrap()
    });
    for case in &cases {
        check(case, 1, None);
    }
}
