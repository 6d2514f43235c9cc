//! `fmu map`: the efficiency map of a machine.

use super::numbers;
use anyhow::{Context, Result, bail};
use clap::Args;
use drive_tools::map::cycle::{CYCLE, Cycle, VEHICLE};
use drive_tools::map::request::{self, Request};
use drive_tools::map::{self, files, report};
use drive_tools::tune::motor::MotorFile;
use fmu_pack::archive;
use fmu_pack::workspace::output_folder;
use std::path::PathBuf;

/// Computes the efficiency map and the envelope of a machine with the values of `fmu tune`.
///
/// The map covers speed and torque at the shaft in both quadrants, for each DC-link voltage and temperature. It counts the
/// losses of copper, iron, inverter and friction that the motor file describes (its tables iron, inverter and mechanics). Some
/// points are compared with PmsmDrive; if one differs by more than 0.1 % of its power or 1 % of a loss, a note states the point
/// and the deviation.
///
/// Writes map.csv (a line per point), envelope.csv, map.npz (for numpy.load), map.svg and map.html (works offline), and prints
/// the best point, the losses at the rated point and the energy of a driving cycle. The example's cycle is omitted if the drive
/// cannot follow it.
///
///   fmu map motors/traction-63kw.toml --out target/map
///   fmu map motors/traction-63kw.toml --u-dc 300,350,400 --T 20,80,120 --grid 21x21
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[expect(non_snake_case, reason = "the symbol of the temperature")]
pub struct Map {
    /// Motor file, as for `fmu tune`
    #[arg(value_name = "MOTOR.toml")]
    pub motor: PathBuf,
    /// Output folder [default: map in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// DC-link voltages [default: from the motor file]
    #[arg(long, value_name = "V,...", allow_hyphen_values = true)]
    pub u_dc: Option<String>,
    /// Temperatures of winding and magnet in degC [default: 20]
    #[arg(long = "T", value_name = "DEGC,...", allow_hyphen_values = true)]
    pub T: Option<String>,
    /// Number of speeds and of torques, which is odd
    #[arg(long, value_name = "NxM", default_value = "47x41", allow_hyphen_values = true)]
    pub grid: String,
    /// Number of points compared with PmsmDrive, for each voltage and temperature; 0: none
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub verify: usize,
    /// Driving cycle: lines of time in s and speed in km/h (or `speed [m/s]` in its header), interpolated linearly [default: from examples/vehicle]
    #[arg(long, value_name = "FILE.csv")]
    pub cycle: Option<PathBuf>,
    /// Vehicle on the cycle [default: from examples/vehicle]
    #[arg(long, value_name = "FILE.toml")]
    pub vehicle: Option<PathBuf>,
}

/// The vehicle and the cycle of the options, or of the examples.
fn cycle(args: &Map) -> Result<Cycle> {
    let read = |file: &Option<PathBuf>, example: &str| match file {
        Some(file) => std::fs::read_to_string(file).with_context(|| format!("reading {}", file.display())),
        None => Ok(example.into()),
    };
    let (vehicle, cycle) = (read(&args.vehicle, VEHICLE)?, read(&args.cycle, CYCLE)?);
    let of = |file: &Option<PathBuf>| file.as_ref().map(|file| file.display().to_string());
    let files: Vec<_> = [of(&args.vehicle), of(&args.cycle)].into_iter().flatten().collect();
    let found = Cycle::new(&vehicle, &cycle);
    if files.is_empty() { Ok(found?) } else { found.with_context(|| files.join(", ")) }
}

/// Runs the command.
///
/// # Errors
/// The motor file or an option is wrong, or a file cannot be written.
pub fn run(args: &Map) -> Result<()> {
    let values = |option: &str, given: &Option<String>| {
        let Some(text) = given else { return Ok(Vec::new()) };
        let values = numbers(option, text)?;
        if values.is_empty() {
            bail!("{option} has no value: give at least one, or omit the option");
        }
        Ok(values)
    };
    let request = Request {
        u_dc: values("--u-dc", &args.u_dc)?,
        T: values("--T", &args.T)?,
        grid: request::grid(&args.grid)?,
        verify: args.verify,
    };
    request.check()?;
    let cycle = cycle(args)?;
    let map = map::make(&MotorFile::read(&args.motor)?, &request)?;
    let report = report::of(&map, &cycle, args.cycle.is_some() || args.vehicle.is_some());
    // All files are ready before the first is written.
    let files = files::all(&map, &report)?;
    let out = args.out.clone().map_or_else(|| output_folder("map"), Ok)?;
    for (name, bytes) in &files {
        archive::write(&out.join(name), bytes)?;
    }
    println!("{}\n{}\n\n{}", map.name, map.source, report.text());
    for (name, _) in &files {
        println!("{}", out.join(name).display());
    }
    Ok(())
}
