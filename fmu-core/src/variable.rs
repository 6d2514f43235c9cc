//! One row of a variable table: name, unit, range, and the closure that finds the value, or a part with its own table.
//!
//! Only causality/variability pairs that FMI 2.0.5 (2.2.7) and FMI 3.0.2 (2.4.7.4) allow have a constructor. Start
//! values are not written here: they come from the model's `Default`.

use crate::table::{Node, Part};
use crate::token::Hash;
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
    /// Computed by the model, for the curious.
    Local,
}

/// When a variable changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum Variability {
    /// Constant after initialisation.
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
    /// Name of the type definition; no variable may bear it.
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
    /// Name.
    pub name: &'static str,
    /// Description.
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
    pub fn contains(&self, x: f64) -> bool {
        let low = if self.above { x > self.min } else { x >= self.min };
        let high = if self.below { x < self.max } else { x <= self.max };
        x.is_finite() && low && high
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

/// Everything about a variable but where its value lives.
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
    /// Grows without bound, like an angle that is not wrapped.
    pub unbounded: bool,
    /// Number of elements of an array, `None` for a scalar.
    pub dimension: Option<usize>,
}

/// Where the value lives.
pub(crate) enum Access<W: 'static> {
    Real(fn(&mut W) -> &mut f64),
    Reals(fn(&mut W) -> &mut [f64]),
    Integer(fn(&mut W) -> &mut i32),
    Boolean(fn(&mut W) -> &mut bool),
    Part { len: usize, hash: Hash, node: &'static dyn Node<W> },
}

/// A value found by a table, ready to read or to write.
#[derive(Debug)]
pub enum Slot<'a> {
    /// A real number.
    Real(&'a mut f64),
    /// An integer or the value of an enumeration.
    Integer(&'a mut i32),
    /// A truth value.
    Boolean(&'a mut bool),
}

/// A row of the table of `W`: a variable, or the table of a part of `W`.
pub struct Row<W: 'static> {
    pub(crate) meta: Meta,
    pub(crate) access: Access<W>,
}

impl<W: 'static> Row<W> {
    const fn new(
        name: &'static str,
        description: &'static str,
        causality: Causality,
        variability: Variability,
        kind: Kind,
        access: Access<W>,
    ) -> Self {
        let meta = Meta {
            name,
            description,
            causality,
            variability,
            kind,
            range: Range::ALL,
            nominal: None,
            unbounded: false,
            dimension: None,
        };
        Self { meta, access }
    }

    const fn real(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::new(name, description, causality, variability, Kind::Real(quantity), Access::Real(get))
    }

    /// All variables of a part, under a prefix that ends with a dot (or none).
    pub const fn part<P>(prefix: &'static str, part: &'static Part<W, P>) -> Self {
        let access = Access::Part { len: part.table.len(), hash: part.table.hash(), node: part };
        Self::new(prefix, "", Causality::Local, Variability::Fixed, Kind::Boolean, access)
    }

    /// A continuous real input.
    pub const fn input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Input, Variability::Continuous), name, quantity, description, get)
    }

    /// A real input that changes at sample instants.
    pub const fn discrete_input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Input, Variability::Discrete), name, quantity, description, get)
    }

    /// A Boolean input.
    pub const fn boolean_input(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        let access = Access::Boolean(get);
        Self::new(name, description, Causality::Input, Variability::Discrete, Kind::Boolean, access)
    }

    /// A continuous real output, calculated from the start on.
    pub const fn output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Output, Variability::Continuous), name, quantity, description, get)
    }

    /// A real output that changes at sample instants.
    pub const fn discrete_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Output, Variability::Discrete), name, quantity, description, get)
    }

    /// An integer output.
    pub const fn integer_output(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut i32) -> Self {
        let access = Access::Integer(get);
        Self::new(name, description, Causality::Output, Variability::Discrete, Kind::Integer, access)
    }

    /// A Boolean output.
    pub const fn boolean_output(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        let access = Access::Boolean(get);
        Self::new(name, description, Causality::Output, Variability::Discrete, Kind::Boolean, access)
    }

    /// A real parameter, fixed after initialisation.
    pub const fn parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Parameter, Variability::Fixed), name, quantity, description, get)
    }

    /// A fixed array of real parameters; `dimension` elements.
    pub const fn array_parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        let kind = Kind::Real(quantity);
        let mut it = Self::new(name, description, Causality::Parameter, Variability::Fixed, kind, Access::Reals(get));
        it.meta.dimension = Some(dimension);
        it
    }

    /// An integer parameter.
    pub const fn integer_parameter(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut i32) -> Self {
        let access = Access::Integer(get);
        Self::new(name, description, Causality::Parameter, Variability::Fixed, Kind::Integer, access)
    }

    /// A Boolean parameter.
    pub const fn boolean_parameter(
        name: &'static str,
        description: &'static str,
        get: fn(&mut W) -> &mut bool,
    ) -> Self {
        let access = Access::Boolean(get);
        Self::new(name, description, Causality::Parameter, Variability::Fixed, Kind::Boolean, access)
    }

    /// An enumeration parameter, stored as its integer; a setter only ever writes a value that exists.
    pub const fn enumeration_parameter(
        name: &'static str,
        enumeration: &'static Enumeration,
        description: &'static str,
        get: fn(&mut W) -> &mut i32,
    ) -> Self {
        let kind = Kind::Enumeration(enumeration);
        Self::new(name, description, Causality::Parameter, Variability::Fixed, kind, Access::Integer(get))
    }

    /// A parameter computed by the model's `derive`, constant during the simulation.
    pub const fn calculated(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::CalculatedParameter, Variability::Fixed), name, quantity, description, get)
    }

    /// A parameter becomes tunable: it may change at communication points.
    ///
    /// # Panics
    /// While compiling, on anything but a parameter.
    pub const fn tunable(mut self) -> Self {
        assert!(matches!(self.meta.causality, Causality::Parameter), "only a parameter can be tunable");
        self.meta.variability = Variability::Tunable;
        self
    }

    /// Values greater than `bound` only.
    pub const fn above(mut self, bound: f64) -> Self {
        self.meta.range.min = bound;
        self.meta.range.above = true;
        self
    }

    /// Values less than `bound` only.
    pub const fn below(mut self, bound: f64) -> Self {
        self.meta.range.max = bound;
        self.meta.range.below = true;
        self
    }

    /// Values of at least `bound`.
    pub const fn at_least(mut self, bound: f64) -> Self {
        self.meta.range.min = bound;
        self
    }

    /// Values of at most `bound`.
    pub const fn at_most(mut self, bound: f64) -> Self {
        self.meta.range.max = bound;
        self
    }

    /// The variable grows without bound, like an angle that is not wrapped (FMI 3.0.2, 2.4.7.5 `unbounded`).
    pub const fn unbounded(mut self) -> Self {
        self.meta.unbounded = true;
        self
    }

    /// Typical magnitude, for solvers' scaling; not 0.
    ///
    /// # Panics
    /// While compiling, on 0.
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        assert!(magnitude != 0.0, "a nominal value must not be 0");
        self.meta.nominal = Some(magnitude);
        self
    }
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
