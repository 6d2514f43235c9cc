//! The gate: every call on an instance passes through it. It checks NULL, re-entry, standard and lifecycle, catches panics,
//! logs failures, and advances the lifecycle. Only this file dereferences an instance's pointer.

use super::callbacks::{Callbacks, Lock, Request};
use super::{Abi, Answer, Wanted};
use crate::blob;
use crate::inside::Reply;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::{Allowed, Call, Next, Standard};
use crate::log::{Log, Status};
use crate::message;
use crate::preset::Made;
use crate::resources::folder;
use crate::snapshot::Snapshot;
use fmu_core::{Exported, Fault, Interface, Model};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::ffi::{CStr, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{
    AtomicBool,
    Ordering::{Acquire, Relaxed, Release},
};

/// The called function: its name in C and its row of the lifecycle table.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    name: &'static str,
    pub(crate) standard: Standard,
    allowed: Allowed,
    next: Next,
    preempted: bool,
}

impl Entry {
    /// Looks up the row at compile time.
    pub const fn new(standard: Standard, call: Call, name: &'static str) -> Self {
        Self { name, standard, allowed: Allowed::of(call, standard), next: call.next(), preempted: call.is_preempted() }
    }
}

/// A C function as a type: its entry is known at compile time, and its checks are compiled into it.
pub trait Function {
    /// Its name and its row.
    const ENTRY: Entry;
}

/// Target of the importer's pointer. `busy` during a call: a logger that calls back is refused. `calling` while a callback runs
/// for a call in progress: the lifecycle table lists the calls that it may make.
struct Handle<E: Exported> {
    busy: AtomicBool,
    calling: AtomicBool,
    callbacks: Callbacks,
    instance: UnsafeCell<Instance<E>>,
}

impl<E: Exported> Handle<E> {
    /// Whether this call has exclusive access to the instance. In Scheduled Execution, calls of several threads interleave.
    #[inline]
    fn take(&self) -> bool {
        if const { E::CAN.scheduled } {
            return !self.busy.swap(true, Acquire);
        }
        let busy = self.busy.load(Relaxed);
        self.busy.store(true, Relaxed);
        !busy
    }

    #[inline]
    fn give(&self) {
        self.busy.store(false, if const { E::CAN.scheduled } { Release } else { Relaxed });
    }

    /// Locks the importer's scheduler for a call that it may interrupt, unless the call comes from a callback.
    #[inline]
    fn lock<F: Function>(&self) -> Option<Lock> {
        let locks = const { E::CAN.scheduled && F::ENTRY.preempted };
        if locks && CALLING.get() != self.address() { self.callbacks.lock() } else { None }
    }

    fn address(&self) -> *const () {
        std::ptr::from_ref(self).cast()
    }
}

thread_local! {
    /// The handle whose callback this thread runs: its calls already have the lock, and those of other threads wait for it.
    static CALLING: Cell<*const ()> = const { Cell::new(std::ptr::null()) };
}

