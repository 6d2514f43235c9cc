//! Parameter values of SSV files, set on the instances of a system.

use super::error::{Error, invalid};
use super::path::{Hop, along, transformed};
use super::ssv::Parameter;
use crate::cosimulation::System;
use fmu_import::quantity;
use model_description::{Measured, ModelDescription, ModelVariable, Passage, format_number, parse_number};

/// A value of an SSV file for an instance.
#[derive(Clone, Debug)]
pub struct Given {
    /// Name of the instance.
    pub instance: String,
    /// The file, for errors.
    pub file: String,
    /// Name and value of the variable.
    pub parameter: Parameter,
    /// The path of the value to the variable; a single part if direct.
    pub hops: Vec<Hop>,
}

impl Given {
    /// The values of a file for one instance.
    pub fn all(instance: &str, file: &str, parameters: &[Parameter]) -> Vec<Self> {
        let one = |p: &Parameter| Self {
            instance: instance.into(),
            file: file.into(),
            parameter: p.clone(),
            hops: vec![Hop::default()],
        };
        parameters.iter().map(one).collect()
    }

    fn port(&self) -> String {
        format!("{}.{}", self.instance, self.parameter.name)
    }
}

/// Sets the values in their order, each checked by its FMU; first come the structural parameters of all files, all of an
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
    for Given { instance, file, parameter, hops } in others {
        one(system, instance, parameter, hops).map_err(|error| error.at(format!("{file}: line {}", parameter.line)))?;
    }
    Ok(())
}

fn one(system: &mut System, instance: &str, p: &Parameter, hops: &[Hop]) -> Result<(), Error> {
    let (name, mut value, mut notes) = (&p.name, std::borrow::Cow::from(&p.value), Vec::new());
    if let Some(i) = system.instances().iter().find(|i| i.name() == instance) {
        let model = &i.description().model_name;
        let Some(variable) = find(i.description(), name) else {
            return invalid(format!("{model} has no variable {name}: correct the name, or remove the parameter"));
        };
        let wrong = |cause| Error::Invalid(format!("{name} {cause}"));
        let found = match hops {
            [] => Ok((None, Vec::new())),
            [hop] => through(p, hop, variable, i.description()),
            hops => along_path(p, hops, variable, i.description()),
        };
        let (converted, unknown) = found.map_err(wrong)?;
        value = converted.map_or(value, Into::into);
        notes.extend(unknown.into_iter().map(|note| format!("{instance}.{name}: {note}")));
    }
    for note in notes {
        system.note(note);
    }
    Ok(system.set(&format!("{instance}.{name}"), &value)?)
}

/// The value converted for the variable, if it differs, and notes on unknown units.
type Arrived = Result<(Option<String>, Vec<String>), String>;

/// The value in the unit of the variable, then transformed.
fn through(p: &Parameter, hop: &Hop, variable: &ModelVariable, description: &ModelDescription) -> Arrived {
    let as_it_is = Ok((None, None));
    let (converted, note) = if hop.no_conversion { as_it_is } else { in_unit_of(p, variable, description) }?;
    let notes = note.into_iter().collect();
    let Some(transformation) = &hop.transformation else { return Ok((converted, notes)) };
    let text = converted.as_ref().unwrap_or(&p.value);
    let taken = transformed(text, Some(transformation), false).map_err(|cause| format!("does not fit: {cause}"))?;
    Ok((Some(taken.into_owned()), notes))
}

/// The value after connectors of systems, each with its unit.
fn along_path(p: &Parameter, hops: &[Hop], variable: &ModelVariable, description: &ModelDescription) -> Arrived {
    let relative = variable.relative;
    let named = p.unit.as_deref().map(|unit| {
        let base = p.base.or_else(|| description.unit(unit).and_then(|defined| defined.base));
        Measured { unit: Some(unit), base, relative }
    });
    let wrong = |cause| format!("does not fit: {cause}");
    let end = Some(description.measured(variable)).filter(|own| own.unit.is_some());
    let way = along(named, hops, end, false).map_err(wrong)?;
    let taken = transformed(&p.value, way.transformation.as_ref(), way.only_units).map_err(wrong)?;
    Ok((Some(taken.into_owned()), way.notes))
}

/// The value in the unit of the variable, if that differs, and a note if one of the units is unknown.
fn in_unit_of(
    p: &Parameter,
    variable: &ModelVariable,
    description: &ModelDescription,
) -> Result<(Option<String>, Option<String>), String> {
    let Some(unit) = p.unit.as_deref() else { return Ok((None, None)) };
    let each = |convert: &dyn Fn(f64) -> Result<f64, String>| {
        let number = |text: &str| {
            let number = parse_number(text).ok_or_else(|| format!("= {text:?} in {unit} is not a number"))?;
            Ok::<_, String>(format_number(convert(number)?))
        };
        Ok::<_, String>(p.value.split_whitespace().map(number).collect::<Result<Vec<_>, _>>()?.join(" "))
    };
    if let (None, Some(own)) = (p.base, variable.unit.as_deref()) {
        if own == unit {
            return Ok((None, None));
        }
        let model = &description.model_name;
        let unknown =
            |_| format!("is given in {unit}, but {model} uses {own}: define {unit} in the file, or convert the value");
        return Ok((Some(each(&|x| quantity::convert(x, unit, variable, description).map_err(unknown))?), None));
    }
    let given = Measured { unit: Some(unit), base: p.base, relative: variable.relative };
    match given.into_unit(description.measured(variable)).map_err(|cause| format!("does not fit: {cause}"))? {
        Passage::Equal => Ok((None, None)),
        Passage::Unknown(why) => Ok((None, Some(format!("{why}: the number passes unchanged")))),
        Passage::Converted(conversion) => Ok((Some(each(&|x| Ok(conversion.apply(x)))?), None)),
    }
}

/// The variable of this name, or the array before its brackets, whose size may have been set.
pub(super) fn find<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a ModelVariable> {
    description.variable(name).or_else(|| description.variable(name.rsplit_once('[')?.0))
}
