//! `fmu simulink`: a MATLAB script that builds a Simulink model around an FMU.

use crate::simulink;
use anyhow::{Context, Result, bail};
use cargo_fmu::message;
use clap::Args;
use fmu_pack::archive;
use std::path::PathBuf;

/// Writes a MATLAB script that builds a masked Simulink block around an FMU.
///
/// DIR receives a copy of the FMU, NAME_parameters.m, which returns its parameters as a struct with units and descriptions, and
/// build_NAME.m: a masked block around Simulink's block FMU, buses from the FMU's terminals, constants at its inputs, and a
/// solver step that divides the communication step. An FMU whose terminal takes speed and angle and gives torque gets a flange:
/// Simscape's ideal torque source and motion sensor, and the rotor's inertia.
///
/// The script is checked as text against MathWorks' documentation. It has not been run in MATLAB. docs/simulink.md lists the
/// functions and the limits.
///
///   fmu simulink target/fmu/fmi3/PmsmDrive.fmu --out drive
///   fmu simulink target/fmu/fmi2/PmsmPlant.fmu --step 0.0001 --out plant
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Simulink {
    /// FMU for Co-Simulation or Model Exchange, of FMI 2.0 or FMI 3.0
    #[arg(value_name = "FILE.fmu")]
    pub file: PathBuf,
    /// Communication step in s [default: the step of the default experiment]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Output folder, empty or new
    #[arg(long, value_name = "DIR", default_value = "simulink")]
    pub out: PathBuf,
}

/// Runs the command; returns the script's path and the next step.
///
/// # Errors
/// Simulink's block does not support the FMU, the step does not fit it, or the folder is not empty or cannot be written.
pub fn run(args: &Simulink) -> Result<String> {
    let out = args.out.display();
    if args.out.exists() {
        let mut entries = args.out.read_dir().with_context(|| format!("--out {out}"))?;
        if entries.next().is_some() {
            bail!("--out {out}: the folder is not empty; give a new one");
        }
    }
    let built = simulink::files(&args.file, args.step)?;
    for (name, bytes) in &built.files {
        archive::write(&args.out.join(name), bytes).with_context(|| format!("--out {out}"))?;
    }
    for (why, names) in &built.left {
        let shown: Vec<&str> = names.iter().take(5).map(String::as_str).collect();
        let more = if names.len() > 5 { format!(" and {} more", names.len() - 5) } else { String::new() };
        message::note(&format!("not in the struct: {why}: {}{more}", shown.join(", ")));
    }
    let function = &built.function;
    let needs = if built.flange { "Simulink and Simscape, R2025a or later" } else { "Simulink" };
    Ok(format!(
        "{}\n{function} in {out} builds the model in MATLAB with {needs}. Checked as text, not run: docs/simulink.md\n",
        args.out.join(function).with_extension("m").display()
    ))
}
