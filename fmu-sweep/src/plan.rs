//! A system with its measures, ready for many runs.

use crate::Error;
use crate::definition::{Definition, Interface, MeasureDefinition, SolverName};
use crate::error::invalid;
use crate::measure::{Measure, Reading};
use crate::pool::{self, BLOCK};
use crate::signal::{Signal, Sum, doubt, period};
use crate::warned::Warned;
use fmu_import::{Fmu, Kind, Number, once, printable};
use fmu_system::cosimulation::{
    self, Integration, Method, PlanTarget, Recording, Settings, Solver, System, Units, Worker, item,
};
use fmu_system::ssp::load::{Connectors, Loaded};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

/// Data shared by all runs. A clone refers to the same data; any thread may use it.
#[derive(Clone)]
pub struct Plan(Arc<Shared>);

struct Shared {
    /// Records the variables of the measures, then the variables of the trace.
    system: Arc<cosimulation::SystemPlan>,
    connectors: Connectors,
    measures: Vec<Measure>,
    columns: Vec<ResultColumn>,
    trace: Vec<usize>,
    /// `instance.variable` of all variables that the definition sets.
    set: Vec<String>,
    outputs: Vec<String>,
    reuse: bool,
    notes: Vec<String>,
}

impl Shared {
    /// A system that is ready to run, without measures.
    fn new(loaded: Loaded, settings: &Settings) -> Result<Self, Error> {
        let outputs = if loaded.connectors.outputs.is_empty() {
            loaded.system.outputs()
        } else {
            loaded.connectors.outputs.iter().map(|outlet| outlet.name.clone()).collect()
        };
        let Loaded { mut system, connectors, mut notes, .. } = loaded;
        notes.extend(system.take_notes());
        let system = Arc::new(system.into_plan(settings)?);
        let (measures, columns, trace, set) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(Self { system, connectors, measures, columns, trace, set, outputs, reuse: true, notes })
    }
}

/// The first column of all results; its name is reserved: no measure or varied variable may use it.
pub(crate) const RUN: &str = "run";

/// Names of the last two columns of all results: `end` and `error`, or `run.end` and `run.error` if one of these names is
/// taken.
pub fn last_columns(taken: impl Fn(&str) -> bool) -> [String; 2] {
    ["end", "error"].map(|name| {
        let mut name = name.to_owned();
        while taken(&name) {
            name = format!("{RUN}.{name}");
        }
        name
    })
}

/// Name and unit of a column of results.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ResultColumn {
    /// Name.
    pub name: String,
    /// Unit; empty if there is none.
    pub unit: String,
    /// Numbers and names of an enumeration's values (results show the names); empty for other types.
    pub items: Vec<(i64, String)>,
}

impl ResultColumn {
    /// The name of the enumeration's value `x`.
    pub fn item(&self, x: Number) -> Option<&str> {
        item(&self.items, x.real())
    }
}

/// A variable that runs set, found by [`Plan::bind`]: one of an FMU, or an input of an SSP's system, which may feed several.
#[derive(Clone, Debug, PartialEq)]
pub struct RunVariable {
    /// Name and unit.
    pub column: ResultColumn,
    targets: Vec<PlanTarget>,
}

impl RunVariable {
    /// The variables of FMUs that it sets.
    pub(crate) fn targets(&self) -> &[PlanTarget] {
        &self.targets
    }
}

/// The result of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunResult {
    /// The measures, or the error in one line.
    pub result: Result<Vec<Number>, String>,
    /// Time reached, in s; NaN if the run never began.
    pub end: f64,
}

/// The results of many runs: columns with one value per run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunResults {
    /// A column for each measure; missing where the run failed.
    pub measures: Vec<Vec<Number>>,
    /// Time reached, in s; NaN if the run never began.
    pub end: Vec<f64>,
    /// The error.
    pub errors: Vec<Option<String>>,
    /// Rows in which the FMUs warned.
    pub warned: Warned,
}

