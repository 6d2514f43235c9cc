//! Sensorless control of a permanent-magnet synchronous machine: current and speed loops, the low-speed law, field weakening,
//! the start, every [`estimator`], and the model [`SensorlessController`] built from them.
//!
//! This crate is independent of the plant: the machine's values are the controller's estimates. For conventions see
//! [`drive_base`].

#![forbid(unsafe_code)]
// The papers' symbols keep their case: psi_M, R_s, L_d, T_s.
#![allow(non_snake_case)]

pub mod battery;
mod catch;
mod catching;
mod checks;
pub mod clocked;
pub mod commission;
pub mod commissioning;
pub mod current;
pub mod current_limit;
mod cycle;
pub mod documentation;
pub mod envelope;
pub mod estimator;
mod gains;
pub mod idle;
pub mod limits;
pub mod lock;
pub mod model;
pub mod modes;
mod one_shunt;
pub mod overload;
pub mod polarity;
pub mod position;
pub mod reference;
mod reluctance;
pub mod sensor;
pub mod settled;
pub mod signals;
pub mod speed;
mod stands;
pub mod start;
mod state;
pub mod tables;
mod terminals;
pub mod tracking;
pub mod trip;
pub mod weakening;
pub mod zero_speed;

pub use clocked::SensorlessControllerClocked;
pub use model::SensorlessController;
