//! Mappings of the values of one file to the parameters of another system (System Structure Parameter Mapping, SSP 1.0, 5.5).

use super::element::local;
use super::ssv::Parameter;
use model_description::{Conversion, Element, format_number, parse_number};

/// An entry: from a name of the file to one of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct MappingEntry {
    source: String,
    target: String,
    transformation: Transformation,
    line: usize,
}

/// The transformation of a value.
#[derive(Clone, Debug, PartialEq)]
enum Transformation {
    None,
    Linear(Conversion),
    /// Values and what becomes of them.
    Table(Vec<(String, String)>),
}

/// The entries of a mapping.
///
/// # Errors
/// The line, and what is missing or unknown there.
pub fn read(root: &Element) -> Result<Vec<MappingEntry>, String> {
    if local(root) != "ParameterMapping" {
        return Err(format!("line {}: <{}> is not a ParameterMapping of SSP", root.line, root.name));
    }
    root.children.iter().filter(|e| local(e) == "MappingEntry").map(entry).collect()
}

fn entry(e: &Element) -> Result<MappingEntry, String> {
    let named =
        |name: &str| e.get(name).map(str::to_owned).ok_or_else(|| format!("line {}: an entry without {name}", e.line));
    let transformation = match e.children.iter().find(|c| local(c).ends_with("Transformation")) {
        None => Transformation::None,
        Some(t) if local(t) == "LinearTransformation" => Transformation::Linear(linear(t)?),
        Some(t) => Transformation::Table(table(t)?),
    };
    Ok(MappingEntry { source: named("source")?, target: named("target")?, transformation, line: e.line })
}

/// The entries of a BooleanMappingTransformation, IntegerMappingTransformation or EnumerationMappingTransformation.
///
/// # Errors
/// The line of an entry that lacks something, or whose source another entry has.
pub(super) fn table(e: &Element) -> Result<Vec<(String, String)>, String> {
    let mut pairs: Vec<(String, String)> = Vec::new();
    for entry in e.children.iter().filter(|c| local(c) == "MapEntry") {
        let (source, target) = pair(entry)?;
        if pairs.iter().any(|(other, _)| *other == source) {
            return Err(format!("line {}: source={source:?} is already in the table", entry.line));
        }
        pairs.push((source, target));
    }
    Ok(pairs)
}

fn pair(e: &Element) -> Result<(String, String), String> {
    let named = |name: &str| {
        e.get(name).map(str::to_owned).ok_or_else(|| format!("line {}: <{}> has no attribute {name}", e.line, e.name))
    };
    Ok((named("source")?, named("target")?))
}

/// The linear transformation of an element.
///
/// # Errors
/// The line and the attribute that is not a number.
pub(super) fn linear(e: &Element) -> Result<Conversion, String> {
    let number = |name: &str, otherwise: f64| match e.get(name) {
        None => Ok(otherwise),
        Some(text) => parse_number(text).ok_or_else(|| format!("line {}: {name}={text:?} is not a number", e.line)),
    };
    Ok(Conversion { factor: number("factor", 1.0)?, offset: number("offset", 0.0)? })
}

/// The values under the names of the mapping; values that it does not name are omitted.
///
/// # Errors
/// The entry whose value cannot be transformed, or whose source is missing from the file.
pub fn apply(entries: &[MappingEntry], parameters: &[Parameter]) -> Result<Vec<Parameter>, String> {
    let one = |entry: &MappingEntry| {
        let at = |cause: String| format!("line {}: {} to {}: {cause}", entry.line, entry.source, entry.target);
        let p =
            parameters.iter().find(|p| p.name == entry.source).ok_or_else(|| at("no value has this name".into()))?;
        let value = match &entry.transformation {
            Transformation::None => p.value.clone(),
            Transformation::Linear(_) if p.unit.is_some() => {
                return Err(at("a value with a unit is not transformed: leave one of them out".into()));
            }
            Transformation::Linear(conversion) => transformed(&p.value, conversion).map_err(at)?,
            Transformation::Table(pairs) => {
                let found = pairs.iter().find(|(source, _)| *source == p.value.trim());
                found.map(|(_, target)| target.clone()).ok_or_else(|| at(format!("has no entry for {}", p.value)))?
            }
        };
        Ok(Parameter { name: entry.target.clone(), value, ..p.clone() })
    };
    entries.iter().map(one).collect()
}

/// Numbers separated by spaces, each converted.
pub(super) fn transformed(text: &str, conversion: &Conversion) -> Result<String, String> {
    let number = |word: &str| {
        let x = parse_number(word).ok_or_else(|| format!("{word:?} is not a number"))?;
        Ok::<_, String>(format_number(conversion.apply(x)))
    };
    Ok(text.split_whitespace().map(number).collect::<Result<Vec<_>, _>>()?.join(" "))
}
