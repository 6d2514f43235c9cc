//! Saved states with arbitrary arguments.

use super::super::log::Status;
use super::super::signatures::{Deserialize, Serialize, SetState, StatePlace, StatePointer, StateSize};
use super::{Handle, Raw, SavedState};
use model_description::FmiVersion;
use std::ptr;

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

    /// `GetFMUState`; `None` for the place passes NULL.
    pub fn get_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        self.with_place("Get", instance, place)
    }

    /// `FreeFMUState`, as [`get_state`](Self::get_state).
    pub fn free_state(&self, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        self.with_place("Free", instance, place)
    }

    fn with_place(&self, name: &str, instance: Handle, place: Option<&mut SavedState>) -> Option<Status> {
        let f: StatePlace = self.function(&self.state_name(name))?;
        match place {
            // SAFETY: the standards' type; NULL is what the checker wants to pass.
            None => Some(unsafe { f(instance.pointer(), ptr::null_mut()) }),
            Some(place) => {
                let mut pointer = place.pointer();
                // SAFETY: the standards' type; the place is ours.
                let status = unsafe { f(instance.pointer(), &raw mut pointer) };
                *place = SavedState(pointer.expose_provenance());
                Some(status)
            }
        }
    }

    /// `SetFMUState`.
    pub fn set_state(&self, instance: Handle, state: SavedState) -> Option<Status> {
        let f: SetState = self.function(&self.state_name("Set"))?;
        // SAFETY: the standards' type; a foreign state is what the checker wants to pass.
        Some(unsafe { f(instance.pointer(), state.pointer()) })
    }

    /// `SerializedFMUStateSize`.
    pub fn state_size(&self, instance: Handle, state: SavedState) -> Option<(Status, usize)> {
        let (f, mut size): (StateSize, _) = (self.function(&self.state_name("Size"))?, 0);
        // SAFETY: the standards' type; the place is ours.
        Some((unsafe { f(instance.pointer(), state.pointer(), &raw mut size) }, size))
    }

    /// `SerializeFMUState` into a buffer of this many bytes; the bytes past it must not change.
    pub fn serialize(&self, instance: Handle, state: SavedState, size: usize) -> Option<(Status, Vec<u8>, bool)> {
        let f: Serialize = self.function(&self.state_name("Serialize"))?;
        let mut bytes = vec![0xc5_u8; size + 256];
        // SAFETY: the standards' type; the buffer is longer than said.
        let status = unsafe { f(instance.pointer(), state.pointer(), bytes.as_mut_ptr(), size) };
        let intact = bytes[size..].iter().all(|b| *b == 0xc5);
        bytes.truncate(size);
        Some((status, bytes, intact))
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
        // SAFETY: the standards' type; as many bytes as said, or NULL.
        let status = unsafe { f(instance.pointer(), pointer, size, &raw mut state) };
        Some((status, SavedState(state.expose_provenance())))
    }
}
