//! `fmu simulate`: co-simulates FMUs, or integrates those for Model Exchange.

mod curves;
mod log;
mod output;
mod overlay;
mod overview;
mod progress;
mod record;
mod replay;

use crate::Failed;
use crate::message;
use crate::system::{EventOptions, SteppingOptions, SystemOptions};
use crate::worker::{self, ProcessOptions};
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use fmu_import::guard::Streams;
use fmu_import::written::names;
use fmu_import::{Instance, Kind, Number, journal, printable, printable_lines};
use fmu_pack::icons::ARE_DRAWN;
use fmu_system::cosimulation::{CommunicationPoint, Settings, System};
use fmu_system::ssp::load::Loaded;
use log::Log;
use model_description::ModelVariable;
use progress::Progress;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Co-simulates FMUs of FMI 2.0 and FMI 3.0, from this project or any other tool.
///
/// An instance is named after its file; NAME=FILE gives another name. Write variables as INSTANCE.VARIABLE, or as VARIABLE if there
/// is one FMU; recordings and plots of one FMU have names without an instance, unless NAME=FILE gives it.
///
/// At every communication point the command reads all outputs, sets all inputs, then steps all FMUs: an output reaches other
/// FMUs one step later. With --sequential, the FMUs step in the order given, and each receives the new outputs of those before
/// it.
///
/// With --me, the command integrates FMUs for Model Exchange itself: it hits time events exactly, locates state events, and
/// sets discrete inputs only at events. --step is then the distance of the recorded points, and the step of --solver rk4. If
/// one of the FMUs has no Co-Simulation, the command does so without --me. With --event-mode and --early-return, FMUs for
/// Co-Simulation of FMI 3.0 handle their events at their time, independent of --step.
///
/// Ctrl-C ends the run at the next communication point and writes the results so far; a second Ctrl-C ends the command at once.
///
/// After the run, warnings on standard error list inputs that kept their start values because they are neither connected nor
/// set, unless their descriptions mark them as optional, and a step that is longer than the DefaultExperiment of an FMU.
/// Finally the command prints the last values (those of the curves if it draws the default plot, otherwise all recorded ones)
/// and the names of its files.
///
/// The FMUs run in a separate process, with limits on memory, open files and new processes. If an FMU crashes, blocks or ends
/// that process, the command names the FMU and the call, removes the temporary files and has exit status 2. Their output goes
/// to standard error. --in-process runs them in the process of the command: it starts a few milliseconds sooner, but a crashing
/// FMU also ends the command.
///
/// With --replay, the command repeats what Simulink, Dymola, OpenModelica or any other importer did with an FMU of this project:
/// run it there with the environment variable FMU_CALL_LOG=FOLDER, and each instance writes its calls into a file of that folder.
///
/// Start the drive, turn it at 1000 rpm, and load it after 0.5 s:
///   fmu simulate target/fmu/fmi3/PmsmDrive.fmu --input speed_ref=0:0,0.1:1000rpm --input tau_load=0:0,0.5:2 --html run.html
/// The drive as controller and plant, without a load:
///   fmu simulate target/fmu/fmi3/PmsmPlant.fmu target/fmu/fmi3/SensorlessController.fmu --auto-connect \
///     --input SensorlessController.speed_ref=0:0,0.1:1000rpm --stop 1 --plot run.svg
/// An SSP file of `fmu ssp` or any other tool; names without a dot refer to connectors of the system:
///   fmu simulate drive.ssp --input speed_ref=0:0,0.1:104.7 --stop 1 --plot run.svg
/// Controller and plant, connected by terminals:
///   fmu simulate p=PmsmPlant.fmu c=SensorlessController.fmu --terminal p.phases=c.phases --terminal p.sensor=c.sensor \
///     --input c.speed_ref=0:0,0.1:104.7 --stop 1 --plot run.svg
/// Controller and plant, connected by hand, with another resistance; selected variables recorded as CSV:
///   fmu simulate p=PmsmPlant.fmu c=SensorlessController.fmu --connect c.u_a=p.u_a --connect c.u_b=p.u_b \
///     --connect c.u_c=p.u_c --connect p.i_a=c.i_a --connect p.i_b=c.i_b --connect p.i_c=c.i_c \
///     --set p.motor.R_s=3.3 --input c.speed_ref=0:0,0.1:104.7 --stop 1 --record p.speed,c.speed_est --csv -
/// Two estimators in one plot, with a measurement of the speed:
///   fmu simulate PmsmDrive.fmu --input speed_ref=0:0,0.1:1000rpm --set controller.estimator=FluxObserver --csv flux.csv
///   fmu simulate PmsmDrive.fmu --input speed_ref=0:0,0.1:1000rpm --overlay flux.csv --overlay bench=speed.csv --html both.html
/// A bouncing ball for Model Exchange, integrated with a relative tolerance of 1e-8 and recorded every 10 ms:
///   fmu simulate BouncingBall.fmu --me --rtol 1e-8 --step 0.01 --stop 3 --csv ball.csv
/// What another importer did with the drive, in a run with FMU_CALL_LOG=logs:
///   fmu simulate PmsmDrive.fmu --replay logs/PmsmDrive-4711-1.calls
#[derive(Debug, Default, Args)]
#[command(verbatim_doc_comment)]
#[expect(clippy::struct_excessive_bools, reason = "options of a command")]
pub struct Simulate {
    #[command(flatten)]
    /// FMUs and values.
    pub system: SystemOptions,
    /// Start time in s [default: from the FMUs, else 0]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub start: Option<f64>,
    /// Stop time in s [default: the latest of the FMUs, else 1]
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub stop: Option<f64>,
    /// Communication step in s [default: the shortest of the FMUs, else a thousandth of the duration]
    #[arg(long, value_name = "H", allow_negative_numbers = true)]
    pub step: Option<f64>,
    /// Variables to record; * in a name stands for any text, ? for one character: '*' records all [default: the outputs]
    #[arg(long, value_name = "VARIABLE,...")]
    pub record: Vec<String>,
    /// Write the recording as CSV; - for standard output
    #[arg(long, value_name = "FILE|-")]
    pub csv: Option<PathBuf>,
    /// Plot the recording; the extension selects the format. Without --record: speed, torque, dq currents, angle error and
    /// power of a drive, the first of each unit of other FMUs
    #[arg(long, value_name = "FILE.svg|FILE.png")]
    pub plot: Option<PathBuf>,
    /// Write the same plot as an offline page with zoom, legend switches and values at the cursor
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Add the columns of a CSV file to the plot (repeatable): a measurement, or an earlier run's --csv. The first column is time;
    /// the headings of the others name variables, optionally with a unit: `time [ms]`, `speed [rpm]`. LABEL names its curves
    #[arg(long, value_name = "[LABEL=]FILE.csv")]
    pub overlay: Vec<String>,
    /// Show and plot all outputs; by default, the plot shows the main ones, and the terminal, of many outputs, those that
    /// change
    #[arg(long, conflicts_with = "record")]
    pub all: bool,
    #[command(flatten)]
    /// Stepping.
    pub stepping: SteppingOptions,
    /// Handle events at their time, for FMUs of FMI 3.0 with event mode (Co-Simulation)
    #[arg(long, conflicts_with_all = ["me", "sequential"])]
    pub event_mode: bool,
    /// Let FMUs of FMI 3.0 return early from a step (Co-Simulation)
    #[arg(long, conflicts_with_all = ["me", "sequential"])]
    pub early_return: bool,
    /// Repeat the calls of another importer: a file that the FMU wrote there because of the environment variable
    /// FMU_CALL_LOG=FOLDER. The command compares every status and value, bit for bit, and names the first difference
    #[arg(long, value_name = "FILE.calls", conflicts_with_all = ["connect", "terminal", "auto_connect", "no_unit_conversion",
        "parameters", "set", "input", "start", "stop", "step", "record", "csv", "plot", "html", "overlay", "all", "sequential",
        "me", "solver", "rtol", "tolerance", "event_mode", "early_return", "logging"])]
    pub replay: Option<PathBuf>,
    /// Show all messages that the FMUs log, not only each warning once
    #[arg(long)]
    pub logging: bool,
    #[command(flatten)]
    /// The process of the FMUs.
    pub process: ProcessOptions,
}

