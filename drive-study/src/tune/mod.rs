//! From a machine and bandwidths to parameter values of the FMUs.
//!
//! - [`motor`]: the TOML file of a machine. [`plausible`] checks its values, [`saturation`] its saturation.
//! - [`rules`]: how values follow from the file: [`bandwidth`] for the loops, [`rasmussen`] and [`extended_emf`] for the
//!   estimators, [`voltage`] for what the DC link allows, [`iron`] for iron loss from a drag test, [`flux_map`] for a map from a
//!   table, [`losses`] for inverter and temperature coefficients. [`check`](mod@check)
//!   compares them with the variables of the models; [`Tuned::pair`](rules::Tuned::pair) is the native drive with these values.
//! - [`trial`]: tries the drive from many start angles, timed by its own time constants ([`pace`]). [`limits`]: what it will not
//!   hold, and why. [`remedy`]: what helps.

pub mod bandwidth;
pub mod check;
pub mod extended_emf;
pub mod flux_map;
pub mod iron;
pub mod limits;
pub mod losses;
pub mod motor;
mod native;
pub mod pace;
pub mod plausible;
pub mod rasmussen;
pub mod remedy;
pub mod rules;
pub mod saturation;
pub mod trial;
mod values;
pub mod voltage;

use anyhow::{Result, anyhow};
use drive::{PmsmPlant, SensorlessController};
use fmu_core::description::{self, Variable, VariableKind};
use fmu_core::{Description, Model};
use motor::MotorFile;
use rules::{Setting, Tuned, Value};
use std::path::Path;

pub use values::values;

/// Reads a machine's file and derives the values of both FMUs.
///
/// # Errors
/// Gives file, line and column, and the problem: a key, a type, a value, or inconsistent values.
pub fn tune(path: &Path) -> Result<Tuned> {
    rules::tune(&MotorFile::read(path)?)
}

/// The settings of plant and controller for importers: the values that differ from the start values of the FMUs. The
/// value of an enumeration is the name of its item, or with `integers` its integer.
///
/// # Errors
/// A model cannot be described.
pub fn needed(tuned: &Tuned, integers: bool) -> Result<(Vec<Setting>, Vec<Setting>)> {
    Ok((of_model::<PmsmPlant>(&tuned.plant, integers)?, of_model::<SensorlessController>(&tuned.controller, integers)?))
}

/// The settings of `PmsmDrive`: those that [`needed`] gives for plant and controller, with the prefixes `plant.` and
/// `controller.`, and `u_dc` once.
///
/// # Errors
/// A model cannot be described.
pub fn of_drive(tuned: &Tuned, integers: bool) -> Result<Vec<(String, Value)>> {
    let (plant, controller) = needed(tuned, integers)?;
    Ok(joined(&plant, &controller))
}

/// Settings of plant and controller with the names that they have in `PmsmDrive`.
pub fn joined(plant: &[Setting], controller: &[Setting]) -> Vec<(String, Value)> {
    let named = |prefix: &str, setting: &Setting| (format!("{prefix}{}", setting.name), setting.value.clone());
    let of_plant = plant.iter().map(|s| named(if s.name == "u_dc" { "" } else { "plant." }, s));
    let of_controller = controller.iter().filter(|s| s.name != "u_dc").map(|s| named("controller.", s));
    of_plant.chain(of_controller).collect()
}

fn of_model<M: Model>(settings: &[Setting], integers: bool) -> Result<Vec<Setting>> {
    let description = Description::of::<M>().map_err(|e| anyhow!("{e}"))?;
    let one = |setting: &Setting| {
        let variable = description.variable(setting.name);
        let number = variable.and_then(|v| item_value(v, &setting.value)).map(Value::Integer);
        let start = variable.and_then(|v| v.start.as_deref());
        let same = start.is_some_and(|start| is(number.as_ref().unwrap_or(&setting.value), start));
        let value = number.filter(|_| integers).unwrap_or_else(|| setting.value.clone());
        (!same).then(|| Setting { value, ..setting.clone() })
    };
    Ok(settings.iter().filter_map(one).collect())
}

/// The integer behind an item of an enumeration.
fn item_value(variable: &Variable, value: &Value) -> Option<i32> {
    match (&variable.kind, value) {
        (VariableKind::Enumeration { items, .. }, Value::Item(item)) => {
            items.iter().find(|(_, name, _)| name == item).map(|(value, ..)| *value)
        }
        _ => None,
    }
}

/// Whether a value is the start value, to the last bit.
fn is(value: &Value, start: &[description::Value]) -> bool {
    let real = |x: f64, start: &description::Value| matches!(start, description::Value::Real(start) if x.to_bits() == start.to_bits());
    match (value, start) {
        (Value::Real(x), [start]) => real(*x, start),
        (Value::Reals(all), starts) => all.iter().zip(starts).all(|(x, start)| real(*x, start)),
        (Value::Integer(x), [description::Value::Integer(start)]) => i128::from(*x) == *start,
        (Value::Boolean(x), [description::Value::Boolean(start)]) => x == start,
        _ => false,
    }
}
