//! The options that `fmu simulate` and `fmu bode` share: FMUs, their connections and values, and how they step.

use crate::message;
use anyhow::{Context, Result, anyhow, bail};
use clap::{Args, ValueEnum};
use fmu_import::written::{assignment, pair};
use fmu_import::{Fmu, Kind, printable};
use fmu_system::cosimulation::{Integration, Method, Sequence, Solver, System, Units};
use fmu_system::ssp::load::Loaded;
use fmu_system::ssp::ssv;
use fmu_system::ssp::values::{self, Given};
use std::path::Path;

/// FMUs, their connections and their values.
#[derive(Debug, Default, Args)]
pub struct SystemOptions {
    /// FMUs, each optionally with a name; or one SSP file
    #[arg(value_name = "[NAME=]FILE", required = true)]
    pub fmus: Vec<String>,
    /// Connect an output to an input (repeatable)
    #[arg(long, value_name = "OUTPUT=INPUT")]
    pub connect: Vec<String>,
    /// Connect two terminals, which group the variables of an instance (repeatable)
    #[arg(long, value_name = "TERMINAL=TERMINAL")]
    pub terminal: Vec<String>,
    /// Connect every unconnected input to the output of the same name of another FMU
    #[arg(long)]
    pub auto_connect: bool,
    /// Pass numbers between different units unchanged; by default they are converted by the BaseUnits of both FMUs
    #[arg(long)]
    pub no_unit_conversion: bool,
    /// Set the values of a parameter file (SSV of SSP 1.0) before --set (repeatable); a single FMU needs no INSTANCE=
    #[arg(long, value_name = "[INSTANCE=]FILE.ssv")]
    pub parameters: Vec<String>,
    /// Set a parameter or an unconnected input (repeatable); a number may have a unit that the FMU shows: 20degC
    #[arg(long, value_name = "VARIABLE=VALUE")]
    pub set: Vec<String>,
    /// Feed an input or a tunable parameter over time (repeatable): TIME:VALUE,TIME:VALUE for steps, TIME:VALUE~TIME:VALUE for
    /// straight lines, or a CSV file with time in the first column; without VARIABLE=, the headings of the other columns name
    /// the inputs. VALUE and headings may have a unit: 1000rpm, `speed_ref [rpm]`. Values that are not real numbers are held
    /// from point to point: texts, bytes as hexadecimal digits, arrays with spaces between their elements
    #[arg(long, value_name = "[VARIABLE=]POINTS|FILE.csv")]
    pub input: Vec<String>,
}

/// How FMUs step.
#[derive(Debug, Default, Args)]
pub struct SteppingOptions {
    /// Step the FMUs one after another; each receives the new outputs of those before it
    #[arg(long)]
    pub sequential: bool,
    /// Integrate the FMUs (Model Exchange) instead of letting them step themselves (Co-Simulation)
    #[arg(long, conflicts_with = "sequential")]
    pub me: bool,
    /// Integrator of --me [default: dopri]
    #[arg(long, value_enum)]
    pub solver: Option<SolverOption>,
    /// Relative tolerance of --solver dopri; the absolute one is this times the nominal value of a state [default: 1e-6]
    #[arg(long, value_name = "TOLERANCE", allow_negative_numbers = true)]
    pub rtol: Option<f64>,
    /// Relative tolerance of the solvers inside FMUs for Co-Simulation [default: from each default experiment]
    #[arg(long, value_name = "TOLERANCE", allow_negative_numbers = true, conflicts_with = "me")]
    pub tolerance: Option<f64>,
}

/// Integrators of Model Exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SolverOption {
    /// Runge-Kutta of order 4, with fixed steps of the size --step
    Rk4,
    /// Dormand-Prince of order 5, with adaptive steps
    Dopri,
}

/// Features of FMI 3.0 in Co-Simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventOptions {
    /// Event mode.
    pub mode: bool,
    /// Early return from a step.
    pub early_return: bool,
}

