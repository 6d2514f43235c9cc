//! Getting and setting variables by value reference: 0 is `time`, `i + 1` the variable `i` of the table.

use crate::instance::Instance;
use crate::lifecycle::State;
use crate::message;
use crate::value::Value;
use fmu_core::description::TIME;
use fmu_core::{Causality, Fault, Meta, Model, Slot, Variability};
use std::mem::MaybeUninit;

/// Number of previous values that a set call keeps to undo a partial set.
const SHORT: usize = 8;

/// The table's index of a value reference; [`TIME`] becomes an index past every table.
#[inline]
const fn index(reference: u32) -> usize {
    (reference as usize).wrapping_sub(1)
}

/// Whether a variable may be set in this state (FMI 2.0.5, 2.2.7 and 4.2.4; FMI 3.0.2, 2.4.7.4).
#[inline]
fn open(meta: &Meta, state: State) -> bool {
    match meta.causality {
        Causality::Input => true,
        Causality::Parameter => state != State::Step || meta.variability == Variability::Tunable,
        _ => false,
    }
}

/// The variable, if it can be set to this value in the current state.
#[inline]
fn settable<'a, T: Value>(
    found: Option<(&'static Meta, Slot<'a>)>,
    state: State,
    value: T,
) -> Option<(&'static Meta, Slot<'a>)> {
    found.filter(|(meta, _)| open(meta, state) && value.judge(meta) == Some(true))
}

impl<M: Model> Instance<M> {
    /// The variables' values, one after the other. In initialization they fit what was set; later they are those of the
    /// last step, inputs and tunable parameters as set.
    ///
    /// # Errors
    /// Unknown reference, another type, or another number of values than `out` has room for.
    #[inline]
    pub fn get<T: Value>(&mut self, references: &[u32], out: &mut [MaybeUninit<T>]) -> Result<(), Fault> {
        self.check_count(references, out.len())?;
        self.refresh();
        if self.arrays { self.get_each::<T, true>(references, out) } else { self.get_each::<T, false>(references, out) }
    }

    fn get_each<T: Value, const ARRAYS: bool>(
        &mut self,
        references: &[u32],
        out: &mut [MaybeUninit<T>],
    ) -> Result<(), Fault> {
        let mut places = out.iter_mut();
        for &reference in references {
            let first = index(reference);
            let count = if ARRAYS { self.elements(reference)? } else { 1 };
            for (offset, place) in (0..count).zip(&mut places) {
                let index = first.wrapping_add(offset);
                if let Some((_, value)) = T::find(M::TABLE, &mut self.current.block, index) {
                    place.write(*value);
                    continue;
                }
                match M::TABLE.entry(&mut self.current.block, index).and_then(|(meta, slot)| T::read(meta, &slot)) {
                    Some(value) => place.write(value),
                    None => place.write(self.read_other(reference, index)?),
                };
            }
        }
        Ok(())
    }

    /// The value of `time`, or an error: no variable of this type has the reference.
    #[cold]
    fn read_other<T: Value>(&mut self, reference: u32, index: usize) -> Result<T, Fault> {
        match M::TABLE.entry(&mut self.current.block, index) {
            Some((meta, _)) => Err(message::type_of::<M>(index, meta, T::CARRIES)),
            None if reference == TIME => T::time(self.current.end).ok_or_else(|| message::time(T::CARRIES)),
            None => Err(message::unknown::<M>(reference)),
        }
    }

    /// Sets variables: all of them or, on an error, none.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, value out of range, another number of values.
    #[inline]
    pub fn set<T: Value>(&mut self, references: &[u32], values: &[T]) -> Result<(), Fault> {
        self.check_count(references, values.len())?;
        let Some(&any) = values.first() else { return Ok(()) };
        if self.arrays {
            self.set_each::<T, true>(references, values, any)
        } else {
            self.set_each::<T, false>(references, values, any)
        }
    }

