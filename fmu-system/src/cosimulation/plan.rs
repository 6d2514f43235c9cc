//! A system prepared for many runs.
//!
//! A [`SystemPlan`] contains the data shared by all runs and threads. A [`Worker`] owns its instances and runs one setting after
//! another: it resets its instances if possible and creates new ones after an error.
//!
//! ```no_run
//! # fn main() -> Result<(), fmu_import::Error> {
//! # let system = fmu_system::cosimulation::System::default();
//! # let settings = fmu_system::cosimulation::Settings { start: 0.0, stop: 1.0, step: 1e-3, sequential: false };
//! let plan = std::sync::Arc::new(system.into_plan(&settings)?);
//! let resistance = plan.target("plant.motor.R_s")?;
//! let mut worker = plan.worker()?;
//! for r in [2.9, 3.0, 3.1] {
//!     let mut peak = 0.0_f64;
//!     worker.run([(&resistance, r)], |_, values| {
//!         peak = peak.max(values[0].real());
//!         std::ops::ControlFlow::Continue(())
//!     })?;
//!     println!("{r}: {peak}");
//! }
//! # Ok(()) }
//! ```

use super::exchange::Exchange;
use super::grid::{CoarseSteps, Grid, Settings};
use super::method::Method;
use super::parts::{Part, Parts, Port};
use super::point::Ended;
use super::point::{take_messages, with_name};
use super::recording::{Column, Recording};
use super::run::simulate;
use super::schedule::{Schedule, Sine};
use super::system::System;
use super::wiring::{Change, Outlet, Record, Source, Wiring};
use fmu_import::{Error, Fmu, Instance, Kind, Logging, Number, Status, Values};
use model_description::{BaseType, Causality, Conversion, Interface, Variability, parse_number};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Data shared by all runs of a system: FMUs, connections, recorded variables, times, and set values.
pub struct SystemPlan {
    method: Method,
    parts: Parts,
    /// The FMU of each part, for new instances.
    live: Vec<Arc<Live>>,
    wiring: Wiring,
    set: Vec<(Port, Values)>,
    records: Vec<Record>,
    exchange: Exchange,
    grid: Grid,
    columns: Vec<Column>,
}

/// An FMU that is opened again after the status Fatal.
struct Live {
    fmu: Mutex<Fmu>,
    /// Number of times it was opened again.
    generation: AtomicU32,
}

impl Live {
    fn fmu(&self) -> MutexGuard<'_, Fmu> {
        self.fmu.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn generation(&self) -> u32 {
        self.generation.load(Ordering::Acquire)
    }
}

/// A variable of a plan that each run sets.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanTarget {
    port: Port,
    written: String,
    /// Conversion of a number before it is set.
    conversion: Option<Conversion>,
}

impl PlanTarget {
    /// `instance.variable`.
    pub fn name(&self) -> &str {
        &self.written
    }

    /// This target, set through a conversion.
    #[must_use]
    pub fn through(self, conversion: Option<Conversion>) -> Self {
        Self { conversion, ..self }
    }
}

impl System {
    /// Prepares the system for many runs from start to stop.
    ///
    /// # Errors
    /// The settings are invalid.
    pub fn into_plan(mut self, settings: &Settings) -> Result<SystemPlan, Error> {
        let grid = self.grid(settings)?;
        let exchange = Exchange::new(self.instances.len(), &self.wiring, &self.records, [].iter());
        let columns = self.columns;
        let live = |fmu: &Fmu| Arc::new(Live { fmu: Mutex::new(fmu.clone()), generation: AtomicU32::new(0) });
        let live = self.parts.0.iter().map(|part| live(&part.fmu)).collect();
        Ok(SystemPlan {
            live,
            exchange,
            grid,
            columns,
            method: self.method,
            parts: self.parts,
            wiring: self.wiring,
            set: self.set,
            records: self.records,
        })
    }
}

