//! Parameter values of SSV files, set on the instances of a system.

use super::ssv::Parameter;
use crate::cosimulation::System;
use anyhow::{Context, Result, bail};

/// Sets the values on an instance, each judged by its FMU; `file` is named where one is wrong.
///
/// # Errors
/// Names file and line: the variable does not exist, has another unit or type, or the FMU refuses the value.
pub fn set(system: &mut System, instance: &str, file: &str, parameters: &[Parameter]) -> Result<()> {
    for p in parameters {
        one(system, instance, p).with_context(|| format!("{file}: line {}", p.line))?;
    }
    Ok(())
}

fn one(system: &mut System, instance: &str, p: &Parameter) -> Result<()> {
    let name = &p.name;
    if let Some(i) = system.instances().iter().find(|i| i.name() == instance) {
        let model = &i.description().model_name;
        let Some(variable) = i.description().variable_or_array(name) else {
            bail!("{model} has no variable {name}: correct the name, or remove the parameter");
        };
        let unit = variable.unit.as_deref().unwrap_or("1");
        if let Some(given) = p.unit.as_deref().filter(|given| *given != unit) {
            bail!("{name} is given in {given}, and {model} has it in {unit}: convert the value");
        }
    }
    Ok(system.set(&format!("{instance}.{name}"), &p.value)?)
}