    /// Writes a short vector at once and undoes it on an error; checks a long one before writing.
    fn set_each<T: Value, const ARRAYS: bool>(
        &mut self,
        references: &[u32],
        values: &[T],
        any: T,
    ) -> Result<(), Fault> {
        if values.len() > SHORT {
            self.judge_each::<T, ARRAYS>(references, values)?;
        }
        let state = self.current.life.state();
        let (mut done, mut old, mut dirty) = (0, [(0, any); SHORT], false);
        let mut next = values.iter();
        for &reference in references {
            let first = index(reference);
            let count = if ARRAYS { self.elements(reference)? } else { 1 };
            for (offset, &value) in (0..count).zip(&mut next) {
                let index = first.wrapping_add(offset);
                if let Some((meta, place)) = T::find(M::TABLE, &mut self.current.block, index)
                    && open(meta, state)
                    && value.judge(meta) == Some(true)
                {
                    if let Some(old) = old.get_mut(done) {
                        *old = (index, *place);
                        done += 1;
                    }
                    *place = value;
                    dirty |= meta.causality == Causality::Parameter;
                    continue;
                }
                let Some((meta, slot)) = settable(M::TABLE.entry(&mut self.current.block, index), state, value) else {
                    self.take_back(&old[..done]);
                    return Err(self.refusal(reference, index, value));
                };
                if let (Some(old), Some(before)) = (old.get_mut(done), T::read(meta, &slot)) {
                    *old = (index, before);
                    done += 1;
                }
                value.write(slot);
                // The model reads inputs directly; parameters take effect through `initialize` or `derive`.
                dirty |= meta.causality == Causality::Parameter;
            }
        }
        self.current.dirty |= dirty || state != State::Step;
        Ok(())
    }

    fn judge_each<T: Value, const ARRAYS: bool>(&mut self, references: &[u32], values: &[T]) -> Result<(), Fault> {
        let state = self.current.life.state();
        let mut next = values.iter();
        for &reference in references {
            let count = if ARRAYS { self.elements(reference)? } else { 1 };
            for (offset, &value) in (0..count).zip(&mut next) {
                let index = index(reference).wrapping_add(offset);
                if settable(M::TABLE.entry(&mut self.current.block, index), state, value).is_none() {
                    return Err(self.refusal(reference, index, value));
                }
            }
        }
        Ok(())
    }

    #[cold]
    fn take_back<T: Value>(&mut self, old: &[(usize, T)]) {
        for &(index, before) in old.iter().rev() {
            if let Some((_, slot)) = M::TABLE.entry(&mut self.current.block, index) {
                before.write(slot);
            }
        }
    }

    /// Why a value cannot be set.
    #[cold]
    fn refusal<T: Value>(&mut self, reference: u32, index: usize, value: T) -> Fault {
        match M::TABLE.entry(&mut self.current.block, index) {
            Some((meta, _)) => match value.judge(meta) {
                None => message::type_of::<M>(index, meta, T::CARRIES),
                Some(_) if !open(meta, self.current.life.state()) => {
                    message::fixed::<M>(index, meta, self.current.life.state())
                }
                Some(_) => message::range::<M>(index, meta, value),
            },
            None if reference == TIME => message::time(T::CARRIES),
            None => message::unknown::<M>(reference),
        }
    }

    /// Refuses a getter or setter of a type that no variable has.
    ///
    /// # Errors
    /// The list of references is not empty.
    pub fn refuse(&mut self, references: &[u32], carries: &str) -> Result<(), Fault> {
        let Some(&reference) = references.first() else { return Ok(()) };
        match M::TABLE.entry(&mut self.current.block, index(reference)) {
            Some((meta, _)) => Err(message::type_of::<M>(index(reference), meta, carries)),
            None if reference == TIME => Err(message::time(carries)),
            None => Err(message::unknown::<M>(reference)),
        }
    }

    /// As many values as references, or in FMI 3.0 as many as the variables have elements (3.0.2, 2.2.7.2).
    #[inline]
    fn check_count(&mut self, references: &[u32], given: usize) -> Result<(), Fault> {
        let mut needed = references.len();
        if self.arrays {
            needed = 0;
            for &reference in references {
                needed += self.elements(reference)?;
            }
        }
        if given == needed { Ok(()) } else { Err(message::count(given, needed)) }
    }

    /// How many values a reference of FMI 3.0 stands for: one, or all elements of an array.
    fn elements(&mut self, reference: u32) -> Result<usize, Fault> {
        let index = index(reference);
        match M::TABLE.element(index) {
            Some(element) if element > 0 => Err(message::element::<M>(reference, index, element)),
            _ => Ok(M::TABLE.entry(&mut self.current.block, index).and_then(|(meta, _)| meta.dimension).unwrap_or(1)),
        }
    }
}
