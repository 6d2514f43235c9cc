//! The values of a machine for programs: one dictionary for each FMU.

use super::rules::{self, Value};
use super::{MotorFile, needed, of_drive};
use anyhow::Result;
use serde_json::{Map, Value as Json, json};
use std::path::Path;

/// Name, source and notes of a machine, and for each FMU the start values by their names, in SI units, enumerations as integers.
///
/// # Errors
/// Those of [`tune`](super::tune), or the estimator has no rules.
pub fn values(path: &Path, estimator: Option<&str>) -> Result<Json> {
    let mut motor = MotorFile::read(path)?;
    if let Some(estimator) = estimator {
        motor.choose(estimator)?;
    }
    let tuned = rules::tune(&motor)?;
    let (plant, controller) = needed(&tuned, true)?;
    let own = |settings: &[rules::Setting]| object(settings.iter().map(|s| (s.name, &s.value)));
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
