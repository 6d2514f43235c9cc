//! The living instances and saved states of an FMU, as entries of a table.
//!
//! Safe code has no address, so it cannot pass a wild or freed one, or one of another binary, to the FMU.

use crate::abi::arguments::Given;
use std::ffi::c_void;
use std::ptr;
use std::sync::atomic::{AtomicU64, Ordering};

/// An entry of the table of one [`Raw`](super::Raw).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    /// Number of the `Raw`.
    of: u64,
    index: usize,
}

/// An instance of a [`Raw`](super::Raw), or NULL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Handle(Option<Place>);

impl Handle {
    /// NULL.
    pub const NULL: Self = Self(None);
}

/// An FMU state of a [`Raw`](super::Raw), or NULL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SavedState(Option<Place>);

impl SavedState {
    /// No state.
    pub const NULL: Self = Self(None);
}

/// A state that the FMU gave to an instance.
#[derive(Debug)]
struct Held {
    /// 0 after it was freed.
    address: usize,
    /// Index of its instance; the state is freed with it.
    instance: Option<usize>,
}

/// Instances and states of one [`Raw`](super::Raw).
#[derive(Debug)]
pub(super) struct Owned {
    /// Unique number of the `Raw`.
    of: u64,
    /// Addresses of the instances; 0 after they were freed.
    instances: Vec<usize>,
    states: Vec<Held>,
}

impl Owned {
    pub(super) fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self { of: NEXT.fetch_add(1, Ordering::Relaxed), instances: Vec::new(), states: Vec::new() }
    }

    /// Index of a living instance; `None` for NULL.
    ///
    /// # Panics
    /// The instance is freed or of another binary.
    fn instance(&self, handle: Handle) -> Option<usize> {
        let Place { of, index } = handle.0?;
        assert!(of == self.of, "the instance is of another binary");
        assert!(self.instances[index] != 0, "the instance is freed");
        Some(index)
    }

    /// Address of an instance, or NULL.
    ///
    /// # Panics
    /// As [`instance`](Self::instance).
    pub(super) fn pointer<'a>(&self, handle: Handle) -> Given<'a> {
        let address = self.instance(handle).map_or(0, |index| self.instances[index]);
        // SAFETY: an instance that the table has, which is locked for one call, or NULL.
        unsafe { Given::new(ptr::with_exposed_provenance_mut(address)) }
    }

    /// Index of a living state; `None` for NULL.
    fn state_index(&self, state: SavedState) -> Option<usize> {
        let Place { of, index } = state.0?;
        assert!(of == self.of, "the state is of another binary");
        assert!(self.states[index].address != 0, "the state was freed, individually or with its instance");
        Some(index)
    }

    /// Address of a state, or NULL.
    ///
    /// # Panics
    /// The state was freed, individually or with its instance, or belongs to another binary.
    pub(super) fn state<'a>(&self, state: SavedState) -> Given<'a> {
        let address = self.state_index(state).map_or(0, |index| self.states[index].address);
        // SAFETY: a state that the table has, which is locked for one call, or NULL.
        unsafe { Given::new(ptr::with_exposed_provenance_mut(address)) }
    }

    /// Takes an instance from the FMU; `None` for NULL.
    pub(super) fn take_instance(&mut self, pointer: *mut c_void) -> Option<Handle> {
        let address = pointer.expose_provenance();
        (address != 0).then(|| {
            self.instances.push(address);
            Handle(Some(Place { of: self.of, index: self.instances.len() - 1 }))
        })
    }

    /// Forgets an instance and its states; returns its address, or NULL.
    ///
    /// # Panics
    /// As [`instance`](Self::instance).
    pub(super) fn forget_instance<'a>(&mut self, handle: Handle) -> Given<'a> {
        let pointer = self.pointer(handle);
        if let Some(index) = self.instance(handle) {
            self.instances[index] = 0;
            self.states.iter_mut().filter(|state| state.instance == Some(index)).for_each(|state| state.address = 0);
        }
        pointer
    }

    /// Takes a state that the FMU gave to an instance.
    pub(super) fn take_state(&mut self, instance: Handle, pointer: *mut c_void) -> SavedState {
        let address = pointer.expose_provenance();
        if address == 0 {
            return SavedState::NULL;
        }
        self.states.push(Held { address, instance: self.instance(instance) });
        SavedState(Some(Place { of: self.of, index: self.states.len() - 1 }))
    }

    /// Forgets a state; returns its address, or NULL.
    pub(super) fn forget_state<'a>(&mut self, state: SavedState) -> Given<'a> {
        let pointer = self.state(state);
        if let Some(index) = self.state_index(state) {
            self.states[index].address = 0;
        }
        pointer
    }
}
