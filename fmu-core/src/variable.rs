//! The properties of a variable except the location of its value: causality, variability, type, range.

use crate::clock::Timing;
use crate::integer::IntegerType;
use crate::need::Need;
use crate::unit::{DisplayUnit, Quantity};
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
    /// The size of arrays, set by the importer in Configuration Mode (FMI 3.0).
    StructuralParameter,
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
    /// Never changes.
    Constant,
}

/// An enumeration: a type with named values.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// Name of the type definition, which no variable may share.
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
    /// A real number of a quantity, in double precision.
    Real(&'static Quantity),
    /// A real number of a quantity, in single precision.
    Float32(&'static Quantity),
    /// An integer.
    Integer(IntegerType),
    /// A truth value.
    Boolean,
    /// One of the named values.
    Enumeration(&'static Enumeration),
    /// A text.
    Text,
    /// A clock (FMI 3.0).
    Clock(Timing),
    /// Bytes (FMI 3.0).
    Binary {
        /// MIME type of the content.
        mime_type: &'static str,
        /// Maximum number of bytes.
        most: usize,
    },
}

/// The allowed values. A strict bound is excluded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound; -infinity if unbounded.
    pub min: f64,
    /// Upper bound; infinity if unbounded.
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

    /// The variable in single precision; its bounds are rounded like its values.
    #[expect(clippy::cast_possible_truncation, reason = "rounds")]
    pub fn contains_single(&self, x: f32) -> bool {
        let single = |bound: f64| f64::from(bound as f32);
        Self { min: single(self.min), max: single(self.max), ..*self }.contains(x.into())
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

/// Another name of a variable (FMI 3.0; FMI 2.0 does not show it).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alias {
    /// Name, relative to the part that the variable belongs to; unique in its table.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Display unit: one of those of the variable's unit.
    pub display: Option<DisplayUnit>,
}

/// All properties of a variable except the location of its value.
#[expect(clippy::struct_excessive_bools, reason = "properties that do not depend on each other")]
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
    /// Allowed values.
    pub range: Range,
    /// Typical magnitude, for solvers' scaling.
    pub nominal: Option<f64>,
    /// The value is unbounded, like an angle that is not wrapped.
    pub unbounded: bool,
    /// The value is a mean over the last communication step.
    pub mean: bool,
    /// The importer may set the start value of this output or local variable.
    pub exact: bool,
    /// Whether an importer must feed it.
    pub need: Need<'static>,
    /// Names of its clocks, separated by spaces; empty if it has none.
    pub clocks: &'static str,
    /// It can be read or set inside a communication step; for a part, one of its variables can.
    pub intermediate: bool,
    /// Number of elements of an array, `None` for a scalar.
    pub dimension: Option<usize>,
    /// Extents of a matrix, which is stored row by row; empty for a scalar, and for an array with one extent.
    pub shape: &'static [usize],
    /// Names of the structural parameters that are the extents of an array, relative to the same part; empty for an array of
    /// one size. Its number of elements is then the maximum.
    pub sized: &'static [&'static str],
    /// Other names.
    pub aliases: &'static [Alias],
}

impl Meta {
    /// The allowed values, for messages.
    pub fn allowed(&self) -> String {
        let enumeration = match self.kind {
            Kind::Enumeration(enumeration) => enumeration,
            Kind::Integer(of) if of != IntegerType::Int32 => {
                let (min, max) = of.within(&self.range);
                return format!("{min} to {max}");
            }
            Kind::Binary { most, .. } => return format!("at most {most} bytes"),
            _ => return self.range.to_string(),
        };
        let items: Vec<String> =
            enumeration.items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
        items.join(", ")
    }

    /// Whether the importer sets it before the simulation starts.
    pub fn takes_start(&self) -> bool {
        self.causality.is_settable() || self.exact
    }

    /// Whether the description has a start value.
    pub fn has_start(&self) -> bool {
        self.takes_start()
            || self.variability == Variability::Constant
            || self.causality == Causality::StructuralParameter
    }
}

/// The index of an array element as written in names: `[2]`, or `[1,2]` in a matrix stored row by row.
pub fn position(shape: &[usize], element: usize) -> String {
    let mut rest = element;
    let mut indices: Vec<String> = Vec::new();
    for extent in shape.iter().skip(1).rev().map(|n| (*n).max(1)) {
        indices.push((rest % extent + 1).to_string());
        rest /= extent;
    }
    indices.push((rest + 1).to_string());
    indices.reverse();
    format!("[{}]", indices.join(","))
}

/// The element that [`position`] writes in this way; `None` if the array has no such element.
pub fn element(shape: &[usize], position: &str) -> Option<usize> {
    let mut indices = position.strip_prefix('[')?.strip_suffix(']')?.split(',');
    let mut element = 0_usize;
    for &extent in shape {
        let index: usize = indices.next()?.parse().ok()?;
        let index = index.checked_sub(1).filter(|index| *index < extent)?;
        element = element.checked_mul(extent)?.checked_add(index)?;
    }
    indices.next().is_none().then_some(element)
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
    fn positions_count_from_1_row_by_row() {
        assert_eq!((position(&[], 2), position(&[3], 2)), ("[3]".into(), "[3]".into()));
        let names: Vec<String> = (0..6).map(|i| position(&[2, 3], i)).collect();
        assert_eq!(names, ["[1,1]", "[1,2]", "[1,3]", "[2,1]", "[2,2]", "[2,3]"]);
        for (i, name) in names.iter().enumerate() {
            assert_eq!(element(&[2, 3], name), Some(i));
        }
        for none in ["", "[1]", "[0,1]", "[3,1]", "[1,4]", "[1,1,1]", "[1,1", "1,1", "[,]", "[1,-1]"] {
            assert_eq!(element(&[2, 3], none), None, "{none}");
        }
    }

    #[test]
    fn single_precision_rounds_the_bounds_too() {
        let tenth = Range { max: 0.1, ..Range::ALL };
        assert!(tenth.contains_single(0.1) && !tenth.contains(f64::from(0.1_f32)) && !tenth.contains_single(0.11));
    }

    #[test]
    fn a_range_reads_as_words() {
        assert_eq!(Range { min: 0.0, above: true, ..Range::ALL }.to_string(), "greater than 0");
        assert_eq!(Range { min: 0.0, max: 2.0, ..Range::ALL }.to_string(), "at least 0 and at most 2");
    }
}
