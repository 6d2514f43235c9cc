//! From a machine and bandwidths to parameter values of the FMUs.
//!
//! - [`motor`]: the TOML file of a machine; [`rules`]: how values follow from it; [`check`](mod@check): whether the models
//!   have such variables; [`Tuned::pair`](rules::Tuned::pair): the drive with these values, natively.

pub mod check;
pub mod motor;
mod native;
pub mod rules;

use anyhow::{Context, Result};
use motor::MotorFile;
use rules::Tuned;
use std::path::Path;

/// Reads a machine's file and derives the values of both FMUs.
///
/// # Errors
/// Names file, line and column, and what is wrong: a key, a type, a value, or values that do not fit together.
pub fn tune(path: &Path) -> Result<Tuned> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let motor = MotorFile::parse(&text, path)?;
    rules::tune(&motor)
}
