//! Studies of the drive: [`reproduce`], the paper's experiments with packed FMUs; [`compare`], the estimators side by
//! side; [`atlas`], what wrong estimates lose at low speed; [`tune`], parameter values for a machine; [`runner`], the closed loop that they share; [`plane`], torque over speed.
//!
//! [`figure`]: what a plot shows; [`plot`] draws it as SVG, [`page`] as a page with zoom; [`ink`]: the colors of both.

#![forbid(unsafe_code)]
// The papers' symbols keep their case: J, T_s.
#![allow(non_snake_case)]

pub mod atlas;
pub mod compare;
pub mod figure;
pub mod ink;
pub mod overview;
pub mod page;
pub mod plane;
pub mod plot;
pub mod reproduce;
pub mod runner;
pub mod tune;
