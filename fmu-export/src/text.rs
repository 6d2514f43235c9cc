//! Getting and setting texts. The texts of a getter are kept until the next getter of texts.

use crate::access::{index, is_time, keeps, open};
use crate::habit::Habit;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::State;
use crate::message;
use fmu_core::{Causality, Exported, Fault, Kind, Kinds, Model, Slot};
use std::ffi::{CStr, CString};

/// The type used by the functions for texts.
const CARRIES: &str = "a text";

/// Maximum size of a text that is set, in bytes.
const MOST: usize = 1 << 20;

impl<E: Exported> Instance<E> {
    /// The texts of variables, `given` of them.
    ///
    /// # Errors
    /// Unknown reference, another type, another number of values, a text that a C string cannot contain.
    pub fn get_texts(&mut self, references: &[u32], given: usize) -> Result<&[CString], Refusal> {
        self.check_count(references, given)?;
        self.refresh();
        if const { !E::Model::TABLE.kinds().meets(Kinds::TEXT) } {
            self.no_variable(references, CARRIES)?;
            return Ok(&[]);
        }
        let mut texts = Vec::with_capacity(given);
        for index in self.each_index(references)? {
            let bytes = match E::Model::TABLE.entry(&mut self.current.block, index) {
                Some((_, Slot::Text(text))) => text.as_bytes(),
                Some((_, Slot::Said(text))) => text.as_bytes(),
                _ => &[],
            };
            let nul = |_| Fault::new(format!("{} has a NUL byte", message::name::<E::Model>(index)));
            texts.push(CString::new(bytes).map_err(nul)?);
        }
        self.texts = texts;
        Ok(&self.texts)
    }

    /// Sets `given` texts, each read by its position: all of them or, on an error, none. `None` is NULL. All references are
    /// checked before anything is read.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, another number of values, NULL, not UTF-8, too long.
    pub fn set_texts<'a>(
        &mut self,
        references: &[u32],
        given: usize,
        read: impl Fn(usize) -> Option<&'a CStr>,
    ) -> Result<(), Refusal> {
        self.check_count(references, given)?;
        if const { !E::Model::TABLE.kinds().meets(Kinds::TEXT) } {
            return Ok(self.no_variable(references, CARRIES)?);
        }
        let indices = self.each_index(references)?;
        for &index in &indices {
            self.check_open(index)?;
        }
        let mut texts = Vec::with_capacity(given);
        for (i, &index) in indices.iter().enumerate() {
            let name = message::name::<E::Model>(index);
            let value = read(i).ok_or_else(|| Fault::value(&name, "NULL", "a text"))?;
            if value.count_bytes() > MOST {
                let long = format!("a text of {} bytes", value.count_bytes());
                return Err(Fault::value(&name, long, format_args!("at most {MOST} bytes")).into());
            }
            let text = value.to_str().map_err(|_| Fault::new(format!("the new value of {name} is not UTF-8")))?;
            self.check_kept(index, text.as_bytes())?;
            texts.push(text);
        }
        for (&index, text) in indices.iter().zip(texts) {
            if self.stays(index) {
                self.forgive(Habit::Fixed);
            } else if let Some((_, Slot::Text(place))) = E::Model::TABLE.entry(&mut self.current.block, index) {
                text.clone_into(place);
            }
        }
        if !indices.is_empty() {
            self.was_set();
        }
        Ok(())
    }

    /// The table's indices of texts: one for each reference or, in FMI 3.0, for each element of an array.
    fn each_index(&mut self, references: &[u32]) -> Result<Vec<usize>, Fault> {
        let mut indices = Vec::with_capacity(references.len());
        for &reference in references {
            let first = self.index_of(reference, CARRIES, |kind| *kind == Kind::Text)?;
            let count = if self.arrays { self.elements(reference)? } else { 1 };
            indices.extend(first..first + count);
        }
        Ok(indices)
    }

    /// The table index of a variable of the right type, or the reason for the mismatch.
    pub(crate) fn index_of(&mut self, reference: u32, carries: &str, fits: fn(&Kind) -> bool) -> Result<usize, Fault> {
        let index = index::<E>(reference);
        match E::Model::TABLE.entry(&mut self.current.block, index) {
            Some((meta, _)) if fits(&meta.kind) => Ok(index),
            Some((meta, _)) => Err(message::type_of::<E::Model>(index, meta, carries)),
            None if is_time(reference, self.standard) => Err(message::real(true, carries)),
            None => Err(self.beside_table(reference, carries, false)),
        }
    }

    /// The model has no variable of this type: an error, if one is named.
    pub(crate) fn no_variable(&mut self, references: &[u32], carries: &str) -> Result<(), Fault> {
        references.first().map_or(Ok(()), |&first| self.index_of(first, carries, |_| false).map(|_| ()))
    }

    /// Whether a variable, a text or bytes, can be set in this state, or [kept](keeps). In Continuous-Time Mode an input is discarded
    /// as other discrete inputs are.
    pub(crate) fn check_open(&mut self, index: usize) -> Result<(), Refusal> {
        let state = self.current.life.state();
        let Some((meta, slot)) = E::Model::TABLE.entry(&mut self.current.block, index) else { return Ok(()) };
        if (open(meta, state) || keeps(meta, state)) && !matches!(slot, Slot::Said(_)) {
            return Ok(());
        }
        let fault = message::fixed::<E::Model>(index, meta, state);
        let tried = state == State::Continuous && meta.causality == Causality::Input;
        Err(if tried { Refusal::Discard(fault) } else { Refusal::Error(fault) })
    }

    /// Whether a text or bytes that cannot change now would have another value.
    pub(crate) fn check_kept(&mut self, index: usize, value: &[u8]) -> Result<(), Refusal> {
        let state = self.current.life.state();
        match E::Model::TABLE.entry(&mut self.current.block, index) {
            Some((meta, slot)) if keeps(meta, state) => {
                let same = match &slot {
                    Slot::Text(text) => text.as_bytes() == value,
                    Slot::Binary(bytes) => ***bytes == *value,
                    _ => false,
                };
                if same { Ok(()) } else { Err(message::fixed::<E::Model>(index, meta, state).into()) }
            }
            _ => Ok(()),
        }
    }

    /// Records that some texts or bytes have new values.
    pub(crate) fn was_set(&mut self) {
        let state = self.current.life.state();
        self.current.dirty |= matches!(state, State::Instantiated | State::Initialization);
        self.stale |= self.exchanges() && state == State::Event;
    }
}
