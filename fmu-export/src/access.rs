//! Getting and setting variables by value reference: 0 is `time` in FMI 3.0 and nothing in FMI 2.0, `i + 1` the variable `i` of the table, of the states'
//! derivatives after it, or of the event indicators after them.

use crate::habit::Habit;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::{Standard, State};
use crate::message;
use crate::value::CValue;
use fmu_core::description::TIME;
use fmu_core::{Causality, Exported, Fault, Kind, Meta, Model, Slot, Table, Variability};
use std::fmt::Display;
use std::mem::MaybeUninit;

/// The table's index of a value reference; [`TIME`] becomes an index past every table.
#[inline]
pub(crate) fn index<E: Exported>(reference: u32) -> usize {
    E::CAN.index(reference)
}

/// Whether the reference belongs to `time`, which exists only in FMI 3.0 archives.
pub(crate) fn is_time(reference: u32, standard: Standard) -> bool {
    reference == TIME && standard == Standard::Fmi3
}

/// Whether a variable may be set in this state (FMI 2.0.5, 2.2.7, 3.2.3 and 4.2.4; FMI 3.0.2, 2.4.7.4).
#[inline]
pub(crate) fn open(meta: &Meta, state: State) -> bool {
    match meta.causality {
        Causality::Input => match state {
            State::Continuous => meta.variability == Variability::Continuous,
            State::Configuration | State::Reconfiguration => false,
            State::Intermediate => meta.intermediate,
            _ => true,
        },
        Causality::Parameter => match state {
            State::Step | State::Event | State::Activation | State::Ended => meta.variability == Variability::Tunable,
            State::Continuous
            | State::Intermediate
            | State::ClockUpdate
            | State::Configuration
            | State::Reconfiguration => false,
            _ => true,
        },
        // Before the initialization, it acts like a separate Configuration Mode.
        Causality::StructuralParameter => match state {
            State::Instantiated | State::Configuration => true,
            State::Reconfiguration => meta.variability == Variability::Tunable,
            _ => false,
        },
        _ => meta.exact && matches!(state, State::Instantiated | State::Initialization),
    }
}

/// Whether a variable cannot change in this state, although tunable parameters can, or could in Event Mode: setting its present
/// value is [`Habit::Fixed`].
pub(crate) fn keeps(meta: &Meta, state: State) -> bool {
    matches!(state, State::Event | State::Continuous | State::Step)
        && (meta.causality == Causality::Parameter || meta.exact)
        && !open(meta, state)
}

/// The table of the model.
const fn table<E: Exported>() -> &'static Table<fmu_core::Block<E::Model>> {
    E::Model::TABLE
}

/// Whether the model has a variable of this type.
pub(crate) const fn has<E: Exported, T: CValue>() -> bool {
    E::Model::TABLE.kinds().meets(T::KINDS)
}

