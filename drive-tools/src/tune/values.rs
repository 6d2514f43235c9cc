//! The values of a machine for importers: the values that differ from the start values, with one dictionary per FMU.

use super::application::Application;
use super::check::variables;
use super::motor::MotorFile;
use super::rules;
use super::setting::{Setting, Tuned, Value};
use crate::error::Result;
use drive::{PmsmPlant, SensorlessController};
use fmu_core::Model;
use fmu_core::description::{self, Variable, VariableKind};
use serde_json::{Map, Value as Json, json};
use std::path::Path;

/// Name, source and notes of a machine in an application, and for each FMU the start values by their names, in SI units,
/// enumerations as integers.
///
/// # Errors
/// As for [`tune`](super::tune) and [`Application::applied`], or the estimator is unknown.
pub fn values(path: &Path, estimator: Option<&str>, application: Application) -> Result<Json> {
    let mut motor = MotorFile::read(path)?;
    if let Some(estimator) = estimator {
        motor.choose(estimator)?;
    }
    let tuned = application.applied(&rules::tune(&motor)?)?;
    let (plant, controller) = needed(&tuned, true)?;
    let own = |settings: &[Setting]| object(settings.iter().map(|s| (s.name, &s.value)));
    let drive = of_drive(&tuned, true)?;
    Ok(json!({
        "name": tuned.name,
        "source": tuned.source,
        "notes": tuned.notes,
        "PmsmDrive": object(drive.iter().map(|(name, value)| (name.as_str(), value))),
        "PmsmPlant": own(&plant),
        "SensorlessController": own(&controller),
    }))
}

fn object<'a>(values: impl Iterator<Item = (&'a str, &'a Value)>) -> Json {
    let value = |value: &Value| match value {
        Value::Real(x) => json!(x),
        Value::Reals(all) => json!(all),
        Value::Integer(i) => json!(i),
        Value::Boolean(b) => json!(b),
        Value::Item(item) => json!(item),
    };
    Json::Object(values.map(|(name, x)| (name.to_owned(), value(x))).collect::<Map<_, _>>())
}

/// The settings of plant and controller for importers: the values that differ from the start values of the FMUs. The
/// value of an enumeration is the name of its item, or with `integers` its integer.
///
/// # Errors
/// A model cannot be described.
pub fn needed(tuned: &Tuned, integers: bool) -> Result<(Vec<Setting>, Vec<Setting>)> {
    Ok((of_model::<PmsmPlant>(&tuned.plant, integers)?, of_model::<SensorlessController>(&tuned.controller, integers)?))
}

/// The settings of `PmsmDrive`: the values that [`needed`] returns for plant and controller, with the prefixes `plant.` and
/// `controller.`, and `u_dc` once.
///
/// # Errors
/// A model cannot be described.
pub fn of_drive(tuned: &Tuned, integers: bool) -> Result<Vec<(String, Value)>> {
    let (plant, controller) = needed(tuned, integers)?;
    Ok(joined(&plant, &controller))
}

/// Settings of plant and controller with their names in `PmsmDrive`.
pub fn joined(plant: &[Setting], controller: &[Setting]) -> Vec<(String, Value)> {
    let named = |prefix: &str, setting: &Setting| (format!("{prefix}{}", setting.name), setting.value.clone());
    let of_plant = plant.iter().map(|s| named(if s.name == "u_dc" { "" } else { "plant." }, s));
    let of_controller = controller.iter().filter(|s| s.name != "u_dc").map(|s| named("controller.", s));
    of_plant.chain(of_controller).collect()
}

fn of_model<M: Model>(settings: &[Setting], integers: bool) -> Result<Vec<Setting>> {
    let description = variables::<M>()?;
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
