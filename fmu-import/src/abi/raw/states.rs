//! Saved states with arbitrary arguments.

use super::super::arguments::{Array, ArrayMut};
use super::super::live::{FILL, room};
use super::super::log::Status;
use super::library::Raw;
use super::owned::{Handle, SavedState};

/// Bytes past a buffer that show whether the FMU writes there.
const GUARD: usize = 256;

impl Raw {
    /// `GetFMUState`; `None` passes NULL. An existing state is offered to the FMU to be overwritten. The variable keeps its
    /// value if the FMU refuses.
    pub fn get_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        let mut owned = self.owned();
        let (i, before) = (owned.pointer(instance), place.as_ref().map(|place| owned.state(**place)));
        let (status, pointer) = self.calls.get_state(i, before).result()?;
        if let (Some(place), Some(before)) = (place, before.map(|before| before.0))
            && status.is_ok()
            && pointer != before
        {
            owned.forget_state(*place);
            *place = owned.take_state(instance, pointer);
        }
        Some(status)
    }

    /// `FreeFMUState`; `None` passes NULL. The variable becomes [`SavedState::NULL`] if the FMU writes NULL; otherwise it keeps
    /// its value, which no call accepts any more.
    pub fn free_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        let mut owned = self.owned();
        let state = place.as_ref().map(|place| owned.forget_state(**place));
        // SAFETY: the table no longer contains the state, freed or not.
        let (status, pointer) = unsafe { self.calls.free_state(owned.pointer(instance), state) }.result()?;
        if let Some(place) = place
            && pointer.is_null()
        {
            *place = SavedState::NULL;
        }
        Some(status)
    }

    /// `SetFMUState`; the checker also passes the state of another instance.
    pub fn set_state(&self, instance: Handle, state: SavedState) -> Option<Status> {
        let owned = self.owned();
        self.calls.set_state(owned.pointer(instance), owned.state(state)).status()
    }

    /// `SerializedFMUStateSize`.
    pub fn state_size(&self, instance: Handle, state: SavedState) -> Option<(Status, usize)> {
        let owned = self.owned();
        self.calls.state_size(owned.pointer(instance), owned.state(state)).result()
    }

    /// `SerializeFMUState` into a buffer of this many bytes: the status, the bytes, and whether those past them kept their
    /// values.
    ///
    /// # Errors
    /// The size, possibly stated by the FMU, is more than 1 GiB.
    pub fn serialize(
        &self,
        instance: Handle,
        state: SavedState,
        size: usize,
    ) -> Result<Option<(Status, Vec<u8>, bool)>, String> {
        let mut bytes = room(size, GUARD)?;
        let owned = self.owned();
        let place = ArrayMut::of(Some(&mut bytes), size);
        let status = self.calls.serialize(owned.pointer(instance), owned.state(state), place).status();
        let intact = bytes[size..].iter().all(|b| *b == FILL);
        bytes.truncate(size);
        Ok(status.map(|status| (status, bytes, intact)))
    }

    /// `DeserializeFMUState`; `None` passes NULL with this size.
    ///
    /// # Panics
    /// There are fewer than `size` bytes.
    pub fn deserialize(&self, instance: Handle, bytes: Option<&[u8]>, size: usize) -> Option<(Status, SavedState)> {
        let mut owned = self.owned();
        let bytes = Array::of(bytes, size);
        let (status, state) = self.calls.deserialize(owned.pointer(instance), bytes).result()?;
        let state = if status.is_ok() { owned.take_state(instance, state) } else { SavedState::NULL };
        Some((status, state))
    }
}
