//! `fmu prove`: the folders of examples required by the FMI tools page, and the importers that replayed them.

use super::build::{self, Models};
use anyhow::{Context, Result, anyhow, bail};
use cargo_fmu::message;
use clap::Args;
use fmu_core::Experiment;
use fmu_import::platform::Platform;
use fmu_import::{Folder, printable};
use fmu_pack::TOOL;
use fmu_pack::archive;
use fmu_pack::reference::{self, FOLDER};
use fmu_system::cosimulation::{Recording, Sequence};
use model_description::{BaseType, Causality, FmiVersion, Interface, ModelDescription, ModelVariable};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Writes examples for the FMI tools page: FMUs with inputs, options, reference results, and the importers that replay them.
///
/// Each FMU gets a folder DIR/fmi2/NAME or DIR/fmi3/NAME with NAME.fmu, NAME_in.csv (where it is fed), NAME_ref.csv, NAME_ref.opt and
/// Readme.txt. In the CSV files, an array is a column with spaces between its elements, and bytes are hexadecimal digits. The contents
/// come from the reference files that `fmu build` writes into every archive. The command then runs the archive again from these files, in
/// this program and, if the Python has it, in FMPy, and validates it with `fmu check`; Readme.txt lists versions and deviations. Exit
/// status 1 if an importer deviates by more than 1e-9 of a column's largest value.
///
/// All FMUs of the Cargo package or workspace around the current folder:
///   fmu prove examples-url
/// Existing archives, with the FMPy of a virtual environment:
///   fmu prove examples-url target/fmu/fmi2/PmsmDrive.fmu target/fmu/fmi3/PmsmDrive.fmu --python venv/bin/python
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub struct Prove {
    /// Folder to write
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// FMUs of `fmu build` [default: the command builds them]
    #[arg(value_name = "FILE.fmu")]
    pub files: Vec<PathBuf>,
    /// Python with FMPy
    #[arg(long, value_name = "PYTHON", default_value = "python3")]
    pub python: PathBuf,
}

/// Maximum deviation that counts as rounding.
const ROUNDING: f64 = 1e-9;

/// The result of FMPy.
#[derive(Deserialize)]
struct Replay {
    version: String,
    /// `None` with the reason if FMPy cannot feed the inputs, or if it is not finite, which JSON cannot express.
    deviation: Option<f64>,
    cannot: Option<String>,
    problems: Vec<String>,
}

/// An example: its files and its experiment.
struct Example {
    folder: PathBuf,
    name: String,
    experiment: Experiment,
}

/// Runs the command; returns the folders, and whether every importer gives the reference results.
///
/// # Errors
/// The FMUs do not build, an archive has no reference files, or a folder cannot be written.
pub fn run(args: &Prove) -> Result<(Vec<PathBuf>, bool)> {
    let dir = Folder::new()?;
    let files = match &args.files[..] {
        [] => build::models(&Models { out: Some(dir.path().into()), ..Models::default() })?,
        files => files.to_vec(),
    };
    let (mut folders, mut good) = (Vec::new(), true);
    for file in &files {
        let (example, md) = example(file, &args.folder)?;
        let (text, replayed) = proof(&example, &md, &args.python)?;
        archive::write(&example.folder.join("Readme.txt"), text.as_bytes())?;
        folders.push(example.folder);
        good &= replayed;
    }
    Ok((folders, good))
}