/// How to run these FMUs.
fn method(args: &SteppingOptions, events: EventOptions, fmus: &[(String, Fmu)]) -> Method {
    let cannot_step = fmus.iter().find(|(_, fmu)| fmu.description().co_simulation.is_none());
    let all_exchange = fmus.iter().all(|(_, fmu)| fmu.description().model_exchange.is_some());
    match cannot_step {
        Some((name, _)) if all_exchange && !args.me && events == EventOptions::default() => {
            message::note(&printable(&format!("{name} has no Co-Simulation: the FMUs are integrated, as with --me")));
        }
        _ if !args.me => {
            return Method::CoSimulation { event_mode: events.mode, early_return: events.early_return };
        }
        _ => {}
    }
    let solver = match (args.solver, args.rtol) {
        (Some(SolverOption::Rk4), _) => Solver::Rk4,
        (_, Some(rtol)) => Solver::Dopri { rtol },
        (_, None) => Solver::default(),
    };
    Method::ModelExchange(Integration { solver, ..Integration::default() })
}

impl SystemOptions {
    /// Opens the FMUs, connects them, and sets and feeds their variables. Relative paths begin in the current folder, to which the
    /// process returns if an FMU changes it.
    ///
    /// # Errors
    /// A file is not an FMU that runs here, or a name or a value is wrong.
    pub fn open(
        &self,
        stepping: &SteppingOptions,
        events: EventOptions,
        logging: bool,
        system: impl FnOnce(System) -> System,
    ) -> Result<Loaded> {
        let home = std::env::current_dir()?;
        if let Some(x) = stepping.tolerance.filter(|x| !(1e-14..=0.1).contains(x)) {
            bail!("--tolerance {x}: expected a number between 1e-14 and 0.1");
        }
        let units = if self.no_unit_conversion { Units::PassOn } else { Units::Convert };
        let system = |fmus: &[_]| {
            let new = System::new(method(stepping, events, fmus)).with_units(units);
            system(new.with_tolerance(stepping.tolerance))
        };
        let mut loaded = Loaded::open_files_with(&self.fmus, Path::new(""), logging, system)?;
        let steps = loaded.system.instances().iter().any(|instance| instance.kind() != Kind::ModelExchange);
        if steps && (stepping.solver.is_some() || stepping.rtol.is_some()) {
            bail!("--solver and --rtol are for Model Exchange: add --me");
        }
        if stepping.solver == Some(SolverOption::Rk4) && stepping.rtol.is_some() {
            bail!("--rtol is for --solver dopri; --solver rk4 takes the steps of --step");
        }
        std::env::set_current_dir(&home)?;
        for note in std::mem::take(&mut loaded.notes) {
            message::note(&printable(&note));
        }
        prepare(&mut loaded, self, stepping.sequential)?;
        Ok(loaded)
    }

    /// The text that a variable of an instance is set to: the last of --set, else of --parameters.
    ///
    /// # Errors
    /// An option or a file of parameters cannot be read.
    pub fn given(&self, instance: &str, name: &str) -> Result<Option<String>> {
        let full = format!("{instance}.{name}");
        let value = |text: &'_ String| {
            let after = |port: &str| {
                Some(text.trim_start().strip_prefix(port)?.trim_start().strip_prefix('=')?.trim().to_owned())
            };
            after(name).or_else(|| after(&full))
        };
        let set = self.set.iter().rev().find_map(value);
        if set.is_some() {
            return Ok(set);
        }
        let found = parameters(self, Some(instance))?
            .into_iter()
            .rev()
            .find(|one| one.instance == instance && one.parameter.name == name);
        Ok(found.map(|one| one.parameter.value))
    }
}

