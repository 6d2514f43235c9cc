//! One row of a variable table: what the variable is and the closure that finds its value, or a part with its own table.
//!
//! Only causality/variability pairs that FMI 2.0.5, 2.2.7 and FMI 3.0.2, 2.4.7.4 allow have a constructor. Start
//! values are not written here: they come from the model's `Default`.

use crate::enumeration::{Choice, Enumerated, Field, Place};
use crate::token::Hash;
use crate::unit::Quantity;
use crate::variable::{Causality, Kind, Meta, Range, Variability};

/// The interface of a part for a table that does not know its type.
pub(crate) trait Node<W>: Sync {
    fn entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)>;
    fn real<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, &'a mut f64)>;
    fn locate(&self, index: usize, name: &mut String) -> Option<(&'static Meta, usize)>;
    fn element(&self, index: usize) -> Option<usize>;
}

/// Where the value lives.
pub(crate) enum Access<W: 'static> {
    Real(fn(&mut W) -> &mut f64),
    Reals(fn(&mut W) -> &mut [f64]),
    Integer(fn(&mut W) -> &mut i32),
    Boolean(fn(&mut W) -> &mut bool),
    Enumeration(&'static dyn Place<W>),
    Part { len: usize, hash: Hash, node: &'static dyn Node<W> },
}

/// A value found by a table, ready to read or to write.
#[derive(Debug)]
pub enum Slot<'a> {
    /// A real number.
    Real(&'a mut f64),
    /// An integer.
    Integer(&'a mut i32),
    /// A truth value.
    Boolean(&'a mut bool),
    /// An item of an enumeration.
    Enumeration(&'a mut dyn Choice),
}

/// A row of the table of `W`: a variable, or the table of a part of `W`.
pub struct Row<W: 'static> {
    pub(crate) meta: Meta,
    pub(crate) access: Access<W>,
}

impl<W: 'static> Row<W> {
    pub(crate) const fn new(
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
            mean: false,
            dimension: None,
        };
        Self { meta, access }
    }

    /// What the row says about its variable.
    pub(crate) const fn meta(&self) -> &Meta {
        &self.meta
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

    /// A continuous real variable that is no output: a state that importers may look at.
    pub const fn state(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Local, Variability::Continuous), name, quantity, description, get)
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

    /// A real parameter, fixed after initialization.
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
        let mut row = Self::new(name, description, Causality::Parameter, Variability::Fixed, kind, Access::Reals(get));
        row.meta.dimension = Some(dimension);
        row
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

    /// An enumeration parameter; `field` says where the model holds the enum.
    pub const fn enumeration_parameter<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        let kind = Kind::Enumeration(E::ENUMERATION);
        Self::new(name, description, Causality::Parameter, Variability::Fixed, kind, Access::Enumeration(field))
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

    /// Makes a parameter tunable: it may change at communication points.
    ///
    /// # Panics
    /// At compile time, if the variable is not a parameter.
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

    /// The variable is unbounded, like an angle that is not wrapped (FMI 3.0.2, 2.4.4 `unbounded`).
    pub const fn unbounded(mut self) -> Self {
        self.meta.unbounded = true;
        self
    }

    /// The output is a mean over the last communication step.
    ///
    /// # Panics
    /// At compile time, if the variable is not a real output.
    pub const fn mean(mut self) -> Self {
        let real = matches!(self.meta.kind, Kind::Real(_));
        assert!(real && matches!(self.meta.causality, Causality::Output), "only a real output can be a mean");
        self.meta.mean = true;
        self
    }

    /// Typical magnitude, for solvers' scaling; not 0.
    ///
    /// # Panics
    /// At compile time, if the value is 0.
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        assert!(magnitude != 0.0, "a nominal value must not be 0");
        self.meta.nominal = Some(magnitude);
        self
    }
}