impl<E: Exported> Instance<E> {
    /// The variables' values in sequence. During initialization they match the values set so far; later they come from the last
    /// step, except inputs and tunable parameters, which return the last value set.
    ///
    /// # Errors
    /// Unknown reference, another type, or a number of values that does not match `out`.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    pub fn get<T: CValue>(&mut self, references: &[u32], out: &mut [MaybeUninit<T>]) -> Result<(), Refusal> {
        if const { !has::<E, T>() } {
            return self.get_none(references, out.len(), T::CARRIES);
        }
        // Outdated outputs are computed only for a valid list, and with arrays that is not known yet.
        let old = self.stale || self.current.dirty;
        if references.len() != out.len() || self.arrays && old {
            return self.get_counted(references, out);
        }
        self.refresh();
        // Only scalars: one value for each reference.
        let done = T::read_reals(&mut self.current.block, references, out);
        if done == out.len() {
            Ok(())
        } else if self.arrays {
            self.get_counted(references, out)
        } else {
            self.get_each(&references[done..], &mut out[done..])
        }
    }

    #[inline(never)]
    fn get_counted<T: CValue>(&mut self, references: &[u32], out: &mut [MaybeUninit<T>]) -> Result<(), Refusal> {
        if let Err(refusal) = self.check_count(references, out.len()) {
            self.computed_count(references, out.len(), refusal)?;
        }
        self.refresh();
        self.get_each(references, out)
    }

    /// Whether the number of values is right once the outputs are computed: an array of them may get its length then. Otherwise nothing
    /// has changed, and the refusal is the result.
    #[cold]
    fn computed_count(&mut self, references: &[u32], given: usize, refusal: Fault) -> Result<(), Fault> {
        if !self.arrays || !self.current.dirty {
            return Err(refusal);
        }
        let before = E::CAN.saved.as_ref().map(|saving| (saving.block(&self.current.block), self.current.stated));
        self.refresh();
        let counted = self.check_count(references, given);
        if counted.is_err()
            && let Some((block, stated)) = before
        {
            (self.current.block, self.current.stated, self.current.dirty) = (block, stated, true);
        }
        counted.map_err(|_| refusal)
    }

    /// Gets variables of a type that the model does not have: an error, if there is a value to get.
    #[inline(never)]
    fn get_none(&mut self, references: &[u32], given: usize, carries: &str) -> Result<(), Refusal> {
        self.check_count(references, given)?;
        self.refresh();
        for &reference in references {
            if self.elements(reference)? > 0 {
                let time = is_time(reference, self.standard);
                self.read_number(reference, index::<E>(reference), (carries, false))?;
                return Err(message::real(time, carries).into());
            }
        }
        Ok(())
    }

    /// Gets variables of any type; their number was checked.
    #[inline(never)]
    fn get_each<T: CValue>(&mut self, references: &[u32], out: &mut [MaybeUninit<T>]) -> Result<(), Refusal> {
        let (mut references, mut out) = (references, out);
        while let Some((&reference, others)) = references.split_first() {
            let count = if self.arrays { self.elements(reference)? } else { 1 };
            let (places, rest) = out.split_at_mut(count);
            for (offset, place) in places.iter_mut().enumerate() {
                let index = index::<E>(reference).wrapping_add(offset);
                let found = table::<E>().entry(&mut self.current.block, index);
                match found.and_then(|(meta, slot)| T::read(meta, &slot, self.standard)) {
                    Some(value) => place.write(value),
                    None => place.write(self.read_other(reference, index)?),
                };
            }
            let done = T::read_reals(&mut self.current.block, others, rest);
            (references, out) = (&others[done..], &mut rest[done..]);
        }
        Ok(())
    }

    /// The value of `time`, of a derivative or of an indicator, or an error: no variable of this type has the reference.
    #[cold]
    fn read_other<T: CValue>(&mut self, reference: u32, index: usize) -> Result<T, Refusal> {
        let x = self.read_number(reference, index, (T::CARRIES, T::NARROW))?;
        T::from_real(x).ok_or_else(|| message::real(is_time(reference, self.standard), T::CARRIES).into())
    }

    /// [`read_other`](Self::read_other) as a real number, for every type.
    #[cold]
    #[inline(never)]
    fn read_number(&mut self, reference: u32, index: usize, (carries, narrow): (&str, bool)) -> Result<f64, Refusal> {
        if let Some((meta, slot)) = table::<E>().entry(&mut self.current.block, index) {
            return Err(match (&slot, meta.kind) {
                (Slot::Integer(x), Kind::Integer(of)) if narrow => message::narrow::<E::Model>(index, x.get(), of),
                _ => message::type_of::<E::Model>(index, meta, carries),
            }
            .into());
        }
        if is_time(reference, self.standard) {
            return Ok(self.current.end);
        }
        self.calculated(index)?.ok_or_else(|| message::unknown::<E>(reference, self.standard).into())
    }

    /// The position after the table of a derivative or, in FMI 3.0, of an indicator.
    fn after_table(&self, index: usize) -> Option<usize> {
        let indicators = if self.standard == Standard::Fmi3 { E::CAN.indicators().len() } else { 0 };
        index.checked_sub(table::<E>().len()).filter(|after| *after < E::CAN.scalars() + indicators)
    }

    /// A derivative or an indicator, by its index after the table.
    fn calculated(&mut self, index: usize) -> Result<Option<f64>, Refusal> {
        let Some(after) = self.after_table(index) else { return Ok(None) };
        let state = self.current.life.state();
        if const { E::CAN.resizable.is_some() } && matches!(state, State::Configuration | State::Reconfiguration) {
            let name = message::calculated::<E>(after);
            return Err(Fault::new(format!("{name} is not known in {state}")).into());
        }
        let (states, now) = (E::CAN.scalars(), self.state_count());
        let mut values = std::mem::take(&mut self.values);
        let read = if after < states {
            let read = self.derivatives(&mut values[..now]);
            E::CAN.spread(&mut self.current.block.model, &mut values[..states]);
            read
        } else {
            self.indicators(&mut values[states..])
        };
        let x = values[after];
        self.values = values;
        read.map(|()| Some(x))
    }

    /// Sets variables: all of them or, on an error, none.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, value out of range, another number of values.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "the way of every communication point, in both standards")]
    pub fn set<T: CValue>(&mut self, references: &[u32], values: &[T]) -> Result<(), Refusal> {
        let state = self.current.life.state();
        let configures =
            const { E::CAN.resizable.is_some() } && matches!(state, State::Configuration | State::Reconfiguration);
        if const { !has::<E, T>() } {
            self.set_none(references, values.len(), T::CARRIES)?;
        } else if references.len() != values.len()
            || configures
            || !T::write_inputs(&mut self.current.block, references, values, state == State::Continuous)
        {
            if const { E::CAN.resizable.is_some() } && state == State::Instantiated {
                self.set_and_configure(references, values)?;
            } else if const { E::CAN.saved.is_none() } && !matches!(state, State::Instantiated | State::Initialization)
            {
                self.set_and_judge(references, values)?;
            } else {
                self.set_each(references, values)?;
            }
        }
        // In Step Mode, the model reads inputs directly.
        if state != State::Step && !references.is_empty() {
            self.current.dirty |= matches!(state, State::Instantiated | State::Initialization);
            self.stale |= (self.exchanges() || const { E::CAN.clocked.is_some() })
                && matches!(state, State::Event | State::Continuous);
        }
        Ok(())
    }

    /// Sets variables of a type that the model does not have: an error, if there is a value to set.
    #[inline(never)]
    fn set_none(&mut self, references: &[u32], given: usize, carries: &str) -> Result<(), Refusal> {
        self.check_count(references, given)?;
        for &reference in references {
            if self.elements(reference)? > 0 {
                return Err(self.refuse(reference, index::<E>(reference), None, &"", carries));
            }
        }
        Ok(())
    }

    /// Checks all values, then writes them. In Continuous-Time Mode, a solver tries values: one out of range is discarded,
    /// states can be set too, and discrete inputs only to their present values.
    #[inline(never)]
    pub(crate) fn set_each<T: CValue>(&mut self, references: &[u32], values: &[T]) -> Result<(), Refusal> {
        self.check_count(references, values.len())?;
        let state = self.current.life.state();
        for write in [false, true] {
            let mut next = values.iter();
            for &reference in references {
                let count = if self.arrays { self.elements(reference)? } else { 1 };
                for (offset, &value) in (0..count).zip(&mut next) {
                    let index = index::<E>(reference).wrapping_add(offset);
                    if write { self.write(index, value) } else { self.try_value(state, reference, index, value)? }
                }
            }
        }
        Ok(())
    }

    /// Sets variables of a running model that cannot be copied: tunable parameters take effect at once, and are taken back if the
    /// model refuses them.
    #[cold]
    fn set_and_judge<T: CValue>(&mut self, references: &[u32], values: &[T]) -> Result<(), Refusal> {
        self.check_count(references, values.len())?;
        let mut before = Vec::new();
        for &reference in references {
            let count = if self.arrays { self.elements(reference)? } else { 1 };
            for index in (0..count).map(|offset| index::<E>(reference).wrapping_add(offset)) {
                let found = table::<E>().entry(&mut self.current.block, index);
                before.extend(found.and_then(|(meta, slot)| Some((index, T::read(meta, &slot, self.standard)?))));
            }
        }
        self.set_each(references, values)?;
        if !std::mem::take(&mut self.current.dirty) {
            return Ok(());
        }
        self.current.adopt(&E::CAN).map_err(|fault| {
            for (index, value) in before {
                self.write(index, value);
            }
            self.current.dirty = false;
            self.current.block.model.derive();
            fault.into()
        })
    }

    /// Whether the value can be written in this state.
    fn try_value<T: CValue>(&mut self, state: State, reference: u32, index: usize, value: T) -> Result<(), Refusal> {
        let found = table::<E>().entry(&mut self.current.block, index);
        let mut possible = None;
        if let Some((meta, slot)) = found {
            let held = (keeps(meta, state)
                || meta.causality == Causality::Input
                    && !matches!(state, State::Configuration | State::Reconfiguration))
                && value.is_held(meta, &slot, self.standard);
            possible = value.judge(meta, self.standard);
            if possible == Some(true) && (self.opens(meta, state) || held || self.sets_state(index)) {
                return Ok(());
            }
        }
        Err(self.refuse(reference, index, possible, &value, T::CARRIES))
    }

    /// [`open`]; FMI 2.0 has no structural parameters.
    fn opens(&self, meta: &Meta, state: State) -> bool {
        open(meta, state) && !(self.standard == Standard::Fmi2 && meta.causality == Causality::StructuralParameter)
    }

    /// Whether the variable is a state that can be set: FMI 3.0.2, 3.2.1.
    fn sets_state(&self, index: usize) -> bool {
        self.exchanges()
            && matches!(self.current.life.state(), State::Event | State::Continuous)
            && self.states.contains(&index)
    }

    /// Whether the variable [keeps](keeps) its value now: a value that passes the check equals it.
    pub(crate) fn stays(&mut self, index: usize) -> bool {
        let (state, sets) = (self.current.life.state(), self.sets_state(index));
        let found = table::<E>().entry(&mut self.current.block, index);
        !sets && found.is_some_and(|(meta, _)| keeps(meta, state))
    }

    /// Writes a value that has been checked.
    fn write<T: CValue>(&mut self, index: usize, value: T) {
        if self.stays(index) {
            self.forgive(Habit::Fixed);
        } else if let (Some(i), Some(x)) = (self.states.iter().position(|&row| row == index), value.real()) {
            self.set_state(i, x);
        } else if let Some((meta, slot)) = table::<E>().entry(&mut self.current.block, index) {
            value.write(slot);
            self.current.dirty |= meta.causality == Causality::Parameter;
        }
    }

    /// The reason why a value cannot be set; `possible` if it is in range. `None` for a variable of another type.
    #[cold]
    #[inline(never)]
    fn refuse(
        &mut self,
        reference: u32,
        index: usize,
        possible: Option<bool>,
        value: &dyn Display,
        carries: &str,
    ) -> Refusal {
        let state = self.current.life.state();
        let Some((meta, _)) = table::<E>().entry(&mut self.current.block, index) else {
            return if is_time(reference, self.standard) {
                message::real(true, carries).into()
            } else {
                self.beside_table(reference, carries, true).into()
            };
        };
        if possible.is_none() {
            return message::type_of::<E::Model>(index, meta, carries).into();
        }
        let settable = self.opens(meta, state) || self.sets_state(index);
        let fault = if settable {
            message::range(&mut self.current.block, index, meta, value)
        } else if keeps(meta, state) {
            message::kept(&mut self.current.block, index, meta, state, value)
        } else {
            message::fixed::<E::Model>(index, meta, state)
        };
        // FMI 2.0.5, 2.1.3. CVode integrates past an event, where FMPy already sets the later discrete inputs.
        let tried = state == State::Continuous && (settable || meta.causality == Causality::Input);
        if tried { Refusal::Discard(fault) } else { Refusal::Error(fault) }
    }

    /// The reason why a reference outside the table cannot be set, or read as another type.
    #[cold]
    pub(crate) fn beside_table(&self, reference: u32, carries: &str, set: bool) -> Fault {
        match self.after_table(index::<E>(reference)) {
            Some(after) if set => {
                Fault::new(format!("{} is calculated and cannot be set", message::calculated::<E>(after)))
            }
            Some(_) => message::real(false, carries),
            None => message::unknown::<E>(reference, self.standard),
        }
    }

    /// Checks the number of values: one for each reference or, in FMI 3.0, for each element of the variables (3.0.2, 2.2.7.2).
    pub(crate) fn check_count(&mut self, references: &[u32], given: usize) -> Result<(), Fault> {
        let mut needed = references.len();
        if self.arrays {
            needed = 0;
            for &reference in references {
                needed += self.elements(reference)?;
            }
        }
        if given == needed { Ok(()) } else { Err(message::count(given, needed)) }
    }

    /// Number of values of a reference in FMI 3.0: one, or all elements of an array.
    pub(crate) fn elements(&mut self, reference: u32) -> Result<usize, Fault> {
        let index = index::<E>(reference);
        match table::<E>().element(index) {
            Some(element) if element > 0 => Err(message::element::<E::Model>(reference, index, element)),
            _ if const { E::CAN.has_arrays() || E::Model::TABLE.has_sizes() } => self.resizable_elements(index),
            _ => {
                Ok(table::<E>().entry(&mut self.current.block, index).and_then(|(meta, _)| meta.dimension).unwrap_or(1))
            }
        }
    }

    /// [`elements`](Self::elements) of a model whose arrays change their sizes, or are states.
    #[cold]
    fn resizable_elements(&mut self, index: usize) -> Result<usize, Fault> {
        if let Some((_, n)) = table::<E>().extent(&mut self.current.block, index) {
            return Ok(n);
        }
        match self.after_table(index).and_then(|number| Some((number, E::CAN.state_of(number)?))) {
            Some((number, (state, first))) if number > first => {
                Err(message::inner_derivative(Self::reference_of(number), state.name, Self::reference_of(first)))
            }
            Some((_, (state, _))) => Ok(state.all(&mut self.current.block.model).len().min(state.most())),
            None => Ok(1),
        }
    }

    /// The reference of a derivative.
    fn reference_of(number: usize) -> u32 {
        E::CAN.reference(table::<E>().len() + number)
    }
}

#[cfg(test)]
mod tests;
