//! The estimators on the switched inverter: the cells of the atlas that a drive holds on one inverter and loses on the other.
#![allow(missing_docs)]

use drive::plant::pwm::InverterMode;
use drive_study::atlas::cell::{Cell, Course, Grid};
use drive_study::atlas::drive::Drive;
use drive_study::atlas::{self, run::Verdict};
use drive_study::compare::candidate::Entry;

/// The verdicts of a drive about these cells, on both inverters.
fn verdicts(entry: Entry, cells: &[Cell]) -> Vec<(Cell, [Verdict; 2])> {
    let drives = [InverterMode::Average, InverterMode::Switched].map(|mode| Drive::compared(entry).on_inverter(mode));
    let [average, switched] = atlas::run(&drives, cells, 2, || ()).unwrap().try_into().ok().unwrap();
    average.runs.iter().zip(&switched.runs).map(|(a, b)| (a.0, [a.1, b.1])).collect()
}

/// Every estimator holds half of the rated torque at a fifth of the rated speed.
#[test]
fn every_estimator_holds_a_load_on_both_inverters() {
    let grid = Grid { R: vec![1.0], psi: vec![1.0], load: vec![0.5], speed: vec![0.2], ..Grid::default() };
    for entry in Entry::all() {
        for (_, [average, switched]) in verdicts(entry, &grid.cells(1).unwrap()) {
            println!("{}: angle errors {:.2} and {:.2} deg", entry.name, average.angle_error, switched.angle_error);
            assert!(average.lost.is_none() && switched.lost.is_none(), "{}: {average:?} {switched:?}", entry.name);
            assert!(
                (average.angle_error - switched.angle_error).abs() < 1.0,
                "{}: {average:?} {switched:?}",
                entry.name
            );
        }
    }
}

/// A table: the cells that are lost on either inverter.
#[test]
#[ignore = "ten minutes: cargo test --release -p drive-study --test switched -- --ignored --nocapture"]
fn the_atlas_on_both_inverters() {
    println!("| estimator | scenario | cells | lost on Average | on Switched | only on Average | only on Switched |");
    println!("|---|---|---|---|---|---|---|");
    for entry in Entry::all() {
        for scenario in [Course::Load, Course::Inverter] {
            let grid = Grid { scenarios: vec![scenario], R: vec![0.8, 1.0, 1.2], psi: vec![1.0], ..Grid::default() };
            let all = verdicts(entry, &grid.cells(1).unwrap());
            let lost = |k: usize| all.iter().filter(|(_, v)| v[k].lost.is_some()).count();
            let only = |k: usize| all.iter().filter(|(_, v)| v[k].lost.is_some() && v[1 - k].lost.is_none()).count();
            let (name, title) = (entry.name, scenario.name());
            println!("| {name} | {title} | {} | {} | {} | {} | {} |", all.len(), lost(0), lost(1), only(0), only(1));
        }
    }
}
