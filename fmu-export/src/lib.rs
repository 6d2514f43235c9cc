//! The C interfaces of FMI 2.0 and FMI 3.0, Co-Simulation and Model Exchange, for any [`fmu_core::Model`], from one line: [`export!`].
//!
//! Layers, from the bottom: [`lifecycle`] (which call is allowed in which state), [`value`] (C types and base types), [`snapshot`]
//! (everything that changes), [`blob`] and [`registry`] (states as bytes and as handles), [`log`], [`instance`], [`exchange`]
//! and [`sensitivity`] (the calls without C), and [`abi`] (pointers). The crate knows neither motors nor XML; only [`abi`] contains `unsafe`.

#![deny(unsafe_code)]

#[allow(unsafe_code)]
pub mod abi;
mod access;
pub mod blob;
pub mod exchange;
pub mod instance;
pub mod lifecycle;
pub mod log;
mod message;
pub mod registry;
mod resources;
pub mod sensitivity;
pub mod snapshot;
mod step;
mod text;
pub mod value;

#[doc(hidden)]
pub use fmu_core::{Capabilities, Exported};
