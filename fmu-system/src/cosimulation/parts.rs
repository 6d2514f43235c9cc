//! The FMUs of a system with their names, and their variables, written `instance.variable`.

use super::Column;
use super::quantity::quantity;
use fmu_core::variable::position;
use fmu_import::quantity::suggest;
use fmu_import::{Error, Fmu, Instance, Kind, Logging, Values};
use model_description::{
    BaseType, Causality, Initial, IntervalVariability, ModelDescription, ModelVariable, Variability,
};

/// A variable of one of the instances.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Port {
    pub(super) instance: usize,
    pub(super) name: String,
    pub(super) reference: u32,
    pub(super) base: BaseType,
    /// Number of elements of the variable; 1 for a scalar.
    pub(super) count: usize,
    /// The element of an array, if it is one.
    pub(super) element: Option<usize>,
    /// The clocks of the variable, by value reference.
    pub(super) clocks: Vec<u32>,
    /// It is an array, or one of its elements.
    array: bool,
}

impl Port {
    /// Whether it is a double-precision number with a separate value reference, and always has a value.
    pub(super) fn is_fast(&self) -> bool {
        self.base == BaseType::Float64 && !self.array && self.clocks.is_empty()
    }

    /// Whether it is a whole array.
    pub(super) fn is_whole(&self) -> bool {
        self.array && self.element.is_none()
    }

    /// Its values now; `None` while its clock has not ticked.
    pub(super) fn read(&self, instance: &mut Instance) -> Result<Option<Values>, Error> {
        let values = instance.get_known(self.base, self.reference, self.count)?;
        Ok(match self.element {
            Some(element) => values.and_then(|values| values.element(element)),
            None => values,
        })
    }

    /// Sets it; the other elements of an array stay.
    pub(super) fn write(&self, instance: &mut Instance, values: &Values) -> Result<(), Error> {
        let Some(element) = self.element else { return instance.set_at(self.base, self.reference, values) };
        let mut all = instance.get_at(self.base, self.reference, self.count)?;
        if !all.replace(element, values) {
            return Err(Error::usage(instance.name(), format!("{} has no such element", self.name)));
        }
        instance.set_at(self.base, self.reference, &all)
    }

    /// This variable in the instance `count` positions later.
    pub(super) fn shifted(&self, count: usize) -> Self {
        Self { instance: self.instance + count, ..self.clone() }
    }
}

/// An FMU with the name of its instance.
#[derive(Clone)]
pub(super) struct Part {
    pub(super) name: String,
    pub(super) fmu: Fmu,
    pub(super) logging: Logging,
    pub(super) kind: Kind,
    /// Structural parameters that were set, and their values.
    pub(super) sizes: Vec<(Port, Values)>,
}

impl Part {
    pub(super) fn description(&self) -> &ModelDescription {
        self.fmu.description()
    }

    /// The value of a structural parameter that was set.
    fn size(&self, reference: u32) -> Option<usize> {
        let (_, values) = self.sizes.iter().rev().find(|(port, _)| port.reference == reference)?;
        let Values::Integers(values) = values else { return None };
        usize::try_from(*values.first()?).ok()
    }

    /// Extents of a variable with the sizes set; empty if one is unknown.
    fn shape(&self, variable: &ModelVariable) -> Vec<usize> {
        self.description().shape_with(variable, |reference| self.size(reference)).unwrap_or_default()
    }

    /// The array and element index denoted by a name, with the sizes set.
    fn element(&self, name: &str) -> Option<(&ModelVariable, usize)> {
        self.description().element_with(name, |reference| self.size(reference))
    }

    /// Sets the structural parameters of an instance, if any, in one Configuration Mode.
    pub(super) fn configure(&self, instance: &mut Instance) -> Result<(), Error> {
        if self.sizes.is_empty() {
            return Ok(());
        }
        let values: Vec<_> = self.sizes.iter().map(|(port, values)| (port.name.as_str(), values)).collect();
        instance.configure(&values)
    }
}

/// All FMUs, in the order they were added.
#[derive(Clone, Default)]
pub(super) struct Parts(pub(super) Vec<Part>);

impl Parts {
    /// `instance.variable`.
    pub(super) fn port(&self, text: &str) -> Result<Port, Error> {
        let (instance, name) = self.instance_and_rest(text, "VARIABLE")?;
        let variable = self.variable(instance, name)?;
        let part = &self.0[instance];
        let is_named = part.description().variable(name).is_some();
        let element = if is_named { None } else { part.element(name).map(|(_, element)| element) };
        let (array, clocks) = (variable.is_array(), variable.clocks.clone());
        let count = if array { part.shape(variable).iter().product() } else { 1 };
        let (reference, base) = (variable.value_reference, variable.base);
        Ok(Port { instance, reference, base, name: name.to_owned(), count, element, clocks, array })
    }

