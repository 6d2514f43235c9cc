//! Getting and setting variables by value reference: 0 is `time`, `i + 1` the variable `i` of the table.

use crate::instance::Instance;
use crate::lifecycle::State;
use crate::message;
use crate::value::Value;
use fmu_core::description::TIME;
use fmu_core::{Causality, Fault, Meta, Model, Variability};
use std::mem::MaybeUninit;

/// The table's index of a value reference; [`TIME`] becomes an index past every table.
#[inline]
const fn index(reference: u32) -> usize {
    (reference as usize).wrapping_sub(1)
}

/// Whether a variable may be set in this state (FMI 2.0.5, 2.2.7 and 4.2.4; FMI 3.0.2, 2.4.7.4).
#[inline]
fn settable(meta: &Meta, state: State) -> bool {
    match meta.causality {
        Causality::Input => true,
        Causality::Parameter => state != State::Step || meta.variability == Variability::Tunable,
        _ => false,
    }
}

impl<M: Model> Instance<M> {
    /// The variables' values, one after the other. In initialisation they fit what was set; later they are those of the
    /// last step, inputs and tunable parameters as set.
    ///
    /// # Errors
    /// Unknown reference, another type, or another number of values than `out` has room for.
    #[inline]
    pub fn get<T: Value>(&mut self, references: &[u32], out: &mut [MaybeUninit<T>]) -> Result<(), Fault> {
        self.check_count(references, out.len())?;
        self.refresh();
        let mut places = out.iter_mut();
        for &reference in references {
            let count = self.count(reference)?;
            for (offset, place) in (0..count).zip(&mut places) {
                place.write(self.read(reference, index(reference).wrapping_add(offset))?);
            }
        }
        Ok(())
    }

    /// Sets variables: all of them or, on an error, none.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, value out of range, another number of values.
    #[inline]
    pub fn set<T: Value>(&mut self, references: &[u32], values: &[T]) -> Result<(), Fault> {
        self.check_count(references, values.len())?;
        let state = self.now.life.state();
        let mut next = values.iter();
        for &reference in references {
            let count = self.count(reference)?;
            for (offset, &value) in (0..count).zip(&mut next) {
                self.judge(reference, index(reference).wrapping_add(offset), value, state)?;
            }
        }
        let mut next = values.iter();
        for &reference in references {
            let count = self.count(reference)?;
            for (offset, value) in (0..count).zip(&mut next) {
                let Some((meta, slot)) = M::TABLE.entry(&mut self.now.block, index(reference) + offset) else {
                    continue;
                };
                value.write(slot);
                // The model sees an input by itself; the rest waits for `initialise` or `derive`.
                self.now.dirty |= state != State::Step || meta.causality == Causality::Parameter;
            }
        }
        Ok(())
    }

    #[inline]
    fn read<T: Value>(&mut self, reference: u32, index: usize) -> Result<T, Fault> {
        match M::TABLE.entry(&mut self.now.block, index) {
            Some((meta, slot)) => T::read(meta, &slot).ok_or_else(|| message::type_of::<M>(index, meta, T::CARRIES)),
            None if reference == TIME => T::time(self.now.end).ok_or_else(|| message::time(T::CARRIES)),
            None => Err(message::unknown::<M>(reference)),
        }
    }

    #[inline]
    fn judge<T: Value>(&mut self, reference: u32, index: usize, value: T, state: State) -> Result<(), Fault> {
        let Some((meta, _)) = M::TABLE.entry(&mut self.now.block, index) else {
            return Err(if reference == TIME { message::time(T::CARRIES) } else { message::unknown::<M>(reference) });
        };
        match value.judge(meta) {
            None => Err(message::type_of::<M>(index, meta, T::CARRIES)),
            Some(_) if !settable(meta, state) => Err(message::fixed::<M>(index, meta, state)),
            Some(false) => Err(message::range::<M>(index, meta, value)),
            Some(true) => Ok(()),
        }
    }

    /// Refuses a getter or setter of a type that no variable has.
    ///
    /// # Errors
    /// There is a reference at all.
    pub fn refuse(&mut self, references: &[u32], carries: &str) -> Result<(), Fault> {
        let Some(&reference) = references.first() else { return Ok(()) };
        match M::TABLE.entry(&mut self.now.block, index(reference)) {
            Some((meta, _)) => Err(message::type_of::<M>(index(reference), meta, carries)),
            None if reference == TIME => Err(message::time(carries)),
            None => Err(message::unknown::<M>(reference)),
        }
    }

    /// As many values as references, or in FMI 3.0 as many as the variables have elements (3.0.2, 2.2.6.2).
    #[inline]
    fn check_count(&mut self, references: &[u32], given: usize) -> Result<(), Fault> {
        let mut needed = references.len();
        if self.arrays {
            needed = 0;
            for &reference in references {
                needed += self.count(reference)?;
            }
        }
        if given == needed { Ok(()) } else { Err(message::count(given, needed)) }
    }

    /// How many values a reference stands for: one, or all elements of an array of FMI 3.0.
    #[inline]
    fn count(&mut self, reference: u32) -> Result<usize, Fault> {
        if self.arrays { self.elements(reference) } else { Ok(1) }
    }

    fn elements(&mut self, reference: u32) -> Result<usize, Fault> {
        let index = index(reference);
        match M::TABLE.element(index) {
            Some(element) if element > 0 => Err(message::element::<M>(reference, index, element)),
            _ => Ok(M::TABLE.entry(&mut self.now.block, index).and_then(|(meta, _)| meta.dimension).unwrap_or(1)),
        }
    }
}
