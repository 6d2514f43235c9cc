//! One row of a variable table: the properties of the variable and the closure that returns its value, or a part with its own
//! table.
//!
//! Only causality/variability pairs that FMI 2.0.5, 2.2.7 and FMI 3.0.2, 2.4.7.4 allow have a constructor. Start
//! values are not written here: they come from the model's `Default`.

mod kinds;
mod settings;
mod slot;

use crate::bytes::Bytes;
use crate::enumeration::Place;
use crate::fault::Fault;
use crate::integer::Getter;
use crate::kinds::Kinds;
use crate::list::List;
use crate::names::check_form;
use crate::need::Need;
use crate::reals::{Interval, RealInputs};
use crate::sizes::Sizes;
use crate::token::Hash;
use crate::variable::{Causality, Kind, Meta, Range, Variability};
pub use slot::{Constant, Slot};
use std::mem::MaybeUninit;

/// The type-erased interface of a part for a table.
pub(crate) trait Node<W>: Sync {
    fn entry<'a>(&self, whole: &'a mut W, index: usize) -> Option<(&'static Meta, Slot<'a>)>;
    fn read(&self, whole: &mut W, list: &[u32], first: u32, out: &mut [MaybeUninit<f64>]) -> usize;
    fn write(&self, whole: &mut W, list: &[u32], first: u32, inputs: RealInputs<'_>) -> usize;
    fn locate(&self, index: usize, name: &mut String) -> Option<(&'static Meta, usize)>;
    fn element(&self, index: usize) -> Option<usize>;
    fn clocks_of(&self, index: usize) -> &'static str;
}

/// The interface of a part with structural parameters, beside [`Node`]: other parts do not need its code.
pub(crate) trait SizedNode<W>: Sync {
    fn extent(&self, whole: &mut W, index: usize) -> Option<(&'static Meta, usize)>;
    fn extents(&self, whole: &mut W, index: usize) -> Vec<usize>;
    fn check_sizes(&self, whole: &mut W) -> Result<(), Fault>;
}

/// Where the value lives.
pub(crate) enum Access<W: 'static> {
    Real(fn(&mut W) -> &mut f64),
    Reals(fn(&mut W) -> &mut [f64]),
    Float32(fn(&mut W) -> &mut f32),
    Integer(Getter<W>),
    Boolean(fn(&mut W) -> &mut bool),
    Enumeration(&'static dyn Place<W>),
    List(&'static dyn List<W>),
    Text(fn(&mut W) -> &mut String),
    Said(fn(&W) -> &str),
    Computed(fn(&W) -> f64),
    Binary(fn(&mut W) -> &mut Bytes),
    ConstantText(&'static str),
    Constant(Constant),
    Constants(&'static [f64]),
    /// A clock, and where its interval is.
    Clock(Option<fn(&mut W) -> &mut f64>),
    Part {
        len: usize,
        wide: usize,
        hash: Hash,
        kinds: Kinds,
        sizes: Sizes,
        node: &'static dyn Node<W>,
        sized: Option<&'static dyn SizedNode<W>>,
    },
}

/// A row of the table of `W`: a variable, or the table of a part of `W`.
///
/// A constructor determines who sets the variable and when it changes; the methods after it restrict its values.
///
/// Real numbers, continuous or sampled:
///
/// ```
/// # use fmu_core::unit::{AMPERE, KELVIN, OHM, Quantity, VOLT, WATT};
/// # use fmu_core::{Row, Table, table};
/// # #[derive(Default)] struct Model { u: f64, u_k: f64, i: f64, i_k: f64, x: f64, x_k: f64, r: f64, g: f64, band: f64 }
/// # type V = Row<Model>;
/// const BAND: Quantity = KELVIN.relative("TemperatureDifference");
/// const TABLE: &Table<Model> = table![
///     V::input("u", &VOLT, "Continuous, held over a step of Co-Simulation", |m| &mut m.u),
///     V::discrete_input("u_k", &VOLT, "Read at sample instants", |m| &mut m.u_k).at_least(-5.0).at_most(5.0),
///     V::output("i", &AMPERE, "Continuous", |m| &mut m.i).mean(),
///     V::discrete_output("i_k", &AMPERE, "Changes at sample instants", |m| &mut m.i_k),
///     V::computed_output("p_k", &WATT, "Discrete, read from the state by a function", |m| m.u_k * m.i_k),
///     V::state("x", &VOLT, "For inspection, continuous", |m| &mut m.x).unbounded().nominal(10.0),
///     V::discrete_local("x_k", &VOLT, "For inspection, sampled", |m| &mut m.x_k),
///     V::parameter("R", &OHM, "Fixed after initialization", |m| &mut m.r).above(0.0).below(1e6),
///     V::parameter("band", &BAND, "May change while the simulation runs", |m| &mut m.band).tunable(),
///     V::calculated("G", &OHM, "From parameters, by `derive`", |m| &mut m.g),
/// ];
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
/// # use fmu_core::{Field, Row, Table, table, enumeration};
/// enumeration! {
///     enum Fan("FanMode", "What the fan does") {
///         1 Off "Stands still";
///         2 On "Turns";
///     }
/// }
/// # struct Model { on: bool, n: i32, small: u8, count: u64, fan: Fan }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = table![
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
/// ];
/// # let mut model = Model { on: false, n: 0, small: 0, count: 0, fan: Fan::Off };
/// if let Some((_, fmu_core::Slot::Enumeration(fan))) = TABLE.entry(&mut model, 10) {
///     assert!(fan.set(2) && !fan.set(3));
/// }
/// assert_eq!(model.fan.name(), "On");
/// ```
///
/// Arrays, matrices, single precision and texts. An array is one variable of FMI 3.0, and `a[1]`, `a[2]` or `m[1,2]` in FMI
/// 2.0; an array of other types is a list:
///
/// ```
/// # use fmu_core::unit::{ONE, VOLT};
/// # use fmu_core::{Items, Row, Table, table};
/// # #[derive(Default)] struct Model { u: [f64; 3], y: [f64; 3], a: [[f64; 3]; 2], x: f32, label: String, on: bool,
/// #     n: [i32; 3], names: [String; 2] }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = table![
///     V::array_input("u", &VOLT, "Three inputs", 3, |m| &mut m.u),
///     V::array_output("y", &VOLT, "Three outputs, sampled", 3, |m| &mut m.y).discrete(),
///     V::array_local("y_local", &VOLT, "For inspection", 3, |m| &mut m.y),
///     V::array_parameter("A", &ONE, "Two rows of three", 6, |m| m.a.as_flattened_mut()).shape(&[2, 3]),
///     V::list_input("n", "Three integers; `list_output`, `list_local` and `list_parameter` too", 3, &Items(|m| &mut m.n)),
///     V::list_parameter("names", "Two texts", 2, &Items(|m| &mut m.names)),
///     V::float32_input("x", &VOLT, "Input, sampled", |m| &mut m.x),
///     V::float32_output("x_out", &VOLT, "Output, continuous", |m| &mut m.x).continuous(),
///     V::float32_local("x_local", &VOLT, "For inspection", |m| &mut m.x),
///     V::float32_parameter("x_parameter", &VOLT, "Parameter", |m| &mut m.x),
///     V::text_input("title", "Set by the importer at any communication point", |m| &mut m.label),
///     V::text_parameter("label", "Fixed after initialization", |m| &mut m.label),
///     V::text_output("status", "Stored or constant, never built in a step", |m| if m.on { &m.label } else { "off" }),
///     V::text_constant("revision", "Never changes", "r1"),
/// ];
/// assert_eq!(TABLE.len(), 3 + 3 + 3 + 6 + 3 + 2 + 4 + 4);
/// ```
///
/// Aliases of a variable, which FMI 2.0 does not have:
///
/// ```
/// # use fmu_core::unit::{DisplayUnit, METER};
/// # use fmu_core::{Alias, Row, Table, table};
/// # struct Model { h: f64 }
/// const FOOT: DisplayUnit = DisplayUnit { name: "ft", factor: 1.0 / 0.3048, offset: 0.0 };
/// const TABLE: &Table<Model> = table![
///     Row::output("h", &METER, "Height", |m: &mut Model| &mut m.h)
///         .aliases(&[Alias { name: "h_ft", description: "Height in feet", display: Some(FOOT) }]),
/// ];
/// # assert_eq!(TABLE.len(), 1);
/// ```
///
/// Start values that the importer may set ([`exact`](Row::exact)), and constants of every type:
///
/// ```
/// # use fmu_core::unit::{KELVIN, METER_PER_S};
/// # use fmu_core::{Row, Table, enumeration, table};
/// # enumeration! { enum Fan("FanMode", "") { 1 Off ""; 2 On ""; } }
/// # struct Model { t: f64, count: i32 }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = table![
///     V::output("T", &KELVIN, "Its start value can be set", |m| &mut m.t).exact(),
///     V::integer_local("count", "So does this", |m| &mut m.count).exact(),
///     V::constant("v_min", &METER_PER_S, "For inspection", 0.1),
///     V::integer_constant("poles", "An output; uint8_constant and so on for the other integers", 8).as_output(),
///     V::boolean_constant("sealed", "True", true),
///     V::enumeration_constant::<Fan>("fan", "Turns", Fan::On as i32),
///     V::float32_constant("single", &KELVIN, "In single precision", 293.15),
///     V::array_constant("levels", &KELVIN, "Three", &[280.0, 290.0, 300.0]),
/// ];
/// # let mut model = Model { t: 0.0, count: 0 };
/// assert_eq!(TABLE.tell_name(&model, "levels"), Some("levels = 280 K".into()));
/// # impl Clone for Model { fn clone(&self) -> Self { Self { ..*self } } }
/// ```
///
/// A part has its own table, which the whole includes under a prefix:
///
/// ```
/// # use fmu_core::unit::OHM;
/// # use fmu_core::{Part, Row, Table, table};
/// # struct Motor { r: f64 }
/// # struct Drive { motor: Motor }
/// const MOTOR: &Table<Motor> = table![Row::parameter("R", &OHM, "Resistance", |m: &mut Motor| &mut m.r)];
/// const DRIVE: &Table<Drive> =
///     table![Row::part("motor.", &Part { table: MOTOR, lens: |d: &mut Drive| &mut d.motor })];
/// assert_eq!(DRIVE.locate(0).map(|(name, ..)| name), Some("motor.R".into()));
/// ```
///
/// An inconsistent row does not compile; the compiler shows it, with its name and the reason:
///
/// ```compile_fail,E0080
/// # use fmu_core::{Row, Table, table};
/// # struct Model { on: bool }
/// # type V = Row<Model>;
/// const TABLE: &Table<Model> = table![
///     V::boolean_input("on", "Input", |m| &mut m.on).at_least(0.0), // on: only a number can have a bound
/// ];
/// # let _ = TABLE.len();
/// ```
///
/// Nor does a name that is not a structured name of FMI; single quotes make one of any characters of ASCII:
///
/// ```compile_fail,E0080
/// # use fmu_core::unit::WATT;
/// # use fmu_core::{Row, Table, table};
/// # struct Model { loss: f64 }
/// const TABLE: &Table<Model> = table![
///     Row::output("loss [W]", &WATT, "Loss", |m: &mut Model| &mut m.loss), // 'loss [W]'
/// ];
/// # let _ = TABLE.len();
/// ```
pub struct Row<W: 'static> {
    pub(crate) meta: Meta,
    pub(crate) access: Access<W>,
    pub(crate) settable: Interval,
    /// Indices of the rows before it.
    pub(crate) start: Start,
}

/// Numbers of indices: individual ones, and those of wide arrays.
#[derive(Clone, Copy)]
pub(crate) struct Start {
    pub(crate) dense: usize,
    pub(crate) wide: usize,
}

impl<W: 'static> Row<W> {
    /// A fixed local variable; [`with`](Self::with) makes it another.
    #[track_caller]
    pub(crate) const fn new(name: &'static str, description: &'static str, kind: Kind, access: Access<W>) -> Self {
        check_form(name, matches!(access, Access::Part { .. }));
        let meta = Meta {
            name,
            description,
            causality: Causality::Local,
            variability: Variability::Fixed,
            kind,
            range: Range::ALL,
            nominal: None,
            unbounded: false,
            mean: false,
            exact: false,
            need: Need::Always,
            clocks: "",
            intermediate: false,
            dimension: None,
            shape: &[],
            sized: &[],
            aliases: &[],
        };
        Self { settable: Interval::of(&meta), meta, access, start: Start { dense: 0, wide: 0 } }
    }

    pub(crate) const fn with(mut self, causality: Causality, variability: Variability) -> Self {
        (self.meta.causality, self.meta.variability) = (causality, variability);
        self.settable = Interval::of(&self.meta);
        self
    }

    /// The properties of the row's variable.
    pub(crate) const fn meta(&self) -> &Meta {
        &self.meta
    }
}

#[cfg(test)]
mod tests;
