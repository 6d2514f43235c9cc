//! The command-line tool `fmu`, as a library so that tests can use its parts.
//!
//! - [`cli`]: the command line; [`commands`]: one module for each command; [`vendor`]: the crates that `fmu new` writes.
//! - [`message`]: errors, warnings and notes on standard error.
//! - [`ssp`], [`ssv`]: write systems and parameter values; [`modelica`]: a Modelica package around an FMU; [`simulink`]: a Simulink model around one.
//!
//! [`fmu_pack`] builds FMUs, [`fmu_import`] runs them, [`fmu_check`] checks them, [`drive_tools`] tunes and identifies drives, [`drive_study`] reproduces the
//! papers and compares estimators, and [`fmu_plot`] draws.

#![forbid(unsafe_code)]

pub mod cli;
pub mod commands;
pub mod message;
pub mod modelica;
pub mod simulink;
pub mod ssp;
pub mod ssv;
pub mod vendor;

/// The work failed although the command and its files were valid: exit status 1 instead of 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failed(pub String);

/// Exit status of an error: 1 if a simulation or a compiler failed, 2 for wrong usage and unusable files.
pub fn exit_status(error: &anyhow::Error) -> u8 {
    let failed = |cause: &(dyn std::error::Error + 'static)| {
        let of_system = || cause.downcast_ref::<fmu_system::ssp::Error>().and_then(fmu_system::ssp::Error::of_fmu);
        let pack = cause.downcast_ref::<fmu_pack::Error>();
        let of_fmu = cause.downcast_ref().or_else(of_system).or_else(|| pack.and_then(fmu_pack::Error::of_fmu));
        cause.is::<Failed>()
            || matches!(pack, Some(fmu_pack::Error::Failed(_)))
            || of_fmu.is_some_and(fmu_import::Error::is_of_the_run)
    };
    if error.chain().any(failed) { 1 } else { 2 }
}

/// The arguments. Cargo runs `cargo-fmu fmu ...` for `cargo fmu ...`.
fn arguments() -> impl Iterator<Item = std::ffi::OsString> {
    let is_second = |(place, argument): &(usize, std::ffi::OsString)| *place == 1 && argument == "fmu";
    std::env::args_os().enumerate().filter(move |a| !is_second(a)).map(|(_, argument)| argument)
}
