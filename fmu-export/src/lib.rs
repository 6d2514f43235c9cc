//! The C interfaces of FMI 2.0 and FMI 3.0 co-simulation for any [`fmu_core::Model`], from one line: [`export!`].
//!
//! Layers, from below: [`lifecycle`] (which call in which state), [`value`] (C types and base types), [`saved`] (all
//! that changes), [`blob`] and [`registry`] (states as bytes and as handles), [`log`], [`instance`] (what the calls
//! mean), and [`abi`] (pointers). No motor, no XML; `unsafe` in [`abi`] only.

#![deny(unsafe_code)]

#[allow(unsafe_code)]
pub mod abi;
mod access;
pub mod blob;
pub mod instance;
pub mod lifecycle;
pub mod log;
mod message;
pub mod registry;
pub mod saved;
mod step;
pub mod value;
