//! An instance of a model as an importer sees it, without C: names, times, saved states, messages.

use crate::lifecycle::{Standard, State};
use crate::log::Log;
use crate::snapshot::{Experiment, Snapshot};
use crate::{blob, message, registry};
use fmu_core::{Fault, Model, Step};

/// One instance. Its functions assume that the lifecycle admits them: that is judged at the gate.
pub struct Instance<M: Model> {
    /// The standard that it was instantiated with.
    pub standard: Standard,
    /// Name given by the importer.
    pub name: String,
    /// The logger.
    pub log: Log,
    /// Everything that a step, a set or a reset changes.
    pub current: Snapshot<M>,
    /// A reference can stand for several values: only in FMI 3.0, and only if the model has an array.
    pub(crate) arrays: bool,
}

impl<M: Model> Instance<M> {
    /// A fresh instance of the model `current`.
    pub fn new(standard: Standard, name: String, log: Log, current: Snapshot<M>) -> Self {
        let table = M::TABLE;
        let arrays = standard == Standard::Fmi3
            && (0..table.len()).any(|i| table.locate(i).is_some_and(|(_, meta, _)| meta.dimension.is_some()));
        log.event(|| format!("{name}: instance of {} {}", M::INFO.name, M::INFO.version));
        Self { standard, name, log, current, arrays }
    }

    /// Stores start and stop time.
    ///
    /// # Errors
    /// As [`Experiment::new`].
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), Fault> {
        self.current.experiment = Some(Experiment::new(start, stop)?);
        self.current.end = start;
        Ok(())
    }

    /// Enters initialization.
    ///
    /// # Errors
    /// No experiment was set up (FMI 2.0.5, 4.2.4: `fmi2SetupExperiment` comes first).
    pub fn enter_initialization(&mut self) -> Result<(), Fault> {
        self.current.experiment.map(|_| ()).ok_or_else(|| Fault::new("fmi2SetupExperiment must be called before it"))
    }

    /// Ends initialization: parameters are judged together, state and outputs computed.
    ///
    /// # Errors
    /// As [`Snapshot::check`] and [`Model::validate`].
    pub fn exit_initialization(&mut self) -> Result<(), Fault> {
        self.current.check()?;
        self.current.judged()?;
        self.current.block.initialize();
        self.current.dirty = false;
        self.log.event(|| message::start(&self.name, &mut self.current));
        Ok(())
    }

    /// Ends the simulation.
    pub fn terminate(&mut self) {
        self.log.event(|| format!("{}: terminated at {} s", self.name, self.current.end));
    }

    /// Restores the state after instantiation; name and logger stay.
    pub fn reset(&mut self) {
        self.current = Snapshot::default();
        self.log.event(|| format!("{}: reset", self.name));
    }

    /// One communication step from `t` to `t + h`. Tunable parameters that were set take effect here, all together.
    ///
    /// # Errors
    /// Times that do not continue the simulation, tunable parameters that do not fit together: then nothing has changed.
    /// Or what the model reports.
    #[inline]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<(), Fault> {
        let current = &mut self.current;
        let next = current.elapsed.plus(h);
        current.check_step(t, h, next)?;
        if current.dirty {
            current.block.model = current.judged()?;
            current.dirty = false;
        }
        current.block.step(&Step { start: current.elapsed, h })?;
        current.elapsed = next;
        current.end = t + h;
        Ok(())
    }

    /// Before the first step, recomputes the outputs if variables were set; afterwards a get returns the values of the last step.
    pub(crate) fn refresh(&mut self) {
        if self.current.dirty && matches!(self.current.life.state(), State::Instantiated | State::Initialization) {
            self.current.block.initialize();
            self.current.dirty = false;
        }
    }

    /// Saves the state under `handle`, or under a new handle if it is 0; returns the handle.
    ///
    /// # Errors
    /// The handle is unknown.
    pub fn save(&self, handle: usize) -> Result<usize, Fault> {
        if handle == 0 {
            return Ok(registry::keep(self.current.clone()));
        }
        registry::with(handle, |state| {
            state.clone_from(&self.current);
            Ok(handle)
        })
    }

    /// Restores a saved state of this or another instance of the model.
    ///
    /// # Errors
    /// The handle is unknown.
    pub fn restore(&mut self, handle: usize) -> Result<(), Fault> {
        registry::with(handle, |state| {
            self.current.clone_from(state);
            Ok(())
        })
    }

    /// Makes a state from bytes and returns its handle.
    ///
    /// # Errors
    /// As [`blob::read`].
    pub fn deserialize(&self, bytes: &[u8]) -> Result<usize, Fault> {
        blob::read::<M>(bytes).map(registry::keep)
    }
}
