//! Refuses start values out of range, and ambiguous names, types and units.

use super::{Variable, VariableKind};
use crate::fault::Fault;
use crate::row::Slot;
use crate::unit::{Exponents, SECOND};
use crate::variable::{Kind, Meta, Range};
use std::collections::{BTreeMap, BTreeSet};

/// Checks a start value by the rules of a set call. A text must be valid in XML (XML 1.0, 2.2).
pub(super) fn check_start(name: &str, meta: &Meta, slot: &Slot<'_>) -> Result<(), Fault> {
    let text = match slot {
        Slot::Text(text) => text.as_str(),
        Slot::Said(text) => text,
        _ => "",
    };
    if text.contains(|c: char| c.is_control() && !"\t\n\r".contains(c) || "\u{fffe}\u{ffff}".contains(c)) {
        return Err(Fault::new(format!("{name} = {slot} at the start has a character that XML does not allow")));
    }
    if slot.is_allowed(meta) {
        return Ok(());
    }
    if let Kind::Binary { most, .. } = meta.kind {
        return Err(Fault::value(name, format!("{slot} at the start"), format_args!("at most {most} bytes")));
    }
    Err(Fault::value(name, format!("{slot} at the start"), Range::to_string(&meta.range)))
}

/// Checks that no two variables or aliases share a name.
pub(super) fn check_names(model: &str, variables: &[Variable]) -> Result<(), Fault> {
    let mut names = BTreeSet::new();
    let all = variables.iter().flat_map(|v| v.aliases.iter().map(|a| &a.name).chain([&v.name]));
    match all.into_iter().find(|name| !names.insert(name.as_str())) {
        Some(name) => Err(Fault::new(format!("two variables of {model} have the name {name}"))),
        None => Ok(()),
    }
}

/// Checks that no type definition has the name of a variable, that type definitions, units and display units have one meaning each,
/// and the units of derivatives.
pub(super) fn check_types(variables: &[Variable]) -> Result<(), Fault> {
    let names: BTreeSet<&str> = variables.iter().map(|v| v.name.as_str()).collect();
    let mut types: BTreeMap<&str, &Variable> = BTreeMap::new();
    let mut units: BTreeMap<&str, (&str, Exponents, f64)> = BTreeMap::new();
    let mut displays: BTreeMap<(&str, &str), (&str, f64, f64)> = BTreeMap::new();
    // Archives of FMI 3.0 have the unit of time.
    units.insert(SECOND.unit.name, ("time", SECOND.unit.exponents, SECOND.unit.factor));
    for of in variables {
        let (VariableKind::Real { quantity: name, .. } | VariableKind::Enumeration { name, .. }) = &of.kind else {
            continue;
        };
        if names.contains(name.as_str()) {
            return Err(Fault::new(format!("the type definition {name} has the name of a variable")));
        }
        let first = types.entry(name).or_insert(of);
        if !same_type(&first.kind, &of.kind) {
            let (first, of) = (&first.name, &of.name);
            return Err(Fault::new(format!("the type definition {name} of {of} differs from that of {first}")));
        }
        let VariableKind::Real { unit, exponents, factor, display, .. } = &of.kind else { continue };
        let (first, others, another) = units.entry(unit).or_insert((&of.name, *exponents, *factor));
        if (*others, *another) != (*exponents, *factor) {
            return Err(Fault::new(format!(
                "the unit {unit} of {} differs from that of {first}: other base units or another factor",
                of.name
            )));
        }
        for (shown, factor, offset) in of.aliases.iter().filter_map(|alias| alias.display.as_ref()).chain(display) {
            let (first, others, another) = displays.entry((unit, shown)).or_insert((&of.name, *factor, *offset));
            if (*others, *another) != (*factor, *offset) {
                return Err(Fault::new(format!(
                    "the display unit {shown} of {} differs from that of {first}: another factor or offset",
                    of.name
                )));
            }
        }
    }
    check_rates(variables)
}

/// Whether two variables can share a type definition; single precision has a separate one.
fn same_type(a: &VariableKind, b: &VariableKind) -> bool {
    match (a, b) {
        (
            VariableKind::Real { unit, display, relative, .. },
            VariableKind::Real { unit: of_b, display: shown, relative: difference, .. },
        ) => (unit, display, relative) == (of_b, shown, difference),
        _ => a == b,
    }
}

