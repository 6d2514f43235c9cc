//! Base units and factors of common units, to compare a file with (FMI 2.0.5, 2.2.2; FMI 3.0.2, 2.4.3).

use model_description::{ModelDescription, Unit};
use std::f64::consts::PI;

/// Name, exponents of kg, m, s, A, K, mol, cd, rad, factor to the base units.
type Known = (&'static str, [i32; 8], f64);

#[rustfmt::skip]
const KNOWN: &[Known] = &[
    ("kg", [1, 0, 0, 0, 0, 0, 0, 0], 1.0), ("g", [1, 0, 0, 0, 0, 0, 0, 0], 1e-3), ("m", [0, 1, 0, 0, 0, 0, 0, 0], 1.0),
    ("mm", [0, 1, 0, 0, 0, 0, 0, 0], 1e-3), ("s", [0, 0, 1, 0, 0, 0, 0, 0], 1.0), ("ms", [0, 0, 1, 0, 0, 0, 0, 0], 1e-3),
    ("min", [0, 0, 1, 0, 0, 0, 0, 0], 60.0), ("h", [0, 0, 1, 0, 0, 0, 0, 0], 3600.0), ("A", [0, 0, 0, 1, 0, 0, 0, 0], 1.0),
    ("K", [0, 0, 0, 0, 1, 0, 0, 0], 1.0), ("mol", [0, 0, 0, 0, 0, 1, 0, 0], 1.0), ("cd", [0, 0, 0, 0, 0, 0, 1, 0], 1.0),
    ("rad", [0, 0, 0, 0, 0, 0, 0, 1], 1.0), ("deg", [0, 0, 0, 0, 0, 0, 0, 1], PI / 180.0),
    ("V", [1, 2, -3, -1, 0, 0, 0, 0], 1.0), ("kV", [1, 2, -3, -1, 0, 0, 0, 0], 1e3), ("mA", [0, 0, 0, 1, 0, 0, 0, 0], 1e-3),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0, 0], 1.0), ("ohm", [1, 2, -3, -2, 0, 0, 0, 0], 1.0), ("H", [1, 2, -2, -2, 0, 0, 0, 0], 1.0),
    ("F", [-1, -2, 4, 2, 0, 0, 0, 0], 1.0), ("Wb", [1, 2, -2, -1, 0, 0, 0, 0], 1.0), ("V.s", [1, 2, -2, -1, 0, 0, 0, 0], 1.0),
    ("T", [1, 0, -2, -1, 0, 0, 0, 0], 1.0), ("C", [0, 0, 1, 1, 0, 0, 0, 0], 1.0), ("S", [-1, -2, 3, 2, 0, 0, 0, 0], 1.0),
    ("N", [1, 1, -2, 0, 0, 0, 0, 0], 1.0), ("N.m", [1, 2, -2, 0, 0, 0, 0, 0], 1.0), ("J", [1, 2, -2, 0, 0, 0, 0, 0], 1.0),
    ("W", [1, 2, -3, 0, 0, 0, 0, 0], 1.0), ("kW", [1, 2, -3, 0, 0, 0, 0, 0], 1e3), ("Pa", [1, -1, -2, 0, 0, 0, 0, 0], 1.0),
    ("bar", [1, -1, -2, 0, 0, 0, 0, 0], 1e5), ("m/s", [0, 1, -1, 0, 0, 0, 0, 0], 1.0), ("m/s2", [0, 1, -2, 0, 0, 0, 0, 0], 1.0),
    ("rad/s", [0, 0, -1, 0, 0, 0, 0, 1], 1.0), ("rad/s2", [0, 0, -2, 0, 0, 0, 0, 1], 1.0), ("m2", [0, 2, 0, 0, 0, 0, 0, 0], 1.0),
    ("m3", [0, 3, 0, 0, 0, 0, 0, 0], 1.0), ("kg.m2", [1, 2, 0, 0, 0, 0, 0, 0], 1.0), ("kg/s", [1, 0, -1, 0, 0, 0, 0, 0], 1.0),
    ("km/h", [0, 1, -1, 0, 0, 0, 0, 0], 1.0 / 3.6), ("kg/m3", [1, -3, 0, 0, 0, 0, 0, 0], 1.0), ("N/m", [1, 0, -2, 0, 0, 0, 0, 0], 1.0),
    ("degC", [0, 0, 0, 0, 1, 0, 0, 0], 1.0), ("degF", [0, 0, 0, 0, 1, 0, 0, 0], 1.0 / 1.8),
];