impl Plan {
    /// Opens the FMUs of a definition, connects them and sets the values common to all runs. Relative paths begin in `folder`.
    ///
    /// # Errors
    /// A file is not an FMU that runs here, or a name, a value or a measure is invalid.
    pub fn new(definition: &Definition, folder: &Path) -> Result<Self, Error> {
        if definition.fmus.is_empty() {
            return invalid("fmus: expected at least one FMU, or an SSP file");
        }
        for (name, given) in [("rtol", definition.rtol), ("tolerance", definition.tolerance)] {
            if let Some(x) = given.filter(|x| !(1e-14..=0.1).contains(x)) {
                return invalid(format!("{name} = {x}: expected a number between 1e-14 and 0.1"));
            }
        }
        let mut unknown = None;
        let units = if definition.no_unit_conversion { Units::PassOn } else { Units::Convert };
        let system = |fmus: &[(String, Fmu)]| {
            let known = |name: &&String| fmus.iter().any(|(other, _)| other == *name);
            unknown = definition.stepping.iter().find(|name| !known(name)).cloned();
            System::new(method(definition, fmus)).with_units(units)
        };
        let mut loaded = Loaded::open_files_with(&definition.fmus, folder, false, system)?;
        if let Some(name) = unknown {
            return invalid(format!("stepping: {name} is not the name of an FMU"));
        }
        let integrates = loaded.system.instances().iter().any(|i| i.kind() == Kind::ModelExchange);
        if !integrates && definition.solver.is_some() {
            return invalid("solver is for Model Exchange, and no FMU runs so: give interface = 'ModelExchange'");
        }
        let own = definition.rtol.filter(|_| !integrates);
        loaded.system = loaded.system.with_tolerance(definition.tolerance.or(own));
        if integrates && definition.sequential {
            return invalid("sequential: FMUs step one after another only in Co-Simulation");
        }
        for [from, to] in &definition.connect {
            loaded.system.connect(from, to)?;
        }
        for [one, other] in &definition.terminal {
            loaded.system.connect_terminals(one, other)?;
        }
        for (name, points) in &definition.input {
            loaded.points(name, points).map_err(|error| Error::Invalid(once(&format!("input: {name}: {error}"))))?;
        }
        if definition.auto_connect {
            loaded.system.connect_by_name()?;
        }
        let mut set = Vec::new();
        for (name, value) in &definition.set {
            loaded.set(name, &value.to_string())?;
            set.extend(loaded.connectors.ports(name)?);
        }
        let Definition { start, stop, step, .. } = *definition;
        let settings = loaded.settings(start, stop, step, definition.sequential);
        let settings = loaded.system.feasible(&settings)?;
        let mut recorded: Vec<String> = Vec::new();
        let mut measures = Vec::new();
        for (name, measure) in &definition.measure {
            if name == RUN {
                return invalid(format!("measure: {name} is the column with the number of each run: rename it"));
            }
            let wrong = |cause: String| Error::Invalid(once(&format!("measure: {name}: {cause}")));
            measures.push(of(measure, &settings, &mut recorded, &|name| loaded.has(name)).map_err(wrong)?);
        }
        let traced = definition.trace.iter().flat_map(|trace| &trace.of);
        let trace = traced.map(|name| place(&mut recorded, name)).collect();
        for name in &recorded {
            loaded.record(name)?;
        }
        let mut shared = Shared::new(loaded, &settings)?;
        let system = Arc::clone(&shared.system);
        let of = |name: &str| system.columns().iter().find(|c| c.name == name);
        let mut mixed = Vec::new();
        let columns = measures.iter().zip(&definition.measure).map(|((measure, sum), (name, definition))| {
            // The unit of a sum of several units, or of a sum with factors, is unknown.
            let units: Vec<&str> = sum.terms.iter().map(|(_, name)| of(name).map_or("", |c| &c.unit)).collect();
            let plain = sum.terms.iter().all(|(factor, _)| factor.abs().to_bits() == 1.0_f64.to_bits());
            let same = plain && units.iter().all(|other| *other == units[0]);
            if let Some(other) = units.iter().find(|other| plain && **other != units[0]) {
                let [one, other] = [units[0], other].map(|unit| if unit.is_empty() { "no unit" } else { unit });
                mixed.push(format!(
                    "measure: {name}: its terms are in {one} and {other}: the numbers are added unchanged"
                ));
            }
            if let Some(note) = definition.wrap.as_ref().and_then(|wrap| doubt(wrap, units[0])) {
                mixed.push(format!("measure: {name}: {note}"));
            }
            let items = match &sum.terms[..] {
                [(1.0, name)] if measure.is_a_value() => of(name).map(|c| c.items.clone()),
                _ => None,
            };
            let unit = measure.unit(if same { units[0] } else { "" });
            ResultColumn { name: name.clone(), unit, items: items.unwrap_or_default() }
        });
        shared.columns = columns.collect();
        shared.notes.append(&mut mixed);
        shared.measures = measures.into_iter().map(|(measure, _)| measure).collect();
        (shared.trace, shared.set, shared.reuse) = (trace, set, definition.reuse.unwrap_or(true));
        Ok(Self(Arc::new(shared)))
    }

