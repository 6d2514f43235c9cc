//! Parameter values of SSV files, set on the instances of a system.

use super::error::{Error, invalid};
use super::ssv::Parameter;
use crate::cosimulation::System;
use model_description::{ModelDescription, ModelVariable};

/// A value of an SSV file for an instance.
#[derive(Clone, Debug)]
pub struct Given {
    /// Name of the instance.
    pub instance: String,
    /// The file, for errors.
    pub file: String,
    /// Name and value of the variable.
    pub parameter: Parameter,
}

impl Given {
    /// The values of a file for one instance.
    pub fn all(instance: &str, file: &str, parameters: &[Parameter]) -> Vec<Self> {
        let one = |p: &Parameter| Self { instance: instance.into(), file: file.into(), parameter: p.clone() };
        parameters.iter().map(one).collect()
    }

    fn port(&self) -> String {
        format!("{}.{}", self.instance, self.parameter.name)
    }
}

/// Sets the values in their order, each checked by its FMU; first come the structural parameters of all files, those of an
/// instance in one Configuration Mode.
///
/// # Errors
/// Names file and line: the variable does not exist, has another unit or type, or the FMU refuses the value.
pub fn set(system: &mut System, given: &[Given]) -> Result<(), Error> {
    let (sizes, others): (Vec<_>, Vec<_>) =
        given.iter().partition(|value| system.is_size(&value.port()).unwrap_or(false));
    let ports: Vec<_> = sizes.iter().map(|size| (size.port(), size.parameter.value.as_str())).collect();
    let mut files: Vec<_> = sizes.iter().map(|size| size.file.as_str()).collect();
    files.dedup();
    let configured = system.configure(ports.iter().map(|(port, value)| (port.as_str(), *value)));
    configured.map_err(|error| Error::from(error).at(files.join(", ")))?;
    for Given { instance, file, parameter } in others {
        one(system, instance, parameter).map_err(|error| error.at(format!("{file}: line {}", parameter.line)))?;
    }
    Ok(())
}

fn one(system: &mut System, instance: &str, p: &Parameter) -> Result<(), Error> {
    let name = &p.name;
    if let Some(i) = system.instances().iter().find(|i| i.name() == instance) {
        let model = &i.description().model_name;
        let Some(variable) = find(i.description(), name) else {
            return invalid(format!("{model} has no variable {name}: correct the name, or remove the parameter"));
        };
        let unit = variable.unit.as_deref().unwrap_or("1");
        if let Some(given) = p.unit.as_deref().filter(|given| *given != unit) {
            return invalid(format!("{name} is given in {given}, but {model} has it in {unit}: convert the value"));
        }
    }
    Ok(system.set(&format!("{instance}.{name}"), &p.value)?)
}

/// The variable of this name, or the array before its brackets, whose size may have been set.
pub(super) fn find<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a ModelVariable> {
    description.variable(name).or_else(|| description.variable(name.rsplit_once('[')?.0))
}
