//! The command `cargo fmu`: what the author of a model needs. Every other command is passed to the command `fmu`, if it is installed.

#![forbid(unsafe_code)]

use anyhow::{Result, anyhow};
use cargo_fmu::{arguments, build, exit_status, info, message, model, new, simulate, worker};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use fmu_import::printable_lines;
use std::ffi::OsString;
use std::io::ErrorKind;
use std::process::ExitCode;

/// Creates, builds and runs FMUs of Rust models.
///
/// Every other command (check, sweep, bode, tune, ...) is passed to the program `fmu`, if it is in PATH.
///
/// Exit status: 0 on success, 1 if a simulation or a compiler fails, 2 for wrong usage or an unusable file.
#[derive(Debug, Parser)]
#[command(name = "cargo fmu", bin_name = "cargo fmu", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    New(new::New),
    Build(build::Models),
    Info(info::Info),
    Simulate(Box<simulate::Simulate>),
    #[command(hide = true)]
    Model(model::ModelWork),
    #[command(external_subcommand)]
    Other(Vec<OsString>),
}

fn main() -> ExitCode {
    if let Some(status) = fmu_import::guard::serve() {
        return status;
    }
    worker::serves();
    // The help of a command names the program `fmu`.
    let line = Cli::command().mut_subcommands(|command| {
        let help = command.get_long_about().map(|text| text.to_string().replace("\n  fmu ", "\n  cargo fmu "));
        help.into_iter().fold(command, clap::Command::long_about)
    });
    let command =
        Cli::from_arg_matches(&line.get_matches_from(arguments())).unwrap_or_else(|error| error.exit()).command;
    let is_worker = match &command {
        Command::Simulate(args) => args.process.worker,
        Command::Model(args) => args.process.worker,
        _ => false,
    };
    let outcome = match command {
        Command::New(args) => new::run(&args).map(|text| print!("{text}")),
        Command::Build(args) => build::run(&args, |_| Ok(None)).map(|files| {
            for file in files {
                println!("{}", file.display());
            }
        }),
        Command::Info(args) => info::run(&args).map(|text| print!("{text}")),
        Command::Simulate(args) => simulate::run(&args),
        Command::Model(args) => model::run(&args),
        Command::Other(arguments) => match other(&arguments) {
            Ok(status) => return status,
            Err(error) => Err(error),
        },
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // The process that started a worker prints its error.
            if !is_worker {
                message::error(&printable_lines(&format!("{error:#}")));
            }
            ExitCode::from(exit_status(&error))
        }
    }
}

/// Runs `fmu` with these arguments; returns its exit status.
fn other(arguments: &[OsString]) -> Result<ExitCode> {
    let name = arguments[0].to_string_lossy();
    match std::process::Command::new("fmu").args(arguments).status() {
        Ok(status) => Ok(ExitCode::from(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1))),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(anyhow!(
            "{name}: is not a command of cargo fmu, which has new, build, info and simulate; \
             the program fmu has more: cargo install --locked fmu, or cargo install --path . in its repository"
        )),
        Err(error) => Err(anyhow!("fmu {name}: {error}")),
    }
}
