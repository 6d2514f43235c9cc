//! The gate: every call on an instance passes here. NULL, re-entry, standard and lifecycle are checked, panics caught,
//! failures logged, and the state of the lifecycle follows. The only place where an instance's pointer is followed.

use crate::instance::Instance;
use crate::lifecycle::{Call, Standard, State, States};
use crate::log::{Log, Status};
use crate::snapshot::Snapshot;
use fmu_core::{Fault, Model};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::ffi::{c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Which function was called: its name in C and its row of the lifecycle table.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    name: &'static str,
    pub(crate) standard: Standard,
    states: States,
    next: Option<State>,
}

impl Entry {
    /// Looks up the row at compile time.
    pub const fn new(standard: Standard, call: Call, name: &'static str) -> Self {
        Self { name, standard, states: call.states(standard), next: call.next() }
    }
}

/// Why a call failed.
pub(crate) enum Refusal {
    /// Status Error: the instance goes to the Error state.
    Error(Fault),
    /// Status Discard: nothing changes.
    Discard(Fault),
}

impl From<Fault> for Refusal {
    fn from(fault: Fault) -> Self {
        Self::Error(fault)
    }
}

/// Target of the importer's pointer. `busy` during a call: a logger that calls back is refused.
struct Handle<M: Model> {
    busy: Cell<bool>,
    instance: UnsafeCell<Instance<M>>,
}

/// Passes a call to the instance.
///
/// # Safety
/// `pointer` is NULL, or comes from [`open`] for the same `M` and was not closed; no other thread uses it now.
#[inline]
pub(crate) unsafe fn enter<M: Model>(
    entry: Entry,
    pointer: *mut c_void,
    body: impl FnOnce(&mut Instance<M>) -> Result<(), Refusal>,
) -> c_int {
    if pointer.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: the caller's promise.
    let handle = unsafe { &*pointer.cast::<Handle<M>>() };
    if handle.busy.replace(true) {
        return Status::Error as c_int;
    }
    // SAFETY: `busy` was false, so no other call of this thread holds the instance, and no other thread uses it.
    let instance = unsafe { &mut *handle.instance.get() };
    let status = pass(entry, instance, body);
    handle.busy.set(false);
    status as c_int
}

#[inline]
fn pass<M: Model>(
    entry: Entry,
    instance: &mut Instance<M>,
    body: impl FnOnce(&mut Instance<M>) -> Result<(), Refusal>,
) -> Status {
    if instance.standard != entry.standard || !entry.states.contains(instance.current.life.state()) {
        return fail(entry, instance, Refusal::Error(misplaced(entry, instance)));
    }
    // A panic can leave a half-done step; from the Error state, only Reset, SetFMUState and Free lead out.
    match catch_unwind(AssertUnwindSafe(|| body(instance))) {
        Ok(Ok(())) => {
            instance.current.life.after(true, entry.next);
            Status::Ok
        }
        Ok(Err(refusal)) => fail(entry, instance, refusal),
        Err(payload) => fail(entry, instance, Refusal::Error(panicked(payload.as_ref()))),
    }
}

#[cold]
fn fail<M: Model>(entry: Entry, instance: &mut Instance<M>, refusal: Refusal) -> Status {
    match refusal {
        Refusal::Error(fault) => {
            instance.current.life.after(false, None);
            instance.log.error(&format!("{}: {fault}", entry.name));
            Status::Error
        }
        Refusal::Discard(fault) => {
            instance.log.discard(&format!("{}: {fault}", entry.name));
            Status::Discard
        }
    }
}

#[cold]
fn misplaced<M: Model>(entry: Entry, instance: &Instance<M>) -> Fault {
    if instance.standard != entry.standard {
        return Fault::new("the instance was made by the other standard's function");
    }
    let state = instance.current.life.state();
    Fault::new(format!("not allowed in the state {state}; allowed in: {}", entry.states))
}

fn panicked(payload: &(dyn Any + Send)) -> Fault {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    Fault::new(format!("a fault in the model's code (panic): {}", text.unwrap_or("no message")))
}

/// A new instance for the importer, or NULL and a message.
pub(crate) fn open<M: Model>(entry: Entry, log: Log, name: Result<String, Fault>) -> *mut c_void {
    let model = || catch_unwind(Snapshot::<M>::default).map_err(|payload| panicked(payload.as_ref()));
    match name.and_then(|name| Ok((name, model()?))) {
        Ok((name, current)) => {
            let instance = UnsafeCell::new(Instance::new(entry.standard, name, log, current));
            Box::into_raw(Box::new(Handle { busy: Cell::new(false), instance })).cast()
        }
        Err(fault) => {
            log.error(&format!("{}: {fault}", entry.name));
            std::ptr::null_mut()
        }
    }
}

/// Frees an instance; ignores NULL and a logger that frees the instance it logs for.
///
/// # Safety
/// As [`enter`]; the pointer is not used again.
pub(crate) unsafe fn close<M: Model>(pointer: *mut c_void) {
    if pointer.is_null() {
        return;
    }
    // SAFETY: the caller's promise.
    let busy = unsafe { &*pointer.cast::<Handle<M>>() }.busy.get();
    if !busy {
        // SAFETY: from `open`, closed once by the caller's promise, not in use. A panic in a model's drop stops here.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(unsafe { Box::from_raw(pointer.cast::<Handle<M>>()) })));
    }
}