impl SystemPlan {
    /// A variable to set in runs, written `instance.variable`.
    ///
    /// # Errors
    /// The variable does not exist, is not a number, cannot be set, or is fed.
    pub fn target(&self, written: &str) -> Result<PlanTarget, Error> {
        let port = self.parts.settable(written)?;
        if self.wiring.feeds(port.instance, &port.name) {
            return Err(Error::usage(written, "is fed by a connection or a schedule: remove that, or do not vary it"));
        }
        Ok(PlanTarget { port, written: written.into(), conversion: None })
    }

    /// Units of a target and, for an enumeration, the names of its values.
    pub fn column(&self, target: &PlanTarget) -> Column {
        self.parts.column(&target.port, target.name())
    }

    /// Converts user input for a target to a number: `3.3`, `true`, or a name of an enumeration.
    ///
    /// # Errors
    /// The text is not a value of the target's type.
    pub fn number(&self, target: &PlanTarget, text: &str) -> Result<Number, Error> {
        if target.conversion.is_some() {
            let number = parse_number(text).map(Number::Real);
            return number.ok_or_else(|| Error::usage(target.name(), "takes a number, without a unit"));
        }
        let Port { instance, name, .. } = &target.port;
        let part = &self.parts.0[*instance];
        let values = Values::read(text, self.parts.variable(*instance, name)?, part.description());
        let values = values.map_err(|cause| Error::usage(&part.name, cause))?;
        Some(values.one(0))
            .filter(|x| *x != Number::Missing)
            .ok_or_else(|| Error::usage(target.name(), "takes a number"))
    }

    /// The recorded variables, without values.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// A plan for this system and these times that records other variables.
    ///
    /// # Errors
    /// The variable does not exist or is not a number.
    pub fn recording(&self, outlets: &[Outlet]) -> Result<Self, Error> {
        let mut columns = Vec::new();
        let mut records = Vec::new();
        for outlet in outlets {
            let port = self.parts.scalar(&outlet.port)?;
            columns.push(self.parts.outlet(&port, outlet));
            records.push(Record { change: self.parts.change(&port, outlet)?, port });
        }
        Ok(Self {
            method: self.method.clone(),
            parts: self.parts.clone(),
            live: self.live.clone(),
            wiring: self.wiring.clone(),
            set: self.set.clone(),
            exchange: Exchange::new(self.parts.0.len(), &self.wiring, &records, [].iter()),
            records,
            grid: self.grid,
            columns,
        })
    }

    /// This plan with other times, and with a sine added to the value of an input, written `instance.variable`, that no connection
    /// feeds, or of a tunable parameter. The run begins with the steps of the `approach`; `settings` has those after it.
    ///
    /// # Errors
    /// The settings are invalid; the variable does not exist, is not a real number, is not an input, or is connected.
    pub fn excited(
        &self,
        written: &str,
        sine: Sine,
        settings: &Settings,
        approach: CoarseSteps,
    ) -> Result<Self, Error> {
        let wrong = |cause: String| Error::usage(written, cause);
        let target = self.parts.scalar(written)?;
        let variable = self.parts.variable(target.instance, &target.name)?;
        let tunable = variable.causality == Causality::Parameter && variable.variability == Variability::Tunable;
        if !target.base.is_float() || !(variable.causality == Causality::Input || tunable) {
            return Err(wrong("cannot follow a sine: it is not a real input or tunable parameter".into()));
        }
        let mut wiring = self.wiring.clone();
        if let Some(feed) = wiring.feeds.iter_mut().find(|feed| feed.target == target) {
            let Source::Schedule(schedule) = &feed.source else {
                return Err(wrong("is connected: only an input that no output feeds can follow a sine".into()));
            };
            feed.source = Source::Schedule(schedule.clone().with_sine(sine));
        } else {
            let set = self.set.iter().rev().find(|(port, _)| *port == target).map(|(_, values)| values.one(0).real());
            let start = || Values::start(variable, self.parts.0[target.instance].description());
            let value = set.map_or_else(|| start().map(|values| values.one(0).real()), Ok).map_err(wrong)?;
            let continuous = variable.variability == Variability::Continuous;
            let schedule = Schedule::steps(vec![(settings.start, value)]).map_err(wrong)?.with_sine(sine);
            wiring.add(target, Source::Schedule(schedule), continuous);
        }
        let mut grid = settings.grid().map_err(|cause| Error::usage("settings", cause))?;
        (grid.tolerance, grid.meets) = (self.grid.tolerance, self.grid.meets);
        let start = settings.start - f64::from(approach.steps) * approach.step;
        Ok(Self {
            method: self.method.clone(),
            parts: self.parts.clone(),
            live: self.live.clone(),
            set: self.set.clone(),
            exchange: Exchange::new(self.parts.0.len(), &wiring, &self.records, [].iter()),
            wiring,
            records: self.records.clone(),
            grid: if approach.steps > 0 { grid.after_approach(approach, start) } else { grid },
            columns: self.columns.clone(),
        })
    }

