//! An instance of a model as an importer sees it, without C: names, times, saved states, messages.

use crate::lifecycle::{Standard, State};
use crate::log::Log;
use crate::saved::{Experiment, Saved};
use crate::{blob, message, registry};
use fmu_core::{Fault, Model, Step};

/// One instance. Its functions assume that the lifecycle admits them: that is judged at the gate.
pub struct Instance<M: Model> {
    /// The standard that it was instantiated with.
    pub standard: Standard,
    /// Name given by the importer.
    pub name: String,
    /// Where messages go.
    pub log: Log,
    /// Everything that a step, a set or a reset changes.
    pub now: Saved<M>,
    /// A reference can stand for several values: only in FMI 3.0, and only if the model has an array.
    pub(crate) arrays: bool,
}

impl<M: Model> Instance<M> {
    /// A fresh instance of the model `now`.
    pub fn new(standard: Standard, name: String, log: Log, now: Saved<M>) -> Self {
        let table = M::TABLE;
        let arrays = standard == Standard::Fmi3
            && (0..table.len()).any(|i| table.locate(i).is_some_and(|(_, meta, _)| meta.dimension.is_some()));
        log.event(|| format!("{name}: instance of {} {}", M::INFO.name, M::INFO.version));
        Self { standard, name, log, now, arrays }
    }

    /// Keeps start and stop time.
    ///
    /// # Errors
    /// As [`Experiment::new`].
    pub fn set_up(&mut self, start: f64, stop: Option<f64>) -> Result<(), Fault> {
        self.now.experiment = Some(Experiment::new(start, stop)?);
        self.now.end = start;
        Ok(())
    }

    /// Enters initialisation.
    ///
    /// # Errors
    /// No experiment was set up (FMI 2.0.5, 4.2.4: `fmi2SetupExperiment` comes first).
    pub fn enter_initialisation(&mut self) -> Result<(), Fault> {
        self.now.experiment.map(|_| ()).ok_or_else(|| Fault::new("fmi2SetupExperiment must be called before it"))
    }

    /// Ends initialisation: parameters are judged together, state and outputs computed.
    ///
    /// # Errors
    /// As [`Saved::check`] and [`Model::validate`].
    pub fn exit_initialisation(&mut self) -> Result<(), Fault> {
        self.now.check()?;
        self.now.judged()?;
        self.now.block.initialise();
        self.now.dirty = false;
        self.log.event(|| message::start(&self.name, &mut self.now));
        Ok(())
    }

    /// Ends the simulation.
    pub fn terminate(&mut self) {
        self.log.event(|| format!("{}: terminated at {} s", self.name, self.now.end));
    }

    /// Back to the fresh instance; name and logger stay.
    pub fn reset(&mut self) {
        self.now = Saved::default();
        self.log.event(|| format!("{}: reset", self.name));
    }

    /// One communication step from `t` to `t + h`. Tunable parameters that were set take effect here, all together.
    ///
    /// # Errors
    /// Times that do not continue the simulation, tunable parameters that do not fit together: then nothing has changed.
    /// Or what the model reports.
    #[inline]
    pub fn do_step(&mut self, t: f64, h: f64) -> Result<(), Fault> {
        let now = &mut self.now;
        let next = now.elapsed.plus(h);
        now.check_step(t, h, next)?;
        if now.dirty {
            now.block.model = now.judged()?;
            now.dirty = false;
        }
        now.block.step(&Step { start: now.elapsed, h })?;
        now.elapsed = next;
        now.end = t + h;
        Ok(())
    }

    /// Before the start the model computes what was set since the last look; later a get shows the last step.
    pub(crate) fn refresh(&mut self) {
        if self.now.dirty && matches!(self.now.life.state(), State::Instantiated | State::Initialization) {
            self.now.block.initialise();
            self.now.dirty = false;
        }
    }

    /// Saves the state under `handle`, or under a new handle if it is 0; returns the handle.
    ///
    /// # Errors
    /// The handle is none of ours.
    pub fn save(&self, handle: usize) -> Result<usize, Fault> {
        if handle == 0 {
            return Ok(registry::keep(self.now.clone()));
        }
        registry::with(handle, |state| {
            state.clone_from(&self.now);
            Ok(handle)
        })
    }

    /// Goes back, or forth, to a saved state, of this or another instance of the model.
    ///
    /// # Errors
    /// The handle is none of ours.
    pub fn restore(&mut self, handle: usize) -> Result<(), Fault> {
        registry::with(handle, |state| {
            self.now.clone_from(state);
            Ok(())
        })
    }

    /// Makes a state from bytes and returns its handle.
    ///
    /// # Errors
    /// As [`blob::read`].
    pub fn deserialise(&self, bytes: &[u8]) -> Result<usize, Fault> {
        blob::read::<M>(bytes).map(registry::keep)
    }
}
