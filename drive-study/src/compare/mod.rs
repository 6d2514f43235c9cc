//! The comparison: runs every estimator through every scenario on all cores, with the native models, then measures, checks
//! and plots the results.
//!
//! - [`run`](fn@run): a selection of estimators in scenarios; [`candidate`]: an estimator with the drive it is compared on;
//!   [`scenario`]: the test it runs through;
//! - [`running`]: the courses of a running drive; [`measure`]: the numbers measured in a run; [`figures`]: the figures that the review's
//!   list expects;
//! - [`table`], [`html`], [`plots`]: the output for an engineer.

pub mod candidate;
pub mod figures;
pub mod html;
pub mod measure;
mod parameters;
pub mod plots;
mod run;
pub mod running;
pub mod scenario;
mod signal;
pub mod table;
mod weakening;

use crate::output::Folder;
use drive_tools::error::Result;
use plots::Plot;
use std::path::Path;

pub use measure::Outcome;
pub use run::{Run, Selection, run};

/// Writes table, CSV, plots and page to `out`.
///
/// # Errors
/// A file cannot be written.
pub fn write(cells: &[Run], out: &Path) -> Result<()> {
    let out = Folder::create(out)?;
    let plots = plots::all(cells);
    for Plot { name, figure } in &plots {
        out.write(&format!("{name}.svg"), &fmu_plot::svg::draw(figure)?)?;
    }
    out.write("compare.csv", &table::csv(cells))?;
    out.write("compare.txt", &table::text(cells))?;
    out.write("compare.md", &table::markdown(cells))?;
    out.write("compare.html", &html::page(cells, &plots)?)
}
