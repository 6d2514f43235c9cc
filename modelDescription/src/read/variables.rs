//! `ModelVariables`.

use super::attributes::{boolean, integer, integers, number, owned, required, required_integer, word, wrong};
use super::types::base_type_2;
use crate::error::Error;
use crate::limits;
use crate::units::TypeDefinition;
use crate::variable::{
    Alias, BaseType, Causality, ClockTiming, Dimension, Initial, IntervalVariability, ModelVariable, Variability,
};
use crate::version::FmiVersion;
use crate::xml::Element;
use std::collections::BTreeMap;

/// Every variable, in the order of the file.
pub(super) fn variables(
    list: &Element,
    version: FmiVersion,
    types: &[TypeDefinition],
) -> Result<Vec<ModelVariable>, Error> {
    limits::VARIABLES.check(list.children.len() as u64).map_err(Error::Limit)?;
    let types = types.iter().map(|t| (t.name.as_str(), t)).rev().collect();
    let mut variables = Vec::new();
    for element in &list.children {
        match version {
            FmiVersion::V2 if element.name == "ScalarVariable" => {
                let (base, typed) = base_type_2(element).ok_or_else(|| Error::MissingElement {
                    line: element.line,
                    parent: element.name.clone(),
                    element: "Real, Integer, Boolean, String or Enumeration".into(),
                })?;
                variables.push(variable(element, base, typed, version, &types)?);
            }
            FmiVersion::V2 => {}
            FmiVersion::V3 => {
                if let Some(base) = BaseType::from_word(&element.name) {
                    variables.push(variable(element, base, element, version, &types)?);
                }
            }
        }
    }
    values(&variables)?;
    Ok(variables)
}

/// The number of values of all variables, which a reader keeps in memory.
fn values(variables: &[ModelVariable]) -> Result<(), Error> {
    let arrays = || variables.iter().filter(|v| v.is_array());
    let sizes: BTreeMap<u32, u64> = if arrays().next().is_none() {
        BTreeMap::new()
    } else {
        let size = |v: &ModelVariable| Some((v.value_reference, v.start.as_deref()?.trim().parse().ok()?));
        variables.iter().filter(|v| !v.is_array()).filter_map(size).collect()
    };
    let mut all = 0_u64;
    for v in arrays() {
        let extent = |d: &Dimension| match d {
            Dimension::Fixed(n) => *n,
            Dimension::Variable(reference) => sizes.get(reference).copied().unwrap_or(1),
        };
        all = all.saturating_add(v.dimensions.iter().map(extent).fold(1, u64::saturating_mul));
        limits::VALUES.check(all).map_err(|e| Error::Limit(format!("line {}: {}: {e}", v.line, v.name)))?;
    }
    Ok(())
}

/// A variable: `element` has its identity, `typed` what depends on its base type (the same element in FMI 3.0).
fn variable(
    element: &Element,
    base: BaseType,
    typed: &Element,
    version: FmiVersion,
    types: &BTreeMap<&str, &TypeDefinition>,
) -> Result<ModelVariable, Error> {
    let causality = word(element, "causality", Causality::ALL, Causality::as_str)?.unwrap_or(Causality::Local);
    let variability = word(element, "variability", Variability::ALL, Variability::as_str)?;
    let declared_type = owned(typed, "declaredType");
    let declared = declared_type.as_deref().and_then(|name| types.get(name).copied());
    let unit = owned(typed, "unit");
    // A display unit belongs to a unit: the type's display unit does not apply to a variable with another unit.
    let same_unit = unit.is_none() || unit.as_ref() == declared.and_then(|t| t.unit.as_ref());
    let inherited = |of: fn(&TypeDefinition) -> &Option<String>| declared.and_then(|t| of(t).clone());
    let start_texts: Vec<String> = element.all("Start").filter_map(|e| owned(e, "value")).collect();
    Ok(ModelVariable {
        name: required(element, "name")?.into(),
        value_reference: required_integer(element, "valueReference")?,
        description: owned(element, "description"),
        causality,
        variability: variability.unwrap_or_else(|| default_variability(version, causality, base)),
        initial: word(element, "initial", Initial::ALL, Initial::as_str)?,
        base,
        start: owned(typed, "start").or_else(|| start_texts.first().cloned()),
        start_texts,
        quantity: owned(typed, "quantity").or_else(|| inherited(|t| &t.quantity)),
        display_unit: owned(typed, "displayUnit").or_else(|| inherited(|t| &t.display_unit).filter(|_| same_unit)),
        unit: unit.or_else(|| inherited(|t| &t.unit)),
        relative: boolean(typed, "relativeQuantity")?.or(declared.and_then(|t| t.relative)).unwrap_or(false),
        min: number(typed, "min")?.or(declared.and_then(|t| t.min)),
        max: number(typed, "max")?.or(declared.and_then(|t| t.max)),
        nominal: number(typed, "nominal")?.or(declared.and_then(|t| t.nominal)),
        max_size: integer(typed, "maxSize")?,
        declared_type,
        dimensions: element.all("Dimension").map(dimension).collect::<Result<_, _>>()?,
        aliases: element.all("Alias").map(alias).collect::<Result<_, _>>()?,
        derivative: integer(typed, "derivative")?,
        reinit: boolean(typed, "reinit")?.unwrap_or(false),
        intermediate: boolean(element, "intermediateUpdate")?.unwrap_or(false),
        clocks: integers(element, "clocks")?.unwrap_or_default(),
        timing: timing(element).filter(|_| base == BaseType::Clock),
        line: element.line,
    })
}

/// FMI 3.0.2, 2.4.4. The fraction equals the decimal; violations are left to a checker.
fn timing(element: &Element) -> Option<ClockTiming> {
    let number = |name: &str| element.get(name)?.trim().parse::<f64>().ok();
    let of = |counter: &str, decimal: &str| {
        let counted = number(counter).zip(number("resolution")).map(|(counter, resolution)| counter / resolution);
        number(decimal).or(counted)
    };
    Some(ClockTiming {
        ticks: IntervalVariability::from_word(element.get("intervalVariability")?)?,
        interval: of("intervalCounter", "intervalDecimal"),
        shift: of("shiftCounter", "shiftDecimal").unwrap_or(0.0),
        priority: element.get("priority").and_then(|text| text.trim().parse().ok()),
    })
}

/// FMI 2.0.5, 2.2.7: continuous, regardless of the type; FMI 3.0.2, 2.4.7.4: what fits.
fn default_variability(version: FmiVersion, causality: Causality, base: BaseType) -> Variability {
    match (version, causality) {
        (FmiVersion::V2, _) => Variability::Continuous,
        (_, Causality::StructuralParameter | Causality::Parameter | Causality::CalculatedParameter) => {
            Variability::Fixed
        }
        _ if base.is_float() => Variability::Continuous,
        _ => Variability::Discrete,
    }
}

/// FMI 3.0.2, 2.4.7.2: a number or a structural parameter.
fn dimension(element: &Element) -> Result<Dimension, Error> {
    match (integer(element, "start")?, integer(element, "valueReference")?) {
        (Some(extent), None) => Ok(Dimension::Fixed(extent)),
        (None, Some(reference)) => Ok(Dimension::Variable(reference)),
        (None, None) => Err(required(element, "start").err().unwrap_or_else(|| wrong(element, "start", "a number"))),
        _ => Err(wrong(element, "start", "either start or valueReference")),
    }
}

fn alias(element: &Element) -> Result<Alias, Error> {
    Ok(Alias {
        name: required(element, "name")?.into(),
        description: owned(element, "description"),
        display_unit: owned(element, "displayUnit"),
    })
}
