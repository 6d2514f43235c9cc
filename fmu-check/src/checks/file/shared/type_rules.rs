//! Types and units: declared types exist and fit, units are defined, and common ones have their meaning
//! (FMI 2.0.5, 2.2.2 and 2.2.3; FMI 3.0.2, 2.4.3 and 2.4.4).

use crate::check::Verdict;
use crate::checks::file::shared::units;
use crate::checks::file::xml::with_description;
use crate::fmu_file::FmuFile;
use model_description::{BaseType, FmiVersion, ModelDescription, ModelVariable};

/// A finding for each variable that violates the rule.
pub(crate) fn each(fmu: &FmuFile, rule: impl Fn(&ModelDescription, &ModelVariable) -> Option<String>) -> Verdict {
    with_description(fmu, |d| {
        let say = |v| rule(d, v).map(|why| format!("line {}: variable {}: {why}", v.line, v.name));
        d.variables.iter().filter_map(say).collect()
    })
}

pub(crate) fn types(fmu: &FmuFile) -> Verdict {
    each(fmu, |d, v| match &v.declared_type {
        None => (v.base == BaseType::Enumeration).then(|| "is an enumeration without declaredType".into()),
        Some(name) => match d.type_definition(name) {
            None => Some(format!("there is no type {name:?}")),
            Some(t) if t.base != v.base => Some(format!("is a {} but its type {name:?} is a {}", v.base, t.base)),
            Some(_) => None,
        },
    })
}

pub(crate) fn definitions(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for (i, t) in d.types.iter().enumerate() {
            if d.types[..i].iter().any(|other| other.name == t.name) {
                findings.push(format!("line {}: there is another type {:?}", t.line, t.name));
            }
            for (j, item) in t.items.iter().enumerate() {
                if t.items[..j].iter().any(|other| other.name == item.name || other.value == item.value) {
                    findings.push(format!(
                        "line {}: type {:?}: {} = {} occurs twice",
                        t.line, t.name, item.name, item.value
                    ));
                }
            }
        }
        findings
    })
}

pub(crate) fn unit_names(fmu: &FmuFile) -> Verdict {
    let wrong = |d: &ModelDescription, unit: Option<&str>, display: Option<&str>| match (unit, display) {
        (None, Some(display)) => Some(format!("the display unit {display:?} comes without a unit")),
        (Some(unit), display) => match (d.unit(unit), display) {
            (None, _) => Some(format!("the unit {unit:?} is not defined")),
            // FMI 2.0 ignores a display unit that is not defined.
            (Some(u), Some(display))
                if d.version == FmiVersion::V3 && u.display_unit(display).is_none() && display != unit =>
            {
                Some(format!("the unit {unit:?} has no display unit {display:?}"))
            }
            _ => None,
        },
        _ => None,
    };
    with_description(fmu, |d| {
        let of_types = d.types.iter().filter_map(|t| {
            let why = wrong(d, t.unit.as_deref(), t.display_unit.as_deref())?;
            Some(format!("line {}: type {}: {why}", t.line, t.name))
        });
        let of_variables = d.variables.iter().filter_map(|v| {
            let why = wrong(d, v.unit.as_deref(), v.display_unit.as_deref())?;
            Some(format!("line {}: variable {}: {why}", v.line, v.name))
        });
        of_types.chain(of_variables).collect()
    })
}

pub(crate) fn unique_units(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for (i, unit) in d.units.iter().enumerate() {
            if d.units[..i].iter().any(|u| u.name == unit.name) {
                findings.push(format!("line {}: the unit {:?} occurs twice", unit.line, unit.name));
            }
            for (j, display) in unit.display_units.iter().enumerate() {
                if unit.display_units[..j].iter().any(|u| u.name == display.name) {
                    findings.push(format!("line {}: the display unit {:?} occurs twice", unit.line, display.name));
                }
            }
        }
        findings
    })
}

pub(crate) fn bases(fmu: &FmuFile) -> Verdict {
    with_description(fmu, units::wrong_bases)
}

pub(crate) fn displays(fmu: &FmuFile) -> Verdict {
    with_description(fmu, units::wrong_displays)
}
