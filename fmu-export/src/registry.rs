//! The saved FMU states, and the handles that represent them in C.
//!
//! A handle is a unique number, not an address: it is looked up and never dereferenced. A foreign, freed or garbage `FMUState`
//! therefore causes an error with a message, never a crash. This is the only global of a binary; a step does not touch it.

use crate::snapshot::Snapshot;
use fmu_core::{Fault, Model};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Distance of two handles: they look like the aligned pointers that some importers expect.
const STRIDE: usize = 16;

struct Registry {
    last: usize,
    states: BTreeMap<usize, Box<dyn Any + Send>>,
}

static REGISTRY: Mutex<Registry> = Mutex::new(Registry { last: 0, states: BTreeMap::new() });

fn registry() -> MutexGuard<'static, Registry> {
    REGISTRY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Stores a state and returns its handle, never 0.
pub fn keep<M: Model>(state: Snapshot<M>) -> usize {
    let mut registry = registry();
    registry.last += STRIDE;
    let handle = registry.last;
    registry.states.insert(handle, Box::new(state));
    handle
}

/// Works with the state behind a handle.
///
/// # Errors
/// The handle is unknown, was freed or belongs to another model; or the error of `work`.
pub fn with<M: Model, T>(handle: usize, work: impl FnOnce(&mut Snapshot<M>) -> Result<T, Fault>) -> Result<T, Fault> {
    match registry().states.get_mut(&handle).and_then(|state| state.downcast_mut()) {
        Some(state) => work(state),
        None => Err(unknown(handle)),
    }
}

/// Frees the state behind a handle; ignores 0.
///
/// # Errors
/// As [`with`].
pub fn free<M: Model>(handle: usize) -> Result<(), Fault> {
    if handle == 0 {
        return Ok(());
    }
    let mut registry = registry();
    if !registry.states.get(&handle).is_some_and(|state| state.is::<Snapshot<M>>()) {
        return Err(unknown(handle));
    }
    registry.states.remove(&handle);
    if registry.states.is_empty() {
        // An empty map still owns a node, which would leak when the importer unloads the binary.
        registry.states = BTreeMap::new();
    }
    Ok(())
}

fn unknown(handle: usize) -> Fault {
    if handle == 0 {
        return Fault::new("the FMU state is NULL; one that this FMU gave is expected");
    }
    Fault::new(format!(
        "the FMU state {handle:#x} is not one that this FMU gave, or it was freed; to get a new one, pass the address of NULL"
    ))
}
