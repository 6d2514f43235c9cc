//! The command line tool `fmu`, as a library so that tests can use its parts.
//!
//! - [`commands`]: what the command line does, one module a command.
//! - [`workspace`], [`target`], [`compile`], [`pack`], [`documentation`], [`icons`], [`licences`]: from Rust sources to `.fmu`
//!   files.
//! - [`importer`]: runs any co-simulation FMU; the only place with `unsafe` code.
//! - [`check`]: whether an FMU keeps to its standard.
//! - [`cosimulation`]: several FMUs connected; [`ssp`]: systems of FMUs as files; [`plot`]: what they did, as a picture.
//! - [`reproduce`]: the paper's experiments; [`compare`]: the estimators side by side, natively; [`tune`]: values for a machine.

pub mod check;
pub mod commands;
pub mod compare;
pub mod compile;
pub mod cosimulation;
pub mod documentation;
pub mod elf;
pub mod icons;
pub mod importer;
pub mod licences;
pub mod pack;
pub mod platform;
pub mod plot;
pub mod reproduce;
pub mod ssp;
pub mod target;
pub mod tune;
pub mod workspace;

/// The work itself failed, although the command and its files were good: exit status 1 instead of 2.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Failed(pub String);

/// The exit status that an error means: 1 when a simulation or a compiler failed, 2 for bad usage and bad files.
pub fn exit_status(error: &anyhow::Error) -> u8 {
    let failed = |cause: &(dyn std::error::Error + 'static)| {
        cause.is::<Failed>() || cause.downcast_ref::<importer::Error>().is_some_and(importer::Error::is_of_the_run)
    };
    if error.chain().any(failed) { 1 } else { 2 }
}
