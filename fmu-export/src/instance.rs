//! An instance of a model for an importer, without C: names, times, saved states, messages.

use crate::clocks::Clocks;
use crate::exchange::MAX_ITERATIONS;
use crate::habit::Habit;
use crate::inside::IntermediateUpdates;
use crate::lifecycle::{Standard, State};
use crate::log::Log;
use crate::origin::Origin;
use crate::sensitivity::Scratch;
use crate::snapshot::{Experiment, Snapshot};
use crate::{blob, message, registry};
use fmu_core::capability::{Eventful, ToEvent};
use fmu_core::idle::Watch;
use fmu_core::log::WARNING;
use fmu_core::log::{Said, Warnings};
use fmu_core::resource::Shelf;
use fmu_core::saved::{Saving, Storing};
use fmu_core::{Elapsed, Exported, Fault, Interface, Model, Outcome, Range, SampleGrid, Step};
use std::ffi::CString;

/// Why a call failed.
#[derive(Debug)]
pub enum Refusal {
    /// Status Error: the instance enters the Error state.
    Error(Fault),
    /// Status Discard: nothing changes.
    Discard(Fault),
}

impl From<Fault> for Refusal {
    fn from(fault: Fault) -> Self {
        Self::Error(fault)
    }
}

/// The results of a communication step in addition to its status (FMI 3.0).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepResult {
    /// The importer must enter Event Mode.
    pub event: bool,
    /// The step ended before the next communication point.
    pub early: bool,
    /// The model has ended the simulation.
    pub terminate: bool,
}

/// One instance. Its functions assume that the lifecycle allows them; the gate checks that.
#[expect(clippy::struct_excessive_bools, reason = "independent facts")]
pub struct Instance<E: Exported> {
    /// The standard that it was instantiated with.
    pub standard: Standard,
    /// Name given by the importer.
    pub name: String,
    /// The logger.
    pub log: Log,
    /// Everything that a step, a set or a reset changes.
    pub current: Snapshot<E::Model>,
    /// The importer takes steps that end early (FMI 3.0).
    pub early_return: bool,
    /// A reference can stand for several values: only in FMI 3.0, and only if the model has an array.
    pub(crate) arrays: bool,
    /// Indices of the rows of the scalar states.
    pub(crate) states: Box<[usize]>,
    /// Ranges of the states.
    pub(crate) ranges: Box<[Range]>,
    /// Room for the derivatives and the indicators.
    pub(crate) values: Box<[f64]>,
    /// The outputs are outdated: they belong to another instant (Model Exchange only).
    pub(crate) stale: bool,
    /// Memory for derivatives of the equations.
    pub(crate) scratch: Option<Box<Scratch<E::Model>>>,
    /// The texts that the last getter returned.
    pub(crate) texts: Vec<CString>,
    /// The resources that the model loaded, for states from bytes.
    pub(crate) shelf: Shelf,
    /// The model as it was instantiated, for a reset.
    pub(crate) origin: Origin<E::Model>,
    /// The properties of the clocks, for a model with clocks.
    pub(crate) clocks: Option<Box<Clocks>>,
    /// Requests of the importer inside communication steps.
    pub(crate) inside: Option<Box<IntermediateUpdates<E::Model>>>,
    /// Keys of the warnings of the last second, and the times of their messages.
    warned: Vec<(&'static str, f64)>,
    /// The importer's habits already reported, one bit each.
    forgiven: u8,
    /// The first step, or continuous time, has begun.
    pub(crate) begun: bool,
    /// Values that were set and have no effect.
    watch: Watch,
    starts: Starts,
}

/// Information about the start values of a run.
#[derive(Default)]
struct Starts {
    /// Whether the values after a reset pass [`Snapshot::check`]: determined at the first reset.
    pass: Option<bool>,
    /// They come from such a reset and from setters, which check each value.
    judged: bool,
}

impl<E: Exported> Instance<E> {
    /// A fresh instance of the model `current`.
    pub fn new(standard: Standard, name: String, log: Log, current: Snapshot<E::Model>) -> Self {
        let table = E::Model::TABLE;
        let arrays = standard == Standard::Fmi3
            && table.indices().any(|i| table.locate(i).is_some_and(|(_, meta, _)| meta.dimension.is_some()));
        let info = E::Model::INFO;
        log.event(|| format!("{name}: instance of {} {}", info.name, info.version));
        // A state without a row has no reference; `fmu build` refuses such a model.
        let states = E::CAN.rows().unwrap_or_default().into_boxed_slice();
        let range = |&row: &usize| table.locate(row).map_or(Range::ALL, |(_, meta, _)| meta.range);
        Self {
            standard,
            name,
            log,
            current,
            early_return: false,
            arrays,
            ranges: states.iter().map(range).collect(),
            states,
            values: vec![0.0; E::CAN.scalars() + E::CAN.indicators().len()].into(),
            stale: false,
            scratch: None,
            texts: Vec::new(),
            shelf: Shelf::default(),
            origin: Origin::Default,
            inside: None,
            clocks: Clocks::of::<E>(),
            warned: Vec::new(),
            forgiven: 0,
            begun: false,
            watch: Watch::default(),
            starts: Starts::default(),
        }
    }

