//! Parameter values of SSV files, set on the instances of a system.

use super::ssv::Parameter;
use crate::cosimulation::System;
use anyhow::{Context, Result, bail};
use fmu_core::variable::position;
use model_description::{Dimension, ModelDescription};

/// Sets the values on an instance, each judged by its FMU; `file` is named where one is wrong.
///
/// # Errors
/// Names file and line: the variable does not exist, has another unit or type, or the FMU refuses the value.
pub fn set(system: &mut System, instance: &str, file: &str, parameters: &[Parameter]) -> Result<()> {
    let description = system.instances().iter().find(|i| i.name() == instance).map(|i| i.description().clone());
    let whole = description.map(|description| arrays(&description, parameters));
    for p in whole.as_deref().unwrap_or(parameters) {
        one(system, instance, p).with_context(|| format!("{file}: line {}", p.line))?;
    }
    Ok(())
}

/// The parameters with the elements of each array, which SSP 1.0 names singly (`w[1]`, `w[2]`), as one of the array; elements that
/// are not named keep their start values.
fn arrays(description: &ModelDescription, parameters: &[Parameter]) -> Vec<Parameter> {
    let mut rest = parameters.to_vec();
    for variable in description.variables.iter().filter(|v| v.is_array()) {
        let fixed = |d: &Dimension| if let Dimension::Fixed(n) = d { usize::try_from(*n).ok() } else { None };
        let Some(shape) = variable.dimensions.iter().map(fixed).collect::<Option<Vec<_>>>() else { continue };
        let start = variable.start.as_deref().unwrap_or_default();
        let mut values: Vec<String> = start.split_whitespace().map(Into::into).collect();
        if values.len() != shape.iter().product::<usize>() {
            continue;
        }
        let mut first = None;
        rest.retain(|p| {
            let Some(at) = p.name.strip_prefix(&variable.name).filter(|at| at.starts_with('[')) else { return true };
            let Some(element) = (0..values.len()).find(|&e| position(&shape, e) == at) else { return true };
            values[element].clone_from(&p.value);
            first.get_or_insert_with(|| p.clone());
            false
        });
        rest.extend(first.map(|p| Parameter { name: variable.name.clone(), value: values.join(","), ..p }));
    }
    rest
}

fn one(system: &mut System, instance: &str, p: &Parameter) -> Result<()> {
    let name = &p.name;
    if let Some(i) = system.instances().iter().find(|i| i.name() == instance) {
        let model = &i.description().model_name;
        let Some(variable) = i.description().variable(name) else {
            bail!("{model} has no variable {name}: correct the name, or remove the parameter");
        };
        let unit = variable.unit.as_deref().unwrap_or("1");
        if let Some(given) = p.unit.as_deref().filter(|given| *given != unit) {
            bail!("{name} is given in {given}, and {model} has it in {unit}: convert the value");
        }
    }
    Ok(system.set(&format!("{instance}.{name}"), &p.value)?)
}
