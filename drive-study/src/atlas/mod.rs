//! The atlas: where a drive with wrong estimates of resistance and magnet flux holds low speeds under load, and whether
//! `lock_lost` reports the cells that it does not hold.
//!
//! - [`cell`]: the grid; [`mod@run`]: a run and the criteria for loss; [`drive`]: the drives;
//! - [`map`]: the map of a drive; [`report`]: tables, CSV and page.

pub mod cell;
pub mod drive;
pub mod map;
pub mod outside;
pub mod report;
pub mod run;

use crate::output::Folder;
use cell::Cell;
use drive::Drive;
use drive_tools::error::{Error, Result};
use drive_tools::queue;
use run::{Atlas, Verdict};
use std::path::Path;

/// Runs every cell with every drive on this many threads; calls `done` after each run. The result does not depend on the
/// number of threads.
///
/// # Errors
/// The parameters of a drive do not fit together.
pub fn run(drives: &[Drive], cells: &[Cell], threads: usize, done: impl Fn() + Sync) -> Result<Vec<Atlas>> {
    let jobs: Vec<_> = drives.iter().flat_map(|drive| cells.iter().map(move |cell| (drive, cell))).collect();
    let verdicts = queue::map_on(threads, &jobs, |(drive, cell)| {
        let verdict = run::run(drive, cell);
        done();
        verdict
    });
    let mut verdicts = verdicts.into_iter();
    let of = |drive: &Drive| {
        let one = |(cell, verdict): (&Cell, Result<Verdict, _>)| {
            let fault = |fault: fmu_core::Fault| {
                Error::new(format!("{} on the {}: {}", drive.name, drive.machine, fault.message()))
            };
            Ok((*cell, verdict.map_err(fault)?))
        };
        let runs = cells.iter().zip(verdicts.by_ref()).map(one).collect::<Result<_>>()?;
        Ok(Atlas { drive: drive.clone(), runs })
    };
    drives.iter().map(of).collect()
}

/// Writes CSV, tables, a map per drive and the page to `out`.
///
/// # Errors
/// A file cannot be written.
pub fn write(atlases: &[Atlas], out: &Path) -> Result<()> {
    let out = Folder::create(out)?;
    for atlas in atlases {
        out.write(&format!("atlas-{}.svg", atlas.drive.name), &map::svg(atlas))?;
    }
    out.write("atlas.csv", &report::csv(atlases))?;
    out.write("atlas.md", &report::markdown(atlases))?;
    out.write("atlas.html", &report::page(atlases))
}