    /// A plan without measures for a system that is ready to run.
    ///
    /// # Errors
    /// The settings or the connections do not allow runs.
    pub fn of(loaded: Loaded, settings: &Settings) -> Result<Self, Error> {
        Ok(Self(Arc::new(Shared::new(loaded, settings)?)))
    }

    /// The FMUs, ready for runs.
    pub(crate) fn system(&self) -> &cosimulation::SystemPlan {
        &self.0.system
    }

    /// The inputs of FMUs that an input is: several of an SSP's system.
    pub(crate) fn ports(&self, name: &str) -> Result<Vec<String>, Error> {
        Ok(self.0.connectors.ports(name)?)
    }

    /// The variable denoted by a name to record.
    pub(crate) fn outlet(&self, name: &str) -> Result<cosimulation::Outlet, Error> {
        Ok(self.0.connectors.outlet(name)?)
    }

    /// Whether the instances of a run are reset for the next; otherwise each run has new ones.
    pub(crate) fn reuses(&self) -> bool {
        self.0.reuse
    }

    /// The reader of the measures from recorded values.
    pub(crate) fn readers(&self) -> &[Measure] {
        &self.0.measures
    }

    /// Names and units of the measures.
    pub fn measures(&self) -> &[ResultColumn] {
        &self.0.columns
    }

    /// The columns of a trace.
    pub(crate) fn traced(&self) -> impl Iterator<Item = &cosimulation::Column> {
        self.0.trace.iter().map(|column| &self.0.system.columns()[*column])
    }

    /// Start, stop and step.
    pub fn settings(&self) -> &Settings {
        self.0.system.settings()
    }

    /// The contents of an SSP file that are not used.
    pub fn notes(&self) -> &[String] {
        &self.0.notes
    }

    /// Names of all outputs.
    pub fn outputs(&self) -> &[String] {
        &self.0.outputs
    }

    /// The name of an FMU, if any, that allows only one instance per process; all runs are then on one thread.
    pub fn only_one_instance(&self) -> Option<&str> {
        self.0.system.only_one_instance()
    }

    /// Finds variables to set in runs.
    ///
    /// # Errors
    /// A variable does not exist, is not a number, cannot be set, is fed or set for all runs, or occurs twice.
    pub fn bind<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<Vec<RunVariable>, Error> {
        let mut all: Vec<RunVariable> = Vec::new();
        for name in names {
            let system = &self.0.system;
            let mut targets = Vec::new();
            let mut own = None;
            for inlet in self.0.connectors.inlets(name)? {
                // A run may replace values of an SSP file, but not values of the definition.
                if self.0.set.contains(&inlet.port) {
                    return invalid(format!("{name} is set for all runs and varied: remove one of them"));
                }
                let wrong = |error| Error::Invalid(format!("{name}: {error}"));
                let conversion = inlet.conversion().map_err(wrong)?;
                own = own.or_else(|| conversion.map(|_| inlet.unit.clone().unwrap_or_default()));
                targets.push(system.target(&inlet.port)?.through(conversion));
            }
            if all.iter().any(|other| other.column.name == name) {
                return invalid(format!("{name} is varied twice"));
            }
            let of = targets.first().map(|target| system.column(target));
            let (unit, items) = of.map(|c| (c.unit, c.items)).unwrap_or_default();
            let unit = own.unwrap_or(unit);
            all.push(RunVariable { column: ResultColumn { name: name.into(), unit, items }, targets });
        }
        Ok(all)
    }

    /// The number for a user's text: `3.3`, `true`, or a name of an enumeration.
    ///
    /// # Errors
    /// The text is not a value of the variable's type.
    pub fn number(&self, variable: &RunVariable, text: &str) -> Result<Number, Error> {
        let number = |target: &PlanTarget| self.0.system.number(target, text);
        Ok(variable.targets.first().map_or(Ok(Number::Missing), number)?)
    }

    /// Simulates once and records variables: `outputs`, or all outputs. Also returns the different warnings of the FMUs.
    ///
    /// # Errors
    /// The variable does not exist, or an FMU refuses.
    pub fn simulate(
        &self,
        values: &[(RunVariable, Number)],
        outputs: Option<&[String]>,
    ) -> Result<(Recording, Vec<String>), Error> {
        let outputs = outputs.unwrap_or(&self.0.outputs);
        let variables = outputs.iter().map(|name| self.outlet(name)).collect::<Result<Vec<_>, Error>>()?;
        let mut worker = Arc::new(self.0.system.recording(&variables)?).worker()?;
        worker.hear(true);
        let recording = worker.record(values.iter().flat_map(|(v, x)| v.targets.iter().map(|target| (target, *x))))?;
        Ok((recording, worker.warnings()))
    }

