//! The commands of the command line, a module for each.

pub mod atlas;
pub mod build;
pub mod compare;
pub mod info;
pub mod merge;
pub mod new;
pub mod preset;
pub mod prove;
pub mod reproduce;
pub mod simulate;
pub mod ssp;
pub mod sweep;
pub mod tune;

use indicatif::{ProgressBar, ProgressStyle};
use std::io::{IsTerminal, stderr};

/// A progress bar for this many cells, on a terminal.
fn bar_of_cells(count: usize) -> ProgressBar {
    let count = u64::try_from(count).unwrap_or(u64::MAX);
    let bar = if stderr().is_terminal() { ProgressBar::new(count) } else { ProgressBar::hidden() };
    let style = ProgressStyle::with_template("{wide_bar} {pos}/{len} cells  {eta} left");
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
