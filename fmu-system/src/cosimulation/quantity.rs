//! Physical quantities in words, from descriptions of any tool.

use model_description::{BaseUnit, ModelDescription, ModelVariable};

/// Quantities of SI units by the exponents of kg, m, s, A, K, mol, cd and rad.
const QUANTITIES: [([i32; 8], &str); 25] = [
    ([0, 1, 0, 0, 0, 0, 0, 0], "Length"),
    ([0, 2, 0, 0, 0, 0, 0, 0], "Area"),
    ([0, 3, 0, 0, 0, 0, 0, 0], "Volume"),
    ([0, 1, -1, 0, 0, 0, 0, 0], "Velocity"),
    ([0, 1, -2, 0, 0, 0, 0, 0], "Acceleration"),
    ([0, 0, 1, 0, 0, 0, 0, 0], "Time"),
    ([0, 0, -1, 0, 0, 0, 0, 0], "Frequency"),
    ([0, 0, 0, 0, 0, 0, 0, 1], "Angle"),
    ([0, 0, -1, 0, 0, 0, 0, 1], "Angular velocity"),
    ([0, 0, -2, 0, 0, 0, 0, 1], "Angular acceleration"),
    ([1, 0, 0, 0, 0, 0, 0, 0], "Mass"),
    ([1, 0, -1, 0, 0, 0, 0, 0], "Mass flow"),
    ([0, 3, -1, 0, 0, 0, 0, 0], "Volume flow"),
    ([1, -3, 0, 0, 0, 0, 0, 0], "Density"),
    ([1, 1, -2, 0, 0, 0, 0, 0], "Force"),
    ([1, -1, -2, 0, 0, 0, 0, 0], "Pressure"),
    ([1, 2, -2, 0, 0, 0, 0, 0], "Energy"),
    ([1, 2, -3, 0, 0, 0, 0, 0], "Power"),
    ([0, 0, 0, 1, 0, 0, 0, 0], "Current"),
    ([0, 0, 1, 1, 0, 0, 0, 0], "Charge"),
    ([1, 2, -3, -1, 0, 0, 0, 0], "Voltage"),
    ([1, 2, -2, -1, 0, 0, 0, 0], "Magnetic flux"),
    ([1, 2, -3, -2, 0, 0, 0, 0], "Resistance"),
    ([1, 2, -2, -2, 0, 0, 0, 0], "Inductance"),
    ([0, 0, 0, 0, 1, 0, 0, 0], "Temperature"),
];

/// The quantity of a variable: the attribute of the variable or of its type, else that of its unit; empty if none is given.
pub(super) fn quantity(description: &ModelDescription, variable: &ModelVariable) -> String {
    let declared = || description.type_definition(variable.declared_type.as_ref()?)?.quantity.as_deref();
    let unit = variable.unit.as_deref().unwrap_or_default();
    let of_unit = || description.unit(unit)?.base.as_ref().and_then(|base| of_base(unit, base));
    variable
        .quantity
        .as_deref()
        .or_else(declared)
        .map(words)
        .or_else(|| of_unit().map(str::to_owned))
        .unwrap_or_default()
}

/// The quantity of a unit. A torque has the dimension of an energy; its unit is a product with a meter.
fn of_base(unit: &str, base: &BaseUnit) -> Option<&'static str> {
    let found = QUANTITIES.iter().find(|(exponents, _)| *exponents == base.exponents).map(|(_, name)| *name)?;
    let is_torque = found == "Energy" && unit.contains('N') && unit.contains('m');
    Some(if is_torque { "Torque" } else { found })
}

/// `AngularVelocity` as `Angular velocity`.
fn words(name: &str) -> String {
    let mut text = String::new();
    let mut small = false;
    for c in name.chars() {
        if small && c.is_uppercase() {
            text.push(' ');
            text.extend(c.to_lowercase());
        } else {
            text.push(c);
        }
        small = c.is_lowercase();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_words() {
        for (name, text) in [("AngularVelocity", "Angular velocity"), ("Speed", "Speed"), ("heat flow", "heat flow")] {
            assert_eq!(words(name), text);
        }
        let base = |exponents| BaseUnit { exponents, factor: 1.0, offset: 0.0 };
        let joule = base([1, 2, -2, 0, 0, 0, 0, 0]);
        assert_eq!(
            ["N.m", "J", "kWh"].map(|unit| of_base(unit, &joule)),
            [Some("Torque"), Some("Energy"), Some("Energy")]
        );
        assert_eq!(of_base("1/min", &base([0, 0, -1, 0, 0, 0, 0, 1])), Some("Angular velocity"));
        assert_eq!(of_base("X", &base([3, 0, 0, 0, 0, 0, 0, 0])), None);
    }

    #[test]
    fn the_exponents_follow_from_each_other() {
        let of = |name: &str| QUANTITIES.iter().find(|(_, other)| *other == name).unwrap().0;
        for (product, one, other) in [
            ("Area", "Length", "Length"),
            ("Volume", "Area", "Length"),
            ("Length", "Velocity", "Time"),
            ("Velocity", "Acceleration", "Time"),
            ("Angle", "Angular velocity", "Time"),
            ("Angular velocity", "Angular acceleration", "Time"),
            ("Angular acceleration", "Angular velocity", "Frequency"),
            ("Mass", "Mass flow", "Time"),
            ("Volume", "Volume flow", "Time"),
            ("Mass", "Density", "Volume"),
            ("Force", "Mass", "Acceleration"),
            ("Force", "Pressure", "Area"),
            ("Energy", "Force", "Length"),
            ("Energy", "Power", "Time"),
            ("Charge", "Current", "Time"),
            ("Power", "Voltage", "Current"),
            ("Magnetic flux", "Voltage", "Time"),
            ("Voltage", "Resistance", "Current"),
            ("Magnetic flux", "Inductance", "Current"),
        ] {
            let sum: [i32; 8] = std::array::from_fn(|k| of(one)[k] + of(other)[k]);
            assert_eq!(of(product), sum, "{product} = {one} times {other}");
        }
        assert_eq!(of("Temperature"), [0, 0, 0, 0, 1, 0, 0, 0]);
    }
}