/// The values of --parameters; those of a file without INSTANCE= are for the `only` instance.
fn parameters(options: &SystemOptions, only: Option<&str>) -> Result<Vec<Given>> {
    let mut all = Vec::new();
    for text in &options.parameters {
        let (instance, file) = match only {
            Some(only) if !text.contains('=') => (only, text.as_str()),
            _ => halves(text, "--parameters INSTANCE=FILE.ssv")?,
        };
        let content = std::fs::read_to_string(file).with_context(|| format!("reading {file}"))?;
        let given = ssv::read(&content).map_err(|cause| anyhow!("{file}: {cause}"))?;
        all.extend(Given::all(instance, file, &given));
    }
    Ok(all)
}

/// Connects the FMUs, sets and feeds their variables.
fn prepare(loaded: &mut Loaded, options: &SystemOptions, sequential: bool) -> Result<()> {
    let value =
        |text| assignment(text, |name| loaded.has(name)).ok_or_else(|| anyhow!("{text}: is not --set VARIABLE=VALUE"));
    let values = options.set.iter().map(|text| value(text.as_str())).collect::<Result<Vec<_>>>()?;
    let Loaded { system, .. } = loaded;
    // The following arguments name elements of arrays whose sizes are set here.
    let (sizes, values): (Vec<_>, Vec<_>) =
        values.into_iter().partition(|(port, _)| system.is_size(port).unwrap_or(false));
    system.configure(sizes)?;
    for text in &options.connect {
        let both = pair(text, |name| system.has(name), |name| system.has(name));
        let (from, to) = both.ok_or_else(|| anyhow!("{text}: is not --connect OUTPUT=INPUT"))?;
        system.connect(from, to.trim())?;
    }
    for text in &options.terminal {
        let (one, other) = halves(text, "--terminal INSTANCE.TERMINAL=INSTANCE.TERMINAL")?;
        for (from, to) in system.connect_terminals(one, other)? {
            eprintln!("connected {} -> {}", printable(&from), printable(&to));
        }
    }
    for text in &options.input {
        match assignment(text, |name| loaded.has(name)) {
            Some((port, file)) if file.to_lowercase().ends_with(".csv") => {
                let column = column(port, file, |name| loaded.has(name));
                let column = column.map_err(|cause| anyhow!("--input {text}: {cause}"))?;
                loaded.sequence(port, &column).with_context(|| format!("--input {text}"))?;
            }
            Some((port, points)) => loaded.points(port, points).with_context(|| format!("--input {text}"))?,
            None => {
                let columns = Sequence::read_csv(Path::new(text), |name| loaded.has(name));
                for (port, texts) in columns.map_err(|cause| anyhow!("--input {cause}"))? {
                    loaded.sequence(&port, &texts).with_context(|| format!("--input {text}"))?;
                }
            }
        }
    }
    if options.auto_connect {
        let connected = loaded.system.connect_by_name()?;
        for (from, to) in &connected {
            eprintln!("connected {} -> {}", printable(from), printable(to));
        }
        if connected.is_empty() {
            message::warning("--auto-connect connects nothing: no free input has the name of an output of another FMU");
        }
    }
    if sequential && loaded.system.instances().len() == 1 {
        message::warning("--sequential has no effect: there is one FMU");
    }
    let only = match loaded.system.instances() {
        [one] => Some(one.name().to_owned()),
        _ => None,
    };
    values::set(&mut loaded.system, &parameters(options, only.as_deref())?)?;
    for (port, value) in values {
        loaded.set(port, value)?;
    }
    Ok(())
}

/// The column of a CSV file that feeds the input `port`: the one with its name, or the only one.
fn column(port: &str, file: &str, known: impl Fn(&str) -> bool) -> Result<Sequence, String> {
    let mut columns = Sequence::read_csv(Path::new(file), known)?;
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    match names.iter().position(|name| *name == port).or_else(|| (names.len() == 1).then_some(0)) {
        Some(index) => Ok(columns.swap_remove(index).1),
        None => Err(format!("has the columns {}; name one of them {port}", names.join(", "))),
    }
}

fn halves<'a>(text: &'a str, form: &str) -> Result<(&'a str, &'a str)> {
    text.split_once('=').ok_or_else(|| anyhow!("{text}: is not {form}"))
}
