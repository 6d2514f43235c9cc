//! The command-line tool `fmu`, as a library so that tests can use its parts.
//!
//! - [`cli`]: the command line; [`commands`]: one module for each command; [`vendor`]: the crates that `fmu new` writes.
//! - [`workspace`], [`target`], [`compile`], [`pack`], [`documentation`], [`icons`], [`licenses`], [`mod@reference`],
//!   [`release`]: from Rust sources to `.fmu` files.
//! - [`preset`]: an FMU with other start values, from its archive; [`page`]: a page that runs an FMU in a browser.
//! - [`message`]: errors, warnings and notes on standard error.
//! - [`ssp`], [`ssv`]: write systems and parameter values; [`modelica`]: a Modelica package around an FMU.
//!
//! [`fmu_import`] runs FMUs, [`fmu_check`] checks them, [`drive_tools`] tunes and identifies drives, [`drive_study`] reproduces the
//! papers and compares estimators, and [`fmu_plot`] draws.

#![forbid(unsafe_code)]

pub mod cli;
pub mod commands;
pub mod compile;
pub mod documentation;
pub mod icons;
pub mod licenses;
pub mod message;
pub mod modelica;
pub mod pack;
pub mod page;
pub mod picture;
pub mod preset;
pub mod reference;
pub mod release;
pub mod ssp;
pub mod ssv;
pub mod target;
pub mod vendor;
pub mod workspace;

/// The name of the tool in `generationTool`.
pub const TOOL: &str = concat!("fmu ", env!("CARGO_PKG_VERSION"));

/// The work failed although the command and its files were valid: exit status 1 instead of 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failed(pub String);

/// Exit status of an error: 1 if a simulation or a compiler failed, 2 for wrong usage and unusable files.
pub fn exit_status(error: &anyhow::Error) -> u8 {
    let failed = |cause: &(dyn std::error::Error + 'static)| {
        let of_system = || cause.downcast_ref::<fmu_system::ssp::Error>().and_then(fmu_system::ssp::Error::of_fmu);
        let of_fmu = cause.downcast_ref::<fmu_import::Error>().or_else(of_system);
        cause.is::<Failed>() || of_fmu.is_some_and(fmu_import::Error::is_of_the_run)
    };
    if error.chain().any(failed) { 1 } else { 2 }
}
