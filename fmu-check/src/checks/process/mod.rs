//! What the FMU does to the process that runs it, and several of its instances.

pub(crate) mod host;
pub(crate) mod instances;
pub(crate) mod shared;