    /// Size of the values of an input, written `instance.variable`: the maximum of its nominal value (1 by default) and the
    /// values set or fed over time.
    ///
    /// # Errors
    /// The variable does not exist or is not a number.
    pub fn magnitude(&self, written: &str) -> Result<f64, Error> {
        let target = self.parts.scalar(written)?;
        let variable = self.parts.variable(target.instance, &target.name)?;
        let set = self.set.iter().rev().find(|(port, _)| *port == target).map(|(_, values)| values.one(0).real());
        let start = Values::start(variable, self.parts.0[target.instance].description()).map(|x| x.one(0).real());
        let fed = self.wiring.feeds.iter().find_map(|feed| match &feed.source {
            Source::Schedule(schedule) if feed.target == target => Some(schedule.magnitude()),
            _ => None,
        });
        let value = fed.or(set).or(start.ok()).filter(|x| x.is_finite());
        Ok(value.map_or(0.0, f64::abs).max(variable.nominal.unwrap_or(1.0)))
    }

    /// Whether every FMU follows a change of the communication step during a run, and whether it takes any step: none has a
    /// `fixedInternalStepSize`.
    pub fn varies_steps(&self) -> (bool, bool) {
        let stepping = self.parts.0.iter().filter(|part| part.kind != Kind::ModelExchange);
        let interfaces = stepping.filter_map(|part| part.description().co_simulation.clone());
        interfaces.fold((true, true), |(varies, any), of| {
            let fixed = of.attribute("fixedInternalStepSize").is_some();
            (varies && of.flag("canHandleVariableCommunicationStepSize"), any && !fixed)
        })
    }

    /// The system together with a copy of it, without connections between the two; the system's columns come first, then the
    /// copy's. FMUs for Model Exchange of both are integrated in the same steps. The results for two close values then differ
    /// only because of the values, and not because of the solver's choice of steps.
    #[must_use]
    pub fn with_copy(&self) -> Self {
        let count = self.parts.0.len();
        let both = |records: &[Record]| {
            records.iter().cloned().chain(records.iter().map(|r| r.shifted(count))).collect::<Vec<_>>()
        };
        let twice = |columns: &[Column]| columns.iter().chain(columns).cloned().collect();
        let (wiring, records) = (self.wiring.with_copy(count), both(&self.records));
        let set = self.set.iter().map(|(port, values)| (port.shifted(count), values.clone()));
        Self {
            method: self.method.clone(),
            parts: Parts(self.parts.0.iter().chain(&self.parts.0).cloned().collect()),
            live: self.live.iter().chain(&self.live).cloned().collect(),
            set: self.set.iter().cloned().chain(set).collect(),
            exchange: Exchange::new(2 * count, &wiring, &records, [].iter()),
            wiring,
            records,
            grid: self.grid,
            columns: twice(&self.columns),
        }
    }

