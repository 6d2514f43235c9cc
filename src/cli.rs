//! The command line: one variant for each command.

use crate::commands::{
    atlas, bode, build, compare, datasheet, identify, map, merge, modelica, page, preset, prove, reproduce, simulink,
    ssp, sweep, tune,
};
use cargo_fmu::message;
use cargo_fmu::{info, model, new, simulate, worker};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use fmu_check::{command as check, probe};
use fmu_import::printable_lines;
use std::process::ExitCode;

/// Builds, runs and checks FMUs of sensorless permanent-magnet motor drives.
///
/// Exit status: 0 on success, 1 if a simulation, a compiler or a check fails, 2 for wrong usage or an unusable file.
#[derive(Debug, Parser)]
#[command(name = "fmu", version, styles = message::HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    New(new::New),
    Build(build::Build),
    Merge(merge::Merge),
    Info(info::Info),
    Simulate(simulate::Simulate),
    Sweep(sweep::Sweep),
    Bode(bode::Bode),
    Check(check::CheckArguments),
    Reproduce(reproduce::Reproduce),
    Compare(compare::Compare),
    Atlas(atlas::Atlas),
    Tune(tune::Tune),
    Identify(identify::Identify),
    Map(map::Map),
    Datasheet(datasheet::Datasheet),
    Ssp(ssp::Ssp),
    Modelica(modelica::Modelica),
    Simulink(simulink::Simulink),
    Preset(preset::Preset),
    Page(page::Page),
    Prove(prove::Prove),
    /// Writes a shell's completion script for this command
    ///
    /// For bash and for PowerShell:
    ///
    ///   fmu completions bash > ~/.local/share/bash-completion/completions/fmu
    ///   fmu completions powershell >> $PROFILE
    #[command(verbatim_doc_comment)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    #[command(hide = true)]
    Probe(probe::ProbeArguments),
    #[command(hide = true)]
    SweepWorker,
    #[command(hide = true)]
    Model(model::ModelWork),
}

/// The command line. `-h` shows the first example of `--help`.
pub fn line() -> clap::Command {
    // The help of `build` is that of the models.
    let models = build::Models::augment_args(clap::Command::new("build"));
    let [about, long] = [models.get_about(), models.get_long_about()].map(|text| text.cloned().unwrap_or_default());
    let line = Cli::command().mut_subcommand("build", |command| command.about(about).long_about(long));
    line.mut_subcommands(|command| {
        let example = command.get_long_about().and_then(|text| first_example(&text.to_string(), command.get_name()));
        example.into_iter().fold(command, |command, text| command.after_help(text).after_long_help(""))
    })
}

/// The first line of a help that starts with two spaces and the command, with the lines that a backslash appends.
fn first_example(help: &str, name: &str) -> Option<String> {
    let start = help.find(&format!("\n  fmu {name}"))? + 1;
    let is_continued = |line: &&str| line.ends_with('\\');
    let lines = help[start..].lines().take_while(is_continued).count() + 1;
    Some(format!("Example:\n{}", help[start..].lines().take(lines).collect::<Vec<_>>().join("\n")))
}

