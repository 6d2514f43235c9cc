//! Units and type definitions used by variables, in the order of first use.
//!
//! FMI 2.0.5, 2.2.2 and 2.2.3; FMI 3.0.2, 2.4.3 and 2.4.4.

use crate::number;
use crate::units::BaseUnit;
use crate::version::FmiVersion;
use crate::xml::Element;
use fmu_core::Description;
use fmu_core::description::VariableKind;
use fmu_core::unit::{Exponents, SECOND};

/// `UnitDefinitions`: the units of the variables, including time in FMI 3.0. It must not be empty: `None` without a unit.
pub(super) fn units(description: &Description, version: FmiVersion) -> Option<Element> {
    let second = unit(SECOND.unit.name, SECOND.unit.exponents, SECOND.unit.factor);
    let mut units: Vec<Element> = (version == FmiVersion::V3).then_some(second).into_iter().collect();
    for variable in &description.variables {
        let VariableKind::Real { unit: name, exponents, factor, display, .. } = &variable.kind else { continue };
        if name.is_empty() {
            continue;
        }
        let at = units.iter().position(|u| u.get("name") == Some(name)).unwrap_or_else(|| {
            units.push(unit(name, *exponents, *factor));
            units.len() - 1
        });
        let aliases = variable.aliases.iter().filter_map(|alias| alias.display.as_ref());
        for (display, factor, offset) in display.iter().chain(aliases.filter(|_| version == FmiVersion::V3)) {
            // Two quantities may share a unit but differ in display unit: rad/s is used for speeds and bandwidths.
            if !units[at].all("DisplayUnit").any(|d| d.get("name") == Some(display)) {
                units[at].children.push(display_unit(display, *factor, *offset));
            }
        }
    }
    (!units.is_empty()).then(|| Element::new("UnitDefinitions").children(units))
}

/// `base value = factor * value`; omitted attributes are 0, or 1 for the factor.
fn unit(name: &str, exponents: Exponents, factor: f64) -> Element {
    let Exponents { kg, m, s, ampere, kelvin, mol, cd, rad } = exponents;
    let mut base = Element::new("BaseUnit");
    for (name, exponent) in BaseUnit::NAMES.into_iter().zip([kg, m, s, ampere, kelvin, mol, cd, rad]) {
        base = base.with_some(name, (exponent != 0).then(|| exponent.to_string()));
    }
    base = base.with_some("factor", differs(factor, 1.0));
    Element::new("Unit").with("name", name).children([base])
}

/// `shown = factor * value + offset`, in both standards: the inverse direction of the base unit's factor.
fn display_unit(name: &str, factor: f64, offset: f64) -> Element {
    Element::new("DisplayUnit")
        .with("name", name)
        .with_some("factor", differs(factor, 1.0))
        .with_some("offset", differs(offset, 0.0))
}

/// The number, unless it is the default.
fn differs(x: f64, default: f64) -> Option<String> {
    let text = number::format(x);
    (text != number::format(default)).then_some(text)
}

/// `TypeDefinitions`, which must not be empty: `None` when no variable has a type definition.
pub(super) fn definitions(description: &Description, version: FmiVersion) -> Option<Element> {
    let mut types: Vec<Element> = Vec::new();
    for variable in &description.variables {
        let Some(definition) = definition(&variable.kind, version) else { continue };
        if !types.iter().any(|t| t.get("name") == definition.get("name")) {
            types.push(definition);
        }
    }
    (!types.is_empty()).then(|| Element::new("TypeDefinitions").children(types))
}

fn definition(kind: &VariableKind, version: FmiVersion) -> Option<Element> {
    let (name, description, base, three) = match kind {
        // FMI 3.0 has other types for single precision; its variables have the attributes themselves.
        VariableKind::Real { single: true, .. } if version == FmiVersion::V3 => return None,
        VariableKind::Real { quantity, unit, display, relative, .. } if !quantity.is_empty() => {
            let display = display.as_ref().map(|(name, ..)| name.as_str()).filter(|_| !unit.is_empty());
            // A number without a unit has no quantity either.
            let measured = Some(quantity.as_str()).filter(|_| !unit.is_empty());
            let base = Element::new("Real")
                .with_some("quantity", measured)
                .with_text("unit", unit)
                .with_some("displayUnit", display)
                .with_some("relativeQuantity", relative.then_some("true"));
            (quantity, "", base, "Float64Type")
        }
        VariableKind::Enumeration { name, description, items } => {
            let items = items.iter().map(|(value, name, description)| {
                Element::new("Item")
                    .with("name", name)
                    .with("value", value.to_string())
                    .with_text("description", description)
            });
            (name, description.as_str(), Element::new("Enumeration").children(items), "EnumerationType")
        }
        _ => return None,
    };
    let named = |element: &str| Element::new(element).with("name", name).with_text("description", description);
    Some(match version {
        FmiVersion::V2 => named("SimpleType").children([base]),
        FmiVersion::V3 => {
            let mut element = named(three).children(base.children);
            element.attributes.extend(base.attributes);
            element
        }
    })
}