/// Runs the command `fmu simulate` of this process.
///
/// # Errors
/// A file is not an FMU that runs here, a name is wrong, an FMU fails, or it ends its process.
pub fn run(args: &Simulate) -> Result<()> {
    let has_ending = |path: &Path, endings: &[&str]| {
        path.extension().is_some_and(|ending| endings.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    };
    if let Some(path) = args.plot.as_deref().filter(|path| !has_ending(path, &["svg", "png"])) {
        bail!("--plot {}: plots are written as .svg or .png; --html FILE.html writes a page", path.display());
    }
    if let Some(path) = args.plot.as_deref().filter(|path| !ARE_DRAWN && has_ending(path, &["png"])) {
        bail!("--plot {}: cargo fmu draws .svg; the command fmu draws .png too", path.display());
    }
    if let Some(path) = args.html.as_deref().filter(|path| !has_ending(path, &["html", "htm"])) {
        bail!("--html {}: pages are written as .html; --plot FILE.svg or FILE.png writes a picture", path.display());
    }
    if !args.overlay.is_empty() && args.plot.is_none() && args.html.is_none() {
        bail!("--overlay {} is for --plot or --html: add one of them", args.overlay[0]);
    }
    worker::run("simulate", &args.process, false, |out| match &args.replay {
        Some(log) => replay::run(&args.system.fmus, log, out),
        None => simulate(args, out),
    })
}

fn simulate(args: &Simulate, mut out: Box<dyn Write>) -> Result<()> {
    // An FMU may change the working directory; file names of the command are relative to this one.
    let home = std::env::current_dir()?;
    let streams = Streams::now();
    let overlays = overlay::read(&args.overlay)?;
    let listens = |system: System| system.with_listener(|note| message::note(&printable(note)));
    let events = EventOptions { mode: args.event_mode, early_return: args.early_return };
    let mut loaded = args.system.open(&args.stepping, events, args.logging, listens)?;
    let for_plot = record_what_is_asked(&mut loaded, args)?;
    let settings = loaded.settings(args.start, args.stop, args.step, args.stepping.sequential);
    let Loaded { mut system, connectors, .. } = loaded;
    for overlay in &overlays {
        overlay.like(system.columns()).map_err(|cause| anyhow!("--overlay {cause}"))?;
    }
    // The names of an SSP's system are its own.
    let of_system = !(connectors.inputs.is_empty() && connectors.outputs.is_empty());
    let settings = system.feasible(&settings)?;
    let before = system.take_notes();
    for note in &before {
        message::note(&printable(note));
    }
    let (mut progress, mut log) = (Progress::new(settings), Log::new(args.logging));
    let (mut look, mut interrupted) = (worker::look(&args.process), None);
    let mut hook = |point: &mut CommunicationPoint<'_>| {
        log.show(&point.take_messages());
        progress.at(point.time);
        journal::reached(point.time);
        if look() {
            interrupted = Some(point.time);
            return Ok(ControlFlow::Break(()));
        }
        Ok(ControlFlow::Continue(()))
    };
    let (recording, outcome) = system.run_keeping(&settings, &mut hook);
    progress.end();
    let during = system.take_notes().into_iter().filter(|note| !before.contains(note));
    during.for_each(|note| message::note(&printable(&note)));
    log.show(&system.take_messages());
    log.end();
    // The numbers of closed descriptors would be reused for files of the command.
    let lost = streams.lost();
    if !lost.is_empty() {
        let names: Vec<&str> = system.instances().iter().map(Instance::name).collect();
        let text = format!("{}: the FMU closed or replaced {} of its process", names.join(" or "), lost.join(", "));
        // Files of the command may have been closed too, and their descriptors reused.
        std::mem::forget(system);
        bail!("{text}");
    }
    let failed = match outcome {
        Err(error) if recording.time.is_empty() => return Err(error.into()),
        outcome => outcome.err().map(|error| ending(&error, recording.time.last(), settings.step)),
    };
    journal::writes();
    std::env::set_current_dir(&home)?;
    let bad = recording.columns.iter().find(|c| matches!(c.last(), Number::Real(x) if !x.is_finite()));
    let bad = failed.or(bad.map(|column| format!("{} is not finite at the end", column.name)));
    let instances: Vec<&str> = system.instances().iter().map(Instance::name).collect();
    let named = |name: &&str| args.system.fmus[0].strip_prefix(*name).is_some_and(|rest| rest.starts_with('='));
    let plain = !of_system && instances.len() == 1 && !instances.iter().any(named);
    let naming = output::Naming { instances: &instances, plain, for_plot };
    let written = output::write(recording, &naming, &overlays, args, &mut out);
    for text in warnings(&system, &settings) {
        message::warning(&printable(&text));
    }
    // The results are written last.
    let written = written?;
    let text = printable_lines(&written);
    if args.csv.as_deref() == Some(Path::new("-")) {
        eprintln!("{text}");
    } else {
        writeln!(out, "{text}").context("standard output")?;
    }
    // Before the FMUs are freed and unloaded.
    drop(out);
    if let Some(bad) = bad {
        return Err(Failed(bad).into());
    }
    match interrupted {
        Some(time) => Err(Failed(format!("interrupted at {time} s, where the results end")).into()),
        None => Ok(()),
    }
}