/// Writes the files of an example.
fn example(archive: &Path, folder: &Path) -> Result<(Example, ModelDescription)> {
    let (md, files) = fmu_import::contents(archive)?;
    let name = md.model_name.clone();
    let folder = folder.join(if md.version == FmiVersion::V2 { "fmi2" } else { "fmi3" }).join(&name);
    let wanted = format!("{FOLDER}{name}_ref.csv");
    if !files.contains_key(&wanted) {
        bail!(
            "{}: has no {wanted}: build it with this command; fmu build reports models that cannot run alone",
            archive.display()
        );
    }
    for file in [format!("{name}_ref.csv"), format!("{name}_in.csv")] {
        if let Some(bytes) = files.get(&format!("{FOLDER}{file}")) {
            archive::write(&folder.join(file), bytes)?;
        }
    }
    let of = &md.default_experiment;
    let times =
        of.start.zip(of.stop).zip(of.step).with_context(|| format!("{}: DefaultExperiment", archive.display()))?;
    let ((start, stop), step) = times;
    let experiment = Experiment { start, stop, step, ..Experiment::DEFAULT };
    #[expect(clippy::cast_precision_loss, reason = "a small count")]
    let interval = step * reference::every(&experiment) as f64;
    let options = format!(
        "StartTime, {start:?}\nStopTime, {stop:?}\nStepSize, {step:?}\nRelTol, 1e-6\nSolverType, FixedStep\n\
         OutputIntervalLength, {interval:?}\n"
    );
    archive::write(&folder.join(format!("{name}_ref.opt")), options.as_bytes())?;
    archive::write(&folder.join(format!("{name}.fmu")), &fs::read(archive)?)?;
    Ok((Example { folder, name, experiment }, md))
}

/// Replays the example from its files; returns Readme.txt, and whether every importer gives the reference.
fn proof(example: &Example, md: &ModelDescription, python: &Path) -> Result<(String, bool)> {
    let Example { name, experiment, .. } = example;
    let file = |ending: &str| example.folder.join(format!("{name}{ending}"));
    let archive = file(".fmu");
    let deviation = own(example, md)?;
    let mut good = deviation <= ROUNDING;
    let mut replays = vec![format!("{TOOL}: {deviation:.1e}")];
    let check = fmu_check::run(&archive, &fmu_check::Options::default())?;
    good &= check.conforms();
    let verdict = if check.conforms() {
        "no requirement of the standard is violated"
    } else {
        "violated requirements: see fmu check"
    };
    let mut validations = vec![format!("{TOOL}, fmu check: {verdict}")];
    match fmpy(example, python)? {
        Some(Replay { version, deviation, cannot, problems }) => {
            good &= problems.is_empty();
            if let Some(cannot) = cannot {
                message::note(&printable(&format!("{}: not replayed in FMPy: {cannot}", archive.display())));
            } else {
                let deviation = deviation.unwrap_or(f64::INFINITY);
                good &= deviation <= ROUNDING;
                replays.push(format!("FMPy {version}: {deviation:.1e}"));
            }
            let found = if problems.is_empty() { "no problems".into() } else { problems.join("; ") };
            validations.push(format!("FMPy {version}, validate_fmu: {found}"));
        }
        None => message::note(&format!(
            "{} has no FMPy: {} lists only this program; select a Python with FMPy by --python (pip install fmpy)",
            python.display(),
            example.folder.join("Readme.txt").display()
        )),
    }
    if !good {
        message::warning(&format!("{}: {}; {}", archive.display(), replays.join(", "), validations.join(", ")));
    }
    let Experiment { start, stop, step, .. } = experiment;
    let fed = if file("_in.csv").is_file() {
        format!("fed with {name}_in.csv")
    } else {
        "with all inputs at their start values".into()
    };
    let text = format!(
        "{name} {}, FMI {}, Co-Simulation\n{}\n\nExported by {TOOL} on {}. To test with it: {}.\n\n\
         {name}_ref.csv is the result from {start} s to {stop} s in communication steps of {step} s, {fed};\n\
         {name}_ref.opt has these options. Inputs are held over these steps; straight lines connect their points.\n\n\
         Importers that ran {name}.fmu from these files, with the largest deviation, relative to the largest value of a column:\n  {}\n\n\
         Validated by:\n  {}\n",
        md.model_version.as_deref().unwrap_or_default(),
        md.version,
        md.description.as_deref().unwrap_or_default(),
        Platform::host(),
        features(md),
        replays.join("\n  "),
        validations.join("\n  "),
    );
    Ok((text, good))
}

