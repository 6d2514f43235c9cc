//! From a machine and bandwidths to parameter values of the FMUs.
//!
//! - [`motor`]: the TOML file of a machine; [`rules`]: how values follow from it; [`check`](mod@check): whether the models
//!   have such variables; [`ssv`]: the files that importers read (SSP 1.0).

pub mod check;
pub mod motor;
mod native;
pub mod rules;
pub mod ssv;

use anyhow::{Context, Result};
use motor::MotorFile;
use rules::Tuned;
use std::path::{Path, PathBuf};

/// Reads a machine's file and derives the values of both FMUs.
///
/// # Errors
/// Names file, line and column, and what is wrong: a key, a type, a value, or values that do not fit together.
pub fn tune(path: &Path) -> Result<Tuned> {
    let text = std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let motor = MotorFile::parse(&text, path)?;
    rules::tune(&motor)
}

/// Writes `NAME.PmsmPlant.ssv` and `NAME.SensorlessController.ssv` to a folder; returns their paths.
///
/// # Errors
/// A file cannot be written.
pub fn write(tuned: &Tuned, folder: &Path) -> Result<[PathBuf; 2]> {
    let write = |model: &str, settings: &[rules::Setting]| {
        let path = folder.join(format!("{}.{model}.ssv", tuned.name));
        crate::pack::write(&path, ssv::text(&format!("{} {model}", tuned.name), settings).as_bytes())?;
        anyhow::Ok(path)
    };
    Ok([write("PmsmPlant", &tuned.plant)?, write("SensorlessController", &tuned.controller)?])
}
