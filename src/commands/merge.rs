//! `fmu merge`: one archive from several archives of one FMU, each with binaries for other platforms.

use anyhow::Result;
use cargo_fmu::build::Linux64;
use clap::Args;
use fmu_pack::archive::{self, GenerationTime};
use fmu_pack::merge::merge;
use std::path::PathBuf;

/// Merges builds of one FMU for different platforms into a single FMU.
///
/// The FMUs must have the same FMI version, token (GUID) and files, except for binaries/ and the generation date; the latest date
/// is kept. Otherwise no file is written. The order of the FMUs does not change the bytes. In FMI 2.0, the libraries for both
/// processors of macOS become one universal library.
///
///   fmu merge linux/PmsmPlant.fmu windows/PmsmPlant.fmu --out PmsmPlant.fmu
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Merge {
    /// FMUs to merge
    #[arg(value_name = "FILE.fmu", num_args = 2.., required = true)]
    pub files: Vec<PathBuf>,
    /// File to write
    #[arg(long, value_name = "FILE.fmu")]
    pub out: PathBuf,
    /// Processor of the library in the folder linux64 of FMI 2.0, as for `fmu build`: x86_64 or aarch64 [default: x86_64]
    #[arg(long, value_name = "PROCESSOR")]
    pub linux64: Option<Linux64>,
}

/// Runs the command.
///
/// # Errors
/// Those of [`merge`]; the file cannot be written.
pub fn run(args: &Merge) -> Result<()> {
    let moment = GenerationTime::of_environment()?;
    let files = merge(&args.files, args.linux64.map(Linux64::platform))?;
    archive::write(&args.out, &archive::archive(&files, moment)?)?;
    println!("{}", args.out.display());
    Ok(())
}