/// Runs the command of this process's arguments.
pub fn main() -> ExitCode {
    if let Some(status) = fmu_import::guard::serve() {
        return status;
    }
    worker::serves();
    let command = Cli::from_arg_matches(&line().get_matches_from(cargo_fmu::arguments()))
        .unwrap_or_else(|error| error.exit())
        .command;
    // The process that started a worker prints its error.
    let is_worker = match &command {
        Command::Simulate(args) => args.process.worker,
        Command::Bode(args) => args.process.worker,
        Command::Model(args) => args.process.worker,
        _ => false,
    };
    let outcome = match command {
        Command::New(args) => new::run(&args).map(|text| {
            print!("{text}");
            ExitCode::SUCCESS
        }),
        Command::Build(args) => build::run(&args).map(|files| {
            for file in files {
                println!("{}", file.display());
            }
            ExitCode::SUCCESS
        }),
        Command::Info(args) => info::run(&args).map(|text| {
            print!("{text}");
            ExitCode::SUCCESS
        }),
        Command::Completions { shell } => {
            clap_complete::generate(shell, &mut line(), "fmu", &mut std::io::stdout());
            Ok(ExitCode::SUCCESS)
        }
        Command::Merge(args) => merge::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Model(args) => model::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Simulate(args) => simulate::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Sweep(args) => sweep::run(&args).map(|good| ExitCode::from(u8::from(!good))),
        Command::SweepWorker => fmu_sweep::isolate::serve().map(|()| ExitCode::SUCCESS).map_err(Into::into),
        Command::Check(args) => check::run(&args).map(|holds| ExitCode::from(u8::from(!holds))).map_err(Into::into),
        Command::Probe(args) => probe::run(&args).map(|()| ExitCode::SUCCESS).map_err(Into::into),
        Command::Reproduce(args) => reproduce::run(&args).map(|holds| ExitCode::from(u8::from(!holds))),
        Command::Bode(args) => bode::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Atlas(args) => atlas::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Datasheet(args) => datasheet::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Map(args) => map::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Tune(args) => tune::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Identify(args) => identify::run(&args).map(|whole| ExitCode::from(u8::from(!whole))),
        Command::Preset(args) => preset::run(&args).map(|text| {
            print!("{text}");
            ExitCode::SUCCESS
        }),
        Command::Modelica(args) => modelica::run(&args).map(|text| {
            print!("{text}");
            ExitCode::SUCCESS
        }),
        Command::Simulink(args) => simulink::run(&args).map(|text| {
            print!("{text}");
            ExitCode::SUCCESS
        }),
        Command::Page(args) => page::run(&args).map(|files| {
            for file in files {
                println!("{}", file.display());
            }
            ExitCode::SUCCESS
        }),
        Command::Prove(args) => prove::run(&args).map(|(folders, good)| {
            for folder in &folders {
                println!("{}", folder.display());
            }
            ExitCode::from(u8::from(!good))
        }),
        Command::Ssp(args) => ssp::run(&args).map(|()| ExitCode::SUCCESS),
        Command::Compare(args) => compare::run(&args).map(|holds| ExitCode::from(u8::from(!holds))),
    };
    outcome.unwrap_or_else(|error| {
        if !is_worker {
            message::error(&printable_lines(&format!("{error:#}")));
        }
        ExitCode::from(cargo_fmu::exit_status(&error))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::error::ErrorKind;

    #[test]
    fn several_packages_are_built_at_once() {
        let arguments = ["fmu", "build", "--package", "own-fmu", "--package", "my-fmu"];
        let Command::Build(args) = Cli::try_parse_from(arguments).unwrap().command else { panic!("another command") };
        assert_eq!(args.models.package, ["own-fmu", "my-fmu"]);
    }

    /// An example is a line of the long help that starts with two spaces and the command; `\\` continues it.
    #[test]
    fn the_help_of_every_command_has_an_example_that_parses() {
        let mut whole = line();
        whole.build();
        let commands: Vec<_> = whole.get_subcommands().filter(|c| !c.is_hide_set() && c.get_name() != "help").collect();
        assert!(commands.len() > 10);
        for command in commands {
            let (name, help) = (command.get_name(), command.clone().render_long_help().to_string());
            let help = help.replace("\\\n", " ");
            let start = format!("  fmu {name} ");
            let own = |line: &&str| format!("{line} ").starts_with(&start);
            assert!(help.lines().any(|line| own(&line)), "fmu {name} --help has no example: {help}");
            let short = command.clone().render_help().to_string();
            assert!(short.lines().any(|line| own(&line)), "fmu {name} -h has no example: {short}");
            for line in help.lines().filter(|line| line.trim_start().starts_with("fmu ")) {
                let words: Vec<&str> = line.split_whitespace().take_while(|w| !["#", ">", ">>"].contains(w)).collect();
                let parsed = Cli::try_parse_from(&words);
                let kind = parsed.as_ref().err().map(clap::Error::kind);
                assert!(
                    kind.is_none() || kind == Some(ErrorKind::DisplayHelp),
                    "fmu {name} --help: {line}: {parsed:?}"
                );
            }
        }
    }
}
