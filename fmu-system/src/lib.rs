//! Several FMUs together, of FMI 2.0 and FMI 3.0, Co-Simulation and Model Exchange, from any tool.
//!
//! - [`cosimulation`]: FMUs connected, fed over time, run and recorded.
//! - [`integration`]: integrators with events, for Model Exchange.
//! - [`ssp`]: systems of FMUs from files.
//!
//! `fmu-import` opens and runs each of the FMUs.

#![forbid(unsafe_code)]

/// The types of one FMU.
pub use fmu_import::{Error, Fmu, Instance, Kind, Logging, Values};

pub mod cosimulation;
pub mod integration;
pub mod ssp;
