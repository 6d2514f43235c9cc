//! The plant: machine, mechanics and inverter, and the model `PmsmPlant` built from them.

pub mod exchange;
pub mod inverter;
pub mod iron;
pub mod legs;
pub mod losses;
pub mod machine;
pub mod mechanics;
pub mod model;
pub mod power;
pub mod saturation;
pub mod signals;
pub mod tables;
pub mod thermal;
