//! The command line tool `fmu`, as a library so that tests can use its parts.
//!
//! - [`commands`]: what the command line does, one module a command.
//! - [`workspace`], [`target`], [`compile`], [`pack`], [`documentation`], [`icons`], [`licences`]: from Rust sources to `.fmu`
//!   files.
//! - [`ssp`], [`ssv`]: systems and parameter values, written.
//!
//! FMUs are run by [`fmu_import`] and checked by [`fmu_check`]; [`drive_study`] has what is done with the drive.

#![forbid(unsafe_code)]

pub mod commands;
pub mod compile;
pub mod documentation;
pub mod icons;
pub mod licences;
pub mod pack;
pub mod ssp;
pub mod ssv;
pub mod target;
pub mod workspace;

/// The work itself failed, although the command and its files were good: exit status 1 instead of 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failed(pub String);

/// The exit status that an error means: 1 when a simulation or a compiler failed, 2 for bad usage and bad files.
pub fn exit_status(error: &anyhow::Error) -> u8 {
    let failed = |cause: &(dyn std::error::Error + 'static)| {
        cause.is::<Failed>() || cause.downcast_ref::<fmu_import::Error>().is_some_and(fmu_import::Error::is_of_the_run)
    };
    if error.chain().any(failed) { 1 } else { 2 }
}
