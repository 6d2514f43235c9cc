//! The plant: machine, mechanics and inverter, and the model `PmsmPlant` built from them.

mod circuit;
pub mod counters;
mod damping;
pub mod exchange;
mod integration;
pub mod inverter;
pub mod iron;
mod kinks;
pub mod legs;
pub mod losses;
pub mod machine;
pub mod mechanics;
pub mod model;
pub mod power;
pub mod saturation;
pub mod signals;
mod state;
mod step;
pub mod tables;
pub mod thermal;
