//! The control: current and speed loops, the low-speed law, and the model `SensorlessController` built from them.

pub mod current;
mod cycle;
pub mod envelope;
pub mod lock;
pub mod model;
pub mod polarity;
pub mod reference;
pub mod sensor;
pub mod signals;
pub mod speed;
pub mod start;
mod state;
pub mod tables;
pub mod tracking;
pub mod weakening;
pub mod zero_speed;
