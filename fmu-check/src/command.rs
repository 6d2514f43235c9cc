//! The command `fmu check`: checks whether an FMU conforms to its standard.

use crate::{self as check, Options, report};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use fmu_import::{guard, printable_lines};
use std::path::PathBuf;
use std::time::Duration;

/// Checks a co-simulation FMU of FMI 2.0 or FMI 3.0, made by any tool: archive, description, and what its binary does.
///
/// Every check has an id, a clause of the standard, and a level: must (the standard requires it), should (the standard
/// recommends it) or hard (the standard leaves it open, but a robust FMU does it). Each probe of the binary runs in its own
/// process, with limits, so a crash or a hang is a finding. The code of the FMU runs on this computer with your rights: check
/// only FMUs that you would run. --sandbox takes the network away from it.
///
/// Exit status: 0 if no must is violated, 1 if one is, 2 if the file is not an FMU. With --strict, a violated should or hard
/// and a check that is not determined count like a must.
///
///   fmu check target/fmu/fmi3/PmsmPlant.fmu
///   fmu check other.fmu --format html > report.html
///   fmu check other.fmu --only lifecycle,X01b
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
#[expect(clippy::struct_excessive_bools, reason = "options of a command")]
pub struct Check {
    /// FMU to check
    #[arg(value_name = "FILE.fmu", required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Run only these checks: ids or group names
    #[arg(long, value_name = "ID,GROUP", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Also show checks that passed and checks that do not apply
    #[arg(long, short)]
    pub verbose: bool,
    /// Time limit for one probe of the binary, in seconds [default: 10]
    #[arg(long, alias = "patience", value_name = "S")]
    pub timeout: Option<f64>,
    /// Address space of one probe, in GiB; 0 for no limit
    #[arg(long, value_name = "GIB", default_value_t = guard::Allowance::default().memory >> 30, value_parser = clap::value_parser!(u64).range(..=1 << 20))]
    pub memory: u64,
    /// Run the probes without network (Linux with user namespaces; refused elsewhere)
    #[arg(long)]
    pub sandbox: bool,
    /// Exit with status 1 unless every applicable check passes
    #[arg(long)]
    pub strict: bool,
    /// List all checks and exit
    #[arg(long)]
    pub list: bool,
}

/// Output formats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text for a terminal.
    #[default]
    Text,
    /// JSON for a program.
    Json,
    /// One HTML page for a browser.
    Html,
}

/// Runs the command. Returns whether no must is violated, or with `strict` whether every applicable check passes.
///
/// # Errors
/// The file is not an FMU, or an id does not exist.
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
        bail!("--only {name}: is neither a check (--list shows them) nor a group: {}", groups.join(", "));
    }
    let Some(file) = &args.file else { bail!("no file is given") };
    let timeout = match args.timeout {
        Some(s) => Some(Duration::try_from_secs_f64(s).map_err(|e| anyhow::anyhow!("--timeout {s}: {e}"))?),
        None => None,
    };
    let allowance = guard::Allowance { memory: args.memory << 30, sandbox: args.sandbox, ..Default::default() };
    let options = Options { only: args.only.clone(), timeout, program: None, allowance };
    let report = check::run(file, &options)?;
    match args.format {
        Format::Text => print!("{}", printable_lines(&report.text(args.verbose))),
        Format::Json => println!("{}", report.json()?),
        Format::Html => print!("{}", report.html()),
    }
    Ok(if args.strict { report.is_clean() } else { report.conforms() })
}
