//! The commands that the author of a model needs: the command `cargo fmu`, and the part of the command `fmu` that is the same.
//!
//! - [`new`]: a project for a new FMU; [`vendor`]: the crates that it carries.
//! - [`build`]: compiles models and packs them; [`model`]: runs the model during a build, in a separate process.
//! - [`info`], [`simulate`]: describe and run an FMU; [`system`] and [`worker`]: their options for FMUs, connections, and the process of the FMUs.
//! - [`message`]: errors, warnings and notes on standard error.
//!
//! The feature `full` adds what the command `fmu` has: colors, a progress bar, icons in archives, and plots as PNG.

#![forbid(unsafe_code)]

pub mod build;
pub mod info;
pub mod message;
pub mod model;
pub mod new;
pub mod simulate;
pub mod system;
pub mod vendor;
pub mod worker;

use std::ffi::OsString;

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
pub fn arguments() -> impl Iterator<Item = OsString> {
    let is_second = |(place, argument): &(usize, OsString)| *place == 1 && argument == "fmu";
    std::env::args_os().enumerate().filter(move |a| !is_second(a)).map(|(_, argument)| argument)
}

/// The command as the user types it.
pub fn command() -> &'static str {
    if std::env::args_os().nth(1).is_some_and(|first| first == "fmu") { "cargo fmu" } else { "fmu" }
}
