//! Tools for a user's machine.
//!
//! - [`tune`]: parameter values for a machine, from its motor file.
//! - [`map`]: efficiency over speed and torque.
//! - [`datasheet`]: the tables of a drive from its data sheet.
//! - [`identify`]: a machine's data from a record.

#![forbid(unsafe_code)]
// The papers' symbols keep their case: J, T_s.
#![allow(non_snake_case)]

pub mod csv;
pub mod datasheet;
pub mod error;
pub mod identify;
pub mod map;
mod plausible;
pub mod queue;
pub mod text_table;
pub mod tune;
