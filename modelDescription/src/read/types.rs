//! `UnitDefinitions` and `TypeDefinitions`.

use super::attributes::{boolean, integer, number, owned, required, required_integer};
use crate::error::Error;
use crate::units::{BaseUnit, DisplayUnit, Item, TypeDefinition, Unit};
use crate::variable::BaseType;
use crate::version::FmiVersion;
use crate::xml::Element;

/// Every unit.
pub(super) fn units(root: &Element) -> Result<Vec<Unit>, Error> {
    root.child("UnitDefinitions").into_iter().flat_map(|list| list.all("Unit")).map(unit).collect()
}

fn unit(element: &Element) -> Result<Unit, Error> {
    Ok(Unit {
        name: required(element, "name")?.into(),
        base: element.child("BaseUnit").map(BaseUnit::read).transpose()?,
        display_units: element.all("DisplayUnit").map(display_unit).collect::<Result<_, _>>()?,
        line: element.line,
    })
}

impl BaseUnit {
    /// Reads an element `BaseUnit` of FMI or SSP.
    ///
    /// # Errors
    /// An attribute is not a number.
    pub fn read(element: &Element) -> Result<Self, Error> {
        let mut exponents = [0; 8];
        for (exponent, name) in exponents.iter_mut().zip(Self::NAMES) {
            *exponent = integer(element, name)?.unwrap_or(0);
        }
        let factor = number(element, "factor")?.unwrap_or(1.0);
        Ok(Self { exponents, factor, offset: number(element, "offset")?.unwrap_or(0.0) })
    }
}

fn display_unit(element: &Element) -> Result<DisplayUnit, Error> {
    Ok(DisplayUnit {
        name: required(element, "name")?.into(),
        factor: number(element, "factor")?.unwrap_or(1.0),
        offset: number(element, "offset")?.unwrap_or(0.0),
        inverse: boolean(element, "inverse")?.unwrap_or(false),
    })
}

/// Every type definition of a known base type.
pub(super) fn definitions(root: &Element, version: FmiVersion) -> Result<Vec<TypeDefinition>, Error> {
    let list = root.child("TypeDefinitions").map_or(&[][..], |list| &list.children);
    let mut definitions = Vec::new();
    for element in list {
        // In FMI 2.0 the base type is a child element; in FMI 3.0 it is the element's own name.
        let typed = match version {
            FmiVersion::V2 => base_type_2(element),
            FmiVersion::V3 => element.name.strip_suffix("Type").and_then(BaseType::from_word).map(|b| (b, element)),
        };
        if let Some((base, typed)) = typed {
            definitions.push(definition(element, base, typed)?);
        }
    }
    Ok(definitions)
}

/// The child with the base type of an FMI 2.0 variable or type.
pub(super) fn base_type_2(element: &Element) -> Option<(BaseType, &Element)> {
    element.children.iter().find_map(|child| {
        let base = match child.name.as_str() {
            "Real" => BaseType::Float64,
            "Integer" => BaseType::Int32,
            "Boolean" => BaseType::Boolean,
            "String" => BaseType::String,
            "Enumeration" => BaseType::Enumeration,
            _ => return None,
        };
        Some((base, child))
    })
}

fn definition(element: &Element, base: BaseType, typed: &Element) -> Result<TypeDefinition, Error> {
    Ok(TypeDefinition {
        name: required(element, "name")?.into(),
        base,
        description: owned(element, "description"),
        quantity: owned(typed, "quantity"),
        unit: owned(typed, "unit"),
        display_unit: owned(typed, "displayUnit"),
        relative: boolean(typed, "relativeQuantity")?,
        min: number(typed, "min")?,
        max: number(typed, "max")?,
        nominal: number(typed, "nominal")?,
        items: typed.all("Item").map(item).collect::<Result<_, _>>()?,
        line: element.line,
    })
}

fn item(element: &Element) -> Result<Item, Error> {
    Ok(Item {
        name: required(element, "name")?.into(),
        value: required_integer(element, "value")?,
        description: owned(element, "description"),
    })
}
