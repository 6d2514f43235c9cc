//! `fmu modelica`: a Modelica package around an FMU.

use crate::modelica::{self, Wrapping};
use anyhow::{Context, Result, bail};
use clap::Args;
use fmu_pack::archive;
use std::path::PathBuf;

/// Writes a Modelica package around a drive's FMU: a flange, ports for DC link and heat, a dialog.
///
/// Modelica tools import an FMU as a block of signals, without units and with a missing equation for each unconnected input.
/// The package wraps that block in a drive with a Flange_a, in two forms. In ImposedShaft the rotor's inertia is in Modelica,
/// which suits every drive train; in CompliantShaft the rotor turns in the FMU, behind a spring. Inputs keep their start values
/// until a switch in the dialog replaces one by a connector, pins or a heat port. Parameters have units, limits, tabs and
/// groups; --motor adds machines with the values of `fmu tune`, to choose in the dialog.
///
/// DIR receives the package, a copy of the FMU, and import.mos: `omc import.mos`, in DIR, imports the FMU into OpenModelica,
/// runs an example and prints figures, and its head lists the expected ones. docs/modelica.md has the details, also for
/// Modelica-FMI.
///
///   fmu modelica target/fmu/fmi2/PmsmDrive.fmu --out drive
/// With machines, and for the block of another import:
///   fmu modelica target/fmu/fmi2/PmsmDrive.fmu --motor motors/servo-6.6kw.toml --motor motors/traction-60kw.toml --out drive
///   fmu modelica target/fmu/fmi3/PmsmDrive.fmu --block FMUs.PmsmDrive --out drive
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Modelica {
    /// FMU with a shaft: PmsmDrive, PmsmDriveMean, MappedDrive, PmsmPlant or a preset of one
    #[arg(value_name = "FILE.fmu")]
    pub file: PathBuf,
    /// Name of the package [default: the FMU's, with Lib]
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// Class of the imported block [default: as in OpenModelica's importFMU, for example PmsmDrive_me_FMU]
    #[arg(long, value_name = "CLASS")]
    pub block: Option<String>,
    /// Motor file, as for `fmu tune` (repeatable)
    #[arg(long, value_name = "MOTOR.toml", num_args = 1..)]
    pub motor: Vec<PathBuf>,
    /// Output folder, empty or new
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

/// Runs the command; returns the package's folder and the next steps.
///
/// # Errors
/// The FMU has no shaft, a name is wrong, or the folder is not empty or cannot be written.
pub fn run(args: &Modelica) -> Result<String> {
    let options = Wrapping { name: args.name.clone(), block: args.block.clone(), motors: args.motor.clone() };
    let out = args.out.display();
    if args.out.exists() {
        let mut entries = args.out.read_dir().with_context(|| format!("--out {out}"))?;
        if entries.next().is_some() {
            bail!("--out {out}: the folder is not empty; give a new one");
        }
    }
    let (package, files) = modelica::files(&args.file, &options)?;
    for (name, bytes) in &files {
        archive::write(&args.out.join(name), bytes).with_context(|| format!("--out {out}"))?;
    }
    let next = if files.contains_key("import.mos") {
        format!("omc import.mos in {out} imports the FMU and runs an example\n")
    } else {
        String::new()
    };
    Ok(format!("{}\n{next}", args.out.join(package).display()))
}
