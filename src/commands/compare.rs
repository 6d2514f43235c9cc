//! `fmu compare`: every estimator through every scenario.

use super::bar_of_cells;
use anyhow::{Result, anyhow};
use clap::Args;
use drive_study::compare::candidate::Entry;
use drive_study::compare::scenario::{self, Effort, SCENARIOS};
use drive_study::compare::{self, Run, Selection, table};
use fmu_pack::workspace::output_folder;
use std::path::PathBuf;

/// Runs every estimator through start-up, load steps, wrong parameters and more, and compares the figures.
///
/// Runs natively on all cores. Writes compare.html, compare.md, compare.txt, compare.csv and plots to `compare` in Cargo's
/// target folder. Exits with status 1 if a figure is outside its tolerance.
///
///   fmu compare --out target/compare
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Compare {
    /// Run only these estimators
    #[arg(long, value_name = "ESTIMATOR,...", value_delimiter = ',')]
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
        return Ok(true);
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
