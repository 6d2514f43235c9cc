//! Getting and setting bytes (FMI 3.0). A getter passes the model's bytes to the importer without a copy; a setter copies into
//! memory reserved with the instance.

use crate::access::index;
use crate::habit::Habit;
use crate::instance::{Instance, Refusal};
use crate::message;
use fmu_core::{Block, Exported, Fault, Kind, Kinds, Model, Slot};

/// The type used by the functions for bytes.
const CARRIES: &str = "bytes";

/// Reserves the maximum size of every binary variable, so that no step and no setter allocates.
pub(crate) fn make_room<M: Model>(block: &mut Block<M>) {
    if const { !M::TABLE.kinds().meets(Kinds::BINARY) } {
        return;
    }
    for index in M::TABLE.indices() {
        if let Some((meta, Slot::Binary(bytes))) = M::TABLE.entry(block, index)
            && let Kind::Binary { most, .. } = meta.kind
        {
            bytes.reserve(most);
        }
    }
}

impl<E: Exported> Instance<E> {
    /// Passes the bytes of `given` variables to `take`; they remain valid until the next call that changes them.
    ///
    /// # Errors
    /// Unknown reference, another type, another number of values, more bytes than the maximum of the variable.
    pub fn get_bytes(&mut self, references: &[u32], given: usize, mut take: impl FnMut(&[u8])) -> Result<(), Refusal> {
        self.check_count(references, given)?;
        self.refresh();
        if const { !E::Model::TABLE.kinds().meets(Kinds::BINARY) } {
            return Ok(self.no_variable(references, CARRIES)?);
        }
        for &reference in references {
            let index = self.index_of(reference, CARRIES, is_binary)?;
            let Some((meta, slot)) = E::Model::TABLE.entry(&mut self.current.block, index) else { continue };
            let (allowed, Slot::Binary(bytes)) = (slot.is_allowed(meta), slot) else { continue };
            if !allowed {
                let found = format!("{} bytes", bytes.len());
                return Err(message::range(&mut self.current.block, index, meta, found).into());
            }
            take(bytes);
        }
        Ok(())
    }

    /// Sets bytes of these sizes, each read by its position: all of them or, on an error, none. All references and sizes are
    /// checked before anything is read.
    ///
    /// # Errors
    /// Unknown reference, another type, not settable in this state, another number of values, a size that is too large, NULL.
    pub fn set_bytes<'a>(
        &mut self,
        references: &[u32],
        sizes: &[usize],
        read: impl Fn(usize) -> Result<&'a [u8], Fault>,
    ) -> Result<(), Refusal> {
        self.check_count(references, sizes.len())?;
        if const { !E::Model::TABLE.kinds().meets(Kinds::BINARY) } {
            return Ok(self.no_variable(references, CARRIES)?);
        }
        for (&reference, &size) in references.iter().zip(sizes) {
            let index = self.index_of(reference, CARRIES, is_binary)?;
            self.check_open(index)?;
            match E::Model::TABLE.entry(&mut self.current.block, index) {
                Some((meta, _)) if !matches!(meta.kind, Kind::Binary { most, .. } if size <= most) => {
                    return Err(
                        message::range(&mut self.current.block, index, meta, format_args!("{size} bytes")).into()
                    );
                }
                _ => {}
            }
        }
        for (i, &reference) in references.iter().enumerate() {
            self.check_kept(index::<E>(reference), read(i)?)?;
        }
        for (i, &reference) in references.iter().enumerate() {
            if self.stays(index::<E>(reference)) {
                self.forgive(Habit::Fixed);
            } else if let Some((_, Slot::Binary(bytes))) =
                E::Model::TABLE.entry(&mut self.current.block, index::<E>(reference))
            {
                bytes.set(read(i)?);
            }
        }
        if !references.is_empty() {
            self.was_set();
        }
        Ok(())
    }
}

fn is_binary(kind: &Kind) -> bool {
    matches!(kind, Kind::Binary { .. })
}
