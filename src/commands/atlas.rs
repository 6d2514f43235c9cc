//! `fmu atlas`: the low speeds at which a drive with wrong estimates carries its load.

use super::{bar_of_cells, numbers};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use drive::estimator::Kind;
use drive::plant::pwm::InverterMode;
use drive_study::atlas::cell::{Course, Grid};
use drive_study::atlas::drive::Drive;
use drive_study::atlas::{self, report};
use drive_study::compare::candidate::Entry;
use fmu_pack::workspace::output_folder;
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::thread;

/// Runs drives with wrong estimates of resistance and magnet flux at low speed under load, and maps where they lose the rotor.
///
/// Without MOTOR.toml, an estimator runs on the drive of `fmu compare`: flux observers on the reference motor (1 pu is 3000 rpm
/// and the 2 N.m of the paper's load steps), all others on the 2.2 kW machine. With it, they run on the drive that `fmu tune`
/// computes for the machine. The cells are all combinations of the values on the axes; shares are of the true or the rated
/// value.
///
/// Writes a map per estimator (atlas-NAME.svg, red where the drive is lost), atlas.csv, atlas.md and atlas.html (works
/// offline). The files have the same bytes for any number of jobs.
///
///   fmu atlas --estimator Rasmussen --out target/atlas
///   fmu atlas --set adaptation.resistance=true --set adaptation.k_a=0.02
///   fmu atlas motors/servo-6.6kw.toml --estimator Rasmussen,VoltageModel --scenario load,speed --flux 1 --every 3
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
pub struct Atlas {
    /// Motor file, as for `fmu tune` [default: the drives of `fmu compare`]
    #[arg(value_name = "MOTOR.toml")]
    pub motor: Option<PathBuf>,
    /// Estimators
    #[arg(long, value_name = "ESTIMATOR,...", value_delimiter = ',', default_value = "Rasmussen")]
    pub estimator: Vec<String>,
    /// Scenarios: load, speed, heating, noise, inverter, cold, hot, torque, sign [default: load]
    #[arg(long, value_name = "SCENARIO,...", value_delimiter = ',')]
    pub scenario: Option<Vec<String>>,
    /// Resistance estimate as a share of the resistance [default: 11 values, 0.5..1.5]
    #[arg(long, value_name = "SHARE,...", allow_hyphen_values = true)]
    pub resistance: Option<String>,
    /// Magnet flux estimate as a share of the magnet flux [default: 5 values, 0.8..1.2]
    #[arg(long, value_name = "SHARE,...", allow_hyphen_values = true)]
    pub flux: Option<String>,
    /// Load as a share of the rated torque [default: 0,0.5,-0.5,1,-1]
    #[arg(long, value_name = "SHARE,...", allow_hyphen_values = true)]
    pub load: Option<String>,
    /// Speed as a share of the rated speed [default: 0,0.01,0.02,0.05]
    #[arg(long, value_name = "SHARE,...", allow_hyphen_values = true)]
    pub speed: Option<String>,
    /// Initial angle in deg of the rotor ahead of the estimate [default: 0]
    #[arg(long, value_name = "DEG,...", allow_hyphen_values = true)]
    pub angle: Option<String>,
    /// Start from the full grid: five scenarios, 7 fluxes, speeds of both signs, 3 angles (40425 cells, about half an hour)
    #[arg(long)]
    pub full: bool,
    /// Run only every N-th cell
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub every: usize,
    /// Set a parameter of the controller (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Inverter of the plant: Average or Switched, with a carrier period of one sample [default: Average]
    #[arg(long, value_name = "MODE")]
    pub inverter: Option<String>,
    /// Threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub jobs: Option<u16>,
    /// Output folder [default: atlas in Cargo's target folder]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A name, a value or the motor file is wrong, an atlas has no cells, or a file cannot be written.
pub fn run(args: &Atlas) -> Result<()> {
    let cells = grid(args)?.cells(args.every)?;
    let drives = drives(args)?;
    let out = args.out.clone().map_or_else(|| output_folder("atlas"), Ok)?;
    let jobs = args.jobs.map_or_else(|| thread::available_parallelism().map_or(1, NonZero::get), usize::from);

    let bar = bar_of_cells(cells.len() * drives.len());
    let atlases = atlas::run(&drives, &cells, jobs, || bar.inc(1))?;
    bar.finish_and_clear();

    atlas::write(&atlases, &out)?;
    println!("{}", report::markdown(&atlases));
    println!("{}", out.join("atlas.html").display());
    Ok(())
}

fn grid(args: &Atlas) -> Result<Grid> {
    let mut grid = if args.full { Grid::full() } else { Grid::default() };
    let axes = [
        ("--resistance", &args.resistance, &mut grid.R),
        ("--flux", &args.flux, &mut grid.psi),
        ("--load", &args.load, &mut grid.load),
        ("--speed", &args.speed, &mut grid.speed),
        ("--angle", &args.angle, &mut grid.theta),
    ];
    for (option, given, axis) in axes {
        if let Some(text) = given {
            *axis = numbers(option, text)?;
        }
    }
    if let Some(names) = &args.scenario {
        let find = |name: &String| {
            let known = || Course::ALL.iter().map(|s| s.name()).collect::<Vec<_>>().join(", ");
            let found = Course::ALL.iter().find(|s| s.name() == name);
            found.copied().ok_or_else(|| anyhow!("--scenario {name}: unknown scenario; available: {}", known()))
        };
        grid.scenarios = names.iter().filter(|name| !name.is_empty()).map(find).collect::<Result<_>>()?;
    }
    Ok(grid)
}

fn drives(args: &Atlas) -> Result<Vec<Drive>> {
    let mode = args.inverter.as_deref().map_or(Ok(InverterMode::Average), mode)?;
    let mut drives: Vec<Drive> = Vec::new();
    for name in args.estimator.iter().filter(|name| !name.is_empty()) {
        let mut drive = if let Some(path) = &args.motor {
            tuned(path, name)?
        } else {
            Drive::compared(Entry::find(name).ok_or_else(|| unknown(name, Entry::all().iter().map(|e| e.name)))?)
        };
        args.set.iter().try_for_each(|text| drive.set(text))?;
        drives.push(drive.on_inverter(mode));
    }
    if drives.is_empty() {
        bail!("--estimator has no value: an atlas needs at least one estimator; omit the option for Rasmussen");
    }
    Ok(drives)
}

fn mode(name: &str) -> Result<InverterMode> {
    let known = || InverterMode::ALL.iter().map(|mode| mode.name()).collect::<Vec<_>>().join(", ");
    let found = InverterMode::ALL.iter().find(|mode| mode.name().eq_ignore_ascii_case(name));
    found.copied().ok_or_else(|| anyhow!("--inverter {name}: unknown mode; available: {}", known()))
}

fn tuned(path: &Path, name: &str) -> Result<Drive> {
    let found = Kind::ALL.iter().find(|kind| kind.name().eq_ignore_ascii_case(name));
    Ok(Drive::tuned(path, *found.ok_or_else(|| unknown(name, Kind::ALL.iter().map(|kind| kind.name())))?)?)
}

fn unknown<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> anyhow::Error {
    anyhow!("--estimator {name}: unknown estimator; available: {}", known.collect::<Vec<_>>().join(", "))
}
