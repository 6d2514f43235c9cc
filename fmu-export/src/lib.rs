//! The C interfaces of FMI 2.0 and FMI 3.0, Co-Simulation and Model Exchange, for any [`fmu_core::Model`], from one line: [`export!`].
//!
//! A whole crate, with `crate-type = ["cdylib"]` in its manifest, from which `fmu build` makes an FMU of each standard:
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
//! fmu_export::export!(Heater: ContinuousTime);
//! # fn main() {
//! #     use fmu_core::Description;
//! #     let description = Description::exported::<fmi::This>().unwrap();
//! #     assert_eq!(description.variables.last().unwrap().name, "der(T)");
//! # }
//! ```
//!
//! Layers, from the bottom: [`lifecycle`] (which call is allowed in which state), [`value`] (C types and base types),
//! [`snapshot`] (everything that changes), [`blob`] and [`registry`] (states as bytes and as handles), [`log`], [`instance`],
//! [`exchange`], [`clocks`], [`inside`] and [`sensitivity`] (the calls without C), and [`abi`] (pointers). The crate contains
//! nothing about motors or XML; only [`abi`] contains `unsafe`.

#![deny(unsafe_code)]

#[allow(unsafe_code)]
pub mod abi;
mod access;
mod binary;
pub mod blob;
mod call_log;
pub mod clocks;
mod configuration;
pub mod exchange;
mod habit;
pub mod inside;
pub mod instance;
pub mod lifecycle;
pub mod log;
mod message;
mod origin;
mod preset;
pub mod registry;
mod resources;
pub mod sensitivity;
pub mod snapshot;
mod step;
mod text;
mod unfed;
pub mod value;

#[doc(hidden)]
pub use fmu_core::rules::check;
pub use fmu_core::{Capabilities, Exported};
