//! Effects of the FMU on the process that runs it, and several instances of the FMU.

pub(crate) mod host;
pub(crate) mod instances;
pub(crate) mod shared;