    /// A port that is one number.
    pub(super) fn scalar(&self, text: &str) -> Result<Port, Error> {
        let port = self.port(text)?;
        if port.is_whole() {
            let shape = self.shape(&port);
            let cause = "is an array, and this needs one number";
            return Err(Error::usage(text, format!("{cause}: name an element, {text}{}", position(&shape, 0))));
        }
        if kind(port.base).is_none() {
            return Err(Error::usage(text, format!("is a {}, and this needs a number", port.base)));
        }
        Ok(port)
    }

    /// A port that is one number and accepts a value before the initialization.
    pub(super) fn settable(&self, text: &str) -> Result<Port, Error> {
        let port = self.scalar(text)?;
        if port.element.is_some() {
            return Err(Error::usage(text, "is an element of an array; only scalars can be varied"));
        }
        let variable = self.variable(port.instance, &port.name)?;
        if variable.causality == Causality::StructuralParameter {
            return Err(Error::usage(
                text,
                "is a structural parameter, which sizes arrays: it has one value in all runs",
            ));
        }
        let starts = matches!(variable.initial_or_default(), Some(Initial::Exact | Initial::Approx));
        if variable.variability == Variability::Constant || !(starts || variable.causality == Causality::Input) {
            let cause = format!("is {} {} and cannot be set", variable.variability, variable.causality);
            return Err(Error::usage(text, format!("{cause}: vary a parameter, an input or a start value")));
        }
        Ok(port)
    }

    /// The variable of this name, or the array that contains the named element.
    pub(super) fn variable(&self, instance: usize, name: &str) -> Result<&ModelVariable, Error> {
        let part = &self.0[instance];
        let none = || Error::variable(&part.name, name, part.description());
        part.description().variable(name).or_else(|| Some(part.element(name)?.0)).ok_or_else(none)
    }

    /// Whether a port is an input clock whose ticks the FMU requests from the importer: it may then tick a triggered clock of
    /// another FMU.
    pub(super) fn is_timed_clock(&self, port: &Port) -> bool {
        let timing = self.variable(port.instance, &port.name).ok().and_then(|v| v.timing);
        timing.is_some_and(|timing| timing.ticks != IntervalVariability::Triggered)
    }

    /// The extents of the variable of a port.
    pub(super) fn shape(&self, port: &Port) -> Vec<usize> {
        let variable = self.variable(port.instance, &port.name);
        variable.map(|variable| self.0[port.instance].shape(variable)).unwrap_or_default()
    }

    pub(super) fn causality(&self, port: &Port) -> Causality {
        self.variable(port.instance, &port.name).map_or(Causality::Local, |v| v.causality)
    }

    /// The instance and the text after its name and a dot; an instance's name may itself contain dots. A single instance need
    /// not be named.
    pub(super) fn instance_and_rest<'a>(&self, text: &'a str, what: &str) -> Result<(usize, &'a str), Error> {
        let split = |(index, part): (usize, &Part)| {
            Some((index, part.name.len(), text.strip_prefix(&part.name)?.strip_prefix('.')?))
        };
        let best = self.0.iter().enumerate().filter_map(split).max_by_key(|(_, length, _)| *length);
        let names = || self.0.iter().map(|part| part.name.as_str()).collect::<Vec<_>>().join(", ");
        let full = |part: &Part| {
            let of = part.name.clone();
            part.description().variables.iter().map(move |v| format!("{of}.{}", v.name)).collect::<Vec<_>>()
        };
        let wrong = || {
            let all: Vec<String> = self.0.iter().flat_map(full).collect();
            let meant = suggest(text, all.iter().map(String::as_str));
            Error::usage(text, format!("is not INSTANCE.{what}; the instances are {}{meant}", names()))
        };
        let best = best.or_else(|| (self.0.len() == 1).then_some((0, 0, text)));
        best.map(|(index, _, rest)| (index, rest)).ok_or_else(wrong)
    }

    /// A column for the values of a port, with the units of its variable.
    pub(super) fn column(&self, port: &Port, name: &str) -> Column {
        let description = self.0[port.instance].description();
        let variable = self.variable(port.instance, &port.name).ok();
        let unit = variable.and_then(|v| v.unit.clone());
        let display = variable.and_then(|v| description.display_unit(v, None));
        let definition = variable.and_then(|v| description.type_definition(v.declared_type.as_ref()?));
        let items = definition.map(|d| d.items.iter().map(|i| (i.value, i.name.clone())).collect());
        let quantity = variable.map(|v| quantity(description, v)).unwrap_or_default();
        let (unit, items) = (unit.unwrap_or_default(), items.unwrap_or_default());
        Column { name: name.into(), quantity, unit, display, items, ..Column::default() }
    }
}

/// Types between which a value may travel have the same letter.
pub(super) fn family(base: BaseType) -> char {
    match base {
        BaseType::Float32 | BaseType::Float64 => 'r',
        BaseType::Boolean => 'b',
        BaseType::Clock => 'c',
        BaseType::String => 's',
        BaseType::Binary => 'x',
        _ => 'i',
    }
}

/// The letter of a type of numbers.
pub(super) fn kind(base: BaseType) -> Option<char> {
    Some(family(base)).filter(|letter| !"sx".contains(*letter))
}
