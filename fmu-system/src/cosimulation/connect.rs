//! Connections between the FMUs of a system: types, extents, units and tables.

use super::parts::{Port, family};
use super::system::System;
use super::tables::widens;
use super::wiring::{Change, Crossing, Source, Transformation, Units};
use fmu_core::variable::position;
use fmu_import::{Error, Instance};
use model_description::{Causality, Conversion, Measured, Passage, Variability};

impl System {
    /// Connects an output to an input, both written `instance.variable`. A number in another unit of the same quantity is converted
    /// (see [`with_units`](Self::with_units)); without a unit on one side it passes unchanged, with a [note](Self::take_notes).
    ///
    /// # Errors
    /// A variable does not exist, causalities, types or units do not fit, or the input is already fed.
    pub fn connect(&mut self, from: &str, to: &str) -> Result<(), Error> {
        self.connect_by(from, to, &Crossing { units: self.units, ..Crossing::default() })
    }

    /// [`connect`](Self::connect) for a crossing.
    ///
    /// # Errors
    /// As [`connect`](Self::connect).
    pub fn connect_by(&mut self, from: &str, to: &str, crossing: &Crossing) -> Result<(), Error> {
        let (source, target) = (self.parts.port(from)?, self.parts.port(to)?);
        let variable = self.parts.variable(source.instance, &source.name)?;
        let sends = matches!(variable.causality, Causality::Output | Causality::Local | Causality::CalculatedParameter);
        if !(sends || variable.variability == Variability::Constant || self.parts.is_timed_clock(&source)) {
            return Err(Error::usage(from, "is not an output"));
        }
        if let Some(Transformation::Table(table)) = &crossing.transformation {
            let change = self.parts.table([(from, &source), (to, &target)], table)?;
            self.check_fed(&target, to, false)?;
            return self.feed(target, to, Source::Port(source, Some(change)));
        }
        if family(source.base) != family(target.base) && !widens(&source, &target) {
            return Err(Error::usage(to, format!("has the type {}, {from} has {}", target.base, source.base)));
        }
        self.check_extents([(from, &source), (to, &target)])?;
        self.check_fed(&target, to, false)?;
        let conversion = match crossing.units {
            Units::PassOn => None,
            Units::Convert => match self.measured(from)?.into_unit(self.measured(to)?) {
                Ok(Passage::Equal) => None,
                Ok(Passage::Converted(conversion)) => Some(conversion),
                Ok(Passage::Unknown(cause)) => {
                    self.notes.push(format!("{from} to {to}: {cause}: the number passes unchanged"));
                    None
                }
                Err(cause) => return Err(Error::usage(to, incompatible(from, &cause))),
            },
        };
        let after = if let Some(Transformation::Linear(after)) = crossing.transformation { Some(after) } else { None };
        let conversion = Conversion::then(conversion, after).map(Change::Linear);
        self.feed(target, to, Source::Port(source, conversion))
    }

    /// Both ends of a connection are single values, or arrays of the same extents.
    fn check_extents(&self, [(from, source), (to, target)]: [(&str, &Port); 2]) -> Result<(), Error> {
        let extents = |port: &Port| if port.is_whole() { self.parts.shape(port) } else { Vec::new() };
        let (sent, taken) = (extents(source), extents(target));
        if sent == taken {
            return Ok(());
        }
        let said = |extents: &[usize]| match extents {
            [] => "one value".to_owned(),
            _ => format!("{} elements", extents.iter().map(usize::to_string).collect::<Vec<_>>().join(" x ")),
        };
        let (whole, shape) = if source.is_whole() { (from, &sent) } else { (to, &taken) };
        let remedy = match (sent.is_empty(), taken.is_empty()) {
            (false, false) => String::new(),
            _ => format!(": name an element of the array, as in {whole}{}", position(shape, 0)),
        };
        Err(Error::usage(to, format!("takes {}, and {from} has {}{remedy}", said(&taken), said(&sent))))
    }

    /// The known part of the unit of a variable, written `instance.variable`.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn measured(&self, port: &str) -> Result<Measured<'_>, Error> {
        let port = self.parts.port(port)?;
        let variable = self.parts.variable(port.instance, &port.name)?;
        Ok(self.parts.0[port.instance].description().measured(variable))
    }

    /// Connects every unconnected input to the output of the same name of another FMU; returns the connections.
    ///
    /// # Errors
    /// Several FMUs have the output.
    pub fn connect_by_name(&mut self) -> Result<Vec<(String, String)>, Error> {
        let mut found = Vec::new();
        for (index, target) in self.instances.iter().enumerate() {
            let inputs = target.description().variables.iter().filter(|v| v.causality == Causality::Input);
            for input in inputs.map(|v| &v.name) {
                if self.wiring.feeds(index, input) {
                    continue;
                }
                let has = |other: &Instance| {
                    let found = other.description().variable(input);
                    found.is_some_and(|v| v.causality == Causality::Output && v.name == *input)
                };
                let others = self.instances.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, other)| other);
                let sources: Vec<_> = others.filter(|other| has(other)).collect();
                let to = format!("{}.{input}", target.name());
                match sources.as_slice() {
                    [] => {}
                    [one] => found.push((format!("{}.{input}", one.name()), to)),
                    [one, two, ..] => {
                        let cause = format!("both {} and {} have an output of this name", one.name(), two.name());
                        return Err(Error::usage(&to, cause));
                    }
                }
            }
        }
        for (from, to) in &found {
            self.connect(from, to)?;
        }
        Ok(found)
    }
}

/// Why a variable in another unit cannot feed an input, and the remedy.
pub fn incompatible(from: &str, cause: &str) -> String {
    let remedy = "connect variables of the same quantity, or pass the number without conversion";
    format!("cannot be fed by {from}: {cause}: {remedy}")
}
