//! Everything that changes in an instance, as one plain value that an FMU state saves.

use crate::binary::make_room;
use crate::clocks::{Tick, ticks};
use crate::lifecycle::{Life, State};
use crate::message;
use fmu_core::saved::Saving;
use fmu_core::{Block, Capabilities, Causality, Elapsed, Fault, Interface, Kind, Meta, Model, Slot, Variability};
use serde::{Deserialize, Serialize};

/// Start and stop time of the importer's experiment in s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Experiment {
    /// Start time.
    pub start: f64,
    /// Stop time, if set by the importer.
    pub stop: Option<f64>,
}

impl Experiment {
    /// Checks the times.
    ///
    /// # Errors
    /// A time is not finite, or the stop time is not after the start time.
    pub fn new(start: f64, stop: Option<f64>) -> Result<Self, Fault> {
        if !start.is_finite() {
            return Err(Fault::value("startTime", start, "any finite number"));
        }
        match stop {
            Some(stop) if !(stop.is_finite() && stop > start) => {
                Err(Fault::value("stopTime", stop, format_args!("finite and greater than startTime = {start}")))
            }
            _ => Ok(Self { start, stop }),
        }
    }
}

/// Whether a derivative of this variable can be set: it is a continuous real input.
pub(crate) fn ramps(meta: &Meta) -> bool {
    meta.causality == Causality::Input
        && meta.variability == Variability::Continuous
        && matches!(meta.kind, Kind::Real(_))
}

/// Calculates parameters, and checks them together.
fn judge<M: Model>(model: &mut M, interface: Interface) -> Result<(), Fault> {
    model.derive();
    model.validate()?;
    model.validate_for(interface)
}

/// Everything but the model and its outputs, as it is stored.
#[derive(Serialize, Deserialize)]
pub(crate) struct Head {
    life: Life,
    experiment: Option<Experiment>,
    elapsed: Elapsed,
    end: f64,
    settled: f64,
    completed: f64,
    stated: bool,
    pending: bool,
    slopes: Vec<(u32, f64)>,
    dirty: bool,
    ticks: Option<Box<[Tick]>>,
}

impl Head {
    /// Adds the model and its outputs.
    pub(crate) fn with<M: Model>(self, block: Block<M>) -> Snapshot<M> {
        let Self { life, experiment, elapsed, end, settled, completed, stated, pending, slopes, dirty, ticks } = self;
        Snapshot { life, experiment, elapsed, end, settled, completed, stated, pending, slopes, dirty, ticks, block }
    }
}

/// Model, outputs, time and state of the lifecycle.
pub struct Snapshot<M: Model> {
    /// State of the lifecycle.
    pub life: Life,
    /// Set by `SetupExperiment` or `EnterInitializationMode`.
    pub experiment: Option<Experiment>,
    /// Time since the start, summed here.
    pub elapsed: Elapsed,
    /// Time as the importer computes it: the end of the last step, `t + h`, or the time set in Model Exchange; before the first
    /// step the start time.
    pub end: f64,
    /// In Model Exchange, time of the last event: no earlier time can be set.
    pub settled: f64,
    /// In Model Exchange, time of the last event or completed step: setting an earlier time discards counts.
    pub completed: f64,
    /// In Initialization Mode, the importer has set the continuous states: they apply unless a start value is set after them.
    pub stated: bool,
    /// Event Mode was entered, and the event has not been done.
    pub pending: bool,
    /// Derivatives of inputs, by index in the table: they apply to the next step (FMI 2.0).
    pub slopes: Vec<(u32, f64)>,
    /// A set call awaits processing by the model: before the start for any variable, afterwards for a tunable parameter.
    pub dirty: bool,
    /// The clocks of the model, if it has any, in the order of the table.
    pub ticks: Option<Box<[Tick]>>,
    /// The model and its outputs.
    pub block: Block<M>,
}

impl<M: Model> Default for Snapshot<M> {
    fn default() -> Self {
        Self::new(Interface::CoSimulation)
    }
}

