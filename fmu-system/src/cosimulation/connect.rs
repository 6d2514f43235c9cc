//! Connections between the FMUs of a system: types, extents, units and tables.

use super::parts::{Port, family, kind};
use super::system::System;
use super::wiring::{Change, Crossing, Source, Units};
use fmu_core::variable::position;
use fmu_import::{Error, Instance, Number, Values};
use model_description::{Causality, Conversion, Measured, Passage};

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
    pub fn connect_by(&mut self, from: &str, to: &str, crossing: &Crossing<'_>) -> Result<(), Error> {
        let Crossing { units, stated, transformation, table } = crossing;
        let (source, target) = (self.parts.port(from)?, self.parts.port(to)?);
        let sends = matches!(self.parts.causality(&source), Causality::Output | Causality::Local);
        if !sends && !self.parts.is_timed_clock(&source) {
            return Err(Error::usage(from, "is not an output"));
        }
        if let Some(table) = table {
            let table = self.table([(from, &source), (to, &target)], table)?;
            self.check_fed(&target, to, false)?;
            return self.feed(target, to, Source::Port(source, Some(Change::Table(table))));
        }
        let widens = matches!((family(source.base), family(target.base)), ('i', 'r'));
        if family(source.base) != family(target.base) && !widens {
            return Err(Error::usage(to, format!("has the type {}, {from} has {}", target.base, source.base)));
        }
        self.check_extents([(from, &source), (to, &target)])?;
        self.check_fed(&target, to, false)?;
        let conversion = match units {
            Units::PassOn => None,
            Units::Convert => match self.measured(from, stated[0])?.into_unit(self.measured(to, stated[1])?) {
                Ok(Passage::Equal) => None,
                Ok(Passage::Converted(conversion)) => Some(conversion),
                Ok(Passage::Unknown(cause)) => {
                    self.notes.push(format!("{from} to {to}: {cause}: the number passes unchanged"));
                    None
                }
                Err(cause) => {
                    let remedy = "connect variables of the same quantity, or pass the number without conversion";
                    return Err(Error::usage(to, format!("cannot be fed by {from}: {cause}: {remedy}")));
                }
            },
        };
        let conversion = Conversion::then(conversion, *transformation).map(Change::Linear);
        self.feed(target, to, Source::Port(source, conversion))
    }

    /// A table between two variables of one number each; the source is an integer, a Boolean or an enumeration.
    fn table(
        &self,
        [(from, source), (to, target)]: [(&str, &Port); 2],
        table: &[(String, String)],
    ) -> Result<std::sync::Arc<[(Number, Number)]>, Error> {
        for (name, port) in [(from, source), (to, target)] {
            if port.is_whole() || kind(port.base).is_none_or(|kind| kind == 'c') {
                return Err(Error::usage(name, "is not one number, which a table of values needs"));
            }
        }
        if source.base.is_float() {
            return Err(Error::usage(
                from,
                "is a real number: a table of values needs an integer, a Boolean or an item",
            ));
        }
        let read = |port: &Port, text: &str| {
            let description = self.parts.0[port.instance].description();
            let values = Values::read(text, self.parts.variable(port.instance, &port.name)?, description);
            Ok::<_, Error>(values.map(|values| values.one(0)))
        };
        let entry = |(one, other): &(String, String)| {
            let sent = read(source, one)?;
            let taken = read(target, other)?.map_err(|cause| Error::usage(to, cause))?;
            // The table may have values beyond those of the source.
            Ok::<_, Error>(sent.ok().map(|sent| (sent, taken)))
        };
        let entries: Vec<Option<_>> = table.iter().map(entry).collect::<Result<_, _>>()?;
        Ok(entries.into_iter().flatten().collect())
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

    /// The known part of the unit of a variable, written `instance.variable`; `stated` if its FMU names none.
    ///
    /// # Errors
    /// The variable does not exist.
    pub fn measured<'a>(&'a self, port: &str, stated: Option<Measured<'a>>) -> Result<Measured<'a>, Error> {
        let port = self.parts.port(port)?;
        let variable = self.parts.variable(port.instance, &port.name)?;
        let own = self.parts.0[port.instance].description().measured(variable);
        Ok(stated.filter(|_| own.unit.is_none()).unwrap_or(own))
    }

    /// Connects every input that nothing feeds to the output of the same name of another FMU; returns the connections.
    ///
    /// # Errors
    /// Several FMUs have the output.
    pub fn connect_by_name(&mut self) -> Result<Vec<(String, String)>, Error> {
        let mut found = Vec::new();
        let names = |i: &Instance, causality| -> Vec<String> {
            i.description().variables.iter().filter(|v| v.causality == causality).map(|v| v.name.clone()).collect()
        };
        for (index, target) in self.instances.iter().enumerate() {
            for input in names(target, Causality::Input) {
                if self.wiring.feeds(index, &input) {
                    continue;
                }
                let others = self.instances.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, other)| other);
                let sources: Vec<_> = others.filter(|o| names(o, Causality::Output).contains(&input)).collect();
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
