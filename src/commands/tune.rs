//! The command `fmu tune`: parameter values of the FMUs for a motor.

use super::preset;
use crate::ssv;
use anyhow::Result;
use clap::Args;
use drive::{PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController};
use drive_tools::tune::application::Application;
use drive_tools::tune::motor::{MotorFile, estimators, torque_constant};
use drive_tools::tune::setting::{Setting, Tuned, Value};
use drive_tools::tune::trial::{self, Trial};
use drive_tools::tune::{self, limits, remedy, rules};
use fmu_core::digits::rounded;
use fmu_core::{Description, Model};
use fmu_pack::archive;
use fmu_pack::workspace::output_folder;
use std::path::{Path, PathBuf};

/// Computes parameter values of PmsmPlant, SensorlessController and PmsmDrive from motor data.
///
/// `fmu tune --example` prints a motor file to start from. MOTOR.toml contains motor, mechanics, ratings and DC link, and may
/// contain the bandwidths of current loop, speed loop and observer; see the examples in motors/. The command writes NAME.PmsmDrive.ssv, NAME.PmsmPlant.ssv and
/// NAME.SensorlessController.ssv (SSP 1.0) with the values that differ from the start values of the FMUs, for importers.
///
/// The command tries the drive: starts from 24 angles, then rated torque as a step at 0.1, 0.5 and 1 pu of the rated speed, and
/// a load at rating.speed_max if that is given. A note lists each load and each start at which the drive fails, with remedies
/// that the command has tried too; the exit status is still 0. Another note states the starts that fail while the rated torque
/// acts from the first sample on, and another the speed at which the drive without a load swings most, on the way from 0.1 to 1 pu
/// and back. Rasmussen's observer adapts the resistance, unless the trial holds fewer loads with it, as a note reports. --check
/// prints the trial as a table, also for the machine at -30 and 130 degC.
///
/// With --fmu it writes an FMU with these start values instead, which needs no parameter file: see `fmu preset`.
///
///   fmu tune motors/ipmsm-2.2kw.toml --fmu target/fmu/fmi3/PmsmDrive.fmu --out MyMotor.fmu
///
/// For a vehicle: torque control with a sensor and the full current limit, on the shaft of the drive train.
///
///   fmu tune motors/traction-100kw.toml --estimator Sensored --control torque --shaft imposed --out target/tune
///
///   fmu tune motors/ipmsm-2.2kw.toml --out target/tune
///   fmu simulate target/fmu/fmi3/PmsmPlant.fmu target/fmu/fmi3/SensorlessController.fmu --auto-connect \
///     --parameters PmsmPlant=target/tune/ipmsm-2.2kw.PmsmPlant.ssv \
///     --parameters SensorlessController=target/tune/ipmsm-2.2kw.SensorlessController.ssv \
///     --input SensorlessController.speed_ref=0:0,0.5:78.5 --stop 3 --plot run.svg
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[expect(clippy::struct_excessive_bools, reason = "options of a command")]
pub struct Tune {
    /// Motor file
    #[arg(value_name = "MOTOR.toml", required_unless_present = "example")]
    pub motor: Option<PathBuf>,
    /// Print the motor file of a 2.2 kW machine and exit
    #[arg(long, exclusive = true)]
    pub example: bool,
    /// Output folder [default: tune in Cargo's target folder]; with --fmu the file to write
    #[arg(long, value_name = "DIR|NEW.fmu")]
    pub out: Option<PathBuf>,
    /// FMU to write with the values as its start values: PmsmDrive, PmsmPlant or SensorlessController
    #[arg(long, value_name = "FILE.fmu", requires = "out", conflicts_with = "integers")]
    pub fmu: Option<PathBuf>,
    /// Write enumerations as integers, for importers that cannot read names (OMSimulator)
    #[arg(long)]
    pub integers: bool,
    /// Print the values as JSON, only a dictionary per FMU, without the trial and its notes; enumerations are integers, as FMPy expects
    #[arg(long, conflicts_with_all = ["fmu", "out", "check", "integers"])]
    pub json: bool,
    /// Estimator to tune for, instead of the motor file's
    #[arg(long, value_name = "NAME", long_help = estimator_help())]
    pub estimator: Option<String>,
    /// Reference of the drive: speed (speed_ref) or torque (tau_ref) [default: speed]. The trial controls the speed in both cases
    #[arg(long, value_name = "speed|torque")]
    pub control: Option<String>,
    /// Shaft of the drive: free (it turns its own inertia against tau_load) or imposed (a drive train sets speed_shaft and angle_shaft) [default: free]
    #[arg(long, value_name = "free|imposed")]
    pub shaft: Option<String>,
    /// Print the trial: starts from 24 angles at each speed, loads carried, minimum speed, maximum angle error
    #[arg(long)]
    pub check: bool,
}

