//! Mappings of the values of one file to the parameters of another system (System Structure Parameter Mapping, SSP 1.0, 5.5).

use super::element::{at, is_true, local, required};
use super::path::Hop;
use super::ssv::Parameter;
use crate::cosimulation::Transformation;
use model_description::{Conversion, Element, parse_number};

/// An entry: from a name of the file to one of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct MappingEntry {
    source: String,
    target: String,
    hop: Hop,
    line: usize,
}

/// The entries of a mapping.
///
/// # Errors
/// The line, and the missing, unknown or repeated item.
pub fn read(root: &Element) -> Result<Vec<MappingEntry>, String> {
    if local(root) != "ParameterMapping" {
        return Err(at(root, format!("<{}> is not a ParameterMapping of SSP", root.name)));
    }
    let mut entries: Vec<MappingEntry> = Vec::new();
    for e in root.children.iter().filter(|e| local(e) == "MappingEntry") {
        let hop = Hop { no_conversion: suppresses(e)?, transformation: transformation(e)?, unit: None };
        let entry = MappingEntry { source: required(e, "source")?, target: required(e, "target")?, hop, line: e.line };
        if entries.iter().any(|other| other.target == entry.target) {
            return Err(at(e, format!("target={:?} is already mapped: remove one of the entries", entry.target)));
        }
        entries.push(entry);
    }
    Ok(entries)
}

/// Whether a connection or an entry passes numbers on without conversion of units.
///
/// # Errors
/// The line and its error.
pub(super) fn suppresses(e: &Element) -> Result<bool, String> {
    is_true(e, "suppressUnitConversion")
}

/// The transformation of a connection or an entry.
///
/// # Errors
/// The line and its error.
pub(super) fn transformation(parent: &Element) -> Result<Option<Transformation>, String> {
    let mut all = parent.children.iter().filter(|c| local(c).ends_with("Transformation"));
    let Some(e) = all.next() else { return Ok(None) };
    if let Some(second) = all.next() {
        return Err(at(second, format!("<{}> is the second transformation: remove one of them", second.name)));
    }
    match local(e) {
        "LinearTransformation" => linear(e).map(|conversion| Some(Transformation::Linear(conversion))),
        "BooleanMappingTransformation" | "IntegerMappingTransformation" | "EnumerationMappingTransformation" => {
            table(e).map(|pairs| Some(Transformation::Table(pairs.into())))
        }
        _ => Err(at(e, format!("<{}> is not a transformation of SSP", e.name))),
    }
}

/// The entries of a table, with unique sources.
fn table(e: &Element) -> Result<Vec<(String, String)>, String> {
    let boolean = local(e).starts_with("Boolean");
    let text = |entry: &Element, name: &str| {
        let text = required(entry, name)?.trim().to_owned();
        match text.as_str() {
            _ if !boolean => Ok(text),
            "true" | "1" => Ok("true".to_owned()),
            "false" | "0" => Ok("false".to_owned()),
            _ => Err(at(entry, format!("{name}={text:?} is not true or false"))),
        }
    };
    let mut pairs: Vec<(String, String)> = Vec::new();
    for entry in e.children.iter().filter(|c| local(c) == "MapEntry") {
        let (source, target) = (text(entry, "source")?, text(entry, "target")?);
        if pairs.iter().any(|(other, _)| *other == source) {
            return Err(at(entry, format!("source={source:?} is already in the table")));
        }
        pairs.push((source, target));
    }
    Ok(pairs)
}

fn linear(e: &Element) -> Result<Conversion, String> {
    let number = |name: &str, otherwise: f64| match e.get(name) {
        None => Ok(otherwise),
        Some(text) => parse_number(text).ok_or_else(|| at(e, format!("{name}={text:?} is not a number"))),
    };
    Ok(Conversion { factor: number("factor", 1.0)?, offset: number("offset", 0.0)? })
}

/// The values under the names of the mapping, each with the transformation of its entry; values that it does not name are
/// omitted.
///
/// # Errors
/// The entry whose source is missing from the file.
pub(super) fn apply(entries: &[MappingEntry], parameters: &[Parameter]) -> Result<Vec<(Parameter, Hop)>, String> {
    let one = |entry: &MappingEntry| {
        let Some(p) = parameters.iter().find(|p| p.name == entry.source) else {
            let other = parameters.iter().find(|p| p.name.ends_with(&format!(".{}", entry.source)));
            let meant = other.map(|p| format!("; with the prefix of the binding it is {}", p.name));
            let (source, target) = (&entry.source, &entry.target);
            let meant = meant.unwrap_or_default();
            return Err(format!("line {}: {source} to {target}: no value has this name{meant}", entry.line));
        };
        Ok((Parameter { name: entry.target.clone(), ..p.clone() }, entry.hop.clone()))
    };
    entries.iter().map(one).collect()
}
