//! The command-line tool `fmu`, as a library so that tests can use its parts.
//!
//! - [`cli`]: the command line; [`commands`]: one module for each command that [`cargo_fmu`] has not.
//! - [`ssp`], [`ssv`]: write systems and parameter values; [`modelica`]: a Modelica package around an FMU; [`simulink`]: a Simulink model around one.
//!
//! [`cargo_fmu`] has the commands of an author and the messages, [`fmu_pack`] builds FMUs, [`fmu_import`] runs them, [`fmu_check`] checks
//! them, [`drive_tools`] tunes and identifies drives, [`drive_study`] reproduces the papers and compares estimators, and [`fmu_plot`] draws.

#![forbid(unsafe_code)]

pub mod cli;
pub mod commands;
pub mod modelica;
pub mod simulink;
pub mod ssp;
pub mod ssv;
