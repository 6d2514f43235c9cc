//! `lock_lost` over a population of machines and estimators, from 0.1 to 1 of the rated speed: cold, hot, with wrong
//! estimates, in torque control, with current sensors of the wrong sign. A machine is of low voltage up to 60 V.
//!
//! ```sh
//! cargo test --release -p drive-study --test lost -- --ignored --nocapture
//! ```
//!
//! runs all cells of the machines in `motors/` and in the folder that `LOST_MOTORS` names, or every `LOST_EVERY`-th of them.
#![allow(missing_docs, non_snake_case)]

use drive::estimator::Kind;
use drive_study::atlas::cell::{Course, Grid};
use drive_study::atlas::drive::Drive;
use drive_study::atlas::run::{self, Verdict};
use drive_tools::queue;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Observations in a class of cells.
#[derive(Default)]
struct Tally {
    held: u32,
    alarms: u32,
    lost: u32,
    seen: u32,
}

impl Tally {
    fn see(&mut self, verdict: &Verdict) {
        if verdict.lost.is_some() {
            (self.lost, self.seen) = (self.lost + 1, self.seen + u32::from(verdict.lock_lost_is_right()));
        } else {
            (self.held, self.alarms) = (self.held + 1, self.alarms + u32::from(!verdict.lock_lost_is_right()));
        }
    }

    fn share(part: u32, whole: u32) -> String {
        if whole == 0 { String::new() } else { format!(" ({:.1} %)", 100.0 * f64::from(part) / f64::from(whole)) }
    }
}

/// Grid of every drive: load in both directions, four speeds, R^ off by 20 %.
fn grid() -> Grid {
    Grid {
        scenarios: vec![Course::Load, Course::Cold, Course::Hot, Course::Torque, Course::Sign],
        R: vec![0.8, 0.9, 1.0, 1.2],
        psi: vec![1.0, 0.85, 1.15],
        load: vec![0.0, 0.7, -0.7],
        speed: vec![0.1, 0.3, 0.5, 1.0],
        theta: vec![0.0],
    }
}

const KINDS: [Kind; 8] = [
    Kind::Rasmussen,
    Kind::ExtendedEmf,
    Kind::FluxObserver,
    Kind::SlidingMode,
    Kind::VoltageModel,
    Kind::KalmanFilter,
    Kind::GradientObserver,
    Kind::Hybrid,
];

fn machines() -> Vec<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors");
    let folders = std::iter::once(own).chain(std::env::var_os("LOST_MOTORS").map(PathBuf::from));
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    let mut files: Vec<_> = files.filter(|path| path.extension().is_some_and(|ext| ext == "toml")).collect();
    if let Ok(names) = std::env::var("LOST_MACHINES") {
        files.retain(|path| names.split(',').any(|name| path.file_stem().is_some_and(|stem| stem == name)));
    }
    files.sort();
    files
}

/// Runs every `every`-th cell of these drives; a line of tallies for each key that `keys` gives, and the cells where `lock_lost` is wrong.
fn population(drives: &[(String, Drive)], every: usize) -> (BTreeMap<String, Tally>, String) {
    let cells = grid().cells(1).unwrap();
    let jobs: Vec<_> =
        drives.iter().flat_map(|drive| cells.iter().map(move |cell| (drive, cell))).step_by(every).collect();
    let verdicts = queue::map(&jobs, |((_, drive), cell)| run::run(drive, cell));
    let (mut tallies, mut wrong) = (BTreeMap::<String, Tally>::new(), String::new());
    for (((file, drive), cell), verdict) in jobs.iter().zip(verdicts) {
        // A drive that the machine's values do not allow.
        let Ok(verdict) = verdict else { continue };
        let low = drive.bench.pair.controller.model.inputs.u_dc <= 60.0;
        let class = verdict.lost.map_or("held", |(loss, _)| loss.name());
        for key in [
            "all".to_owned(),
            format!("voltage: {}", if low { "up to 60 V" } else { "above 60 V" }),
            format!("estimator: {}", drive.name),
            format!("scenario: {}", cell.scenario.name()),
            format!("class: {class}"),
            format!("speed: {}", cell.speed),
            format!("machine: {file}"),
        ] {
            tallies.entry(key).or_default().see(&verdict);
        }
        if !verdict.lock_lost_is_right() {
            let _ = writeln!(
                wrong,
                "{file},{},{},{},{},{},{},{class},{:.2},{:.2},{:.3},{:.0}",
                drive.name,
                cell.scenario.name(),
                cell.R,
                cell.psi,
                cell.load,
                cell.speed,
                verdict.lock_lost,
                verdict.while_held,
                verdict.speed_error,
                verdict.angle_error
            );
        }
    }
    (tallies, wrong)
}

fn drives(files: &[PathBuf], kinds: &[Kind]) -> Vec<(String, Drive)> {
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    let tuned =
        |path: &PathBuf| kinds.iter().filter_map(|&kind| Some((name(path), Drive::tuned(path, kind).ok()?))).collect();
    files.iter().flat_map(|path| -> Vec<_> { tuned(path) }).collect()
}

#[test]
#[ignore = "minutes: the population behind docs/atlas.md"]
fn the_population() {
    let every = std::env::var("LOST_EVERY").map_or(1, |text| text.parse().unwrap());
    let mut kinds = KINDS.to_vec();
    if let Ok(names) = std::env::var("LOST_KINDS") {
        kinds.retain(|kind| names.split(',').any(|name| name == kind.name()));
    }
    let drives = drives(&machines(), &kinds);
    let began = Instant::now();
    let (tallies, wrong) = population(&drives, every);
    println!(
        "machine,estimator,scenario,R^/R,psi^/psi,load,speed,class,lock_lost,while held,speed error,angle error\n{wrong}"
    );
    println!("| Cells | Lost | Seen | Held | False alarms |\n|---|---|---|---|---|");
    for (key, Tally { held, alarms, lost, seen }) in &tallies {
        println!(
            "| {key} | {lost} | {seen}{} | {held} | {alarms}{} |",
            Tally::share(*seen, *lost),
            Tally::share(*alarms, *held)
        );
    }
    println!("{} drives, {:.0} s", drives.len(), began.elapsed().as_secs_f64());
}
