//! Settings of a row after its constructor; the compiler checks them.

use crate::need::Need;
use crate::reals::Interval;
use crate::refusal::{demand, same_text};
use crate::row::Row;
use crate::variable::{Alias, Causality, Kind, Range, Variability};

impl<W: 'static> Row<W> {
    /// Makes a parameter tunable: it may change at communication points, and a structural parameter in Reconfiguration Mode.
    ///
    /// # Panics
    /// At compile time, if the variable is not a parameter, or is a text or bytes.
    #[track_caller]
    pub const fn tunable(mut self) -> Self {
        let parameter = matches!(self.meta.causality, Causality::Parameter | Causality::StructuralParameter)
            && !matches!(self.meta.kind, Kind::Text | Kind::Binary { .. });
        demand(parameter, self.meta.name, "only a parameter of a type other than text and bytes can be tunable");
        self.meta.variability = Variability::Tunable;
        self
    }

    /// Makes a real input, output or local variable change at sample instants only.
    ///
    /// # Panics
    /// At compile time, if the variable is not continuous.
    #[track_caller]
    pub const fn discrete(mut self) -> Self {
        let continuous = matches!(self.meta.variability, Variability::Continuous);
        demand(continuous, self.meta.name, "only a continuous variable can be made discrete");
        self.meta.variability = Variability::Discrete;
        self
    }

    /// The importer may set the start value of this output or local variable, before the initialization and in it. The start
    /// value comes from the model's `Default`; [`initialize`](crate::Model::initialize) must not change it. The row of a state
    /// sets the state itself; the closure of any other row must refer to a field of the model, not to one of its outputs.
    ///
    /// # Panics
    /// At compile time, if the variable is not an output or a local variable, or is a text, bytes, a mean or a constant. Describing the
    /// model checks that the value survives the initialization.
    #[track_caller]
    pub const fn exact(mut self) -> Self {
        let calculated = matches!(self.meta.causality, Causality::Output | Causality::Local)
            && !matches!(self.meta.variability, Variability::Constant)
            && !matches!(self.meta.kind, Kind::Text | Kind::Binary { .. })
            && !self.meta.mean;
        let rule = "only an output or a local variable can be exact, and neither a text, bytes, a mean nor a constant";
        demand(calculated, self.meta.name, rule);
        self.meta.exact = true;
        self
    }

    /// Makes a constant an output.
    ///
    /// # Panics
    /// At compile time, if the variable is not a constant.
    #[track_caller]
    pub const fn as_output(mut self) -> Self {
        let constant = matches!(self.meta.variability, Variability::Constant);
        demand(constant, self.meta.name, "only a constant can be made an output");
        self.meta.causality = Causality::Output;
        self
    }

    /// Makes an input, output or local variable in single precision continuous.
    ///
    /// # Panics
    /// At compile time, if the variable is not in single precision, or is a parameter.
    #[track_caller]
    pub const fn continuous(mut self) -> Self {
        let single =
            matches!(self.meta.kind, Kind::Float32(_)) && matches!(self.meta.variability, Variability::Discrete);
        demand(
            single,
            self.meta.name,
            "only a variable in single precision other than a parameter can be made continuous",
        );
        self.meta.variability = Variability::Continuous;
        self
    }

    /// Makes an array a matrix or an array of more dimensions; the product of the extents is the number of elements.
    /// The elements are row by row, as `as_flattened_mut` of `[[f64; COLUMNS]; ROWS]` gives them.
    ///
    /// # Panics
    /// At compile time, if the variable is not an array, or if the extents do not give its number of elements.
    #[track_caller]
    pub const fn shape(mut self, extents: &'static [usize]) -> Self {
        let (mut product, mut i) = (1, 0);
        while i < extents.len() {
            product *= extents[i];
            i += 1;
        }
        let fits = matches!(self.meta.dimension, Some(n) if n == product) && self.meta.sized.is_empty();
        demand(fits, self.meta.name, "the product of the extents is not the number of elements");
        self.meta.shape = extents;
        self
    }

    /// Makes the extents of an array structural parameters of the same table, by their names: `&["n", "n"]`. Its number of
    /// elements is the maximum, the product of their upper bounds; the present number is the length of the model's array,
    /// stored row by row. See [`Resizable`](crate::Resizable).
    ///
    /// # Panics
    /// At compile time, if the variable is not an array, has a [`shape`](Self::shape) or is a constant; the table checks the names
    /// and the number of elements.
    #[track_caller]
    pub const fn sized(mut self, extents: &'static [&'static str]) -> Self {
        let array = self.meta.dimension.is_some()
            && self.meta.shape.is_empty()
            && !matches!(self.meta.variability, Variability::Constant);
        demand(
            array && !extents.is_empty(),
            self.meta.name,
            "only an array without a shape can be sized, and no constant",
        );
        self.meta.sized = extents;
        self
    }

    /// Values greater than `bound` only.
    ///
    /// # Panics
    /// At compile time, like every bound: if the variable is not a number, or if no value remains.
    #[track_caller]
    pub const fn above(mut self, bound: f64) -> Self {
        self.meta.range.min = bound;
        self.meta.range.above = true;
        self.bounded()
    }

    /// Values less than `bound` only.
    ///
    /// # Panics
    /// At compile time, as [`above`](Self::above).
    #[track_caller]
    pub const fn below(mut self, bound: f64) -> Self {
        self.meta.range.max = bound;
        self.meta.range.below = true;
        self.bounded()
    }

    /// Values of at least `bound`.
    ///
    /// # Panics
    /// At compile time, as [`above`](Self::above).
    #[track_caller]
    pub const fn at_least(mut self, bound: f64) -> Self {
        self.meta.range.min = bound;
        self.bounded()
    }

    /// Values of at most `bound`.
    ///
    /// # Panics
    /// At compile time, as [`above`](Self::above).
    #[track_caller]
    pub const fn at_most(mut self, bound: f64) -> Self {
        self.meta.range.max = bound;
        self.bounded()
    }

    #[track_caller]
    const fn bounded(mut self) -> Self {
        let number = matches!(self.meta.kind, Kind::Real(_) | Kind::Float32(_) | Kind::Integer(_));
        demand(number, self.meta.name, "only a number can have a bound");
        let Range { min, max, above, below } = self.meta.range;
        demand(min < max || (min <= max && !above && !below), self.meta.name, "the bounds leave no value");
        self.settable = Interval::of(&self.meta);
        self
    }

    /// The variable is unbounded, like an angle that is not wrapped (FMI 3.0.2, 2.4.4 `unbounded`).
    ///
    /// # Panics
    /// At compile time, if the variable is not real.
    #[track_caller]
    pub const fn unbounded(mut self) -> Self {
        demand(self.is_real(), self.meta.name, "only a real variable can be unbounded");
        self.meta.unbounded = true;
        self
    }

    /// The input can be set, the output be read, inside a communication step: see [`Intermediate`](crate::Intermediate).
    ///
    /// # Panics
    /// At compile time, if the variable is not a continuous real input or output.
    #[track_caller]
    pub const fn intermediate(mut self) -> Self {
        let connected = matches!(self.meta.causality, Causality::Input | Causality::Output);
        let continuous = matches!(self.meta.variability, Variability::Continuous) && connected;
        demand(continuous, self.meta.name, "only a continuous input or output can be intermediate");
        self.meta.intermediate = true;
        self
    }

    /// The output is a mean over the last communication step.
    ///
    /// # Panics
    /// At compile time, if the variable is not a real output.
    #[track_caller]
    pub const fn mean(mut self) -> Self {
        let output = matches!(self.meta.causality, Causality::Output)
            && matches!(self.meta.kind, Kind::Real(_))
            && !self.meta.exact
            && !matches!(self.meta.variability, Variability::Constant);
        demand(output, self.meta.name, "only a real output can be a mean");
        self.meta.mean = true;
        self
    }

    /// The input is optional, because its start value usually suits. The description says so.
    ///
    /// # Panics
    /// At compile time, if the variable is not an input.
    #[track_caller]
    pub const fn optional(self) -> Self {
        self.needed(Need::Never)
    }

    /// The model reads the input only while a Boolean parameter is `true` or `false`, or while an enumeration has the named
    /// value. The description states this, with the parameter's full name.
    ///
    /// # Panics
    /// At compile time, if the variable is not an input. Describing the model checks the parameter and the value.
    #[track_caller]
    pub const fn read_with(self, parameter: &'static str, value: &'static str) -> Self {
        self.needed(Need::With { parameter, value })
    }

    #[track_caller]
    const fn needed(mut self, need: Need<'static>) -> Self {
        let input = matches!(self.meta.causality, Causality::Input);
        demand(input, self.meta.name, "only an input can be left unconnected");
        self.meta.need = need;
        self
    }

    /// Other names of the variable (FMI 3.0).
    ///
    /// # Panics
    /// At compile time, if a name is missing or equals the row's, or a display unit belongs to a variable without a unit.
    #[track_caller]
    pub const fn aliases(mut self, aliases: &'static [Alias]) -> Self {
        let mut i = 0;
        while i < aliases.len() {
            let named = !aliases[i].name.is_empty() && !same_text(aliases[i].name, self.meta.name);
            demand(named, self.meta.name, "an alias needs its own name");
            let with_unit = matches!(self.meta.kind, Kind::Real(of) | Kind::Float32(of) if !of.unit.name.is_empty());
            let fits = with_unit || aliases[i].display.is_none();
            demand(fits, aliases[i].name, "only a real variable with a unit can have a display unit");
            i += 1;
        }
        self.meta.aliases = aliases;
        self
    }

    /// Typical magnitude, for solvers' scaling; not 0.
    ///
    /// # Panics
    /// At compile time, if the variable is not real, or the value is 0.
    #[track_caller]
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        demand(self.is_real(), self.meta.name, "only a real variable has a nominal value");
        demand(magnitude != 0.0, self.meta.name, "a nominal value must not be 0");
        self.meta.nominal = Some(magnitude);
        self
    }

    const fn is_real(&self) -> bool {
        matches!(self.meta.kind, Kind::Real(_) | Kind::Float32(_))
    }
}
