//! Studies of the drive: [`reproduce`], the paper's experiments with packed FMUs; [`compare`], the estimators side by
//! side; [`atlas`], what wrong estimates lose at low speed; [`tune`], parameter values for a machine; [`runner`], the closed loop that they share; [`plot`], curves as
//! SVG; [`plane`], torque over speed.

#![forbid(unsafe_code)]
// The papers' symbols keep their case: J, T_s.
#![allow(non_snake_case)]

pub mod atlas;
pub mod compare;
pub mod overview;
pub mod plane;
pub mod plot;
pub mod reproduce;
pub mod runner;
pub mod tune;