    /// The variable of the copy in [`with_copy`](Self::with_copy) that a target of this plan is.
    #[must_use]
    pub fn in_copy(&self, target: &PlanTarget) -> PlanTarget {
        PlanTarget { port: target.port.shifted(self.parts.0.len()), ..target.clone() }
    }

    /// Whether the master integrates an FMU (Model Exchange).
    pub fn integrates(&self) -> bool {
        self.parts.0.iter().any(|part| part.kind == Kind::ModelExchange)
    }

    /// Start, stop and step.
    pub fn settings(&self) -> &Settings {
        self.grid.settings()
    }

    /// The name of an FMU, if any, that allows only one instance per process; there is then one worker.
    pub fn only_one_instance(&self) -> Option<&str> {
        let flag = |interface: &Interface| interface.flag("canBeInstantiatedOnlyOncePerProcess");
        let interface = |part: &Part| match part.kind {
            Kind::CoSimulation { .. } => part.description().co_simulation.clone(),
            Kind::ModelExchange => part.description().model_exchange.clone(),
        };
        let only_one = |part: &&Part| interface(part).iter().any(flag);
        self.parts.0.iter().find(only_one).map(|part| part.name.as_str())
    }

    /// Creates a worker that runs this plan on one thread.
    ///
    /// # Errors
    /// An FMU refuses an instance.
    pub fn worker(self: &Arc<Self>) -> Result<Worker, Error> {
        let mut worker = Worker {
            plan: self.clone(),
            instances: Vec::new(),
            generations: Vec::new(),
            exchange: self.exchange.clone(),
            row: Vec::new(),
            used: false,
            hears: false,
            heard: false,
        };
        worker.renew()?;
        Ok(worker)
    }
}

/// Runs a plan again and again.
pub struct Worker {
    plan: Arc<SystemPlan>,
    /// Empty after an error.
    instances: Vec<Instance>,
    /// Generation of the FMU of each instance.
    generations: Vec<u32>,
    exchange: Exchange,
    row: Vec<Number>,
    used: bool,
    /// Whether the FMUs are asked for warnings in the next run, and whether they were in the last one.
    hears: bool,
    heard: bool,
}

impl Worker {
    /// The plan that this runs.
    pub fn plan(&self) -> &Arc<SystemPlan> {
        &self.plan
    }

    /// Runs from start to stop with these values in addition to those set in the system. `hook` receives the time and the
    /// recorded values at every communication point, and may end the run. A run does not depend on those before it.
    ///
    /// # Errors
    /// An FMU refuses a value or a call. The next run has new instances.
    pub fn run<'a, N: Into<Number>>(
        &mut self,
        values: impl IntoIterator<Item = (&'a PlanTarget, N)>,
        mut hook: impl FnMut(f64, &[Number]) -> ControlFlow<()>,
    ) -> Result<Ended, Error> {
        self.refresh()?;
        self.used = true;
        let outcome = self.set(values).and_then(|()| {
            let Self { instances, exchange, row, plan, .. } = self;
            simulate(&plan.method, instances, exchange, &plan.grid, row, |point| Ok(hook(point.time, point.values)))
        });
        if outcome.is_err() {
            self.give_up();
        }
        outcome
    }

    /// Runs as [`run`](Self::run), and returns all recorded values.
    ///
    /// # Errors
    /// As for [`run`](Self::run).
    pub fn record<'a>(
        &mut self,
        values: impl IntoIterator<Item = (&'a PlanTarget, Number)>,
    ) -> Result<Recording, Error> {
        let mut recording = Recording::new(self.plan.columns.iter().cloned());
        let ended = self.run(values, |time, values| {
            recording.push(time, values);
            ControlFlow::Continue(())
        })?;
        recording.ended_by = ended.by;
        Ok(recording)
    }

    /// Whether the FMUs are asked for warnings in the next runs. By default they are not, because looking for them can take longer than a
    /// short run.
    pub fn hear(&mut self, hears: bool) {
        self.hears = hears;
    }

