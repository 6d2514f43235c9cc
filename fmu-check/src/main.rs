//! The command `fmu-check`: the checker as a separate program, with the options of `fmu check`.

#![forbid(unsafe_code)]

use clap::error::ErrorKind;
use clap::{Error, Parser, Subcommand};
use fmu_check::{command, probe};
use std::process::ExitCode;

#[derive(Debug, Parser)]
#[command(name = "fmu-check", version, subcommand_negates_reqs = true, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(flatten)]
    check: command::CheckArguments,
    #[command(subcommand)]
    probe: Option<Hidden>,
}

#[derive(Debug, Subcommand)]
enum Hidden {
    #[command(hide = true)]
    Probe(probe::ProbeArguments),
}

fn main() -> ExitCode {
    if let Some(status) = fmu_import::guard::serve() {
        return status;
    }
    let Cli { check, probe } = Cli::parse();
    let outcome = match probe {
        Some(Hidden::Probe(args)) => probe::run(&args).map(|()| ExitCode::SUCCESS),
        None => command::run(&check).map(|holds| ExitCode::from(u8::from(!holds))),
    };
    outcome.unwrap_or_else(|error| {
        let text = format!("{error}\n");
        let _ = Error::raw(ErrorKind::Io, fmu_import::printable_lines(&text)).print();
        ExitCode::from(2)
    })
}
