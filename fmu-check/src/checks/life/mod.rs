//! The life of an instance: the calls that it allows, the values that it accepts and keeps, its saved states and its messages.

pub(crate) mod access;
pub(crate) mod configuration;
pub(crate) mod lifecycle;
pub(crate) mod logging;
pub(crate) mod shared;
pub(crate) mod state;
