//! The life of an instance: which calls it allows, what it takes and keeps, saves and says.

pub(crate) mod access;
pub(crate) mod configuration;
pub(crate) mod lifecycle;
pub(crate) mod logging;
pub(crate) mod shared;
pub(crate) mod state;
