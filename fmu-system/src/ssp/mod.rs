//! Systems of FMUs as one file: System Structure and Parameterization, SSP 1.0 and 2.0.
//!
//! [`structure`]: the structure of any system; [`load`]: a system prepared for co-simulation; [`values`], [`ssv`] and [`ssm`]:
//! parameter values from SSV files and their mappings.

mod component;
mod element;
mod error;
mod flat;
mod known;
pub mod load;
mod outside;
mod package;
mod path;
pub mod ssm;
pub mod ssv;
pub mod structure;
pub mod values;

pub use error::Error;

/// Name of the description in the archive.
pub const DESCRIPTION: &str = "SystemStructure.ssd";

/// MIME type of a component that is an FMU, the default.
pub const FMU_TYPE: &str = "application/x-fmu-sharedlibrary";
