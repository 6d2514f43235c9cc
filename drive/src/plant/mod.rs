//! The plant: machine, mechanics and inverter, and the model `PmsmPlant` built from them.

pub mod counters;
pub mod exchange;
mod integration;
pub mod inverter;
pub mod iron;
pub mod legs;
mod linear;
pub mod losses;
pub mod machine;
pub mod mechanics;
pub mod model;
pub mod power;
mod rates;
pub mod saturation;
pub mod signals;
mod state;
mod step;
pub mod tables;
pub mod thermal;
