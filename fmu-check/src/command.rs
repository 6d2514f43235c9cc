//! `fmu check`: whether an FMU keeps to its standard.

use crate::{self as check, Options, report};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// Checks a co-simulation FMU of FMI 2.0 or FMI 3.0, made by any tool: archive, description, and what its binary does.
///
/// Every check has an id, a clause of the standard, and a level: must (the standard demands it), should (it recommends it)
/// and hard (it leaves it open, and a robust FMU does it). Each probe of the binary runs in a process of its own, so a
/// crash or a hang is a finding. The FMU's code runs on this machine with your rights: check only what you would run.
///
/// Exit status: 0 when no must is violated, 1 when one is, 2 when the file is no FMU at all. With --strict, a violated
/// should or hard, and a check that is not determined, count like a must.
///
///   fmu check target/fmu/fmi3/PmsmPlant.fmu
///   fmu check other.fmu --format html > report.html
///   fmu check other.fmu --only lifecycle,X01b
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Check {
    /// The file
    #[arg(value_name = "FILE.fmu", required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Some checks only: ids, or names of groups
    #[arg(long, value_name = "ID,GROUP", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Tell the checks that passed and those that do not apply, too
    #[arg(long, short)]
    pub verbose: bool,
    /// Seconds that one probe of the binary may take [default: 10]
    #[arg(long, value_name = "S")]
    pub patience: Option<f64>,
    /// Exit status 1 unless everything that applies passes
    #[arg(long)]
    pub strict: bool,
    /// List all checks and end
    #[arg(long)]
    pub list: bool,
}

/// Forms of the result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For a terminal.
    #[default]
    Text,
    /// For a program.
    Json,
    /// For a browser.
    Html,
}

/// Runs the command; whether no must is violated, or with `strict` whether everything that applies passes.
///
/// # Errors
/// The file is no FMU, or an id does not exist.
pub fn run(args: &Check) -> Result<bool> {
    if args.list {
        print!("{}", report::list());
        return Ok(true);
    }
    let known = |name: &String| {
        check::GROUPS
            .iter()
            .any(|g| g.name.eq_ignore_ascii_case(name) || g.checks.iter().any(|c| c.id.eq_ignore_ascii_case(name)))
    };
    if let Some(name) = args.only.iter().find(|name| !known(name)) {
        let groups: Vec<_> = check::GROUPS.iter().map(|g| g.name).collect();
        bail!("--only {name}: is no check (--list tells them) and no group: {}", groups.join(", "));
    }
    let Some(file) = &args.file else { bail!("no file is given") };
    let patience = match args.patience {
        Some(s) => Some(Duration::try_from_secs_f64(s).map_err(|e| anyhow::anyhow!("--patience {s}: {e}"))?),
        None => None,
    };
    let options = Options { only: args.only.clone(), patience, program: None };
    let report = check::run(file, &options)?;
    match args.format {
        Format::Text => print!("{}", report.text(args.verbose)),
        Format::Json => println!("{}", report.json()?),
        Format::Html => print!("{}", report.html()),
    }
    Ok(if args.strict { report.is_clean() } else { report.conforms() })
}
