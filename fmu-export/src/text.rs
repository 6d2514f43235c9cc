//! Getting and setting texts. The texts of a getter are kept until the next getter of texts.

use crate::access::{index, is_time, open};
use crate::instance::{Instance, Refusal};
use crate::message;
use fmu_core::{Causality, Exported, Fault, Kind, Model, Slot};
use std::ffi::{CStr, CString};

/// What the functions for texts carry.
const CARRIES: &str = "a text";

impl<E: Exported> Instance<E> {
    /// The texts of variables, `given` of them.
    ///
    /// # Errors
    /// Unknown reference, another type, another number of values, a text that C cannot have.
    pub fn get_texts(&mut self, references: &[u32], given: usize) -> Result<&[CString], Refusal> {
        self.check_count(references, given)?;
        self.refresh();
        let mut texts = Vec::with_capacity(references.len());
        for &reference in references {
            let slot = self.text_of(reference)?;
            let bytes = match &slot {
                Slot::Text(text) => text.as_bytes(),
                Slot::Said(text) => text.as_bytes(),
                _ => &[],
            };
            let nul = |_| Fault::new(format!("{} has a NUL byte", message::name::<E::Model>(index(reference))));
            texts.push(CString::new(bytes).map_err(nul)?);
        }
        self.texts = texts;
        Ok(&self.texts)
    }

    /// Sets `given` texts, each read by its position: all of them or, on an error, none. `None` is NULL. Nothing is read before
    /// all references are known to be texts that can be set.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, another number of values, NULL, not UTF-8.
    pub fn set_texts<'a>(
        &mut self,
        references: &[u32],
        given: usize,
        read: impl Fn(usize) -> Option<&'a CStr>,
    ) -> Result<(), Fault> {
        self.check_count(references, given)?;
        let state = self.current.life.state();
        for &reference in references {
            self.text_of(reference)?;
            let index = index(reference);
            if let Some((meta, _)) = E::Model::TABLE.entry(&mut self.current.block, index)
                && !(meta.causality == Causality::Parameter && open(meta, state))
            {
                return Err(message::fixed::<E::Model>(index, meta, state));
            }
        }
        let mut texts = Vec::with_capacity(given);
        for (i, &reference) in references.iter().enumerate() {
            let name = message::name::<E::Model>(index(reference));
            let value = read(i).ok_or_else(|| Fault::value(&name, "NULL", "a text"))?;
            texts.push(value.to_str().map_err(|_| Fault::new(format!("the new value of {name} is not UTF-8")))?);
        }
        for (&reference, text) in references.iter().zip(texts) {
            if let Some((_, Slot::Text(place))) = E::Model::TABLE.entry(&mut self.current.block, index(reference)) {
                text.clone_into(place);
                self.current.dirty = true;
            }
        }
        Ok(())
    }

    /// The text with this reference.
    fn text_of(&mut self, reference: u32) -> Result<Slot<'_>, Fault> {
        let index = index(reference);
        match E::Model::TABLE.locate(index) {
            Some((_, meta, _)) if meta.kind == Kind::Text => {}
            Some((_, meta, _)) => return Err(message::type_of::<E::Model>(index, meta, CARRIES)),
            None if is_time(reference, self.standard) => return Err(message::real(true, CARRIES)),
            None => return Err(self.beside_table(reference, CARRIES, false)),
        }
        let found = E::Model::TABLE.entry(&mut self.current.block, index);
        found.map(|(_, slot)| slot).ok_or_else(|| message::unknown::<E>(reference, self.standard))
    }
}
