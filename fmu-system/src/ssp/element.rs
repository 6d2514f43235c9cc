//! Elements of the files of SSP: names without their prefixes, lists, units.

use super::path::StatedUnit;
use model_description::{BaseUnit, Element};

/// Name without its namespace prefix.
pub(super) fn local(element: &Element) -> &str {
    element.name.rsplit(':').next().unwrap_or_default()
}

pub(super) fn child<'a>(parent: &'a Element, name: &str) -> Option<&'a Element> {
    parent.children.iter().find(|c| local(c) == name)
}

/// The children of a child, or none.
pub(super) fn list<'a>(parent: &'a Element, name: &str) -> impl Iterator<Item = &'a Element> {
    child(parent, name).into_iter().flat_map(|e| &e.children).filter(|e| local(e) != "Annotations")
}

pub(super) fn at(e: &Element, what: impl std::fmt::Display) -> String {
    format!("line {}: {what}", e.line)
}

pub(super) fn required(e: &Element, name: &str) -> Result<String, String> {
    e.get(name).map(str::to_owned).ok_or_else(|| at(e, format!("<{}> has no attribute {name}", e.name)))
}

/// A truth value of XML, false if it is not given.
pub(super) fn is_true(e: &Element, name: &str) -> Result<bool, String> {
    match e.get(name).map(str::trim) {
        Some("true" | "1") => Ok(true),
        None | Some("false" | "0") => Ok(false),
        Some(other) => Err(at(e, format!("{name}={other:?} is not true or false"))),
    }
}

/// Definitions of a file for its elements: units (SSP 1.0, 4.3) and enumerations.
#[derive(Clone, Debug, Default)]
pub(super) struct Definitions {
    units: Vec<StatedUnit>,
    /// Name, numbers and names of the items.
    enumerations: Vec<(String, Vec<(i64, String)>)>,
}

impl Definitions {
    pub(super) fn read(root: &Element) -> Result<Self, String> {
        let unit = |e: &Element| {
            let base = child(e, "BaseUnit").map(BaseUnit::read).transpose().map_err(|why| at(e, why))?;
            Ok::<_, String>(StatedUnit { name: required(e, "name")?, base })
        };
        let item = |e: &Element| {
            let text = required(e, "value")?;
            let value = text.parse().map_err(|_| at(e, format!("value={text:?} is not an integer")))?;
            Ok::<_, String>((value, required(e, "name")?))
        };
        let enumeration = |e: &Element| {
            let items = e.children.iter().filter(|c| local(c) == "Item").map(item).collect::<Result<_, _>>()?;
            Ok::<_, String>((required(e, "name")?, items))
        };
        Ok(Self {
            units: list(root, "Units").map(unit).collect::<Result<_, _>>()?,
            enumerations: list(root, "Enumerations").map(enumeration).collect::<Result<_, _>>()?,
        })
    }

    /// The unit of a typed element. Some tools write `None` for none.
    pub(super) fn unit(&self, typed: &Element) -> Option<StatedUnit> {
        let name = typed.get("unit").filter(|unit| !["", "None"].contains(unit))?;
        let known = self.units.iter().find(|unit| unit.name == name).cloned();
        Some(known.unwrap_or_else(|| StatedUnit { name: name.into(), base: None }))
    }

    /// The items of a typed element that is an enumeration.
    pub(super) fn items(&self, typed: &Element) -> Vec<(i64, String)> {
        let name = typed.get("name").filter(|_| local(typed) == "Enumeration");
        let known = self.enumerations.iter().find(|(other, _)| Some(other.as_str()) == name);
        known.map(|(_, items)| items.clone()).unwrap_or_default()
    }
}

/// Whether this element of a connector names a clock that the connector is on; a clock without a name is a type.
pub(super) fn is_on_clock(e: &Element) -> bool {
    local(e) == "Clock" && e.get("name").is_some()
}

/// Elements that give the type of a connector, a value or an entry of a dictionary.
pub(super) const TYPES: [&str; 17] = [
    "Real",
    "Float64",
    "Float32",
    "Integer",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "String",
    "Enumeration",
    "Binary",
    "Clock",
];
