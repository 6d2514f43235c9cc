//! Checks that the models have the variables that the rules set, with matching type and range.

use super::motor::MotorFile;
use super::setting::{Setting, Value};
use crate::error::{Error, Result, bail};
use drive::{PmsmPlant, SensorlessController};
use fmu_core::description::VariableKind;
use fmu_core::{Description, Model};

/// The variables of a model.
///
/// # Errors
/// The model cannot be described.
pub fn variables<M: Model>() -> Result<Description> {
    Description::variables::<M>().map_err(Error::new)
}

/// Checks both lists against the descriptions of the models.
///
/// # Errors
/// States the variable and the position of its value in the machine file.
pub fn check(plant_settings: &[Setting], controller_settings: &[Setting], motor: &MotorFile) -> Result<()> {
    let (plant, controller) = (variables::<PmsmPlant>()?, variables::<SensorlessController>()?);
    for (description, settings) in [(&plant, plant_settings), (&controller, controller_settings)] {
        for setting in settings {
            one(description, setting).map_err(|what| match setting.origin {
                Some(offset) => Error::new(format!("{}: {what}", motor.place_at(offset))),
                None => Error::new(format!("{what} (by the rule: {})", setting.rule)),
            })?;
        }
    }
    Ok(())
}

fn one(description: &Description, setting: &Setting) -> Result<()> {
    let (model, name) = (&description.name, setting.name);
    let Some(variable) = description.variable(name) else { bail!("{model} has no variable {name}") };
    let number = match (&variable.kind, &setting.value) {
        (VariableKind::Real { .. }, Value::Real(x)) => *x,
        (VariableKind::Real { .. }, Value::Reals(all)) if all.len() == variable.elements() => return Ok(()),
        (VariableKind::Integer(_), Value::Integer(i)) => f64::from(*i),
        (VariableKind::Boolean, Value::Boolean(_)) => return Ok(()),
        (VariableKind::Enumeration { items, .. }, Value::Item(item)) => {
            if items.iter().any(|(_, known, _)| known == item) {
                return Ok(());
            }
            let known: Vec<_> = items.iter().map(|(_, known, _)| known.as_str()).collect();
            bail!("{name} of {model} is one of {}, not {item}", known.join(", "));
        }
        _ => bail!("{name} of {model} has another type than {:?}", setting.value),
    };
    let allowed = variable.range();
    if !allowed.contains(number) {
        bail!("{name} of {model} = {number} must be {allowed}: correct the value");
    }
    Ok(())
}
