//! Units and type definitions as in a file (FMI 2.0.5, 2.2.2 and 2.2.3; FMI 3.0.2, 2.4.3 and 2.4.4).

use crate::variable::BaseType;
use serde::{Deserialize, Serialize};

/// A unit with its display units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// Name, for example `N.m`.
    pub name: String,
    /// Its relation to the SI base units, if the file gives it.
    pub base: Option<BaseUnit>,
    /// Display units for values.
    pub display_units: Vec<DisplayUnit>,
    /// Line of the element.
    pub line: usize,
}

impl Unit {
    /// The display unit of this name.
    pub fn display_unit(&self, name: &str) -> Option<&DisplayUnit> {
        self.display_units.iter().find(|d| d.name == name)
    }
}

/// Exponents of the SI base units and of the radian: `base value = factor * value + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaseUnit {
    /// Exponents of kg, m, s, A, K, mol, cd and rad, in this order.
    pub exponents: [i32; 8],
    /// Factor from the unit to the base unit.
    pub factor: f64,
    /// Offset in the base unit.
    pub offset: f64,
}

impl BaseUnit {
    /// The attributes of the exponents, in the order of `exponents`.
    pub const NAMES: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];
}

/// A display unit: `shown = factor * value + offset`, or `factor / value` when inverse.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DisplayUnit {
    /// Name, for example `rpm`.
    pub name: String,
    /// Factor from the unit to the display unit, the inverse direction of [`BaseUnit`].
    pub factor: f64,
    /// Offset in the display unit.
    pub offset: f64,
    /// Whether the value is divided instead (FMI 3.0 only).
    pub inverse: bool,
}

impl DisplayUnit {
    /// The conversion of differences of values: only its factor.
    pub fn of_differences(&self) -> Self {
        Self { offset: 0.0, ..self.clone() }
    }

    /// The value in this display unit.
    pub fn show(&self, value: f64) -> f64 {
        if self.inverse { self.factor / value } else { self.factor * value + self.offset }
    }

    /// The value in the unit, from one in this display unit.
    pub fn unshow(&self, shown: f64) -> f64 {
        if self.inverse { self.factor / shown } else { (shown - self.offset) / self.factor }
    }
}

/// A type definition: the common properties of the variables that refer to it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TypeDefinition {
    /// Name that `declaredType` refers to.
    pub name: String,
    /// Base type.
    pub base: BaseType,
    /// One sentence.
    pub description: Option<String>,
    /// Physical quantity.
    pub quantity: Option<String>,
    /// Name of the unit.
    pub unit: Option<String>,
    /// Display unit.
    pub display_unit: Option<String>,
    /// Values are differences, to which the offset of a display unit does not apply (`relativeQuantity`).
    pub relative: Option<bool>,
    /// Lower bound.
    pub min: Option<f64>,
    /// Upper bound.
    pub max: Option<f64>,
    /// Typical magnitude.
    pub nominal: Option<f64>,
    /// Values of an enumeration.
    pub items: Vec<Item>,
    /// Line of the element.
    pub line: usize,
}

/// One value of an enumeration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Item {
    /// Name that tools show.
    pub name: String,
    /// The integer that crosses the interface.
    pub value: i64,
    /// Meaning of the value.
    pub description: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fahrenheit_and_miles_per_gallon() {
        // The worked example of FMI 3.0.2, 2.4.3: 273.15 K are 32 degrees Fahrenheit.
        let fahrenheit = DisplayUnit { name: "degF".into(), factor: 1.8, offset: -459.67, inverse: false };
        assert!((fahrenheit.show(273.15) - 32.0).abs() < 1e-9);
        assert!((fahrenheit.unshow(212.0) - 373.15).abs() < 1e-9);
        let per_second = DisplayUnit { name: "1/s".into(), factor: 1.0, offset: 0.0, inverse: true };
        assert!((per_second.unshow(per_second.show(4.0)) - 4.0).abs() < 1e-15);
    }

    /// A band of 10 K is one of 18 degrees Fahrenheit.
    #[test]
    fn a_difference_has_no_offset() {
        let fahrenheit = DisplayUnit { name: "degF".into(), factor: 1.8, offset: -459.67, inverse: false };
        assert!((fahrenheit.of_differences().show(10.0) - 18.0).abs() < 1e-12);
    }
}