    /// Creates a runner of one row after another, for one thread.
    ///
    /// # Errors
    /// An FMU refuses an instance.
    pub fn runner(&self, variables: &[RunVariable]) -> Result<Runner, Error> {
        Ok(Runner {
            plan: self.clone(),
            worker: self.0.system.worker()?,
            variables: variables.to_vec(),
            states: Vec::new(),
            reuse: self.0.reuse,
            fresh: true,
        })
    }

    /// Runs many rows: `columns` has the values of each variable. `progress` is called with the number of rows done, on any of
    /// the threads, and may stop the run.
    ///
    /// # Errors
    /// The columns differ in length, an FMU refuses to create an instance, or `progress` stops it. An error of a run is in
    /// its row.
    pub fn run_many<N: Copy + Into<Number> + Sync>(
        &self,
        variables: &[RunVariable],
        columns: &[&[N]],
        threads: usize,
        progress: &(dyn Fn(u64) -> ControlFlow<()> + Sync),
    ) -> Result<RunResults, Error> {
        if variables.len() != columns.len() {
            return invalid(format!("{} columns of values for {} variables", columns.len(), variables.len()));
        }
        let length = columns.first().map_or(0, |column| column.len());
        if let Some(k) = columns.iter().position(|column| column.len() != length) {
            let name = &variables[k].column.name;
            return invalid(format!(
                "{name} has {} values, expected {length} as in the first column",
                columns[k].len()
            ));
        }
        let row = |index: u64, values: &mut Vec<Number>| {
            values.clear();
            let index = usize::try_from(index).unwrap_or(usize::MAX);
            values.extend(columns.iter().map(|column| column[index].into()));
        };
        self.run_rows(variables, u64::try_from(length).unwrap_or(u64::MAX), &row, threads, progress)
    }

    /// The measures from the readings of a run.
    pub(crate) fn measured(&self, readings: &[Reading]) -> Result<Vec<Number>, String> {
        let of = |((measure, reading), column): ((&Measure, &Reading), &ResultColumn)| {
            measure.end(reading).map_err(|cause| format!("{}: {cause}", column.name))
        };
        self.0.measures.iter().zip(readings).zip(&self.0.columns).map(of).collect()
    }

    /// Runs `count` rows generated by a function, which receives the number of a row, from 0, and fills in the values.
    ///
    /// # Errors
    /// As for [`run_many`](Self::run_many).
    pub fn run_rows(
        &self,
        variables: &[RunVariable],
        count: u64,
        row: &(dyn Fn(u64, &mut Vec<Number>) + Sync),
        threads: usize,
        progress: &(dyn Fn(u64) -> ControlFlow<()> + Sync),
    ) -> Result<RunResults, Error> {
        let rows =
            usize::try_from(count).map_err(|_| Error::Invalid(format!("{count} rows do not fit into the memory")))?;
        let all = Mutex::new((RunResults::empty(self.0.measures.len(), rows), 0));
        let threads = if self.only_one_instance().is_some() { 1 } else { threads };
        pool::run(
            count.div_ceil(BLOCK),
            threads,
            |_| Ok((self.runner(variables)?, Vec::new())),
            |(runner, values), block| {
                let range = pool::rows_of(block, count);
                let outcomes: Vec<_> = range
                    .clone()
                    .map(|index| {
                        row(index, values);
                        runner.hear(Warned::asks(index, count));
                        (runner.run(values, &mut |_, _| {}), runner.warning())
                    })
                    .collect();
                let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
                for (index, (outcome, warning)) in range.clone().zip(outcomes) {
                    all.0.put(usize::try_from(index).unwrap_or(usize::MAX), outcome);
                    all.0.warned.asked += u64::from(Warned::asks(index, count));
                    if let Some(text) = warning {
                        all.0.warned.add(index, text);
                    }
                }
                all.1 += range.end - range.start;
                let done = all.1;
                drop(all);
                if progress(done).is_break() { Err(Error::Interrupted) } else { Ok(()) }
            },
        )?;
        Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner).0)
    }
}

impl RunResults {
    pub(crate) fn empty(measures: usize, rows: usize) -> Self {
        Self {
            measures: vec![vec![Number::Missing; rows]; measures],
            end: vec![f64::NAN; rows],
            errors: vec![None; rows],
            warned: Warned::default(),
        }
    }

