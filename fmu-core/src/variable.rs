//! The properties of a variable except the location of its value: causality, variability, type, range.

use crate::unit::Quantity;
use serde::{Deserialize, Serialize};

/// Who sets a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Causality {
    /// Set by the importer before the simulation.
    Parameter,
    /// Computed from parameters, constant during the simulation.
    CalculatedParameter,
    /// Set by the importer at communication points.
    Input,
    /// Computed by the model.
    Output,
    /// Computed by the model, for inspection only.
    Local,
}

impl Causality {
    /// Whether the importer sets variables of this causality.
    pub fn is_settable(self) -> bool {
        matches!(self, Self::Input | Self::Parameter)
    }
}

/// When a variable changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Variability {
    /// Constant after initialization.
    Fixed,
    /// A parameter that may change at communication points.
    Tunable,
    /// Changes at sample instants.
    Discrete,
    /// Changes all the time.
    Continuous,
}

/// An enumeration: a type with named values.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Name of the type definition; no variable may have it.
    pub name: &'static str,
    /// Description of the type.
    pub description: &'static str,
    /// The values that exist.
    pub items: &'static [Item],
}

/// One value of an enumeration.
#[derive(Debug, PartialEq, Eq)]
pub struct Item {
    /// The integer that crosses the interface.
    pub value: i32,
    /// Name that tools show and SSV files may use.
    pub name: &'static str,
    /// What the value means.
    pub description: &'static str,
}

/// Base type of a variable and what belongs to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// A real number of a quantity.
    Real(&'static Quantity),
    /// A 32-bit integer.
    Integer,
    /// A truth value.
    Boolean,
    /// One of the named values.
    Enumeration(&'static Enumeration),
}

/// The values that are allowed. A strict bound is not itself allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound, -infinity for none.
    pub min: f64,
    /// Upper bound, infinity for none.
    pub max: f64,
    /// The lower bound is strict.
    pub above: bool,
    /// The upper bound is strict.
    pub below: bool,
}

impl Range {
    /// Every finite value.
    pub const ALL: Self = Self { min: f64::NEG_INFINITY, max: f64::INFINITY, above: false, below: false };

    /// Whether `x` is finite and inside.
    #[inline]
    pub fn contains(&self, x: f64) -> bool {
        let on_the_edge = (self.above && x <= self.min) || (self.below && x >= self.max);
        x.is_finite() && x >= self.min && x <= self.max && !on_the_edge
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let low = (self.min.is_finite(), if self.above { "greater than" } else { "at least" });
        let high = (self.max.is_finite(), if self.below { "less than" } else { "at most" });
        match (low, high) {
            ((true, low), (true, high)) => write!(f, "{low} {} and {high} {}", self.min, self.max),
            ((true, low), _) => write!(f, "{low} {}", self.min),
            (_, (true, high)) => write!(f, "{high} {}", self.max),
            _ => write!(f, "any finite number"),
        }
    }
}

/// All properties of a variable except the location of its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meta {
    /// Name, relative to the part that it belongs to.
    pub name: &'static str,
    /// One sentence for the importer's user.
    pub description: &'static str,
    /// Who sets it.
    pub causality: Causality,
    /// When it changes.
    pub variability: Variability,
    /// Base type.
    pub kind: Kind,
    /// What is allowed.
    pub range: Range,
    /// Typical magnitude, for solvers' scaling.
    pub nominal: Option<f64>,
    /// The value is unbounded, like an angle that is not wrapped.
    pub unbounded: bool,
    /// The value is a mean over the last communication step.
    pub mean: bool,
    /// Number of elements of an array, `None` for a scalar.
    pub dimension: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strict_bounds_exclude_themselves() {
        let positive = Range { min: 0.0, above: true, ..Range::ALL };
        assert!(positive.contains(1e-300) && !positive.contains(0.0) && !positive.contains(-1.0));
        let closed = Range { min: -1.0, max: 1.0, ..Range::ALL };
        assert!(closed.contains(-1.0) && closed.contains(1.0) && !closed.contains(1.000_000_1));
        assert!(!Range::ALL.contains(f64::NAN) && !Range::ALL.contains(f64::INFINITY));
    }

    #[test]
    fn a_range_reads_as_words() {
        assert_eq!(Range { min: 0.0, above: true, ..Range::ALL }.to_string(), "greater than 0");
        assert_eq!(Range { min: 0.0, max: 2.0, ..Range::ALL }.to_string(), "at least 0 and at most 2");
    }
}
