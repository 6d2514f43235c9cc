//! The plant: machine, mechanics and inverter, and the model `PmsmPlant` built from them.
//!
//! It does not depend on the controller. For conventions see [`drive_base`].

#![forbid(unsafe_code)]
// The papers' symbols keep their case: psi_M, R_s, L_d, T_s.
#![allow(non_snake_case)]

// A unit test shares its machines with integration tests.
#[cfg(test)]
extern crate self as drive_plant;

pub mod checkpoint;
mod circuit;
pub mod counters;
mod damping;
pub mod documentation;
pub mod exchange;
pub mod flux_map;
pub mod following;
pub mod idle;
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
pub mod pwm;
pub mod rectifier;
pub mod rules;
pub mod saturation;
pub mod sensors;
pub mod signals;
mod state;
mod step;
pub mod switched;
pub mod tables;
pub mod terminals;
pub mod thermal;
mod warming;

pub use model::PmsmPlant;