    pub(crate) fn put(&mut self, row: usize, outcome: RunResult) {
        self.end[row] = outcome.end;
        match outcome.result {
            Ok(values) => self.measures.iter_mut().zip(values).for_each(|(column, x)| column[row] = x),
            Err(error) => self.errors[row] = Some(error),
        }
    }
}

/// The method for the FMUs, as in the definition; by default, each FMU that can step itself does.
fn method(definition: &Definition, fmus: &[(String, Fmu)]) -> Method {
    let steps = |fmu: &Fmu| fmu.description().co_simulation.is_some();
    let stepping = match definition.interface {
        Some(Interface::CoSimulation) => return Method::default(),
        None if fmus.iter().all(|(_, fmu)| steps(fmu)) => return Method::default(),
        None => fmus.iter().filter(|(_, fmu)| steps(fmu)).map(|(name, _)| name.clone()).collect(),
        Some(Interface::ModelExchange) => definition.stepping.clone(),
    };
    let solver = match (definition.solver, definition.rtol) {
        (Some(SolverName::Rk4), _) => Solver::Rk4,
        (_, Some(rtol)) => Solver::Dopri { rtol },
        (_, None) => Solver::default(),
    };
    Method::ModelExchange(Integration { solver, stepping, ..Integration::default() })
}

/// The position of a name in a list, added if it is new.
fn place(names: &mut Vec<String>, name: &str) -> usize {
    names.iter().position(|n| n == name).unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    })
}

fn of(
    measure: &MeasureDefinition,
    settings: &Settings,
    recorded: &mut Vec<String>,
    known: &dyn Fn(&str) -> bool,
) -> Result<(Measure, Sum), String> {
    let sum = Sum::parse(&measure.of, known).map_err(|cause| format!("of = {cause}"))?;
    let wrap = measure.wrap.as_ref().map(period).transpose()?;
    let signal = Signal::new(&sum, wrap, |name| place(recorded, name));
    Ok((Measure::new(measure, signal, settings)?, sum))
}

/// Runs one row after another.
pub struct Runner {
    plan: Plan,
    worker: Worker,
    variables: Vec<RunVariable>,
    states: Vec<Reading>,
    reuse: bool,
    /// No run yet.
    fresh: bool,
}

impl Runner {
    /// Whether the instances of a run are reset for the next; otherwise each run has new ones.
    pub fn reuse(&mut self, reuse: bool) {
        self.reuse = reuse;
    }

    /// Whether the FMUs are asked for warnings in the next run.
    pub(crate) fn hear(&mut self, hears: bool) {
        self.worker.hear(hears);
    }

    /// The first warning of the last run, in one line, if the FMUs are asked for them.
    pub(crate) fn warning(&self) -> Option<String> {
        let text = self.worker.warnings().into_iter().next()?;
        Some(printable(&text.split_whitespace().collect::<Vec<_>>().join(" ")).into_owned())
    }

    /// Runs with a value for each variable. `trace` receives the time and the traced variables at every communication point.
    pub fn run(
        &mut self,
        values: &[Number],
        trace: &mut dyn FnMut(f64, &mut dyn Iterator<Item = Number>),
    ) -> RunResult {
        let Self { plan, worker, variables, states, .. } = self;
        let Shared { measures, trace: traced, .. } = &*plan.0;
        let mut end = f64::NAN;
        states.clear();
        states.resize_with(measures.len(), Measure::begin);
        let set = variables.iter().zip(values).flat_map(|(v, x)| v.targets.iter().map(|target| (target, *x)));
        let renewed = if self.reuse || self.fresh { Ok(()) } else { worker.renew() };
        self.fresh = false;
        let ended = renewed.and_then(|()| {
            worker.run(set, |t, row| {
                end = t;
                measures.iter().zip(states.iter_mut()).for_each(|(measure, state)| measure.take(state, t, row));
                if !traced.is_empty() {
                    trace(t, &mut traced.iter().map(|column| row[*column]));
                }
                ControlFlow::Continue(())
            })
        });
        let result = ended.map_err(|error| error.to_string()).and_then(|_| plan.measured(states));
        RunResult { result, end }
    }
}

#[cfg(test)]
mod tests {
    use super::last_columns;

    #[test]
    fn the_last_columns_step_aside() {
        assert_eq!(last_columns(|_| false), ["end", "error"]);
        assert_eq!(last_columns(|name| name == "error"), ["end", "run.error"]);
        assert_eq!(last_columns(|name| ["end", "run.end"].contains(&name)), ["run.run.end", "error"]);
    }
}
