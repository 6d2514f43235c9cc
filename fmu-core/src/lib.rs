//! The definition of a model, for exporters and authors: the trait [`Model`], its variable [`Table`], quantities and units,
//! time on an integer grid, and the neutral [`Description`].
//!
//! A whole model, and a test of it:
//!
//! ```
//! use fmu_core::unit::{Exponents, JOULE_PER_KELVIN, KELVIN, Quantity, Unit, WATT, WATT_PER_KELVIN};
//! use fmu_core::{
//!     Block, ContinuousTime, Elapsed, Fault, Info, Model, Row, State, Step, Table, table, integrate,
//! };
//! use serde::{Deserialize, Serialize};
//!
//! /// Inputs, parameters and state are plain data: the content of a saved state.
//! #[derive(Clone, Serialize, Deserialize)]
//! struct Heater { p: f64, t_ambient: f64, c: f64, g: f64, t: f64 }
//!
//! /// The start values, defined only here.
//! impl Default for Heater {
//!     fn default() -> Self {
//!         Self { p: 0.0, t_ambient: 293.15, c: 500.0, g: 2.0, t: 0.0 }
//!     }
//! }
//!
//! #[derive(Clone, Default, Serialize, Deserialize)]
//! struct Outputs { t: f64 }
//!
//! type V = Row<Block<Heater>>;
//!
//! impl Model for Heater {
//!     type Outputs = Outputs;
//!     const INFO: Info = Info { name: "Heater", description: "A heated body", ..Info::DEFAULT };
//!     const TABLE: &'static Table<Block<Self>> = table![
//!         V::input("P", &WATT, "Heating power", |m| &mut m.model.p).at_least(0.0),
//!         V::output("T", &KELVIN, "Temperature", |m| &mut m.out.t),
//!         V::parameter("T_ambient", &KELVIN, "Temperature around it, and at the start", |m| &mut m.model.t_ambient),
//!         V::parameter("C", &JOULE_PER_KELVIN, "Heat capacity", |m| &mut m.model.c).above(0.0),
//!         V::parameter("G", &WATT_PER_KELVIN, "Conductance to the ambient", |m| &mut m.model.g).tunable(),
//!     ];
//!
//!     fn initialize(&mut self) {
//!         self.t = self.t_ambient;
//!     }
//!
//!     fn output(&self, _now: Elapsed, out: &mut Outputs) {
//!         out.t = self.t;
//!     }
//!
//!     // Co-Simulation: one state, substeps of at most 0.1 s.
//!     fn advance(&mut self, step: &Step) -> Result<(), Fault> {
//!         integrate::smooth::<Self, { Self::SCALARS }>(self, step, 0.1)
//!     }
//! }
//!
//! /// The physics, for Model Exchange and derivatives too.
//! impl ContinuousTime for Heater {
//!     const STATES: &'static [State<Self>] = &[State::new("T", &KELVIN_PER_S, |m| &mut m.t)];
//!
//!     fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
//!         dx[0] = (self.p - self.g * (self.t - self.t_ambient)) / self.c;
//!         Ok(())
//!     }
//! }
//!
//! /// A quantity that the crate lacks: its name, its unit, the exponents of the SI base units.
//! const KELVIN_PER_S: Quantity =
//!     Quantity::new("Heating", Unit::si("K/s", Exponents::mechanical(0, 0, -1, 0).with_kelvin(1)));
//!
//! let mut heater = Block::<Heater>::default();
//! heater.model.p = 100.0;
//! heater.initialize();
//! heater.step(&Step { start: Elapsed::ZERO, h: 250.0 })?;
//! // 100 W over 2 W/K are 50 K; the time constant is 500/2 s.
//! assert!((heater.out.t - 293.15 - 50.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
//! # Ok::<(), Fault>(())
//! ```
//!
//! [`Row`] has an example of every kind of variable. [`ContinuousTime`], [`Events`], [`Sampled`], [`Differentiable`],
//! [`CompletedSteps`], [`Intermediate`], [`Clocked`], [`Resizable`] and [`Warns`] are further capabilities of a model;
//! [`Saved`] and [`Stored`] are the capabilities that a model has unless its export leaves them out. [`Model::load`] reads files
//! that the FMU contains, and a [`preset`] is one of them.
//!
//! Layers, from below: [`mod@unit`], [`variable`], [`token`], [`row`], [`mod@table`], [`sizes`], [`terminal`], [`model`],
//! [`continuous`], [`events`], [`capability`], [`saved`], [`rules`], [`description`]. No motor, no XML, no C, no `unsafe`.

#![forbid(unsafe_code)]

pub mod bytes;
pub mod call_log;
pub mod capability;
pub mod clock;
pub mod continuous;
pub mod description;
pub mod digits;
pub mod draw;
pub mod dual;
pub mod enumeration;
pub mod events;
pub mod fault;
pub mod idle;
pub mod integer;
pub mod integrate;
pub mod intermediate;
pub mod kept;
pub mod kinds;
pub mod list;
pub mod log;
pub mod model;
mod names;
pub mod need;
pub mod preset;
mod probe;
pub mod reals;
mod refusal;
pub mod resource;
pub mod row;
pub mod rules;
pub mod saved;
pub mod sizes;
pub mod table;
pub mod terminal;
pub mod time;
pub mod token;
pub mod unit;
pub mod variable;

pub use bytes::Bytes;
pub use capability::{Capabilities, Exported, Plain, Warns};
pub use clock::{Clock, Clocked, Ticks, Timing};
pub use continuous::{CompletedSteps, ContinuousTime, Differentiable, State};
pub use description::Description;
pub use dual::{Dual, Scalar};
pub use enumeration::{Choice, Enumerated, Field};
pub use events::{EventMode, Events, Indicator, Next, Outcome, Sampled, Stop};
pub use fault::Fault;
pub use integer::{IntegerField, IntegerType};
pub use intermediate::Intermediate;
pub use kept::{Account, Kept};
pub use kinds::Kinds;
pub use list::{Element, Items};
pub use model::{Block, Experiment, Info, Interface, Model};
pub use need::Need;
pub use reals::RealInputs;
pub use resource::Resource;
pub use row::{Constant, Row, Slot};
pub use saved::{Keeps, Saved, Stored};
pub use sizes::Resizable;
pub use table::{Part, Table};
pub use terminal::{Icon, Member, Terminal};
pub use time::{Elapsed, SampleGrid, Step};
pub use token::{Hash, Token};
pub use variable::{Alias, Causality, Enumeration, Item, Kind, Meta, Range, Variability};
