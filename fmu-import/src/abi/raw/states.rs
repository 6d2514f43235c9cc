//! Saved states with arbitrary arguments.

use super::super::log::Status;
use super::super::signatures::{Deserialize, Serialize, SetState, StatePlace, StatePointer, StateSize};
use super::{Handle, Raw, SavedState};
use crate::abi::shared::{FILL, room};
use model_description::FmiVersion;
use std::ptr;

/// Bytes past a buffer that show whether the FMU writes there.
const GUARD: usize = 256;

impl Raw {
    /// The names of the functions of FMU states, which the standards spell differently.
    pub fn state_name(&self, name: &str) -> String {
        match (self.version, name) {
            (FmiVersion::V2, "Deserialize") => "DeSerializeFMUstate".into(),
            (FmiVersion::V2, "Size") => "SerializedFMUstateSize".into(),
            (FmiVersion::V3, "Size") => "SerializedFMUStateSize".into(),
            (FmiVersion::V2, _) => format!("{name}FMUstate"),
            (FmiVersion::V3, _) => format!("{name}FMUState"),
        }
    }

    /// `GetFMUState`; `None` for the place passes NULL. A state in the place is offered to the FMU to be overwritten. The
    /// place keeps its value if the FMU refuses.
    pub fn get_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        let f: StatePlace = self.function(&self.state_name("Get"))?;
        let mut owned = self.owned();
        let i = owned.pointer(instance);
        let Some(place) = place else {
            // SAFETY: the standards' type; NULL is what the checker wants to pass.
            return Some(unsafe { f(i, ptr::null_mut()) });
        };
        let before = owned.state(*place);
        let mut pointer = before;
        // SAFETY: the standards' type; the place is ours.
        let status = unsafe { f(i, &raw mut pointer) };
        if status.is_ok() && pointer != before {
            owned.forget_state(*place);
            *place = owned.take_state(instance, pointer);
        }
        Some(status)
    }

    /// `FreeFMUState`; `None` for the place passes NULL. The place becomes [`SavedState::NULL`] if the FMU writes NULL;
    /// otherwise it keeps its value, which is of no more use.
    pub fn free_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        let f: StatePlace = self.function(&self.state_name("Free"))?;
        let mut owned = self.owned();
        let i = owned.pointer(instance);
        let Some(place) = place else {
            // SAFETY: as in `get_state`.
            return Some(unsafe { f(i, ptr::null_mut()) });
        };
        let mut pointer = owned.state(*place);
        owned.forget_state(*place);
        // SAFETY: the standards' type; the place is ours; the table has forgotten the state, freed or not.
        let status = unsafe { f(i, &raw mut pointer) };
        if pointer.is_null() {
            *place = SavedState::NULL;
        }
        Some(status)
    }

    /// `SetFMUState`.
    pub fn set_state(&self, instance: Handle, state: SavedState) -> Option<Status> {
        let f: SetState = self.function(&self.state_name("Set"))?;
        let owned = self.owned();
        // SAFETY: the standards' type; the state of another instance is what the checker wants to pass.
        Some(unsafe { f(owned.pointer(instance), owned.state(state)) })
    }

    /// `SerializedFMUStateSize`.
    pub fn state_size(&self, instance: Handle, state: SavedState) -> Option<(Status, usize)> {
        let (f, mut size): (StateSize, _) = (self.function(&self.state_name("Size"))?, 0);
        let owned = self.owned();
        // SAFETY: the standards' type; the place is ours.
        Some((unsafe { f(owned.pointer(instance), owned.state(state), &raw mut size) }, size))
    }

    /// `SerializeFMUState` into a buffer of this many bytes: the status, the bytes, and whether those past them kept their
    /// values.
    ///
    /// # Errors
    /// The size, which may be what the FMU said, is more than 1 GiB.
    pub fn serialize(
        &self,
        instance: Handle,
        state: SavedState,
        size: usize,
    ) -> Result<Option<(Status, Vec<u8>, bool)>, String> {
        let Some(f) = self.function::<Serialize>(&self.state_name("Serialize")) else { return Ok(None) };
        let mut bytes = room(size, GUARD)?;
        let owned = self.owned();
        // SAFETY: the standards' type; the buffer is longer than said.
        let status = unsafe { f(owned.pointer(instance), owned.state(state), bytes.as_mut_ptr(), size) };
        let intact = bytes[size..].iter().all(|b| *b == FILL);
        bytes.truncate(size);
        Ok(Some((status, bytes, intact)))
    }

    /// `DeserializeFMUState`; `None` passes NULL with this size.
    ///
    /// # Panics
    /// There are fewer than `size` bytes.
    pub fn deserialize(&self, instance: Handle, bytes: Option<&[u8]>, size: usize) -> Option<(Status, SavedState)> {
        let (f, mut state): (Deserialize, StatePointer) =
            (self.function(&self.state_name("Deserialize"))?, ptr::null_mut());
        assert!(bytes.is_none_or(|b| size <= b.len()), "there are fewer bytes than the size");
        let pointer = bytes.map_or(ptr::null(), <[u8]>::as_ptr);
        let mut owned = self.owned();
        // SAFETY: the standards' type; as many bytes as said, or NULL.
        let status = unsafe { f(owned.pointer(instance), pointer, size, &raw mut state) };
        let state = if status.is_ok() { owned.take_state(instance, state) } else { SavedState::NULL };
        Some((status, state))
    }
}
