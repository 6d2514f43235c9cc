//! The comparison: runs every estimator through every scenario on all cores, with the native models, then measures, checks
//! and plots the results.
//!
//! - [`run`](fn@run): a selection of estimators in scenarios; [`candidate`]: an estimator with the drive it is compared on;
//!   [`scenario`]: the test it runs through;
//! - [`running`]: the courses of a running drive; [`measure`]: the numbers measured in a run; [`figures`]: the figures that the review's
//!   list expects;
//! - [`on_machine`]: the same question on the user's machine, with tuned values; [`trials`]: its scenarios;
//! - [`table`], [`html`], [`plots`]: the output for an engineer.

pub mod candidate;
pub mod figures;
pub mod html;
pub mod machine;
pub mod measure;
mod parameters;
pub mod plots;
mod run;
pub mod running;
pub mod scenario;
mod signal;
pub mod table;
pub mod trials;
mod weakening;

use crate::output::Folder;
use drive_tools::error::Result;
use drive_tools::tune::setting::Unsuited;
use plots::Plot;
use std::path::Path;

pub use machine::{OnMachine, on_machine};
pub use measure::Outcome;
pub use run::{Run, Selection, run};

/// Writes table, CSV, plots and page to `out`.
///
/// # Errors
/// A file cannot be written.
pub fn write(cells: &[Run], out: &Path) -> Result<()> {
    let plots = plots::all(cells);
    let texts = [table::csv(cells), table::text(cells), table::markdown(cells), html::page(cells, &plots)?];
    files(&texts, &plots, out)
}

/// Writes table, CSV, plots and page of a machine to `out`.
///
/// # Errors
/// A file cannot be written.
pub fn write_machine(compared: &OnMachine, out: &Path) -> Result<()> {
    let (cells, plots) = (&compared.runs, plots::all(&compared.runs));
    let reasons = |each: fn(&Unsuited) -> String| compared.refused.iter().map(each).collect::<String>();
    let csv = table::csv(cells)
        + &reasons(|u| format!("{},,,,,,\"refused: {}\",\n", u.estimator.name(), u.reason.replace('"', "'")));
    let refused = reasons(|u| format!("- {}: {}\n", u.estimator.name(), u.reason));
    let heading = if refused.is_empty() { "" } else { "Methods that the machine does not suit:" };
    let words = [&compared.machine, &compared.starts, heading, &refused];
    let texts = [
        csv,
        machine_text(compared),
        table::markdown_under("Estimators compared on one machine", &words, cells),
        html::machine_page(compared, &plots)?,
    ];
    files(&texts, &plots, out)
}

/// The tables of a machine in plain text, and the methods that it does not suit.
pub fn machine_text(compared: &OnMachine) -> String {
    let refused = |u: &Unsuited| format!("does not suit {}: {}\n", u.estimator.name(), u.reason);
    table::tables(&compared.runs)
        + &table::refusals(&compared.runs)
        + &compared.refused.iter().map(refused).collect::<String>()
}

fn files(texts: &[String; 4], plots: &[Plot], out: &Path) -> Result<()> {
    let out = Folder::create(out)?;
    for Plot { name, figure } in plots {
        out.write(&format!("{name}.svg"), &fmu_plot::svg::draw(figure)?)?;
    }
    let names = ["compare.csv", "compare.txt", "compare.md", "compare.html"];
    names.iter().zip(texts).try_for_each(|(name, text)| out.write(name, text))
}
