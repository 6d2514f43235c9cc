//! `fmu compare`: every estimator through every scenario, on the machines of the review or on the user's.

use super::bar_of_cells;
use anyhow::{Result, anyhow};
use clap::Args;
use drive::estimator::Kind;
use drive_study::compare::candidate::Entry;
use drive_study::compare::scenario::{self, Effort, SCENARIOS, Scenario};
use drive_study::compare::trials::TRIALS;
use drive_study::compare::{self, Run, Selection, table};
use drive_tools::tune::motor::{MotorFile, estimators};
use fmu_pack::workspace::output_folder;
use std::path::{Path, PathBuf};

/// Runs every estimator through start-up, load steps, wrong parameters and more, and compares the figures.
///
/// Runs natively on all cores. Writes compare.html, compare.md, compare.txt, compare.csv and plots to `compare` in Cargo's
/// target folder. Exits with status 1 if a figure is outside its tolerance.
///
/// With MOTOR.toml, the estimators run on that machine, each with the values of `fmu tune`: start, load step, reversal, top speed,
/// the lowest speed under rated load with wrong parameters, dead time, noise and offset, and the cost of an injection. A method that
/// the machine does not suit is listed with the reason.
///
///   fmu compare --out target/compare
///   fmu compare motors/servo-48v.toml --only Rasmussen,ExtendedEmf
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Compare {
    /// Motor file, as for `fmu tune` [default: the machines of the review]
    #[arg(value_name = "MOTOR.toml")]
    pub motor: Option<PathBuf>,
    /// Run only these estimators
    #[arg(long, visible_alias = "estimator", value_name = "ESTIMATOR,...", value_delimiter = ',')]
    pub only: Vec<String>,
    /// Run only these scenarios
    #[arg(long, value_name = "SCENARIO,...", value_delimiter = ',')]
    pub scenario: Vec<String>,
    /// List estimators and scenarios and exit
    #[arg(long, exclusive = true)]
    pub list: bool,
    /// Output folder [default: compare in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// The comparison on the user's machine.
fn on_machine(args: &Compare, path: &Path) -> Result<bool> {
    let motor = MotorFile::read(path)?;
    let kind = |name: &String| {
        let known = Kind::ALL.iter().copied().find(|kind| kind.name().eq_ignore_ascii_case(name));
        known.ok_or_else(|| anyhow!("--only {name}: unknown estimator; available: {}", estimators()))
    };
    let kinds: Vec<Kind> = args.only.iter().map(kind).collect::<Result<_>>()?;
    let kinds = if kinds.is_empty() { Kind::ALL.to_vec() } else { kinds };
    let trial = |id: &String| {
        let known = || names(TRIALS.iter().map(|s| s.id));
        let found = TRIALS.iter().find(|s| s.id == id);
        found.ok_or_else(|| anyhow!("--scenario {id}: unknown scenario on a machine; available: {}", known()))
    };
    let trials: Vec<&Scenario> = args.scenario.iter().map(trial).collect::<Result<_>>()?;
    let trials = if trials.is_empty() { TRIALS.iter().collect() } else { trials };
    let out = args.out.clone().map_or_else(|| output_folder("compare"), Ok)?;

    let bar = bar_of_cells(kinds.len() * trials.len());
    let compared = compare::on_machine(&motor, &kinds, &trials, Effort::Full, || bar.inc(1))?;
    bar.finish_and_clear();

    compare::write_machine(&compared, &out)?;
    println!("{}", compare::machine_text(&compared));
    println!("{}", out.join("compare.html").display());
    Ok(true)
}

/// Runs the command; returns whether every figure is within its tolerance.
///
/// # Errors
/// A name is unknown, or a file cannot be written.
pub fn run(args: &Compare) -> Result<bool> {
    if args.list {
        println!("estimators: {}", names(Entry::all().iter().map(|e| e.name)));
        for s in SCENARIOS {
            println!("{:18}{}: {}", s.id, s.group, s.title);
        }
        println!("with MOTOR.toml:");
        for s in TRIALS {
            println!("{:18}{}: {}", s.id, s.group, s.title);
        }
        return Ok(true);
    }
    if let Some(path) = &args.motor {
        return on_machine(args, path);
    }
    let selection = selection(args)?;
    let out = args.out.clone().map_or_else(|| output_folder("compare"), Ok)?;

    let bar = bar_of_cells(selection.entries.len() * selection.scenarios.len());
    let cells = compare::run(&selection, || bar.inc(1));
    bar.finish_and_clear();

    compare::write(&cells, &out)?;
    println!("{}", table::text(&cells));
    println!("{}", out.join("compare.html").display());
    Ok(cells.iter().all(Run::holds))
}

fn names<'a>(all: impl Iterator<Item = &'a str>) -> String {
    all.collect::<Vec<_>>().join(", ")
}

fn selection(args: &Compare) -> Result<Selection> {
    let mut selection = Selection::all(Effort::Full);
    let estimator = |name: &String| {
        let known = || names(Entry::all().iter().map(|e| e.name));
        Entry::find(name).ok_or_else(|| anyhow!("--only {name}: unknown estimator; available: {}", known()))
    };
    let scenario = |id: &String| {
        let known = || names(SCENARIOS.iter().map(|s| s.id));
        scenario::find(id).ok_or_else(|| anyhow!("--scenario {id}: unknown scenario; available: {}", known()))
    };
    if !args.only.is_empty() {
        selection.entries = args.only.iter().map(estimator).collect::<Result<_>>()?;
    }
    if !args.scenario.is_empty() {
        selection.scenarios = args.scenario.iter().map(scenario).collect::<Result<_>>()?;
    }
    Ok(selection)
}