impl<M: Model> Snapshot<M> {
    /// After instantiation for this interface.
    pub fn new(interface: Interface) -> Self {
        Self::of(interface, Block::default())
    }

    /// Like [`new`](Self::new), for a model that differs from its `Default`.
    pub fn of(interface: Interface, mut block: Block<M>) -> Self {
        make_room(&mut block);
        Self {
            life: Life::new(interface),
            experiment: None,
            elapsed: Elapsed::ZERO,
            end: M::INFO.experiment.start,
            settled: M::INFO.experiment.start,
            completed: M::INFO.experiment.start,
            stated: false,
            pending: false,
            slopes: Vec::new(),
            dirty: true,
            ticks: ticks::<M>(),
            block,
        }
    }
}

impl<M: Model> Snapshot<M> {
    /// All but the model and its outputs.
    pub(crate) fn head(&self) -> Head {
        let Self { life, experiment, elapsed, end, settled, completed, stated, pending, dirty, .. } = *self;
        let (slopes, ticks) = (self.slopes.clone(), self.ticks.clone());
        Head { life, experiment, elapsed, end, settled, completed, stated, pending, slopes, dirty, ticks }
    }

    /// A copy.
    pub fn copy(&self, saving: &Saving<M>) -> Self {
        let block = saving.block(&self.block);
        Self { block, slopes: self.slopes.clone(), ticks: self.ticks.clone(), ..*self }
    }

    /// Overwrites `self` with a copy of `source`, and reuses its memory: for a plain model, and for one that implements
    /// `clone_from`, nothing is allocated.
    pub fn overwrite(&mut self, source: &Self, saving: &Saving<M>) {
        let Self { life, experiment, elapsed, end, settled, completed, stated, pending, slopes, dirty, ticks, block } =
            source;
        (self.life, self.experiment, self.elapsed) = (*life, *experiment, *elapsed);
        (self.end, self.settled, self.completed, self.stated) = (*end, *settled, *completed, *stated);
        (self.pending, self.dirty) = (*pending, *dirty);
        self.slopes.clone_from(slopes);
        self.ticks.clone_from(ticks);
        saving.overwrite(&mut self.block.model, &block.model);
        self.block.out.clone_from(&block.out);
    }
}

impl<M: Model> Snapshot<M> {
    /// Checks that every value of a settable variable is one that the importer could have set, and that no other value is NaN.
    ///
    /// # Errors
    /// Names the first variable that is not, its value and what is allowed.
    pub fn check(&mut self) -> Result<(), Fault> {
        for index in M::TABLE.indices() {
            let Some((meta, slot)) = M::TABLE.entry(&mut self.block, index) else { continue };
            let set =
                matches!(meta.causality, Causality::Input | Causality::Parameter | Causality::StructuralParameter);
            let refused = match &slot {
                _ if set => !slot.is_allowed(meta),
                Slot::Real(x) => x.is_nan(),
                Slot::Float32(x) => x.is_nan(),
                _ => false,
            };
            if refused {
                let allowed = if set { meta.allowed() } else { "a number".into() };
                let value = slot.to_string();
                return Err(Fault::value(&message::sized_name(&mut self.block, index), value, allowed));
            }
        }
        // Where sizes are set, arrays keep their old lengths, even if the simulation ends there.
        if const { M::TABLE.has_sizes() }
            && !matches!(self.life.state(), State::Configuration | State::Reconfiguration | State::Terminated)
        {
            M::TABLE.check_sizes(&mut self.block)?;
        }
        let sane = match (&self.ticks, ticks::<M>()) {
            (Some(ticks), Some(fresh)) => ticks.len() == fresh.len() && ticks.iter().all(Tick::is_sane),
            (ticks, fresh) => ticks.is_none() && fresh.is_none(),
        };
        if !sane {
            return Err(Fault::new("clocks"));
        }
        let ramps = |&(index, slope): &(u32, f64)| {
            let entry = M::TABLE.entry(&mut self.block, index as usize);
            slope.is_finite() && entry.is_some_and(|(meta, _)| ramps(meta))
        };
        if self.slopes.iter().all(ramps) { Ok(()) } else { Err(Fault::new("derivatives of inputs")) }
    }

