//! The FMU as a file: archive, description, terminals, libraries. None of its code runs.

pub(crate) mod archive;
pub(crate) mod binary;
pub(crate) mod shared;
pub(crate) mod structure;
pub(crate) mod terminals;
pub(crate) mod variables;
pub(crate) mod xml;