    /// The different warnings of the last run, with the names of the instances; none if the FMUs were not asked, because some warn
    /// unasked.
    pub fn warnings(&self) -> Vec<String> {
        let mut all: Vec<String> = Vec::new();
        if self.heard {
            for (name, message) in take_messages(&self.instances) {
                let text = with_name(&name, message.text);
                if message.status == Status::WARNING && !all.contains(&text) {
                    all.push(text);
                }
            }
        }
        all
    }

    /// Creates new instances, for an FMU whose reset is incomplete.
    ///
    /// # Errors
    /// An FMU refuses.
    pub fn renew(&mut self) -> Result<(), Error> {
        // Dropped before the new ones: some FMUs allow only one instance at a time.
        self.instances.clear();
        self.generations.clear();
        for (part, live) in self.plan.parts.0.iter().zip(self.plan.live.iter()) {
            let fmu = live.fmu();
            self.generations.push(live.generation());
            self.instances.push(fmu.instantiate_as(part.kind, &part.name, part.logging == Logging::All)?);
        }
        (self.used, self.heard) = (false, false);
        Ok(())
    }

    /// Instances in their state after instantiation, with the values of the system.
    fn refresh(&mut self) -> Result<(), Error> {
        let Self { plan, instances, generations, .. } = self;
        let mut lost = instances.len() < plan.parts.0.len();
        for ((live, generation), instance) in plan.live.iter().zip(generations.iter()).zip(instances.iter_mut()) {
            if live.generation() != *generation {
                instance.abandon();
                lost = true;
            }
            // Drops the messages of earlier runs.
            drop(instance.take_messages());
        }
        // An FMU that cannot be reset still runs.
        if lost || (self.used && instances.iter_mut().any(|instance| instance.reset().is_err())) {
            self.renew()?;
        }
        // A reset may end it.
        if self.hears || self.heard {
            let mut asked =
                self.plan.parts.0.iter().zip(&mut self.instances).filter(|(part, _)| part.logging != Logging::All);
            if asked.any(|(_, instance)| instance.log_warnings(self.hears).is_err()) {
                self.renew()?;
            } else {
                self.heard = self.hears;
            }
        }
        for (part, instance) in self.plan.parts.0.iter().zip(&mut self.instances) {
            part.configure(instance)?;
        }
        for (port, values) in &self.plan.set {
            self.instances[port.instance].set_at(port.base, port.reference, values)?;
        }
        Ok(())
    }

    fn set<'a, N: Into<Number>>(&mut self, values: impl IntoIterator<Item = (&'a PlanTarget, N)>) -> Result<(), Error> {
        for (PlanTarget { port, written, conversion }, value) in values {
            let (instance, value) = (&mut self.instances[port.instance], value.into());
            let value = conversion.map_or(value, |conversion| Change::Linear(conversion).apply(value));
            let outcome = if port.base == BaseType::Float64 {
                instance.set_reals(&[port.reference], &[value.real()])
            } else {
                let values = Values::from_number(value, port.base);
                let values = values.map_err(|cause| Error::usage(instance.name(), cause));
                values.and_then(|values| instance.set_at(port.base, port.reference, &values))
            };
            outcome.map_err(|error| error.during(&format!("{written} = {value}")))?;
        }
        Ok(())
    }

    /// After an error, no instance is used again; after the status Fatal, no instance of that binary in any worker.
    fn give_up(&mut self) {
        for ((live, generation), instance) in self.plan.live.iter().zip(&self.generations).zip(&self.instances) {
            let mut fmu = live.fmu();
            if instance.is_dead() && live.generation() == *generation {
                // If that fails, new instances of the old binary will report the fault.
                if let Ok(again) = fmu.open_again() {
                    *fmu = again;
                    live.generation.fetch_add(1, Ordering::Release);
                }
            }
        }
        self.instances.clear();
    }
}
