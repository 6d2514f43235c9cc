//! The command `fmu tune`: parameter values of the FMUs for a motor.

use crate::workspace::Workspace;
use crate::{pack, ssv};
use anyhow::Result;
use clap::Args;
use drive_study::tune::rules::{Setting, Value};
use drive_study::tune::{self, rules::Tuned};
use std::path::{Path, PathBuf};

/// Computes parameter values of PmsmPlant and SensorlessController from motor data and bandwidths.
///
/// MOTOR.toml contains motor, mechanics, ratings, DC link and the bandwidths of current loop, speed loop and observer; see the
/// examples in motors/. The command writes NAME.PmsmPlant.ssv and NAME.SensorlessController.ssv (SSP 1.0) with the values that
/// differ from the start values of the FMUs, for importers:
///
///   fmu tune motors/ipmsm-2.2kw.toml --out target/tune
///   fmu simulate target/fmu/fmi3/PmsmPlant.fmu target/fmu/fmi3/SensorlessController.fmu --auto-connect \
///     --parameters PmsmPlant=target/tune/ipmsm-2.2kw.PmsmPlant.ssv \
///     --parameters SensorlessController=target/tune/ipmsm-2.2kw.SensorlessController.ssv \
///     --input SensorlessController.speed_ref=0:0,0.5:78.5 --stop 3 --plot run.svg
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Tune {
    /// Motor file
    #[arg(value_name = "MOTOR.toml")]
    pub motor: PathBuf,
    /// Output folder [default: tune in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write enumerations as integers, for importers that cannot read names (OMSimulator)
    #[arg(long)]
    pub integers: bool,
}

/// Runs the command.
///
/// # Errors
/// The motor file is invalid, or a file cannot be written.
pub fn run(args: &Tune) -> Result<()> {
    let tuned = tune::tune(&args.motor)?;
    let out = args.out.clone().map_or_else(|| Workspace::find().map(|w| w.target.join("tune")), Ok)?;
    let files = write(&tuned, &out, args.integers)?;
    println!("{}\n{}", tuned.name, tuned.source);
    for (model, settings) in [("PmsmPlant", &tuned.plant), ("SensorlessController", &tuned.controller)] {
        println!("\n{model}");
        for Setting { name, value, rule, .. } in settings {
            println!("  {name:26}{:>14}  {rule}", shown(value));
        }
    }
    for note in &tuned.notes {
        println!("\nnote: {note}");
    }
    println!();
    for file in &files {
        println!("{}", file.display());
    }
    Ok(())
}

/// Writes `NAME.PmsmPlant.ssv` and `NAME.SensorlessController.ssv` to a folder, each with what [`tune::needed`] leaves; returns
/// their paths.
fn write(tuned: &Tuned, folder: &Path, integers: bool) -> Result<[PathBuf; 2]> {
    let write = |model: &str, settings: &[Setting]| {
        let path = folder.join(format!("{}.{model}.ssv", tuned.name));
        pack::write(&path, ssv::text(&format!("{} {model}", tuned.name), settings).as_bytes())?;
        anyhow::Ok(path)
    };
    let (plant, controller) = tune::needed(tuned, integers)?;
    Ok([write("PmsmPlant", &plant)?, write("SensorlessController", &controller)?])
}

fn shown(value: &Value) -> String {
    match value {
        // Six digits are enough to read; the file has them all.
        Value::Real(x) => format!("{}", format!("{x:.5e}").parse::<f64>().unwrap_or(*x)),
        Value::Integer(i) => i.to_string(),
        Value::Boolean(b) => b.to_string(),
        Value::Item(item) => item.clone(),
    }
}
