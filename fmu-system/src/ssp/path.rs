//! The path of a value through connectors: the units of each, and transformations.

use crate::cosimulation::{Transformation, converted};
use fmu_import::Number;
use fmu_import::quantity::split;
use model_description::{BaseUnit, Measured, Passage, format_number, parse_number};
use std::borrow::Cow;

/// A unit of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedUnit {
    /// Name.
    pub name: String,
    /// Relation to the SI base units, if the file defines it.
    pub base: Option<BaseUnit>,
}

impl StatedUnit {
    /// The unit of a number that is a difference or not.
    pub(super) fn measured(&self, relative: bool) -> Measured<'_> {
        Measured { unit: Some(&self.name), base: self.base, relative }
    }
}

/// A part of the path of a value: from one connector to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Hop {
    /// Unit of the connector at its end, if the file gives one.
    pub unit: Option<StatedUnit>,
    /// Whether values pass without conversion, even between different units.
    pub no_conversion: bool,
    /// Transformation after the conversion of the units.
    pub transformation: Option<Transformation>,
}

/// Transformation of a value from the beginning of a path to its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Way {
    pub(super) transformation: Option<Transformation>,
    /// The path only converts units.
    pub(super) only_units: bool,
    /// Name of the unit at the end.
    pub(super) unit: Option<String>,
    /// Units that are not known.
    pub(super) notes: Vec<String>,
}

/// Follows a path; a connector without a unit takes that of the preceding one.
///
/// # Errors
/// The units of two connectors belong to different quantities, or two transformations do not fit.
pub(super) fn along<'a>(
    start: Option<Measured<'a>>,
    hops: &'a [Hop],
    end: Option<Measured<'a>>,
    passes: bool,
) -> Result<Way, String> {
    let (mut way, mut unit) = (Way { only_units: true, ..Way::default() }, start);
    for (k, hop) in hops.iter().enumerate() {
        let relative = unit.or(end).is_some_and(|unit| unit.relative);
        let stated = hop.unit.as_ref().map(|unit| unit.measured(relative));
        let next = if k + 1 == hops.len() { end.or(stated) } else { stated };
        if let (Some(from), Some(into), false) = (unit, next, passes || hop.no_conversion) {
            match from.into_unit(into)? {
                Passage::Equal => {}
                Passage::Converted(conversion) => {
                    let conversion = Some(Transformation::Linear(conversion));
                    way.transformation = Transformation::then(way.transformation, conversion)?;
                }
                Passage::Unknown(cause) => way.notes.push(format!("{cause}: the number passes unchanged")),
            }
        }
        way.only_units &= hop.transformation.is_none();
        way.transformation = Transformation::then(way.transformation, hop.transformation.clone())?;
        unit = next.or(unit);
    }
    way.unit = unit.and_then(|unit| unit.unit).map(str::to_owned);
    Ok(way)
}

/// A text after a transformation.
///
/// # Errors
/// The text is not a number, for a linear one; a number with a unit passes only if units alone are converted.
pub(super) fn transformed<'a>(
    text: &'a str,
    transformation: Option<&Transformation>,
    only_units: bool,
) -> Result<Cow<'a, str>, String> {
    match transformation {
        None => Ok(text.into()),
        Some(Transformation::Linear(conversion)) => {
            let number = |word: &str| {
                let whole = word.parse::<i128>().map(Number::Integer).ok();
                whole.or_else(|| parse_number(word).map(Number::Real))
            };
            let written = |number: Number| match converted(conversion, number) {
                Number::Integer(i) => i.to_string(),
                other => format_number(other.real()),
            };
            let words: Option<Vec<String>> = text.split_whitespace().map(|word| number(word).map(written)).collect();
            match words {
                Some(words) => Ok(words.join(" ").into()),
                None if only_units && split(text).is_some() => Ok(text.into()),
                None if split(text).is_some() => {
                    Err(format!("{text:?} has a unit, and a transformation follows: write the number alone"))
                }
                None => Err(format!("{text:?} is not a number")),
            }
        }
        Some(Transformation::Table(table)) => {
            let text = text.trim();
            let other = match text {
                "1" => "true",
                "0" => "false",
                _ => text,
            };
            let entry = |sought: &str| table.iter().find(|(sent, _)| sent == sought);
            Ok(entry(text).or_else(|| entry(other)).map_or(text.into(), |(_, taken)| taken.clone().into()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use model_description::Conversion;

    fn unit(name: &str, factor: f64) -> StatedUnit {
        StatedUnit { name: name.into(), base: Some(BaseUnit { exponents: [0; 8], factor, offset: 0.0 }) }
    }

    fn linear(factor: f64, offset: f64) -> Transformation {
        Transformation::Linear(Conversion { factor, offset })
    }

    /// Each connection converts the unit and then transforms: 2 km are 2000 m, 2010 m after the offset, 2.01 km, 4.02 km.
    #[test]
    fn each_connector_counts_with_its_unit() {
        let (km, m) = (unit("km", 1e3), unit("m", 1.0));
        let hop =
            |unit: &StatedUnit, transformation| Hop { unit: Some(unit.clone()), transformation, ..Hop::default() };
        let hops = [hop(&m, Some(linear(1.0, 10.0))), hop(&km, Some(linear(2.0, 0.0)))];
        let way = along(Some(km.measured(false)), &hops, None, false).unwrap();
        let Some(Transformation::Linear(conversion)) = way.transformation else { panic!("{way:?}") };
        assert!((conversion.apply(2.0) - 4.02).abs() < 1e-12);
        assert_eq!((way.unit.as_deref(), way.only_units), (Some("km"), false));
        let way = along(Some(km.measured(false)), &hops, None, true).unwrap();
        assert_eq!(way.transformation, Some(linear(2.0, 20.0)));
        let plain = [Hop { transformation: None, ..hops[0].clone() }, Hop::default()];
        let way = along(Some(km.measured(true)), &plain, None, false).unwrap();
        assert_eq!((way.transformation, way.only_units), (Some(linear(1e3, 0.0)), true));
    }

    #[test]
    fn tables_follow_tables_and_keep_other_values() {
        let table = |pairs: &[(&str, &str)]| {
            Some(Transformation::Table(pairs.iter().map(|(a, b)| ((*a).into(), (*b).into())).collect()))
        };
        let both = Transformation::then(table(&[("a", "b"), ("c", "d")]), table(&[("b", "x"), ("e", "y")])).unwrap();
        let after = |text| transformed(text, both.as_ref(), false).unwrap().into_owned();
        assert_eq!(["a", "b", "c", "d", "e", "f"].map(after), ["x", "x", "d", "d", "y", "f"]);
        assert!(Transformation::then(both, Some(linear(2.0, 0.0))).unwrap_err().contains("a table and a linear"));
        let not = table(&[("true", "false"), ("false", "true")]);
        assert_eq!(["1", "false"].map(|text| transformed(text, not.as_ref(), false).unwrap()), ["false", "true"]);
        let twice = Some(linear(2.0, 1.0));
        assert_eq!(transformed("1 2", twice.as_ref(), false).unwrap(), "3 5");
        assert_eq!(transformed("9007199254740993 1.5", twice.as_ref(), false).unwrap(), "18014398509481987 4");
        assert_eq!(transformed("1 rpm", twice.as_ref(), true).unwrap(), "1 rpm");
        assert!(transformed("1 rpm", twice.as_ref(), false).unwrap_err().contains("write the number alone"));
        assert!(transformed("on", twice.as_ref(), true).unwrap_err().contains("\"on\" is not a number"));
    }
}
