//! `fmu ssp`: the closed loop of plant and controller as one file.

use super::build::{self, Models};
use crate::ssp::{self, COMPONENTS, ComponentValues, Options};
use crate::ssv;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use drive_tools::tune;
use fmu_import::Folder;
use fmu_pack::archive::{self, GenerationTime};
use model_description::FmiVersion;
use std::path::{Path, PathBuf};

/// Packs plant and controller, connected and with the values of a motor, into one SSP file (SSP 1.0).
///
/// The system has the inputs (speed_ref, tau_load, u_dc and more) and outputs of PmsmDrive. Values come from a motor file, as with
/// `fmu tune`, or from SSV files for the components controller and plant; otherwise the FMUs keep their start values.
///
///   fmu ssp --motor motors/ipmsm-2.2kw.toml --out drive.ssp
///   fmu simulate drive.ssp --input speed_ref=0:0,0.5:78.5 --stop 3 --plot run.svg
/// With existing FMUs:
///   fmu ssp --fmus target/fmu --fmi 3 --out drive.ssp
///
/// SSP 1.0 is older than FMI 3.0, and many SSP importers accept only FMUs of FMI 2.0. OMSimulator runs the file unchanged, with
/// its command line and its Python package. With SOURCE_DATE_EPOCH set, identical sources give identical bytes.
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Ssp {
    /// FMI version of the FMUs: 2 or 3 [default: 2, or as in --fmus]
    #[arg(long, value_name = "VERSION", value_parser = clap::builder::PossibleValuesParser::new(["2", "3"]))]
    pub fmi: Option<String>,
    /// Folder with PmsmPlant.fmu and SensorlessController.fmu, or with the folders of `fmu build` [default: they are built from
    /// the sources around the current folder]
    #[arg(long, value_name = "DIR")]
    pub fmus: Option<PathBuf>,
    /// Motor file, as for `fmu tune`
    #[arg(long, value_name = "MOTOR.toml", conflicts_with = "parameters")]
    pub motor: Option<PathBuf>,
    /// Values for controller or plant as SSV of SSP 1.0 (repeatable)
    #[arg(long, value_name = "COMPONENT=FILE.ssv")]
    pub parameters: Vec<String>,
    /// Write values of enumerations by name, as SSP 1.0 describes them, instead of by number; some importers do not read names
    /// (OMSimulator)
    #[arg(long)]
    pub names: bool,
    /// Write values of enumerations by number: the default, kept for older scripts
    #[arg(long, hide = true, conflicts_with = "names")]
    pub integers: bool,
    /// Connect `enabled` of the controller to `enable` of the plant, for a drive that can be switched off; some importers do
    /// not support Boolean connections
    #[arg(long)]
    pub gates: bool,
    /// Write the size of the diagram (SystemGeometry), which some importers refuse (OMSimulator)
    #[arg(long)]
    pub geometry: bool,
    /// File to write
    #[arg(long, value_name = "FILE.ssp")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// The FMUs do not build, values do not fit, or the file cannot be written.
pub fn run(args: &Ssp) -> Result<()> {
    let moment = GenerationTime::of_environment()?;
    let values = values(args)?;
    let dir = Folder::new()?;
    if values.is_empty() && args.names {
        bail!("--names has no values to write: add --motor or --parameters");
    }
    let fmi = args.fmi.as_deref().unwrap_or("2");
    let standard = format!("fmi{fmi}");
    let folder = if let Some(given) = &args.fmus {
        let folder = packed(given, &standard)?;
        if args.fmi.is_some() {
            is_of(&folder, fmi.parse()?)?;
        }
        folder
    } else {
        let fmus = COMPONENTS.map(|(_, fmu, _)| fmu.to_owned()).to_vec();
        let out = Some(dir.path().into());
        build::models(&Models { fmus, fmi: Some(fmi.to_owned()), out, ..Models::default() })
            .context("the FMUs of the drive cannot be built here; --fmus DIR takes FMUs from a folder")?;
        dir.path().join(standard)
    };
    let options = Options { gates: args.gates, geometry: args.geometry, names: args.names };
    let files = ssp::files(&folder, &values, options, moment)?;
    archive::write(&args.out, &archive::archive(&files, moment)?)?;
    println!("{}", args.out.display());
    Ok(())
}

/// The folder with the FMUs: the given one, or the one of the standard in it.
fn packed(given: &Path, standard: &str) -> Result<PathBuf> {
    let file = |folder: &Path, fmu: &str| folder.join(fmu).with_extension("fmu");
    let has_all = |folder: &PathBuf| COMPONENTS.iter().all(|(_, fmu, _)| file(folder, fmu).is_file());
    [given.to_owned(), given.join(standard)].into_iter().find(has_all).ok_or_else(|| {
        let names = COMPONENTS.map(|(_, fmu, _)| format!("{fmu}.fmu")).join(" and ");
        anyhow!(
            "--fmus {}: expected {names} there or in its folder {standard}, as fmu build --out writes them",
            given.display()
        )
    })
}

/// Requires FMUs of the version that `--fmi` names.
fn is_of(folder: &Path, version: FmiVersion) -> Result<()> {
    for (_, fmu, _) in COMPONENTS {
        let file = folder.join(fmu).with_extension("fmu");
        let found = fmu_import::outline(&file)?.description.version;
        if found != version {
            bail!("{}: is of FMI {found}, but --fmi is {version}", file.display());
        }
    }
    Ok(())
}

/// The values, each with its file.
fn values(args: &Ssp) -> Result<Vec<ComponentValues>> {
    if let Some(motor) = &args.motor {
        let tuned = tune::tune(motor)?;
        let of = |component: &str, settings: &[tune::setting::Setting]| ComponentValues {
            component: component.into(),
            file: motor.display().to_string(),
            text: ssv::text(&format!("{} {component}", tuned.name), settings),
        };
        let (plant, controller) = tune::needed(&tuned, false)?;
        return Ok(vec![of("controller", &controller), of("plant", &plant)]);
    }
    let mut values: Vec<ComponentValues> = Vec::new();
    for text in &args.parameters {
        let (component, file) =
            text.split_once('=').ok_or_else(|| anyhow!("{text}: is not --parameters COMPONENT=FILE.ssv"))?;
        if !COMPONENTS.iter().any(|(name, ..)| *name == component) {
            let names: Vec<&str> = COMPONENTS.iter().map(|(name, ..)| *name).collect();
            bail!("--parameters {text}: there is no component {component}; available: {}", names.join(", "));
        }
        if values.iter().any(|v| v.component == component) {
            bail!("--parameters {text}: {component} already has a file: put the values of both into one");
        }
        let content = std::fs::read_to_string(file).with_context(|| file.to_owned())?;
        values.push(ComponentValues { component: component.into(), file: file.into(), text: content });
    }
    Ok(values)
}