/// Why a run ended early, with advice.
fn ending(error: &fmu_import::Error, last: Option<&f64>, step: f64) -> String {
    let advice = if error.is_discard() {
        format!("; a shorter step may continue: --step {}", 0.5 * step)
    } else {
        String::new()
    };
    format!("{error}; the results end at {} s{advice}", last.copied().unwrap_or_default())
}

/// Warns of inputs that keep their start values and of a step that is too long, because FMUs refuse neither.
fn warnings(system: &System, settings: &Settings) -> Vec<String> {
    let mut found = Vec::new();
    for (index, instance) in system.instances().iter().enumerate() {
        let name = instance.name();
        let value = |v: &ModelVariable| {
            let unit = v.unit.as_ref().map(|unit| format!(" {unit}")).unwrap_or_default();
            format!("{} = {}{unit}", v.name, v.start.as_deref().unwrap_or("(no start value)"))
        };
        let inputs: Vec<_> = system.untouched(index).into_iter().map(value).collect();
        if !inputs.is_empty() {
            found.push(format!(
                "{name}: inputs left at their start values: {}; connect them, feed them with --input, or set them with --set",
                inputs.join(", ")
            ));
        }
        let steps_itself = instance.kind() != Kind::ModelExchange;
        let step = instance.description().default_experiment.step.filter(|_| steps_itself);
        if let Some(longest) = step.filter(|longest| settings.step > longest * (1.0 + 1e-9)) {
            found.push(format!(
                "{name}: the step of {} s is longer than the stepSize of its DefaultExperiment, {longest} s; --step {longest} \
                 shows whether the results depend on it",
                settings.step
            ));
        }
    }
    found
}

/// Records what the options ask for; returns how many of the last columns are only for the plot.
fn record_what_is_asked(loaded: &mut Loaded, args: &Simulate) -> Result<usize> {
    if args.record.is_empty() {
        loaded.record_outputs()?;
    }
    let mut for_plot = 0;
    if args.record.is_empty() && (args.plot.is_some() || args.html.is_some()) && !args.all {
        for port in loaded.system.fed_inputs(&overview::INPUTS) {
            loaded.system.record(&port)?;
            for_plot += 1;
        }
    }
    for text in &args.record {
        for name in names(text, |name| loaded.has(name)) {
            loaded.record(&name).with_context(|| format!("--record {text}"))?;
        }
    }
    Ok(for_plot)
}
