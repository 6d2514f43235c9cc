//! From a machine and bandwidths to parameter values of the FMUs.
//!
//! - [`motor`]: the TOML file of a machine. [`plausible`] checks its values, [`saturation`] its saturation.
//! - [`rules`]: how values ([`setting`]) follow from the file: [`bandwidth`] and [`loops`] for the loops, [`method`] for the
//!   estimators ([`rasmussen`], [`flux_observer`], [`back_emf`], [`injection`]), [`adaptation`] for the resistance,
//!   [`voltage`] for what the DC link allows, [`iron`] for iron loss from a drag test,
//!   [`flux_map`] for a map from a table, [`losses`] for inverter and temperature coefficients. [`check`](mod@check)
//!   compares them with the variables of the models; [`Tuned::pair`] is the native drive with these values.
//! - [`application`]: torque or speed control, and the shaft.
//! - [`trial`]: tries the drive from many start angles, timed by its own time constants ([`pace`]). [`limits`]: the conditions
//!   that it cannot hold, and why. [`remedy`]: what helps.

pub mod adaptation;
pub mod application;
pub mod back_emf;
pub mod bandwidth;
pub mod check;
pub mod flux_map;
pub mod flux_observer;
pub mod injection;
pub mod iron;
pub mod limits;
pub mod loops;
pub mod losses;
pub mod method;
pub mod motor;
mod native;
pub mod pace;
pub mod plausible;
pub mod rasmussen;
pub mod remedy;
pub mod rules;
pub mod saturation;
pub mod setting;
pub mod trial;
mod values;
pub mod voltage;

use crate::error::Result;
use motor::MotorFile;
use setting::Tuned;
use std::path::Path;

pub use values::{joined, needed, of_drive, values};

/// Reads a machine's file and derives the values of both FMUs.
///
/// # Errors
/// Gives file, line and column, and the problem: a key, a type, a value, or inconsistent values.
pub fn tune(path: &Path) -> Result<Tuned> {
    rules::tune(&MotorFile::read(path)?)
}
