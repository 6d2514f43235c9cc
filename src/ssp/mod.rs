//! Systems of FMUs as one file: System Structure and Parameterization, SSP 1.0.
//!
//! [`drive`]: the closed loop of plant and controller, written; [`structure`]: the structure of any system, read;
//! [`load`]: a system made ready for our co-simulation; [`values`]: parameter values from SSV files.

pub mod drive;
pub mod load;
pub mod structure;
pub mod values;

/// Name of the description in the archive.
pub const DESCRIPTION: &str = "SystemStructure.ssd";

/// MIME type of a component that is an FMU, the default.
const FMU_TYPE: &str = "application/x-fmu-sharedlibrary";
