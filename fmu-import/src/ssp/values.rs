//! Parameter values of SSV files, set on the instances of a system.

use super::ssv::Parameter;
use crate::cosimulation::System;
use anyhow::{Context, Result, bail};
use model_description::{ModelDescription, ModelVariable};

/// Sets the values on an instance, each judged by its FMU, structural parameters first and together; `file` is named where one is
/// wrong.
///
/// # Errors
/// Names file and line: the variable does not exist, has another unit or type, or the FMU refuses the value.
pub fn set(system: &mut System, instance: &str, file: &str, parameters: &[Parameter]) -> Result<()> {
    let is_size = |p: &&Parameter| system.is_size(&format!("{instance}.{}", p.name)).unwrap_or(false);
    let (sizes, others): (Vec<_>, Vec<_>) = parameters.iter().partition(is_size);
    let named: Vec<_> = sizes.iter().map(|p| (format!("{instance}.{}", p.name), p.value.as_str())).collect();
    system.configure(named.iter().map(|(name, value)| (name.as_str(), *value))).with_context(|| file.to_owned())?;
    for p in others {
        one(system, instance, p).with_context(|| format!("{file}: line {}", p.line))?;
    }
    Ok(())
}

fn one(system: &mut System, instance: &str, p: &Parameter) -> Result<()> {
    let name = &p.name;
    if let Some(i) = system.instances().iter().find(|i| i.name() == instance) {
        let model = &i.description().model_name;
        let Some(variable) = find(i.description(), name) else {
            bail!("{model} has no variable {name}: correct the name, or remove the parameter");
        };
        let unit = variable.unit.as_deref().unwrap_or("1");
        if let Some(given) = p.unit.as_deref().filter(|given| *given != unit) {
            bail!("{name} is given in {given}, and {model} has it in {unit}: convert the value");
        }
    }
    Ok(system.set(&format!("{instance}.{name}"), &p.value)?)
}

/// The variable of this name, or the array before its brackets, whose size may be one that was set.
fn find<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a ModelVariable> {
    description.variable(name).or_else(|| description.variable(name.rsplit_once('[')?.0))
}
