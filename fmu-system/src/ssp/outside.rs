//! Connectors of a system, which name variables for users.

use super::error::{Error, invalid};
use super::path::transformed;
use crate::cosimulation::{Outlet, Schedule, Sequence, Transformation};
use model_description::Conversion;
use std::borrow::Cow;

/// Connectors of a system, none for FMUs without an SSP.
#[derive(Clone, Debug, Default)]
pub struct Connectors {
    /// Names of the inputs, each with the inputs `component.variable` that it feeds.
    pub inputs: Vec<(String, Vec<Inlet>)>,
    /// The outputs, each with its source.
    pub outputs: Vec<Outlet>,
}

/// A variable that receives values, and their transformation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inlet {
    /// `component.variable`.
    pub port: String,
    /// Transformation of the values.
    pub transformation: Option<Transformation>,
    /// Unit before the transformation.
    pub unit: Option<String>,
    /// The transformation only converts units.
    pub only_units: bool,
}

impl Inlet {
    /// A value as the variable takes it.
    ///
    /// # Errors
    /// The text is not a value that can be transformed.
    pub(super) fn text<'a>(&self, text: &'a str) -> Result<Cow<'a, str>, Error> {
        let wrong = |cause| Error::Invalid(format!("{}: {cause}", self.port));
        transformed(text, self.transformation.as_ref(), self.only_units).map_err(wrong)
    }

    /// Values over time as the variable takes them.
    ///
    /// # Errors
    /// As [`text`](Self::text).
    pub(super) fn sequence(&self, texts: &Sequence) -> Result<Sequence, Error> {
        match &self.transformation {
            None => Ok(texts.clone()),
            Some(Transformation::Linear(_)) if texts.has_unit() && self.only_units => Ok(texts.clone()),
            Some(Transformation::Linear(_)) if texts.has_unit() => {
                invalid(format!("{}: a transformation follows: write the column without a unit", self.port))
            }
            Some(_) => texts.through(|text| self.text(text).map(Cow::into_owned)),
        }
    }

    /// Numbers over time as the variable takes them.
    ///
    /// # Errors
    /// As [`text`](Self::text).
    pub(super) fn schedule(&self, schedule: Schedule) -> Result<Schedule, Error> {
        match &self.transformation {
            None => Ok(schedule),
            Some(Transformation::Linear(_)) if schedule.has_units() && self.only_units => Ok(schedule),
            Some(Transformation::Linear(_)) if schedule.has_units() => {
                invalid(format!("{}: a transformation follows: write numbers without a unit", self.port))
            }
            Some(Transformation::Linear(conversion)) => Ok(schedule.through(conversion)),
            Some(Transformation::Table(_)) => {
                invalid(format!("{}: is behind a table, which takes single values and no lines", self.port))
            }
        }
    }

    /// The conversion of a number that a sweep sets.
    ///
    /// # Errors
    /// It is a table.
    pub fn conversion(&self) -> Result<Option<Conversion>, Error> {
        match &self.transformation {
            None => Ok(None),
            Some(Transformation::Linear(conversion)) => Ok(Some(*conversion)),
            Some(Transformation::Table(_)) => invalid(format!("is behind a table: vary {} instead", self.port)),
        }
    }
}

impl Connectors {
    /// The variables denoted by a name to set: the inputs fed by an input of the system, or the name itself.
    ///
    /// # Errors
    /// The name has no dot, and the system has no such input.
    pub fn inlets(&self, name: &str) -> Result<Vec<Inlet>, Error> {
        if let Some((_, targets)) = self.inputs.iter().find(|(n, _)| n == name) {
            return Ok(targets.clone());
        }
        let of_system = !(self.inputs.is_empty() && self.outputs.is_empty());
        if of_system && !name.contains('.') {
            let names: Vec<&str> = self.inputs.iter().map(|(n, _)| n.as_str()).collect();
            return invalid(format!("{name}: is not an input of the system; it has {}", names.join(", ")));
        }
        Ok(vec![Inlet { port: name.to_owned(), ..Inlet::default() }])
    }

    /// The ports of [`inlets`](Self::inlets).
    ///
    /// # Errors
    /// As for [`inlets`](Self::inlets).
    pub fn ports(&self, name: &str) -> Result<Vec<String>, Error> {
        Ok(self.inlets(name)?.into_iter().map(|inlet| inlet.port).collect())
    }

    /// The variable denoted by a name to record: an output of the system, an input fed by one of the system, or the name itself.
    ///
    /// # Errors
    /// As for [`inlets`](Self::inlets), or an input of the system has no value that can be computed from the input that it feeds.
    pub fn outlet(&self, name: &str) -> Result<Outlet, Error> {
        if let Some(outlet) = self.outputs.iter().find(|outlet| outlet.name == name) {
            return Ok(outlet.clone());
        }
        let inlet = self.inlets(name)?.swap_remove(0);
        let back = match &inlet.transformation {
            None => None,
            Some(Transformation::Linear(Conversion { factor, offset })) if *factor != 0.0 => {
                Some(Transformation::Linear(Conversion { factor: 1.0 / factor, offset: -offset / factor }))
            }
            Some(_) => return invalid(format!("{name}: is behind a table: record {} instead", inlet.port)),
        };
        Ok(Outlet { port: inlet.port, name: name.into(), transformation: back, unit: inlet.unit, items: Vec::new() })
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Products that nothing rounds.
mod tests {
    use super::*;

    /// From km to m; with a transformation to the double of it.
    fn inlet(only_units: bool) -> Inlet {
        let conversion = Conversion { factor: if only_units { 1e3 } else { 2e3 }, offset: 0.0 };
        Inlet { transformation: Some(Transformation::Linear(conversion)), only_units, ..Inlet::default() }
    }

    #[test]
    fn numbers_over_time_are_converted_unless_they_have_a_unit() {
        let [plain, united] = ["0:1~1:3", "0:1~1:3 m"].map(|text| Schedule::parse(text).unwrap());
        assert!(!plain.has_units() && united.has_units());
        let at_end = |only_units, of: &Schedule| inlet(only_units).schedule(of.clone()).map(|s| s.at(1.0));
        assert_eq!(at_end(true, &plain).unwrap(), 3e3);
        assert_eq!(at_end(false, &plain).unwrap(), 6e3);
        assert_eq!(at_end(true, &united).unwrap(), 3.0, "the system converts it");
        assert!(at_end(false, &united).unwrap_err().to_string().contains("write numbers without a unit"));
    }
}