    /// State and outputs at the start, from the values set so far.
    pub(crate) fn initialize(&mut self) {
        self.block.initialize();
        (self.dirty, self.stated) = (false, false);
    }

    /// Checks the parameters together, with the calculated ones: on a copy or, if there can be none, on the model itself.
    ///
    /// # Errors
    /// As [`Model::validate`].
    pub(crate) fn judge(&mut self, can: &Capabilities<M>) -> Result<(), Fault> {
        match can.saved {
            Some(_) => self.judged(can).map(drop),
            None => self.adopt(can),
        }
    }

    /// Calculates parameters from those that were set, if they are consistent.
    ///
    /// # Errors
    /// As [`Model::validate`]; a model that can be copied has not changed.
    pub(crate) fn adopt(&mut self, can: &Capabilities<M>) -> Result<(), Fault> {
        match self.judged(can)? {
            Some(model) => self.block.model = model,
            None => judge(&mut self.block.model, self.life.interface())?,
        }
        Ok(())
    }

    /// A copy of the model with its calculated parameters; `None` for a model that cannot be copied.
    fn judged(&self, can: &Capabilities<M>) -> Result<Option<M>, Fault> {
        let copy = can.saved.as_ref().map(|saving| saving.model(&self.block.model));
        copy.map(|mut model| judge(&mut model, self.life.interface()).map(|()| model)).transpose()
    }

    /// Whether an instance for this interface can be in this state.
    pub(crate) fn fits_its_interface(&self) -> bool {
        match (self.life.state(), self.life.interface()) {
            (State::Step | State::Ended, interface) => {
                matches!(interface, Interface::CoSimulation | Interface::EventMode)
            }
            (State::Event, interface) => matches!(interface, Interface::EventMode | Interface::ModelExchange),
            (State::Activation, interface) => interface == Interface::ScheduledExecution,
            (State::Continuous, interface) => interface == Interface::ModelExchange,
            // A step in progress cannot be saved.
            (State::Intermediate | State::ClockUpdate, _) => false,
            _ => true,
        }
    }

    /// Checks that a simulation can reach this time: the sum of the steps matches the importer's own time, which rounding can at
    /// most double if a step is as short as the last digit of the time.
    ///
    /// # Errors
    /// Names the time and the state of the lifecycle that contradict each other.
    pub fn check_time(&self) -> Result<(), Fault> {
        let start = self.experiment.map_or(M::INFO.experiment.start, |e| e.start);
        let (elapsed, since) = (self.elapsed.seconds(), self.end - start);
        let rounding = 8.0 * f64::EPSILON * start.abs().max(self.end.abs());
        // A sum that is not in normal form may contain numbers that cancel.
        let fits = self.elapsed == self.elapsed.plus(0.0)
            && match (self.life.state(), self.experiment) {
                (State::Instantiated | State::Configuration, _) | (State::Initialization, Some(_)) => {
                    since == 0.0 && elapsed == 0.0
                }
                (
                    State::Step
                    | State::Event
                    | State::Continuous
                    | State::Ended
                    | State::Reconfiguration
                    | State::Activation
                    | State::Terminated,
                    Some(_),
                ) => {
                    self.end.is_finite()
                        && (start..=self.end + rounding).contains(&self.completed)
                        && (start..=self.completed).contains(&self.settled)
                        && elapsed >= 0.0
                        && elapsed <= 2.0 * since + rounding
                        && since <= 2.0 * elapsed + rounding
                }
                _ => false,
            };
        if !fits {
            return Err(Fault::new(format!("time {} after {elapsed} s of simulation from {start}", self.end)));
        }
        self.experiment.map_or(Ok(()), |e| Experiment::new(e.start, e.stop).map(|_| ()))
    }
}