    /// Stores start and stop time.
    ///
    /// # Errors
    /// As [`Experiment::new`].
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), Fault> {
        self.current.experiment = Some(Experiment::new(start, stop)?);
        (self.current.end, self.current.settled, self.current.completed) = (start, start, start);
        Ok(())
    }

    /// Enters initialization.
    ///
    /// # Errors
    /// No experiment was set up (FMI 2.0.5, 4.2.4: `fmi2SetupExperiment` comes first).
    pub fn enter_initialization(&mut self) -> Result<(), Fault> {
        self.current.experiment.map(|_| ()).ok_or_else(|| Fault::new("fmi2SetupExperiment must be called before it"))
    }

    /// Ends initialization: checks the parameters together, and computes state and outputs. If the importer handles events, the
    /// first event begins.
    ///
    /// # Errors
    /// As [`Snapshot::check`] and [`Model::validate`].
    pub fn exit_initialization(&mut self) -> Result<(), Fault> {
        // Of many runs, only the first is checked completely: the check takes longer than everything else between reset and
        // first step. Sizes and clocks must be consistent.
        if !self.starts.judged || const { E::CAN.resizable.is_some() || E::CAN.clocked.is_some() } {
            // NaN in an output may follow from parameters that the model refuses with a reason.
            self.current.check().map_err(|fault| self.current.judge(&E::CAN).err().unwrap_or(fault))?;
        }
        self.current.judge(&E::CAN)?;
        if self.current.dirty || !self.current.stated {
            self.current.initialize();
        }
        self.log.event(|| message::start(&self.name, &mut self.current, self.origin.starts(&E::CAN)));
        if const { E::CAN.clocked.is_some() } {
            self.plan_ticks(true)?;
        }
        if self.current.life.handles_events() { self.enter_event() } else { Ok(()) }
    }

    /// Ends the simulation.
    pub fn terminate(&mut self) {
        self.log.event(|| format!("{}: terminated {}", self.name, message::at(self.current.end)));
    }

    /// Restores the state after instantiation; name and logger stay. A model that cannot be copied is made again.
    ///
    /// # Errors
    /// Such a model cannot load its resources again.
    pub fn reset(&mut self) -> Result<(), Fault> {
        let fresh = self.origin.fresh(&E::CAN)?;
        self.current = Snapshot::of(self.current.life.interface(), fresh);
        self.starts.judged = *self.starts.pass.get_or_insert_with(|| self.current.check().is_ok());
        self.stale = false;
        if const { E::CAN.resizable.is_some() } {
            self.scratch = None;
            self.refresh();
        }
        self.warned.clear();
        self.begun = false;
        self.watch = Watch::default();
        self.log.event(|| format!("{}: reset", self.name));
        Ok(())
    }

