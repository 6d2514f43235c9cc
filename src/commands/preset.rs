//! `fmu preset`: an FMU with other start values.

mod motor;

use anyhow::{Context, Result, anyhow, bail, ensure};
use cargo_fmu::message;
use clap::Args;
use drive_tools::datasheet::MappedSheet;
use drive_tools::tune::{self, setting::Tuned};
use fmu_import::printable;
use fmu_import::written::assignment;
use fmu_pack::preset::{NewExperiment, PresetFmu};
use fmu_system::cosimulation::Sequence;
use fmu_system::ssp::ssv;
use std::path::{Path, PathBuf};

/// Writes an FMU with other start values, from an FMU of this program.
///
/// The new FMU starts with these values in every importer, even in those that do not read parameter files: they are in its
/// description and in its instances, and a reset returns to them. An importer may still set others. Binaries are unchanged: the
/// values are stored in a file under resources/; without it the binary refuses to run. The result of the default experiment is
/// computed again, and documentation/index.html lists the new start values.
///
/// A value is written as for `fmu simulate --set`: a number, with one of the variable's units if needed (1000rpm), true or false, a
/// name or a number of an enumeration, a text; the elements of an array with commas, or one element as `NAME[2]` or
/// `NAME[1,2]`. The values of --ssv or --motor are set before the values of --set. An FMU that is already a preset keeps its
/// other values.
///
/// The command writes nothing if a name is wrong, if a value is not allowed, or if the FMU refuses the values together.
///
/// The drive with another machine, and then with another estimator:
///   fmu preset target/fmu/fmi2/PmsmDrive.fmu --motor motors/ipmsm-2.2kw.toml --name Pump --out Pump.fmu
///   fmu preset Pump.fmu --set controller.estimator=FluxObserver --set plant.mechanics.J=0.02 --out Pump2.fmu
/// The values of a parameter file:
///   fmu preset PmsmPlant.fmu --ssv target/tune/ipmsm-2.2kw.PmsmPlant.ssv --out MyPlant.fmu
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Preset {
    /// FMU of `fmu build`, or of this command
    #[arg(value_name = "FILE.fmu")]
    pub file: PathBuf,
    /// Start value of an input or a parameter (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Parameter file (SSV of SSP 1.0) with start values
    #[arg(long, value_name = "FILE.ssv")]
    pub ssv: Option<PathBuf>,
    /// Motor file, as for `fmu tune`, for `PmsmDrive`, `PmsmPlant` and `SensorlessController`
    #[arg(long, value_name = "MOTOR.toml", conflicts_with = "ssv")]
    pub motor: Option<PathBuf>,
    /// Display name (modelName) [default: from FILE.fmu]
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// CSV file with the inputs of the default experiment and, by its last time, its stop time, for the reference result
    /// [default: from FILE.fmu; with --motor one that fits the machine]
    #[arg(long, value_name = "FILE.csv")]
    pub stimuli: Option<PathBuf>,
    /// File to write [default: NAME.fmu]
    #[arg(long, value_name = "NEW.fmu", required_unless_present = "name")]
    pub out: Option<PathBuf>,
}

