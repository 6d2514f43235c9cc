//! Studies of the drive. They share the closed loop of [`runner`] and the colors of [`ink`].
//!
//! - [`reproduce`]: the paper's experiments with packed FMUs.
//! - [`compare`]: the estimators side by side.
//! - [`atlas`]: the effect of wrong estimates of resistance and magnet flux at low speed.
//! - [`plane`]: torque and losses over speed, drawn for the documentation.

#![forbid(unsafe_code)]
// The papers' symbols keep their case: J, T_s.
#![allow(non_snake_case)]

pub mod atlas;
pub mod compare;
pub mod expected;
pub mod ink;
mod output;
pub mod plane;
pub mod reproduce;
pub mod runner;
