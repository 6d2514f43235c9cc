//! Configuration Mode and Reconfiguration Mode (FMI 3.0.2, 2.3.6 and 2.3.7): structural parameters, and the sizes of arrays.
//!
//! Until the mode is left, every array keeps its size. Then the model resizes a copy, which replaces the model if its sizes are
//! right; no old value is kept.

use crate::instance::{Instance, Refusal};
use crate::lifecycle::State;
use crate::value::CValue;
use fmu_core::{Block, Causality, Exported, Fault, Model};
use std::mem;

impl<E: Exported> Instance<E> {
    /// Enters Configuration Mode, or Reconfiguration Mode once the simulation runs.
    ///
    /// # Errors
    /// No structural parameter can change once the simulation runs.
    pub fn enter_configuration(&mut self) -> Result<(), Fault> {
        if self.current.life.state() == State::Instantiated || E::Model::TABLE.has_tunable_sizes() {
            // No output is computed while sizes and arrays differ.
            self.refresh();
            return Ok(());
        }
        Err(Fault::new("no structural parameter is tunable: sizes can be set before the initialization only"))
    }

    /// Leaves the mode: the arrays get their new sizes.
    ///
    /// # Errors
    /// The model refuses the sizes, or an array does not have the expected length; the instance is unchanged.
    pub fn exit_configuration(&mut self) -> Result<(), Fault> {
        // A model with sizes can be saved.
        match &E::CAN.saved {
            Some(saving) => self.resize(saving.block(&self.current.block)),
            None => Ok(()),
        }
    }

    /// Resizes the arrays of this model to its sizes, and adopts it.
    fn resize(&mut self, mut block: Block<E::Model>) -> Result<(), Fault> {
        let Some(resize) = E::CAN.resizable else { return Ok(()) };
        let exchanges = self.exchanges();
        let current = &mut self.current;
        resize(&mut block.model)?;
        if matches!(current.life.state(), State::Configuration | State::Instantiated) {
            block.initialize();
        } else {
            block.model.derive();
            block.model.output(current.elapsed, &mut block.out);
        }
        E::Model::TABLE.check_sizes(&mut block)?;
        current.block = block;
        // Discards data that depends on discarded values.
        current.slopes.clear();
        current.dirty = true;
        let event = exchanges && current.life.state() == State::Reconfiguration;
        current.pending |= event;
        self.stale = event;
        self.scratch = None;
        Ok(())
    }

    /// Sets variables before the initialization: structural parameters take effect at once, as in a separate Configuration
    /// Mode.
    ///
    /// # Errors
    /// Those of [`set`](Self::set) and [`exit_configuration`](Self::exit_configuration); an error leaves everything unchanged.
    #[cold]
    pub(crate) fn set_and_configure<T: CValue>(&mut self, references: &[u32], values: &[T]) -> Result<(), Refusal> {
        let structural = |reference: &u32| {
            let found = E::Model::TABLE.locate(E::CAN.index(*reference));
            found.is_some_and(|(_, meta, _)| meta.causality == Causality::StructuralParameter)
        };
        let Some(saving) = E::CAN.saved.as_ref().filter(|_| references.iter().any(structural)) else {
            return self.set_each(references, values);
        };
        let before = saving.block(&self.current.block);
        self.set_each(references, values)?;
        let changed = mem::replace(&mut self.current.block, before);
        Ok(self.resize(changed)?)
    }

    /// Present number of scalar states.
    #[inline]
    pub(crate) fn state_count(&mut self) -> usize {
        if const { E::CAN.has_arrays() } {
            E::CAN.count_states(&mut self.current.block.model)
        } else {
            const { E::CAN.scalars() }
        }
    }

    /// The number, counted with the maximum sizes, of a present state.
    #[cold]
    pub(crate) fn number_of_state(&mut self, place: usize) -> usize {
        let mut numbers = Vec::new();
        E::CAN.each_state(&mut self.current.block.model, |number, _| numbers.push(number));
        numbers.get(place).copied().unwrap_or(place)
    }
}
