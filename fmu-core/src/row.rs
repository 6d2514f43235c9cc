//! One row of a variable table: what the variable is and the closure that finds its value, or a part with its own table.
//!
//! Only causality/variability pairs that FMI 2.0.5, 2.2.7 and FMI 3.0.2, 2.4.7.4 allow have a constructor. Start
//! values are not written here: they come from the model's `Default`.

use crate::enumeration::{Choice, Enumerated, Field, Place};
use crate::integer::{Getter, Whole};
use crate::reals::{Inputs, Interval};
use crate::token::Hash;
use crate::unit::Quantity;
use crate::variable::{Causality, Kind, Meta, Range, Variability};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::mem::MaybeUninit;

/// The interface of a part for a table that does not know its type.
pub(crate) trait Node<W>: Sync {
    fn entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)>;
    fn read(&self, whole: &mut W, list: &[u32], first: u32, out: &mut [MaybeUninit<f64>]) -> usize;
    fn write(&self, whole: &mut W, list: &[u32], first: u32, inputs: Inputs<'_>) -> usize;
    fn locate(&self, index: usize, name: &mut String) -> Option<(&'static Meta, usize)>;
    fn element(&self, index: usize) -> Option<usize>;
}

/// Where the value lives.
pub(crate) enum Access<W: 'static> {
    Real(fn(&mut W) -> &mut f64),
    Reals(fn(&mut W) -> &mut [f64]),
    Float32(fn(&mut W) -> &mut f32),
    Integer(Getter<W>),
    Boolean(fn(&mut W) -> &mut bool),
    Enumeration(&'static dyn Place<W>),
    Text(fn(&mut W) -> &mut String),
    Said(fn(&W) -> &str),
    Constant(&'static str),
    Part { len: usize, hash: Hash, node: &'static dyn Node<W> },
}

/// A value found by a table, ready to read or to write.
#[derive(Debug)]
pub enum Slot<'a> {
    /// A real number.
    Real(&'a mut f64),
    /// A real number in single precision.
    Float32(&'a mut f32),
    /// An integer.
    Integer(&'a mut dyn Whole),
    /// A truth value.
    Boolean(&'a mut bool),
    /// An item of an enumeration.
    Enumeration(&'a mut dyn Choice),
    /// A text that can be set.
    Text(&'a mut String),
    /// A text that the model says.
    Said(&'a str),
}

impl Slot<'_> {
    /// Whether the value is one that the variable can be set to.
    pub fn is_allowed(&self, meta: &Meta) -> bool {
        match (self, meta.kind) {
            (Self::Real(x), _) => meta.range.contains(**x),
            (Self::Float32(x), _) => meta.range.contains_single(**x),
            (Self::Integer(x), Kind::Integer(of)) => of.allows(x.get(), &meta.range),
            _ => true,
        }
    }

    /// The bits of the value, for comparisons; a hash of a text.
    pub(crate) fn bits(&self) -> u64 {
        let hash = |text: &str| {
            let mut hasher = DefaultHasher::new();
            text.hash(&mut hasher);
            hasher.finish()
        };
        match self {
            Self::Real(x) => x.to_bits(),
            Self::Float32(x) => x.to_bits().into(),
            Self::Integer(x) => u64::try_from(x.get() & i128::from(u64::MAX)).unwrap_or_default(),
            Self::Boolean(x) => u64::from(**x),
            Self::Enumeration(x) => x.get().cast_unsigned().into(),
            Self::Text(x) => hash(x),
            Self::Said(x) => hash(x),
        }
    }
}

/// The value as a message shows it; an enumeration as its number, a text in quotes.
impl std::fmt::Display for Slot<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Real(x) => x.fmt(f),
            Self::Float32(x) => x.fmt(f),
            Self::Integer(x) => x.get().fmt(f),
            Self::Boolean(x) => x.fmt(f),
            Self::Enumeration(x) => x.get().fmt(f),
            Self::Text(x) => write!(f, "{x:?}"),
            Self::Said(x) => write!(f, "{x:?}"),
        }
    }
}

/// A row of the table of `W`: a variable, or the table of a part of `W`.
///
/// A constructor says who sets the variable and when it changes; what follows says what is allowed.
///
/// Real numbers, continuous or sampled:
///
/// ```
/// # use fmu_core::unit::{AMPERE, KELVIN, OHM, Quantity, VOLT};
/// # use fmu_core::{Row, Table};
/// # #[derive(Default)] struct Model { u: f64, u_k: f64, i: f64, i_k: f64, x: f64, x_k: f64, r: f64, g: f64, band: f64 }
/// # type V = Row<Model>;
/// const BAND: Quantity = KELVIN.relative("TemperatureDifference");
/// const TABLE: &Table<Model> = &Table::new(const { &[
///     V::input("u", &VOLT, "Continuous, held over a step of Co-Simulation", |m| &mut m.u),
///     V::discrete_input("u_k", &VOLT, "Read at sample instants", |m| &mut m.u_k).at_least(-5.0).at_most(5.0),
///     V::output("i", &AMPERE, "Continuous", |m| &mut m.i).mean(),
///     V::discrete_output("i_k", &AMPERE, "Changes at sample instants", |m| &mut m.i_k),
///     V::state("x", &VOLT, "For inspection, continuous", |m| &mut m.x).unbounded().nominal(10.0),
///     V::discrete_local("x_k", &VOLT, "For inspection, sampled", |m| &mut m.x_k),
///     V::parameter("R", &OHM, "Fixed after initialization", |m| &mut m.r).above(0.0).below(1e6),
///     V::parameter("band", &BAND, "May change while the simulation runs", |m| &mut m.band).tunable(),
///     V::calculated("G", &OHM, "From parameters, by `derive`", |m| &mut m.g),
/// ] });
/// let mut model = Model::default();
/// assert_eq!(TABLE.tell(&model, |m| &mut m.band), "band = 0 K");
/// assert_eq!(TABLE.fault(&model, |m| &mut m.r, "above 0").to_string(), "R = 0 Ohm is not allowed: above 0");
/// # impl Clone for Model { fn clone(&self) -> Self { Self { ..*self } } }
/// ```
///
/// Truth values, integers and enumerations. There are constructors for each integer type of FMI 3.0, `int8_input` to
/// `uint64_parameter`; `integer_input` is of 32 bits:
///
/// ```
/// # use fmu_core::{Field, Row, Table, enumeration};
/// enumeration! {
///     enum Fan("FanMode", "What the fan does") {
///         1 Off "Stands still";
///         2 On "Turns";
///     }
/// }
/// # struct Model { on: bool, n: i32, small: u8, count: u64, fan: Fan }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = &Table::new(const { &[
///     V::boolean_input("on", "Input", |m| &mut m.on),
///     V::boolean_output("on_out", "Output", |m| &mut m.on),
///     V::boolean_local("on_local", "For inspection", |m| &mut m.on),
///     V::boolean_parameter("on_parameter", "Parameter", |m| &mut m.on).tunable(),
///     V::integer_input("n", "Input", |m| &mut m.n),
///     V::integer_output("n_out", "Output", |m| &mut m.n),
///     V::integer_local("n_local", "For inspection", |m| &mut m.n),
///     V::integer_parameter("n_parameter", "Parameter", |m| &mut m.n).at_least(1.0),
///     V::uint8_input("level", "Input; 0 to 100", |m| &mut m.small).at_most(100.0),
///     V::uint64_output("count", "Output", |m| &mut m.count),
///     V::enumeration_input("fan", "Input", &Field(|m| &mut m.fan)),
///     V::enumeration_output("fan_out", "Output", &Field(|m| &mut m.fan)),
///     V::enumeration_local("fan_local", "For inspection", &Field(|m| &mut m.fan)),
///     V::enumeration_parameter("fan_parameter", "Parameter", &Field(|m| &mut m.fan)),
/// ] });
/// # let mut model = Model { on: false, n: 0, small: 0, count: 0, fan: Fan::Off };
/// if let Some((_, fmu_core::Slot::Enumeration(fan))) = TABLE.entry(&mut model, 10) {
///     assert!(fan.set(2) && !fan.set(3));
/// }
/// assert_eq!(model.fan.name(), "On");
/// ```
///
/// Arrays, matrices, single precision and texts. An array is one variable of FMI 3.0, and `a[1]`, `a[2]` or `m[1,2]` in
/// FMI 2.0:
///
/// ```
/// # use fmu_core::unit::{ONE, VOLT};
/// # use fmu_core::{Row, Table};
/// # #[derive(Default)] struct Model { u: [f64; 3], y: [f64; 3], a: [[f64; 3]; 2], x: f32, label: String, on: bool }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = &Table::new(const { &[
///     V::array_input("u", &VOLT, "Three inputs", 3, |m| &mut m.u),
///     V::array_output("y", &VOLT, "Three outputs, sampled", 3, |m| &mut m.y).discrete(),
///     V::array_local("y_local", &VOLT, "For inspection", 3, |m| &mut m.y),
///     V::array_parameter("A", &ONE, "Two rows of three", 6, |m| m.a.as_flattened_mut()).shape(&[2, 3]),
///     V::float32_input("x", &VOLT, "Input, sampled", |m| &mut m.x),
///     V::float32_output("x_out", &VOLT, "Output, sampled", |m| &mut m.x),
///     V::float32_local("x_local", &VOLT, "For inspection", |m| &mut m.x),
///     V::float32_parameter("x_parameter", &VOLT, "Parameter", |m| &mut m.x),
///     V::text_parameter("label", "Fixed after initialization", |m| &mut m.label),
///     V::text_output("status", "Chosen or kept, never made in a step", |m| if m.on { &m.label } else { "off" }),
///     V::text_constant("revision", "Never changes", "r1"),
/// ] });
/// assert_eq!(TABLE.len(), 3 + 3 + 3 + 6 + 4 + 3);
/// ```
///
/// A part has a table of its own, which the whole sees under a prefix:
///
/// ```
/// # use fmu_core::unit::OHM;
/// # use fmu_core::{Part, Row, Table};
/// # struct Motor { r: f64 }
/// # struct Drive { motor: Motor }
/// const MOTOR: &Table<Motor> = &Table::new(const { &[Row::parameter("R", &OHM, "Resistance", |m: &mut Motor| &mut m.r)] });
/// const DRIVE: &Table<Drive> =
///     &Table::new(const { &[Row::part("motor.", &Part { table: MOTOR, lens: |d: &mut Drive| &mut d.motor })] });
/// assert_eq!(DRIVE.locate(0).map(|(name, ..)| name), Some("motor.R".into()));
/// ```
///
/// A row that contradicts itself does not compile; the compiler shows it, with its name and the reason:
///
/// ```compile_fail,E0080
/// # use fmu_core::{Row, Table};
/// # struct Model { on: bool }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = &Table::new(const { &[
///     V::boolean_input("on", "Input", |m| &mut m.on).at_least(0.0), // on: only a number can have a bound
/// ] });
/// # let _ = TABLE.len();
/// ```
pub struct Row<W: 'static> {
    pub(crate) meta: Meta,
    pub(crate) access: Access<W>,
    pub(crate) settable: Interval,
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
            shape: &[],
        };
        Self { settable: Interval::of(&meta), meta, access }
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

    const fn boolean(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        description: &'static str,
        get: fn(&mut W) -> &mut bool,
    ) -> Self {
        Self::new(name, description, causality, variability, Kind::Boolean, Access::Boolean(get))
    }

    /// A Boolean input.
    pub const fn boolean_input(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Input, Variability::Discrete), name, description, get)
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

    /// A real variable that is no output and changes at sample instants.
    pub const fn discrete_local(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f64,
    ) -> Self {
        Self::real((Causality::Local, Variability::Discrete), name, quantity, description, get)
    }

    /// A Boolean output.
    pub const fn boolean_output(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Output, Variability::Discrete), name, description, get)
    }

    /// A Boolean variable that is no output.
    pub const fn boolean_local(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut bool) -> Self {
        Self::boolean((Causality::Local, Variability::Discrete), name, description, get)
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

    const fn array(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        let mut row = Self::new(name, description, causality, variability, Kind::Real(quantity), Access::Reals(get));
        row.meta.dimension = Some(dimension);
        row
    }

    /// An array of continuous real inputs; `dimension` elements.
    pub const fn array_input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Input, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// An array of continuous real outputs; `dimension` elements.
    pub const fn array_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Output, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// An array of continuous real variables that are no outputs; `dimension` elements.
    pub const fn array_local(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Local, Variability::Continuous), name, quantity, description, dimension, get)
    }

    /// A fixed array of real parameters; `dimension` elements.
    pub const fn array_parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        dimension: usize,
        get: fn(&mut W) -> &mut [f64],
    ) -> Self {
        Self::array((Causality::Parameter, Variability::Fixed), name, quantity, description, dimension, get)
    }

    /// A Boolean parameter.
    pub const fn boolean_parameter(
        name: &'static str,
        description: &'static str,
        get: fn(&mut W) -> &mut bool,
    ) -> Self {
        Self::boolean((Causality::Parameter, Variability::Fixed), name, description, get)
    }

    const fn enumeration<E: Enumerated>(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        let kind = Kind::Enumeration(E::ENUMERATION);
        Self::new(name, description, causality, variability, kind, Access::Enumeration(field))
    }

    /// An enumeration input; `field` says where the model holds the enum.
    pub const fn enumeration_input<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Input, Variability::Discrete), name, description, field)
    }

    /// An enumeration output.
    pub const fn enumeration_output<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Output, Variability::Discrete), name, description, field)
    }

    /// An enumeration that is no output.
    pub const fn enumeration_local<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Local, Variability::Discrete), name, description, field)
    }

    /// An enumeration parameter.
    pub const fn enumeration_parameter<E: Enumerated>(
        name: &'static str,
        description: &'static str,
        field: &'static Field<W, E>,
    ) -> Self {
        Self::enumeration((Causality::Parameter, Variability::Fixed), name, description, field)
    }

    const fn single(
        (causality, variability): (Causality, Variability),
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::new(name, description, causality, variability, Kind::Float32(quantity), Access::Float32(get))
    }

    /// A real input in single precision, which changes at sample instants. FMI 2.0 has double precision only: what the
    /// importer sets is rounded.
    pub const fn float32_input(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Input, Variability::Discrete), name, quantity, description, get)
    }

    /// A real output in single precision, which changes at sample instants.
    pub const fn float32_output(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Output, Variability::Discrete), name, quantity, description, get)
    }

    /// A real variable in single precision that is no output and changes at sample instants.
    pub const fn float32_local(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Local, Variability::Discrete), name, quantity, description, get)
    }

    /// A real parameter in single precision.
    pub const fn float32_parameter(
        name: &'static str,
        quantity: &'static Quantity,
        description: &'static str,
        get: fn(&mut W) -> &mut f32,
    ) -> Self {
        Self::single((Causality::Parameter, Variability::Fixed), name, quantity, description, get)
    }

    /// A text parameter, fixed after initialization: a file name, a mode that has no list.
    pub const fn text_parameter(name: &'static str, description: &'static str, get: fn(&mut W) -> &mut String) -> Self {
        Self::new(name, description, Causality::Parameter, Variability::Fixed, Kind::Text, Access::Text(get))
    }

    /// A text output. The model keeps it or chooses among constants: to say it allocates nothing in a step.
    pub const fn text_output(name: &'static str, description: &'static str, say: fn(&W) -> &str) -> Self {
        Self::new(name, description, Causality::Output, Variability::Discrete, Kind::Text, Access::Said(say))
    }

    /// A text that never changes, for inspection: a revision, a source.
    pub const fn text_constant(name: &'static str, description: &'static str, text: &'static str) -> Self {
        Self::new(name, description, Causality::Local, Variability::Constant, Kind::Text, Access::Constant(text))
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
    /// At compile time, if the variable is not a parameter, or is a text.
    #[track_caller]
    pub const fn tunable(mut self) -> Self {
        let parameter = matches!(self.meta.causality, Causality::Parameter) && !matches!(self.meta.kind, Kind::Text);
        demand(parameter, self.meta.name, "only a parameter that is no text can be tunable");
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

    /// Makes an array a matrix, or an array of more dimensions: its extents, of which the product is the number of elements.
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
        let fits = matches!(self.meta.dimension, Some(n) if n == product);
        demand(fits, self.meta.name, "the product of the extents is not the number of elements");
        self.meta.shape = extents;
        self
    }

    /// Values greater than `bound` only.
    ///
    /// # Panics
    /// At compile time, as every bound: if the variable is not a number, or if no value is left.
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

    /// The output is a mean over the last communication step.
    ///
    /// # Panics
    /// At compile time, if the variable is not a real output.
    #[track_caller]
    pub const fn mean(mut self) -> Self {
        let output = matches!(self.meta.causality, Causality::Output) && matches!(self.meta.kind, Kind::Real(_));
        demand(output, self.meta.name, "only a real output can be a mean");
        self.meta.mean = true;
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

/// A compile-time check of a row. The error is shown at the caller's place, which is the row, with the variable's name.
#[track_caller]
pub(crate) const fn demand(fits: bool, name: &str, why: &str) {
    if fits {
        return;
    }
    // A panic while compiling takes one text.
    let (parts, mut text, mut len, mut part) = ([name, ": ", why], [0_u8; 256], 0, 0);
    while part < parts.len() {
        let (bytes, mut i) = (parts[part].as_bytes(), 0);
        while i < bytes.len() && len < text.len() {
            text[len] = bytes[i];
            (i, len) = (i + 1, len + 1);
        }
        part += 1;
    }
    match std::str::from_utf8(text.split_at(len).0) {
        Ok(text) => panic!("{}", text),
        Err(_) => panic!("{}", why),
    }
}