/// Passes a call to the instance.
///
/// # Safety
/// `pointer` is NULL, or comes from [`open`] for the same `E` and was not closed; no other thread uses it now.
#[inline]
pub(crate) unsafe fn enter<E: Exported, F: Function>(
    pointer: *mut c_void,
    body: impl FnOnce(Abi<'_, E>) -> Answer,
) -> c_int {
    if pointer.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: the caller's promise.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    let _lock = handle.lock::<F>();
    pass_one::<E, F>(handle, body)
}

#[inline]
fn pass_one<E: Exported, F: Function>(handle: &Handle<E>, body: impl FnOnce(Abi<'_, E>) -> Answer) -> c_int {
    if !handle.take() {
        return Status::Error as c_int;
    }
    // SAFETY: `busy` was false, so no other call of this thread holds the instance, and no other thread uses it.
    let instance = unsafe { &mut *handle.instance.get() };
    let status =
        if const { calls_back::<E>() } && handle.calling.load(Relaxed) && !instance.current.life.state().calls_back() {
            instance.log.error(&format!("{}: not allowed: an earlier call of this callback failed", F::ENTRY.name));
            Status::Error
        } else {
            pass(const { &F::ENTRY }, instance, body)
        };
    handle.give();
    status as c_int
}

/// Whether a call of the model can call the importer, which may call the instance again.
const fn calls_back<E: Exported>() -> bool {
    E::CAN.intermediate.is_some() || E::CAN.scheduled
}

/// Passes a call to the instance in parts. If a part requests it, the gate then calls the importer, while no part of the instance
/// is borrowed and it is not busy; the lifecycle table lists the calls that the callback may make. If one of them fails, this
/// call fails.
///
/// # Safety
/// As [`enter`].
pub(crate) unsafe fn enter_parts<E: Exported, F: Function>(
    pointer: *mut c_void,
    mut part: impl FnMut(Abi<'_, E>, Reply) -> Result<Option<Request>, Refusal>,
) -> c_int {
    if pointer.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: the caller's promise; the instance lives on, because `close` does not free an instance during a callback.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    let _lock = handle.lock::<F>();
    let mut reply = None;
    loop {
        let mut request = None;
        let status = pass_one::<E, F>(handle, |mut abi| {
            request = part(Abi(&mut *abi.0), reply)?;
            if request.is_some() {
                abi.current.life.call_back();
            }
            Ok(())
        });
        let Some(request) = request else { return status };
        handle.calling.store(true, Relaxed);
        if const { E::CAN.scheduled } {
            let outer = CALLING.replace(handle.address());
            reply = handle.callbacks.call(request);
            CALLING.set(outer);
        } else {
            reply = handle.callbacks.call(request);
        }
        handle.calling.store(false, Relaxed);
        // Another thread may be in a call, if the importer passed no lock.
        while !handle.take() {
            std::thread::yield_now();
        }
        // SAFETY: `busy` was false, as in `pass_one`.
        let instance = unsafe { &mut *handle.instance.get() };
        let waited = instance.current.life.called_back();
        if !waited {
            instance.log.error(&format!("{}: a call of the callback failed", F::ENTRY.name));
        }
        handle.give();
        if !waited {
            return Status::Error as c_int;
        }
    }
}

#[inline]
fn pass<E: Exported>(
    entry: &'static Entry,
    instance: &mut Instance<E>,
    body: impl FnOnce(Abi<'_, E>) -> Answer,
) -> Status {
    let life = instance.current.life;
    if instance.standard != entry.standard || !entry.allowed.of_interface(life.interface()).contains(life.state()) {
        return fail(entry, instance, Refusal::Error(misplaced(entry, instance)));
    }
    // A panic can leave a half-done step; only Reset, SetFMUState and Free leave the Error state.
    match catch_unwind(AssertUnwindSafe(|| body(Abi(instance)))) {
        Ok(Ok(())) => {
            instance.current.life.after(true, entry.next);
            Status::Ok
        }
        Ok(Err(refusal)) => fail(entry, instance, refusal),
        Err(payload) => fail(entry, instance, Refusal::Error(panicked(payload.as_ref()))),
    }
}

#[cold]
fn fail<E: Exported>(entry: &'static Entry, instance: &mut Instance<E>, refusal: Refusal) -> Status {
    match refusal {
        Refusal::Error(fault) => {
            instance.current.life.after(false, Next::Stay);
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
fn misplaced<E: Exported>(entry: &'static Entry, instance: &Instance<E>) -> Fault {
    if instance.standard != entry.standard {
        return Fault::new("the instance was made by the other standard's function");
    }
    let (state, interface) = (instance.current.life.state(), instance.current.life.interface());
    let allowed = entry.allowed.of_interface(interface);
    if allowed.is_empty() {
        return Fault::new(format!("not allowed: the instance is one {}", message::made_for(interface)));
    }
    Fault::new(format!("not allowed in the state {state}; allowed in: {allowed}"))
}

pub(super) fn panicked(payload: &(dyn Any + Send)) -> Fault {
    let text = payload.downcast_ref::<&str>().copied();
    let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
    Fault::new(format!("a fault in the model's code (panic): {}", text.unwrap_or("no message")))
}

/// How the importer makes communication steps.
#[derive(Clone, Copy)]
pub(crate) struct Steps<'a> {
    /// They may end early.
    pub(crate) early_return: bool,
    /// The callback functions.
    pub(crate) callbacks: Callbacks,
    /// The variables that it uses inside a step.
    pub(crate) required: &'a [u32],
}

impl Steps<'_> {
    /// Whole steps.
    pub(crate) const WHOLE: Self = Self { early_return: false, callbacks: Callbacks::NONE, required: &[] };
}

/// A new instance for the importer, or NULL and a message.
pub(crate) fn open<E: Exported>(
    entry: &'static Entry,
    log: Log,
    wanted: Result<Wanted, Fault>,
    resources: Option<&CStr>,
    interface: Interface,
    steps: Steps<'_>,
) -> *mut c_void {
    let make = |suffix: &str| {
        let made = catch_unwind(|| {
            let resources = folder(resources);
            let mut block = Made::<E::Model>::asked(&E::CAN, resources.as_deref(), suffix)?.block;
            block.model.load(resources.as_deref())?;
            if const { E::Model::TABLE.has_sizes() } {
                // The arrays of its outputs get their lengths.
                block.initialize();
            }
            let shelf = blob::shelf(&block.model);
            Ok((block, shelf))
        });
        made.unwrap_or_else(|payload| Err(panicked(payload.as_ref())))
    };
    match wanted.and_then(|Wanted { name, suffix }| Ok((name, make(&suffix)?, suffix))) {
        Ok((name, (block, shelf), suffix)) => {
            let made = (!shelf.is_empty() || !suffix.is_empty()).then(|| Box::new(block.clone()));
            let mut instance = Instance::<E>::new(entry.standard, name, log, Snapshot::of(interface, block));
            (instance.shelf, instance.made, instance.early_return) = (shelf, made, steps.early_return);
            if const { E::CAN.intermediate.is_some() }
                && steps.callbacks.intermediate.is_some()
                && let Err(fault) = instance.look_inside(steps.required)
            {
                instance.log.error(&format!("{}: {fault}", entry.name));
                return std::ptr::null_mut();
            }
            let (busy, calling) = (AtomicBool::new(false), AtomicBool::new(false));
            let instance = UnsafeCell::new(instance);
            Box::into_raw(Box::new(Handle { busy, calling, callbacks: steps.callbacks, instance })).cast()
        }
        Err(fault) => {
            log.error(&format!("{}: {fault}", entry.name));
            std::ptr::null_mut()
        }
    }
}

/// Frees an instance; ignores NULL and a callback that frees the instance it is called for.
///
/// # Safety
/// As [`enter`]; the pointer is not used again.
pub(crate) unsafe fn close<E: Exported>(pointer: *mut c_void) {
    if pointer.is_null() {
        return;
    }
    // SAFETY: the caller's promise.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    if !handle.busy.load(Acquire) && !handle.calling.load(Relaxed) {
        // SAFETY: from `open`, closed once by the caller's promise, not in use. A panic in a model's drop stops here.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(unsafe { Box::from_raw(pointer.cast::<Handle<E>>()) })));
    }
}
