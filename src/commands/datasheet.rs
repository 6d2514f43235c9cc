//! The command `fmu datasheet`: parameter values of `MappedDrive` for the drive of a data sheet.

use super::preset;
use crate::ssv;
use anyhow::{Context, Result};
use cargo_fmu::message;
use clap::Args;
use drive_tools::datasheet::file::RPM;
use drive_tools::datasheet::{self, MappedSheet};
use fmu_core::digits::rounded;
use fmu_pack::archive;
use fmu_pack::workspace::output_folder;
use std::path::PathBuf;

/// Computes parameter values of MappedDrive from the data sheet of a drive: torque over speed, continuous and peak, a table of
/// efficiencies or losses, inertia and voltage range.
///
/// `fmu datasheet --example` prints a data sheet to start from. The table of losses may also be the map.csv of `fmu map`. The
/// command checks the data sheet, prints what it assumed, and writes NAME.MappedDrive.ssv (SSP 1.0), for importers. With
/// --fmu it writes an FMU with these start values instead, which needs no parameter file: see `fmu preset`.
///
///   fmu datasheet --example > drive.toml
///   fmu datasheet drive.toml --fmu target/fmu/fmi3/MappedDrive.fmu --out MyDrive.fmu
///   fmu datasheet drive.toml --out target/datasheet
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Datasheet {
    /// Data sheet
    #[arg(value_name = "SHEET.toml", required_unless_present = "example")]
    pub sheet: Option<PathBuf>,
    /// Print the data sheet of a drive of 30 kW and exit
    #[arg(long, exclusive = true)]
    pub example: bool,
    /// Output folder [default: datasheet in Cargo's target folder]; with --fmu the file to write
    #[arg(long, value_name = "DIR|NEW.fmu")]
    pub out: Option<PathBuf>,
    /// FMU MappedDrive to write with the values as its start values
    #[arg(long, value_name = "FILE.fmu", requires = "out")]
    pub fmu: Option<PathBuf>,
    /// Print the values as JSON, only a dictionary
    #[arg(long, conflicts_with_all = ["fmu", "out"])]
    pub json: bool,
}

/// The data sheet of --example.
const EXAMPLE: &str = include_str!("datasheet.toml");

/// Runs the command.
///
/// # Errors
/// The data sheet is invalid, or a file cannot be written.
pub fn run(args: &Datasheet) -> Result<()> {
    if args.example {
        print!("{EXAMPLE}");
        return Ok(());
    }
    let path = args.sheet.as_ref().context("SHEET.toml is missing")?;
    if args.json {
        let (values, doubts) = datasheet::values(path)?;
        println!("{values:#}");
        for doubt in &doubts {
            message::warning(doubt);
        }
        return Ok(());
    }
    let sheet = datasheet::read(path)?;
    let file = if let Some(fmu) = &args.fmu {
        let out = args.out.clone().context("--out NEW.fmu is missing")?;
        preset::of_sheet(fmu, &sheet, &out)?;
        out
    } else {
        let out = args.out.clone().map_or_else(|| output_folder("datasheet"), Ok)?;
        let values = sheet.values();
        let text =
            ssv::text_of(&format!("{} MappedDrive", sheet.name), values.iter().map(|(name, value)| (*name, value)));
        let file = out.join(format!("{}.MappedDrive.ssv", sheet.name));
        archive::write(&file, text.as_bytes())?;
        file
    };
    print!("{}", text(&sheet));
    sheet.notes.iter().for_each(|note| message::note(note));
    sheet.doubts.iter().for_each(|doubt| message::warning(doubt));
    println!("\n{}", file.display());
    Ok(())
}

/// What the data sheet gives.
fn text(sheet: &MappedSheet) -> String {
    let ([power, at], [efficiency, n, tau]) = sheet.map.best();
    let map = &sheet.map;
    let rpm = |n: f64| rounded(n / RPM, 4);
    let most = |values: &[f64]| rounded(values.iter().copied().fold(0.0, f64::max), 4);
    let overload = if map.t_overload > 0.0 {
        format!("time constant of the overload {} s", rounded(map.t_overload, 3))
    } else {
        "the peak torque is available at any time".into()
    };
    format!(
        "{}\n{}\n\n\
         torque            peak {} N.m, continuous {} N.m; {overload}\n\
         speed             up to {} rpm\n\
         peak power        {} kW at {} rpm\n\
         best efficiency   {} % at {} rpm, {} N.m\n\
         voltage           {} V, {} to {} V\n",
        sheet.name,
        sheet.source,
        most(&map.tau_motor),
        most(&map.tau_continuous),
        rpm(map.last()),
        rounded(power * 1e-3, 4),
        rpm(at),
        rounded(100.0 * efficiency, 4),
        rpm(n),
        rounded(tau, 4),
        rounded(map.u_dc, 4),
        rounded(map.u_min, 4),
        rounded(map.u_max, 4)
    )
}