/// The capabilities of FMI that the FMU has.
fn features(md: &ModelDescription) -> String {
    let cs = md.co_simulation.as_ref();
    let all = [
        ("Co-Simulation", cs.is_some()),
        ("Model Exchange", md.model_exchange.is_some()),
        ("FMU state, saved and restored", cs.is_some_and(Interface::can_get_and_set_state)),
        ("FMU state as bytes", cs.is_some_and(Interface::can_serialize_state)),
        (
            "directional derivatives",
            cs.is_some_and(|cs| cs.flag("providesDirectionalDerivative") || cs.flag("providesDirectionalDerivatives")),
        ),
        ("Event Mode in Co-Simulation", cs.is_some_and(Interface::has_event_mode)),
        ("arrays", md.variables.iter().any(ModelVariable::is_array)),
        ("structural parameters", md.variables.iter().any(|v| v.causality == Causality::StructuralParameter)),
        ("binary variables", md.variables.iter().any(|v| v.base == BaseType::Binary)),
        ("clocks", md.variables.iter().any(|v| v.base == BaseType::Clock)),
    ];
    all.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect::<Vec<_>>().join(", ")
}

/// Largest deviation of the run in this program.
fn own(example: &Example, md: &ModelDescription) -> Result<f64> {
    let Example { folder, name, experiment } = example;
    let known = |name: &str| md.variable(name).is_some();
    let csv = |ending: &str| Sequence::read_csv(&folder.join(format!("{name}{ending}")), known).map_err(|e| anyhow!(e));
    let fed = if folder.join(format!("{name}_in.csv")).is_file() { csv("_in.csv")? } else { Vec::new() };
    let recording = reference::run(&folder.join(format!("{name}.fmu")), experiment, &fed)?;
    let every = reference::every(experiment);
    let mut largest = 0.0_f64;
    for (column, expected) in csv("_ref.csv")? {
        let found = cells(&recording, &column).with_context(|| format!("{name}_ref.csv: {column} is not an output"))?;
        let pairs = recording.time.iter().zip(&found).step_by(every).map(|(t, x)| (x.as_str(), expected.at(*t)));
        largest = largest.max(deviation(pairs));
    }
    Ok(largest)
}

/// The values of a column in CSV form.
fn cells(recording: &Recording, name: &str) -> Option<Vec<String>> {
    let numbers = |column: &fmu_system::cosimulation::Column| {
        (0..column.values.len()).map(|k| column.at(k).to_string()).collect()
    };
    let texts = || Some(recording.texts.iter().find(|column| column.name == name)?.values.clone());
    recording.column(name).map(numbers).or_else(texts)
}

/// Largest difference of the numbers of two columns, relative to the largest number of the second. A cell of an array has
/// several; values that are not numbers are either equal or infinitely far apart.
fn deviation<'a>(pairs: impl Iterator<Item = (&'a str, &'a str)>) -> f64 {
    let numbers = |text: &str| text.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>().ok();
    let (mut apart, mut size) = (0.0_f64, f64::MIN_POSITIVE);
    for (found, expected) in pairs {
        match (numbers(found), numbers(expected)) {
            (Some(found), Some(expected)) if found.len() == expected.len() => {
                for (x, y) in found.iter().zip(expected) {
                    (apart, size) = (apart.max((x - y).abs()), size.max(y.abs()));
                }
            }
            _ if found.trim() == expected => {}
            _ => return f64::INFINITY,
        }
    }
    apart / size
}

/// Replays the example in FMPy; `None` if the Python lacks it.
fn fmpy(example: &Example, python: &Path) -> Result<Option<Replay>> {
    let has_it = Command::new(python).args(["-c", "import fmpy"]).output();
    if !has_it.is_ok_and(|output| output.status.success()) {
        return Ok(None);
    }
    let Example { folder, name, experiment } = example;
    let file = |ending: &str| folder.join(format!("{name}{ending}"));
    let stimuli = Some(file("_in.csv")).filter(|f| f.is_file()).unwrap_or_default();
    let mut command = Command::new(python);
    command.args(["-c", include_str!("prove/replay.py")]).arg(file(".fmu")).arg(file("_ref.csv")).arg(stimuli);
    let output = command.args([experiment.start, experiment.stop, experiment.step].map(|x| x.to_string())).output()?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().last().unwrap_or_default().to_owned();
        return Err(cargo_fmu::Failed(format!("{}: FMPy cannot run it: {last}", file(".fmu").display())).into());
    }
    // FMPy may print other text before.
    let said = String::from_utf8_lossy(&output.stdout);
    Ok(Some(serde_json::from_str(said.lines().last().unwrap_or_default()).context("what FMPy found")?))
}