/// The help of --estimator: the names of all.
fn estimator_help() -> String {
    format!("Estimator to tune for, instead of the motor file's: {}", estimators())
}

/// The motor file of --example.
const EXAMPLE: &str = include_str!("../../motors/ipmsm-2.2kw.toml");

/// Start angles of the trial.
const ANGLES: u32 = 24;

/// Runs the command.
///
/// # Errors
/// The motor file is invalid, or a file cannot be written.
pub fn run(args: &Tune) -> Result<()> {
    let Some(motor) = &args.motor else {
        print!("{EXAMPLE}");
        return Ok(());
    };
    let application = Application::named(args.control.as_deref(), args.shaft.as_deref())?;
    if args.json {
        println!("{:#}", tune::values(motor, args.estimator.as_deref(), application)?);
        return Ok(());
    }
    let mut motor = MotorFile::read(motor)?;
    if let Some(estimator) = &args.estimator {
        motor.choose(estimator)?;
    }
    let tuned = rules::tune(&motor)?;
    let used = application.applied(&tuned)?;
    let out = args.out.clone().map_or_else(|| output_folder("tune"), Ok)?;
    let files = match &args.fmu {
        Some(fmu) => {
            preset::of_machine(fmu, &used, &out)?;
            vec![out]
        }
        None => write(&used, &out, args.integers)?,
    };
    println!("{}\n{}", tuned.name, tuned.source);
    for (model, settings) in [("PmsmPlant", &used.plant), ("SensorlessController", &used.controller)] {
        println!("\n{model}");
        for Setting { name, value, rule, .. } in settings {
            println!("  {name:26}{:>14}  {rule}", shown(value));
        }
    }
    let constant = shown(&Value::Real(torque_constant(&motor.data)));
    println!("\nK = 1.5 n_p psi_M = {constant} N.m/A: torque per ampere of i_q; R^: the R_s of the controller");
    let trials = trial::all(&tuned, ANGLES);
    let (limits, narrow) = limits::of(&motor, &tuned, &trials);
    for note in tuned.notes.iter().chain(&narrow) {
        println!("\nnote: {note}");
    }
    for limit in &limits {
        println!("\nnote: {limit}");
    }
    let (level, started) = trial::loaded(&tuned, ANGLES);
    if let Some(note) = limits::under_load(&tuned, level, (started, ANGLES)) {
        println!("\nnote: {note}");
    }
    let swings = trial::swings(&tuned);
    if let Some(worst) = swings.iter().max_by(|a, b| a.speed.total_cmp(&b.speed)) {
        let cure = remedy::calm(&motor, &tuned, &trials);
        let cure = cure.map_or("use a sensor (estimator Sensored)".to_owned(), |cure| cure.to_string());
        println!("\nnote: {worst}; {cure}");
    }
    if args.check {
        table(&trials, "does not hold: see the note");
        println!("under the rated torque from rest: {level} pu reached from {started} of {ANGLES} angles");
        if swings.is_empty() {
            println!("without a load, from 0.1 to 1 pu and back, the drive does not swing");
        }
        for swing in &swings {
            println!("{swing}");
        }
        for celsius in trial::TEMPERATURES {
            println!("\nwinding and magnet at {celsius:.0} degC since before the start, the rated current:");
            table(&trial::all(&trial::at_temperature(&tuned, celsius), ANGLES / 4), "does not hold");
        }
    }
    println!();
    for file in &files {
        println!("{}", file.display());
    }
    Ok(())
}