/// Checks that the derivative of each state has its unit per second, if both have one.
fn check_rates(variables: &[Variable]) -> Result<(), Fault> {
    let unit = |v: &Variable| match &v.kind {
        VariableKind::Real { unit, exponents, factor, .. } if !unit.is_empty() => {
            Some((unit.clone(), *exponents, *factor))
        }
        _ => None,
    };
    let states: BTreeMap<u32, &Variable> = variables.iter().map(|v| (v.value_reference, v)).collect();
    for rate in variables {
        let Some(state) = rate.derivative.and_then(|reference| states.get(&reference)) else { continue };
        let (Some((of, base, factor)), Some((per_second, rate_base, rate_factor))) = (unit(state), unit(rate)) else {
            continue;
        };
        if rate_base != (Exponents { s: base.s - 1, ..base }) || (rate_factor / factor - 1.0).abs() > 1e-9 {
            return Err(Fault::new(format!(
                "{} has the unit {per_second}, which is not the unit {of} of {} per second: State::new has the quantity of the \
                 derivative",
                rate.name, state.name
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::variable;
    use crate::row::Row;
    use crate::unit::{
        DisplayUnit, JOULE, METER, METER_PER_S, METER_PER_S2, NEWTON_METER, ONE, PASCAL, Quantity, Unit,
    };

    #[test]
    fn a_name_has_one_meaning() {
        const BAR: DisplayUnit = DisplayUnit { name: "bar", factor: 1e-5, offset: 0.0 };
        const GAUGE: DisplayUnit = DisplayUnit { offset: -1.0, ..BAR };
        const TORQUE: Quantity = Quantity::new("Torque", METER.unit);
        const LEVER: Quantity = Quantity::new("Lever", Unit::si("N.m", METER.unit.exponents));
        const MINUTES: Quantity = Quantity::new("Minutes", Unit { factor: 60.0, ..SECOND.unit });
        const SHOWN: Quantity = PASCAL.shown_in(BAR);
        const OTHER: Quantity = PASCAL.shown_in(GAUGE);
        const PRESSURE: Quantity = Quantity { name: "GaugePressure", ..OTHER };
        let of = |name: &str, quantity| {
            variable(name.into(), Row::<f64>::output(name.to_owned().leak(), quantity, "", |m| m).meta(), 1, None)
        };
        let why = |quantities: [&'static Quantity; 2]| {
            let [a, b] = quantities.map(|quantity| of(quantity.name.to_lowercase().as_str(), quantity));
            let b = Variable { name: format!("{}2", b.name), ..b };
            check_types(&[a, b]).err().map_or_else(String::new, |fault| fault.to_string())
        };
        assert_eq!((why([&SHOWN, &SHOWN]), why([&NEWTON_METER, &JOULE])), (String::new(), String::new()));
        for (pair, start) in [
            ([&NEWTON_METER, &TORQUE], "the type definition Torque") as ([&'static Quantity; 2], &str),
            ([&NEWTON_METER, &LEVER], "the unit N.m of lever2 differs from that of torque"),
            ([&SHOWN, &OTHER], "the type definition Pressure of pressure2 differs"),
            ([&SHOWN, &PRESSURE], "the display unit bar of gaugepressure2 differs from that of pressure"),
            ([&METER, &MINUTES], "the unit s of minutes2 differs from that of time"),
        ] {
            assert!(why(pair).starts_with(start), "{pair:?}: {}", why(pair));
        }
    }

    #[test]
    fn a_derivative_has_the_unit_of_its_state_per_second() {
        const KM_PER_S: Unit = Unit { name: "km/s", factor: 1000.0, ..METER_PER_S.unit };
        const FAST: Quantity = Quantity::new("Fast", KM_PER_S);
        let why = |rate: &'static Quantity| {
            let of = |name: &str, quantity, reference| {
                variable(name.into(), Row::<f64>::state("", quantity, "", |m| m).meta(), reference, None)
            };
            let rate = Variable { derivative: Some(1), ..of("der(x)", rate, 2) };
            check_types(&[of("x", &METER, 1), rate]).err().map(|fault| fault.to_string())
        };
        assert_eq!((why(&METER_PER_S), why(&ONE)), (None, None));
        for (wrong, unit) in [(&METER_PER_S2, "m/s2"), (&METER, "m"), (&FAST, "km/s")] {
            let start = format!("der(x) has the unit {unit}, which is not the unit m of x per second");
            assert!(why(wrong).is_some_and(|why| why.starts_with(&start)), "{unit}");
        }
    }
}