/// Runs the command; returns the start values that differ, and the file.
///
/// # Errors
/// The FMU is not of this program, or has no binary for this computer; a name or a value is wrong; a file cannot be written.
pub fn run(args: &Preset) -> Result<String> {
    if args.set.is_empty() && args.ssv.is_none() && args.motor.is_none() {
        bail!("nothing to preset: give --set NAME=VALUE, --ssv FILE.ssv or --motor MOTOR.toml");
    }
    args.name.as_deref().map_or(Ok(()), judge)?;
    let out = args.out.clone().or_else(|| args.name.as_ref().map(|name| format!("{name}.fmu").into()));
    let out = out.context("--out NEW.fmu is missing")?;
    let tuned = args.motor.as_deref().map(tune::tune).transpose()?;
    let mut preset = PresetFmu::open(&args.file)?;
    let given = args.stimuli.as_deref().map(|path| course(path, |name| preset.has(name))).transpose()?;
    if let Some(path) = &args.ssv {
        let of = || path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(of)?;
        for p in ssv::read(&text).map_err(|cause| anyhow!("{}: {cause}", of()))? {
            let line = || format!("{}: line {}", of(), p.line);
            preset.set(&p.name, &p.value, p.unit.as_deref()).with_context(line)?;
        }
    }
    let of_motor = tuned.map(|tuned| motor::set(&mut preset, &tuned)).transpose()?;
    for text in &args.set {
        let known = assignment(text, |name| preset.has(name));
        let (name, value) = known.ok_or_else(|| anyhow!("{text}: is not --set NAME=VALUE"))?;
        preset.set(name.trim(), value.trim(), None).with_context(|| format!("--set {text}"))?;
    }
    let changes = written(preset, args.name.as_deref(), given.or(of_motor).as_ref(), &out)?;
    let lines = changes.iter().map(|line| format!("  {}\n", printable(line)));
    Ok(lines.chain([format!("{}\n", out.display())]).collect())
}

/// The FMU with the values of a machine, for `fmu tune --fmu`.
///
/// # Errors
/// Those of [`run`].
pub fn of_machine(file: &Path, tuned: &Tuned, out: &Path) -> Result<()> {
    let mut preset = PresetFmu::open(file)?;
    let course = motor::set(&mut preset, tuned)?;
    written(preset, None, Some(&course), out).map(drop)
}

/// The FMU with the values of a data sheet, for `fmu datasheet --fmu`.
///
/// # Errors
/// Those of [`run`].
pub fn of_sheet(file: &Path, sheet: &MappedSheet, out: &Path) -> Result<()> {
    let mut preset = PresetFmu::open(file)?;
    let course = motor::set_sheet(&mut preset, sheet)?;
    written(preset, None, Some(&course), out).map(drop)
}

/// Writes the FMU and shows its limitations; returns its changes.
fn written(preset: PresetFmu, name: Option<&str>, course: Option<&NewExperiment>, out: &Path) -> Result<Vec<String>> {
    let written = preset.write(name, course, out)?;
    written.notes.iter().for_each(|note| message::note(&printable(note)));
    Ok(written.changes)
}

/// The default experiment with the inputs of a file.
fn course(path: &Path, known: impl Fn(&str) -> bool) -> Result<NewExperiment> {
    let of = || format!("--stimuli {}", path.display());
    let stimuli = std::fs::read_to_string(path).with_context(of)?;
    let columns = Sequence::read_csv(path, known).map_err(|cause| anyhow!("--stimuli {cause}"))?;
    let stop = columns.first().map(|(_, texts)| texts.end()).with_context(|| format!("{}: has no last time", of()))?;
    Ok(NewExperiment { stimuli, stop, step: None })
}

/// Checks that a name for users is also a file name on every system, because the reference files use it.
fn judge(name: &str) -> Result<()> {
    let plain = |b: u8| (b' '..=b'~').contains(&b) && !br#"/\:*?"<>|"#.contains(&b);
    ensure!(
        name.bytes().all(plain) && (1..=100).contains(&name.len()) && name.trim() == name && !name.starts_with('.'),
        "--name {name}: a name has 1 to 100 letters of ASCII, none of / \\ : * ? \" < > |, no blank at its ends and no dot before it, because files use it"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_name_is_one_for_files() {
        for good in ["Pump", "My motor, 2.2 kW (new)", &"x".repeat(100)] {
            super::judge(good).unwrap();
        }
        for bad in ["", " x", "x ", ".x", "a/b", "a\\b", "C:x", "a\nb", "\u{fc}", &"x".repeat(101)] {
            assert!(super::judge(bad).is_err(), "{bad}");
        }
    }
}
