//! The closed loop run natively: the reference for every figure and for the packed FMUs.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::missing_panics_doc)]

pub mod archives;
pub mod estimators;
pub mod importers;
pub mod packed;
pub mod pages;
pub mod python;
#[path = "../../drive-study/tests/common/shows.rs"]
pub mod shows;
pub mod words;

pub use archives::archives;
use drive::Pair;
use drive_study::reproduce::experiment::{ClosedLoop, Experiment, Point, RPM, Record, at, samples_apart};
use drive_study::runner::run_in_steps;
use fmu_core::{Block, Model, Slot};
use std::path::Path;

/// Sets the variable `name` of a block; integers and Booleans are converted from a number.
pub fn set<M: Model>(block: &mut Block<M>, name: &str, value: f64) {
    let index = (0..M::TABLE.len())
        .find(|&i| M::TABLE.locate(i).is_some_and(|(n, ..)| n == name))
        .unwrap_or_else(|| panic!("{} has no variable {name}", M::INFO.name));
    match M::TABLE.entry(block, index) {
        Some((_, Slot::Real(x))) => *x = value,
        #[expect(clippy::cast_possible_truncation, reason = "small integers in tests")]
        Some((_, Slot::Integer(x))) => assert!(x.set(value as i128), "{name} = {value}"),
        Some((_, Slot::Boolean(x))) => *x = value != 0.0,
        #[expect(clippy::cast_possible_truncation, reason = "small integers in tests")]
        Some((_, Slot::Enumeration(x))) => assert!(x.set(value as i32), "{name} = {value}"),
        _ => unreachable!("{name} is no number"),
    }
}

/// Angle error theta^ - theta in deg, wrapped.
pub fn error(pair: &Pair) -> f64 {
    drive::math::wrap(pair.controller.out.theta_est - pair.plant.out.theta_e).to_degrees()
}

/// Runs a pair for `duration` (s) in steps of `h` (s); `each` is called with it and the time before every step, and at the end.
pub fn run(pair: &mut Pair, h: f64, duration: f64, each: impl FnMut(f64, &mut Pair)) {
    let lasted = run_in_steps(pair, h, duration, each).expect("parameters that fit together");
    assert!(lasted, "a step failed");
}

/// A pair with parameters set on both sides.
pub fn pair(plant: &[(&str, f64)], controller: &[(&str, f64)]) -> Pair {
    let mut pair = Pair::default();
    for (name, value) in plant {
        set(&mut pair.plant, name, *value);
    }
    for (name, value) in controller {
        set(&mut pair.controller, name, *value);
    }
    pair
}

/// The native closed loop.
pub struct Native;

impl ClosedLoop for Native {
    fn run(&self, experiment: &Experiment, h: f64) -> Result<Record, fmu_import::Error> {
        let mut record = Record::default();
        let (mut k, every) = (0, samples_apart(h));
        run(&mut pair(experiment.plant, experiment.controller), h, experiment.duration, |t, p| {
            p.controller.model.inputs.speed_ref = at(experiment.speed_ref, t) * RPM;
            p.plant.model.inputs.tau_load = at(experiment.load, t);
            k += 1;
            if (k - 1) % every != 0 {
                return;
            }
            let (plant, controller) = (&p.plant.out, &p.controller.out);
            let point = Point {
                speed: plant.speed,
                theta_e: plant.theta_e,
                speed_est: controller.speed_est,
                theta_est: controller.theta_est,
                i_d: controller.i.d,
                i_q: controller.i.q,
            };
            record.push(experiment, t, &point);
        });
        Ok(record)
    }
}

/// Copies an archive entry by entry, each with new bytes or omitted.
pub fn rewrite(from: &Path, to: &Path, each: impl Fn(&str, Vec<u8>) -> Option<Vec<u8>>) {
    let mut source = zip::ZipArchive::new(std::fs::File::open(from).unwrap()).unwrap();
    let mut target = zip::ZipWriter::new(std::fs::File::create(to).unwrap());
    for index in 0..source.len() {
        let mut entry = source.by_index(index).unwrap();
        let (name, mut bytes) = (entry.name().unwrap().into_owned(), Vec::new());
        std::io::copy(&mut entry, &mut bytes).unwrap();
        if let Some(bytes) = each(&name, bytes) {
            target.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut target, &bytes).unwrap();
        }
    }
    target.finish().unwrap();
}
