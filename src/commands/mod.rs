//! The commands of the command line, a module for each.

pub mod atlas;
pub mod bode;
pub mod build;
pub mod compare;
pub mod datasheet;
pub mod identify;
pub mod map;
pub mod merge;
pub mod modelica;
pub mod page;
pub mod preset;
pub mod prove;
pub mod reproduce;
pub mod simulink;
pub mod ssp;
pub mod sweep;
pub mod tune;

use anyhow::{Result, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, stderr};

/// The numbers of an option, separated by commas.
///
/// # Errors
/// Names the option and the part that is not a number.
fn numbers(option: &str, text: &str) -> Result<Vec<f64>> {
    let number = |part: &str| {
        let number = part.trim().parse();
        number.map_err(|_| anyhow!("{option} {part}: is not a number; write for example {option} 0.9,1"))
    };
    text.split(',').filter(|part| !part.trim().is_empty()).map(number).collect()
}

/// A progress bar for this many cells, on a terminal.
fn bar_of_cells(count: usize) -> ProgressBar {
    let count = u64::try_from(count).unwrap_or(u64::MAX);
    let bar = if stderr().is_terminal() { ProgressBar::new(count) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} cells  {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
