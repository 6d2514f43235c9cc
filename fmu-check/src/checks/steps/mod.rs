//! Co-Simulation and Scheduled Execution: steps, events, clocks.

pub(crate) mod clocks;
pub(crate) mod event_mode;
pub(crate) mod intermediate;
pub(crate) mod scheduled;
pub(crate) mod shared;
pub(crate) mod time;
