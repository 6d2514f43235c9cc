//! The commands of the command line.

pub mod build;
pub mod check;
pub mod reproduce;
pub mod simulate;