/// Units of the temperature with an offset, in K.
const OFFSETS: [(&str, f64); 2] = [("degC", 273.15), ("degF", 273.15 - 32.0 / 1.8)];

/// Revolutions per minute, where a revolution is an angle; without, they are a frequency of 1/60 Hz.
const REVOLUTIONS_NAMES: [&str; 4] = ["rpm", "r/min", "rev/min", "1/min"];
const REVOLUTIONS: Known = ("rpm", [0, 0, -1, 0, 0, 0, 0, 1], PI / 30.0);
const PER_MINUTE: Known = ("1/min", [0, 0, -1, 0, 0, 0, 0, 0], 1.0 / 60.0);

/// Index of the radian exponent, which tools may count or omit; only the others must agree.
const RADIAN: usize = 7;

fn known(name: &str) -> Option<&'static Known> {
    KNOWN.iter().find(|(n, ..)| *n == name)
}

fn differ(a: f64, b: f64) -> bool {
    (a - b).abs() > 1e-6 * b.abs()
}

/// Units whose base unit contradicts their name.
pub(crate) fn wrong_bases(description: &ModelDescription) -> Vec<String> {
    let say = |unit: &Unit| {
        let base = unit.base?;
        let (_, exponents, factor) = match unit.name.as_str() {
            name if !REVOLUTIONS_NAMES.contains(&name) => known(name)?,
            _ if base.exponents[RADIAN] == 0 && !differ(base.factor, PER_MINUTE.2) => &PER_MINUTE,
            _ => &REVOLUTIONS,
        };
        let same = base.exponents[..RADIAN] == exponents[..RADIAN] && !differ(base.factor, *factor);
        let offset = OFFSETS.iter().find(|(name, _)| *name == unit.name).map_or(base.offset, |(_, offset)| *offset);
        if same && (base.offset - offset).abs() > 0.01 {
            return Some(format!(
                "line {}: unit {:?} has the offset {}, expected {offset}",
                unit.line, unit.name, base.offset
            ));
        }
        (!same).then(|| {
            format!(
                "line {}: unit {:?} has exponents {:?} and factor {}, expected {exponents:?} and {factor}",
                unit.line, unit.name, base.exponents, base.factor
            )
        })
    };
    description.units.iter().filter_map(say).collect()
}

/// Display units of the temperature in K, with their factor and offset.
const TEMPERATURES: [(&str, f64, f64); 3] = [("degC", 1.0, -273.15), ("degF", 1.8, -459.67), ("degR", 1.8, 0.0)];

/// Display units whose factor or offset contradicts their name, for example because it is the reciprocal or has the other sign.
pub(crate) fn wrong_displays(description: &ModelDescription) -> Vec<String> {
    let mut findings = Vec::new();
    for unit in &description.units {
        let Some(base) = unit.base else { continue };
        for display in unit.display_units.iter().filter(|d| !d.inverse) {
            let temperature = TEMPERATURES.iter().find(|(name, ..)| unit.name == "K" && *name == display.name);
            if let Some(&(_, factor, offset)) = temperature {
                if differ(display.factor, factor) || (display.offset - offset).abs() > 0.01 {
                    findings.push(format!(
                        "line {}: display unit {:?} of \"K\" has factor {} and offset {}, expected {factor} and {offset}",
                        unit.line, display.name, display.factor, display.offset
                    ));
                }
                continue;
            }
            let per_second = base.exponents[..RADIAN] == [0, 0, -1, 0, 0, 0, 0];
            let factor = match display.name.as_str() {
                name if REVOLUTIONS_NAMES.contains(&name) => {
                    (per_second && base.exponents[RADIAN] == 1).then_some(REVOLUTIONS.2)
                }
                "deg/s" if per_second => Some(PI / 180.0),
                name => known(name).filter(|k| k.1[..RADIAN] == base.exponents[..RADIAN]).map(|k| k.2),
            };
            // shown = value in the unit * (its factor to the base) / (the display unit's factor to the base)
            if let Some(expected) = factor.map(|f| base.factor / f).filter(|&e| differ(display.factor, e)) {
                findings.push(format!(
                    "line {}: display unit {:?} of {:?} has factor {}, expected {expected}",
                    unit.line, display.name, unit.name, display.factor
                ));
            }
        }
    }
    findings
}
