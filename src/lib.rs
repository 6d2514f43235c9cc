//! The command line tool, as a library for its tests.

pub mod importer;
pub mod platform;
pub mod reproduce;
