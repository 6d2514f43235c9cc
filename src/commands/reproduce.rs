//! `fmu reproduce`: the paper's experiments through the packed FMUs.

use super::build::{self, Models};
use anyhow::Result;
use clap::Args;
use fmu_pack::workspace::Workspace;
use std::path::PathBuf;

/// Builds the FMUs, runs the paper's experiments through them in both standards and compares the figures.
///
/// Writes CSV, plots and report.html to `reproduce` in Cargo's target folder. Exits with status 1 if a figure
/// is outside its tolerance.
///
///   fmu reproduce
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Reproduce {
    /// Output folder [default: reproduce in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Runs the command; returns whether every figure is within its tolerance.
///
/// # Errors
/// The FMUs cannot be built or run, or a file cannot be written.
pub fn run(args: &Reproduce) -> Result<bool> {
    let target = Workspace::find()?.target;
    let fmus = target.join("fmu");
    build::models(&Models { out: Some(fmus.clone()), ..Models::default() })?;
    let out = args.out.clone().unwrap_or_else(|| target.join("reproduce"));
    let (table, holds) = drive_study::reproduce::run(&fmus, &out)?;
    println!("{table}");
    println!("{}", out.join("report.html").display());
    Ok(holds)
}