/// Prints the trial.
fn table(trials: &[Trial], lost: &str) {
    println!("\nspeed   started    held load   min. speed  angle error");
    for trial in trials {
        let Trial { task, angles, started, held, least, error, .. } = trial;
        let least = if *started > 0 { format!("{least:8.3} pu") } else { format!("{:>11}", "-") };
        let error = if *held > 0 { format!("{error:.1} deg") } else { "-".into() };
        let verdict = match (trial.starts() && trial.holds(), trial.slips()) {
            (true, false) => "holds",
            (true, true) => "slipped, recovered",
            (false, _) => lost,
        };
        let level = format!("{:.2}", task.level);
        let level = level.trim_end_matches('0').trim_end_matches('.');
        println!(
            "{level:>3} pu  {started:2} of {angles:2}   {held:2} of {started:2}   {least}  {error:>11}   {verdict}"
        );
    }
}

/// The values of the machine of --example for one of the FMUs: the name of the set and the SSV file. `None` for a model with
/// another interface.
///
/// # Errors
/// A model cannot be described.
pub fn example_for(description: &Description) -> Result<Option<(String, String)>> {
    let Some(place) = place(description)? else { return Ok(None) };
    let tuned = rules::tune(&MotorFile::parse(EXAMPLE, Path::new("ipmsm-2.2kw.toml"))?)?;
    let (_, text) = texts(&tuned, false)?.swap_remove(place);
    Ok(Some((tuned.name, text)))
}

/// Which of the three models an FMU is, in the order of [`texts`]; `PmsmDriveMean` has the values of `PmsmDrive`.
pub(super) fn place(description: &Description) -> Result<Option<usize>> {
    let (place, known) = match &*description.name {
        name if name == PmsmDrive::INFO.name => (0, tune::check::variables::<PmsmDrive>()),
        name if name == PmsmDriveMean::INFO.name => (0, tune::check::variables::<PmsmDriveMean>()),
        name if name == PmsmPlant::INFO.name => (1, tune::check::variables::<PmsmPlant>()),
        name if name == SensorlessController::INFO.name => (2, tune::check::variables::<SensorlessController>()),
        _ => return Ok(None),
    };
    let known = known?;
    let names = |d: &Description| d.variables.iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    Ok(names(description).starts_with(&names(&known)).then_some(place))
}

/// Writes `NAME.PmsmDrive.ssv`, `NAME.PmsmPlant.ssv` and `NAME.SensorlessController.ssv` to a folder; returns their paths.
fn write(tuned: &Tuned, folder: &Path, integers: bool) -> Result<Vec<PathBuf>> {
    let write = |(model, text): (&str, String)| {
        let path = folder.join(format!("{}.{model}.ssv", tuned.name));
        archive::write(&path, text.as_bytes())?;
        Ok(path)
    };
    texts(tuned, integers)?.into_iter().map(write).collect()
}

/// The SSV files of the three FMUs, each with the values that [`tune::needed`] returns.
fn texts(tuned: &Tuned, integers: bool) -> Result<Vec<(&'static str, String)>> {
    let (plant, controller) = tune::needed(tuned, integers)?;
    let drive = tune::of_drive(tuned, integers)?;
    let title = |model: &str| format!("{} {model}", tuned.name);
    let of_drive = drive.iter().map(|(name, value)| (name.as_str(), value));
    Ok(vec![
        ("PmsmDrive", ssv::text_of(&title("PmsmDrive"), of_drive)),
        ("PmsmPlant", ssv::text(&title("PmsmPlant"), &plant)),
        ("SensorlessController", ssv::text(&title("SensorlessController"), &controller)),
    ])
}

fn shown(value: &Value) -> String {
    match value {
        // Six digits suffice for reading; the file has all digits.
        Value::Real(x) => rounded(*x, 6).to_string(),
        Value::Reals(all) => format!("{} values", all.len()),
        Value::Integer(i) => i.to_string(),
        Value::Boolean(b) => b.to_string(),
        Value::Item(item) => item.clone(),
    }
}