    /// One communication step from `t` to `t + h`. Tunable parameters take effect here, all together.
    ///
    /// # Errors
    /// Times that do not continue the simulation, or inconsistent tunable parameters (nothing has changed); or an error of the
    /// model.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<StepResult, Fault> {
        let next = self.begin_step(t, h)?;
        self.advance(t, h, next)
    }

    /// Checks a communication step and the tunable parameters; returns the time after the step.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    pub(crate) fn begin_step(&mut self, t: f64, h: f64) -> Result<Elapsed, Fault> {
        let current = &mut self.current;
        let next = current.elapsed.plus(h);
        current.check_step(t, h, next)?;
        if current.dirty {
            current.adopt(&E::CAN)?;
            current.dirty = false;
        }
        if !self.begun {
            self.warn_of_unfed();
        }
        Ok(next)
    }

    /// A checked communication step, or a part of it.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    pub(crate) fn advance(&mut self, t: f64, h: f64, next: Elapsed) -> Result<StepResult, Fault> {
        let current = &mut self.current;
        let handles_events = current.life.handles_events();
        if E::CAN.event_mode() && E::CAN.clocked.is_none() && (handles_events || self.early_return) {
            return match E::CAN.to_event {
                Some(to_event) => self.step_to_stop(to_event, t, h),
                None => self.step_to_event(t, h),
            };
        }
        if E::CAN.continuous.is_some() && !current.slopes.is_empty() {
            if let Err(fault) = self.step_on_slopes(h) {
                return self.end_or_fail(fault, t, h);
            }
        } else {
            if let Err(fault) = current.block.model.advance(&Step { start: current.elapsed, h }) {
                return self.end_or_fail(fault, t, h);
            }
            current.block.model.output(next, &mut current.block.out);
        }
        self.current.elapsed = next;
        self.current.end = t + h;
        self.warn();
        Ok(StepResult::default())
    }

    /// The result of an incomplete step: the model ends the simulation (FMI 2.0.5, 4.2.2 and 4.2.3; FMI 3.0.2, 4.2.1), or the
    /// step fails. Without early return, FMI 3.0 cannot report a time before the end of the step.
    #[cold]
    fn end_or_fail(&mut self, fault: Fault, t: f64, h: f64) -> Result<StepResult, Fault> {
        let Some(at) = fault.ends() else { return Err(fault) };
        let current = &mut self.current;
        let end = current.elapsed.plus(h);
        let inside = end.since(at) > f64::EPSILON * h;
        let early = inside && (self.standard == Standard::Fmi2 || (E::CAN.event_mode() && self.early_return));
        (current.elapsed, current.end) =
            if early { (at, current.experiment.map_or(0.0, |e| e.start) + at.seconds()) } else { (end, t + h) };
        current.life.end();
        current.block.model.output(current.elapsed, &mut current.block.out);
        self.log.event(|| format!("{}: {fault}", self.name));
        self.warn();
        Ok(StepResult { early, terminate: true, ..StepResult::default() })
    }

    /// A step of a sampled model for an importer that handles its events, or takes steps that end early. Every sample reads the
    /// inputs set at its instant or, if none were set, the last ones.
    fn step_to_event(&mut self, t: f64, h: f64) -> Result<StepResult, Fault> {
        let Some(samples) = &E::CAN.samples else { return Ok(StepResult::default()) };
        let event_mode = self.current.life.handles_events();
        let (start, end) = (self.current.elapsed, self.current.elapsed.plus(h));
        let model = &mut self.current.block.model;
        (samples.bounded)(model, if self.early_return { start } else { end })?;
        let grid = SampleGrid { period: (samples.period)(model) };
        let mut stepped = StepResult::default();
        loop {
            let k = (samples.samples)(model);
            if !grid.reached(k, end) {
                break;
            }
            let inside = grid.passed(k, end);
            if inside && (grid.reached(k, start) || !self.early_return) {
                (samples.show)(model);
                (samples.sample)(model)?;
                continue;
            }
            if !event_mode {
                (samples.show)(model);
            }
            (stepped.event, stepped.early) = (event_mode, inside);
            break;
        }
        let current = &mut self.current;
        if stepped.early {
            let k = (samples.samples)(&current.block.model);
            current.elapsed = fmu_core::Elapsed::periods(k, grid.period);
            current.end = grid.instant(k, current.experiment.map_or(0.0, |e| e.start));
        } else {
            (current.elapsed, current.end) = (end, t + h);
        }
        current.block.model.output(current.elapsed, &mut current.block.out);
        self.warn();
        Ok(stepped)
    }

    /// Warns, if warnings are enabled and this key was not reported in the last second.
    pub(crate) fn warn_of(&mut self, key: &'static str, message: impl FnOnce() -> String) {
        let now = self.current.elapsed.seconds();
        self.warned.retain(|&(_, at)| (now - 1.0..=now).contains(&at));
        let heard = self.log.hears_model(&[]);
        if heard && !self.warned.iter().any(|&(other, _)| other == key) {
            self.warned.push((key, now));
            self.log.said(WARNING, &[], &format!("{}: {}: {}", self.name, message::at(self.current.end), message()));
        }
    }

    /// Accepts a call that the standard forbids, with a warning the first time.
    #[cold]
    pub(crate) fn forgive(&mut self, habit: Habit) {
        let bit = 1 << habit as u8;
        if self.forgiven & bit == 0 && self.log.hears_model(&[]) {
            self.forgiven |= bit;
            let Self { name, current, .. } = &*self;
            self.log.said(WARNING, &[], &format!("{name}: {}: {}", message::at(current.end), habit.tell()));
        }
    }

    /// A step of a model with states for an importer that handles its events, or takes steps that end early. Events that the
    /// importer does not handle are handled as in [`Model::advance`].
    fn step_to_stop(&mut self, to_event: ToEvent<E::Model>, t: f64, h: f64) -> Result<StepResult, Fault> {
        let Some(events) = &E::CAN.events else { return Ok(StepResult::default()) };
        let event_mode = self.current.life.handles_events();
        let (mut start, end) = (self.current.elapsed, self.current.elapsed.plus(h));
        let mut stepped = StepResult::default();
        let stop = loop {
            let rest = if start == self.current.elapsed { h } else { end.since(start) };
            let stop = match to_event(&mut self.current.block.model, &Step { start, h: rest }) {
                Ok(stop) => stop,
                Err(fault) => return self.end_or_fail(fault, t, h),
            };
            let inside = stop.event && end.since(stop.at) > f64::EPSILON * h;
            if !inside || self.early_return {
                (stepped.event, stepped.early) = (stop.event && event_mode, inside);
                break stop;
            }
            // The next part of the step begins with this event.
            start = stop.at;
        };
        let current = &mut self.current;
        if !event_mode {
            (events.begin)(&mut current.block.model, stop.at);
            if stop.settles
                && !stepped.early
                && let Err(fault) = settle(events, &mut current.block.model, stop.at)
            {
                return self.end_or_fail(fault, t, h);
            }
        }
        let current = &mut self.current;
        (current.elapsed, current.end) = if stepped.early {
            (stop.at, current.experiment.map_or(0.0, |e| e.start) + stop.at.seconds())
        } else {
            (end, t + h)
        };
        current.block.model.output(current.elapsed, &mut current.block.out);
        self.warn();
        Ok(stepped)
    }

    /// Lets the model warn, if warnings are enabled.
    #[inline]
    pub(crate) fn warn(&mut self) {
        let Some(warn) = E::CAN.warn else { return };
        let own = E::Model::INFO.categories;
        if !self.log.hears_model(own) {
            return;
        }
        let Self { current, log, warned, watch, name, .. } = self;
        let (now, end) = (current.elapsed.seconds(), current.end);
        if log.hears(WARNING, own) {
            watch.look(&mut current.block, |said| {
                log.said(WARNING, own, &format!("{name}: {}: {said}", message::at(end)));
            });
        }
        warned.retain(|&(_, at)| (now - 1.0..=now).contains(&at));
        let mut sink = |(category, key, message): Said<'_>| {
            if log.hears(category, own) && !warned.iter().any(|&(other, _)| other == key) {
                warned.push((key, now));
                log.said(category, own, &format!("{name}: {}: {}", message::at(current.end), message()));
            }
        };
        warn(&current.block.model, &mut Warnings::to(&mut sink));
    }

    /// Brings the outputs up to date with the values set: before the first step or event by a new initialization; later a
    /// getter returns the values of the last step, and in Model Exchange those of the present states, inputs and time.
    #[inline]
    pub(crate) fn refresh(&mut self) {
        if self.current.dirty && matches!(self.current.life.state(), State::Instantiated | State::Initialization) {
            self.current.initialize();
        }
        self.observe();
    }

    /// Computes the outputs if they are outdated.
    #[inline]
    fn observe(&mut self) {
        if self.stale {
            let observe = match &E::CAN.continuous {
                Some(continuous) => continuous.observe,
                None => E::Model::output,
            };
            let block = &mut self.current.block;
            observe(&block.model, self.current.elapsed, &mut block.out);
            self.stale = false;
        }
    }

    /// Saves the state under `handle`, or under a new handle if it is 0; returns the handle.
    ///
    /// # Errors
    /// The handle is unknown.
    pub fn save(&mut self, handle: usize) -> Result<usize, Fault> {
        let saving = Self::saving()?;
        self.observe();
        if handle == 0 {
            return Ok(registry::keep(self.current.copy(saving)));
        }
        registry::with(handle, |state: &mut Snapshot<E::Model>| {
            state.overwrite(&self.current, saving);
            Ok(handle)
        })
    }

    /// Restores a saved state of this or another instance of the model.
    ///
    /// # Errors
    /// The handle is unknown, or the state is of an instance for another interface.
    pub fn restore(&mut self, handle: usize) -> Result<(), Fault> {
        let saving = Self::saving()?;
        registry::with(handle, |state| {
            let (theirs, ours) = (state.life.interface(), self.current.life.interface());
            if theirs != ours {
                return Err(message::interface(theirs, ours));
            }
            self.current.overwrite(state, saving);
            self.starts.judged = false;
            Ok(())
        })?;
        self.stale = false;
        if const { E::CAN.resizable.is_some() } {
            // Its arrays may have other sizes.
            self.scratch = None;
        }
        Ok(())
    }

    /// Creates a state from bytes and returns its handle.
    ///
    /// # Errors
    /// As [`blob::read`].
    pub fn deserialize(&self, bytes: &[u8]) -> Result<usize, Fault> {
        let storing = Self::storing()?;
        self.shelf.attach(|| blob::read(bytes, storing)).map(registry::keep)
    }

    /// The functions that turn a state into bytes, and bytes into a state.
    ///
    /// # Errors
    /// The model has none.
    pub(crate) fn storing() -> Result<&'static Storing<E::Model>, Fault> {
        const { &E::CAN.stored }.as_ref().ok_or_else(|| message::lacks("canSerializeFMUState", "stored as bytes"))
    }

    /// The functions that save a state.
    fn saving() -> Result<&'static Saving<E::Model>, Fault> {
        const { &E::CAN.saved }.as_ref().ok_or_else(|| message::lacks("canGetAndSetFMUState", "saved"))
    }

    /// Whether the importer integrates.
    #[inline]
    pub(crate) fn exchanges(&self) -> bool {
        E::CAN.model_exchange() && self.current.life.interface() == Interface::ModelExchange
    }
}

/// Handles an event at `now` until it needs no further update.
fn settle<M: Model>(events: &Eventful<M>, model: &mut M, now: Elapsed) -> Result<(), Fault> {
    for _ in 0..MAX_ITERATIONS {
        match (events.event)(model, now)? {
            Outcome { terminate: true, .. } => return Err(Fault::end(now)),
            Outcome { again: false, .. } => return Ok(()),
            _ => {}
        }
    }
    Err(Fault::new(format!("the event at {} s after the start does not settle", now.seconds())))
}
