//! The gate: every call on an instance passes through it. It checks NULL, re-entry, standard and lifecycle, catches panics,
//! logs failures, and advances the lifecycle. Only this file dereferences an instance's pointer.

use super::callbacks::{Callbacks, Lock, Request};
use super::fault::panicked;
use super::{Abi, Answer, Wanted};
use crate::call_log::CallLog;
use crate::inside::Reply;
use crate::instance::{Instance, Refusal};
use crate::lifecycle::{Allowed, Call, Next, Standard};
use crate::log::{Log, Status};
use crate::message;
use crate::origin::Origin;
use crate::resources::folder;
use crate::snapshot::Snapshot;
use fmu_core::call_log::{CallEnd, LogValue};
use fmu_core::{Exported, Fault, Interface};
use std::any::Any;
use std::cell::{Cell, UnsafeCell};
use std::ffi::{CStr, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{
    AtomicBool, AtomicU8,
    Ordering::{Acquire, Relaxed, Release},
};
use std::sync::{Mutex, PoisonError};

/// The called function: its name in C and its row of the lifecycle table.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub(super) name: &'static str,
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

/// No call uses the instance.
pub(super) const FREE: u8 = 0;
/// A call uses it: a logger that calls back is refused.
const BUSY: u8 = 1;
/// No call uses it, and the next one is written into its call log. To a call, it is as unusual as a busy one, so that the log
/// costs nothing where there is none.
pub(super) const LOGGED: u8 = 2;

/// Target of the importer's pointer. `calling` while a callback runs for a call in progress: the lifecycle table lists the calls
/// that it may make.
pub(super) struct Handle<E: Exported> {
    /// [`FREE`], [`BUSY`] or [`LOGGED`].
    usage: AtomicU8,
    calling: AtomicBool,
    callbacks: Callbacks,
    /// The call log, if the importer asked for one.
    pub(super) calls: Option<Box<Mutex<CallLog>>>,
    instance: UnsafeCell<Instance<E>>,
}

impl<E: Exported> Handle<E> {
    /// Whether this call now has the instance, which was used as stated. In Scheduled Execution, calls of several threads
    /// interleave.
    #[inline]
    pub(super) fn take(&self, usage: u8) -> bool {
        if const { E::CAN.scheduled } {
            return self.usage.compare_exchange(usage, BUSY, Acquire, Relaxed).is_ok();
        }
        let found = self.usage.load(Relaxed) == usage;
        if found {
            self.usage.store(BUSY, Relaxed);
        }
        found
    }

    #[inline]
    fn give(&self) {
        self.give_as(FREE);
    }

    #[inline]
    pub(super) fn give_as(&self, usage: u8) {
        self.usage.store(usage, if const { E::CAN.scheduled } { Release } else { Relaxed });
    }

    /// Locks the importer's scheduler for a call that it may interrupt, unless the call comes from a callback.
    fn lock(&self) -> Option<Lock> {
        if CALLING.get() == self.address() { None } else { self.callbacks.lock() }
    }

    /// Follows the importer's pointer.
    ///
    /// # Safety
    /// As [`enter`], and the pointer is not NULL.
    pub(super) unsafe fn behind<'a>(pointer: *mut c_void) -> &'a Self {
        // SAFETY: the caller's promise.
        unsafe { &*pointer.cast::<Self>() }
    }

    /// Gives the new instance behind a pointer a call log.
    ///
    /// # Safety
    /// The pointer comes from [`open`] for the same `E`, and the importer has not got it yet.
    pub(super) unsafe fn keep_log(pointer: *mut c_void, log: CallLog) {
        // SAFETY: the caller's promise.
        let handle = unsafe { &mut *pointer.cast::<Self>() };
        handle.calls = Some(Box::new(Mutex::new(log)));
        handle.give_as(LOGGED);
    }

    /// The instance, while this call has it.
    ///
    /// # Safety
    /// [`take`](Self::take) has succeeded, and nothing gives the instance back during `'a`.
    pub(super) unsafe fn taken(&self) -> &Instance<E> {
        // SAFETY: no other call has it, and no other thread uses it.
        unsafe { &*self.instance.get() }
    }

    /// Makes a call with the instance, now free, for a call that has the scheduler's lock already.
    pub(super) fn free_for(&self, call: &dyn Fn() -> c_int) -> c_int {
        self.give();
        if const { !E::CAN.scheduled } {
            return call();
        }
        let outer = CALLING.replace(self.address());
        let code = call();
        CALLING.set(outer);
        code
    }

    fn address(&self) -> *const () {
        std::ptr::from_ref(self).cast()
    }
}

thread_local! {
    /// The handle whose callback this thread runs: its calls already have the lock, and those of other threads wait for it.
    static CALLING: Cell<*const ()> = const { Cell::new(std::ptr::null()) };
}

/// Passes a call to the instance; `unusual` answers if it is not free.
///
/// # Safety
/// `pointer` is NULL, or comes from [`open`] for the same `E` and was not closed; no other thread uses it now.
#[inline]
pub(crate) unsafe fn enter<E: Exported, F: Function>(
    pointer: *mut c_void,
    body: impl FnOnce(Abi<'_, E>) -> Answer,
    unusual: impl FnOnce() -> c_int,
) -> c_int {
    if pointer.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: the caller's promise.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    if const { !locks::<E, F>() } {
        return pass_one::<E, F>(handle, body, unusual);
    }
    let _lock = handle.lock();
    pass_one::<E, F>(handle, body, unusual)
}

/// Whether a call locks the importer's scheduler, which may interrupt it.
const fn locks<E: Exported, F: Function>() -> bool {
    E::CAN.scheduled && F::ENTRY.preempted
}

#[inline]
fn pass_one<E: Exported, F: Function>(
    handle: &Handle<E>,
    body: impl FnOnce(Abi<'_, E>) -> Answer,
    unusual: impl FnOnce() -> c_int,
) -> c_int {
    if !handle.take(FREE) {
        return unusual();
    }
    pass_taken::<E, F>(handle, body) as c_int
}

/// Passes a call to the instance, which this call has taken, and gives it back.
#[inline]
fn pass_taken<E: Exported, F: Function>(handle: &Handle<E>, body: impl FnOnce(Abi<'_, E>) -> Answer) -> Status {
    // SAFETY: it was free, so no other call of this thread holds the instance, and no other thread uses it.
    let instance = unsafe { &mut *handle.instance.get() };
    let status =
        if const { calls_back::<E>() } && handle.calling.load(Relaxed) && !instance.current.life.state().calls_back() {
            instance.log.error(&format!("{}: not allowed: an earlier call of this callback failed", F::ENTRY.name));
            Status::Error
        } else {
            pass(const { &F::ENTRY }, instance, body)
        };
    handle.give();
    status
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
    unusual: impl FnOnce() -> c_int,
) -> c_int {
    if pointer.is_null() {
        return Status::Error as c_int;
    }
    // SAFETY: the caller's promise; the instance lives on, because `close` does not free an instance during a callback.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    let _lock = if const { locks::<E, F>() } { handle.lock() } else { None };
    if !handle.take(FREE) {
        return unusual();
    }
    let mut reply = None;
    loop {
        let mut request = None;
        let pass = |mut abi: Abi<'_, E>| {
            request = part(Abi(&mut *abi.0), reply)?;
            if request.is_some() {
                abi.current.life.call_back();
            }
            Ok(())
        };
        let status = pass_taken::<E, F>(handle, pass);
        let Some(request) = request else { return status as c_int };
        handle.calling.store(true, Relaxed);
        if const { E::CAN.scheduled } {
            let outer = CALLING.replace(handle.address());
            reply = handle.call_back(request);
            CALLING.set(outer);
        } else {
            reply = handle.call_back(request);
        }
        handle.calling.store(false, Relaxed);
        // Another thread may be in a call, if the importer passed no lock.
        while !handle.take(FREE) && !handle.take(LOGGED) {
            std::thread::yield_now();
        }
        // SAFETY: no call had it, as in `pass_one`.
        let instance = unsafe { &mut *handle.instance.get() };
        // The next part follows without giving the instance back: a call of another thread in between would make this one fail.
        if !instance.current.life.called_back() {
            instance.log.error(&format!("{}: a call of the callback failed", F::ENTRY.name));
            handle.give();
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
        return misplaced(entry, instance);
    }
    // A panic can leave a half-done step; only Reset, SetFMUState and Free leave the Error state.
    match catch_unwind(AssertUnwindSafe(|| body(Abi(instance)))) {
        Ok(Ok(())) => {
            instance.current.life.after(true, entry.next);
            Status::Ok
        }
        Ok(Err(refusal)) => fail(entry, instance, refusal),
        Err(payload) => fail_by_panic(entry, instance, payload.as_ref()),
    }
}

#[cold]
#[inline(never)]
fn fail_by_panic<E: Exported>(entry: &'static Entry, instance: &mut Instance<E>, payload: &(dyn Any + Send)) -> Status {
    fail(entry, instance, Refusal::Error(panicked(payload)))
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

/// The status of a call that the instance's standard or state does not allow.
#[cold]
#[inline(never)]
fn misplaced<E: Exported>(entry: &'static Entry, instance: &mut Instance<E>) -> Status {
    let (state, interface) = (instance.current.life.state(), instance.current.life.interface());
    let allowed = entry.allowed.of_interface(interface);
    let why = if instance.standard != entry.standard {
        "the instance was made by the other standard's function".into()
    } else if allowed.is_empty() {
        format!("not allowed: the instance is one {}", message::made_for(interface))
    } else {
        format!("not allowed in the state {state}; allowed in: {allowed}")
    };
    fail(entry, instance, Refusal::Error(Fault::new(why)))
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
    let make = |suffix: String| {
        let made = catch_unwind(|| Origin::open::<E>(folder(resources), suffix));
        made.unwrap_or_else(|payload| Err(panicked(payload.as_ref())))
    };
    match wanted.and_then(|Wanted { name, suffix }| Ok((name, make(suffix)?))) {
        Ok((name, (origin, block, shelf))) => {
            let mut instance = Instance::<E>::new(entry.standard, name, log, Snapshot::of(interface, block));
            (instance.shelf, instance.origin, instance.early_return) = (shelf, origin, steps.early_return);
            if const { E::CAN.intermediate.is_some() }
                && steps.callbacks.intermediate.is_some()
                && let Err(fault) = instance.look_inside(steps.required)
            {
                instance.log.error(&format!("{}: {fault}", entry.name));
                return std::ptr::null_mut();
            }
            let (usage, calling) = (AtomicU8::new(FREE), AtomicBool::new(false));
            let instance = UnsafeCell::new(instance);
            Box::into_raw(Box::new(Handle { usage, calling, callbacks: steps.callbacks, calls: None, instance })).cast()
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
pub(crate) unsafe fn close<E: Exported>(pointer: *mut c_void, name: &'static str) {
    if pointer.is_null() {
        return;
    }
    // SAFETY: the caller's promise.
    let handle = unsafe { &*pointer.cast::<Handle<E>>() };
    if handle.usage.load(Acquire) == BUSY || handle.calling.load(Relaxed) {
        if let Some(calls) = &handle.calls {
            write(calls, |log| {
                log.begin(None, name, &[]);
                log.end(&ended("ignored"));
            });
        }
        return;
    }
    // SAFETY: from `open`, closed once by the caller's promise, not in use.
    let mut handle = unsafe { Box::from_raw(pointer.cast::<Handle<E>>()) };
    let calls = handle.calls.take();
    if let Some(calls) = &calls {
        write(calls, |log| log.begin(Some(handle.instance.get_mut().current.end), name, &[]));
    }
    // A panic in a model's drop stops here.
    let _ = catch_unwind(AssertUnwindSafe(|| drop(handle)));
    if let Some(calls) = &calls {
        write(calls, |log| log.end(&ended("done")));
    }
}

impl<E: Exported> Handle<E> {
    /// Calls the importer, and records that.
    fn call_back(&self, request: Request) -> Reply {
        let Some(calls) = &self.calls else { return self.callbacks.call(request) };
        write(calls, |log| {
            let (time, name, values) = match request {
                Request::Intermediate(pause) => {
                    let can_return =
                        ("can_return".to_owned(), LogValue::Number(u8::from(pause.can_return).to_string()));
                    (Some(pause.time), "intermediateUpdate", vec![can_return])
                }
                Request::Clocks => (None, "clockUpdate", Vec::new()),
            };
            log.begin(time, name, &values);
        });
        self.give_as(LOGGED);
        let reply = self.callbacks.call(request);
        write(calls, |log| {
            let results = reply.map(|time| ("early_return".to_owned(), LogValue::Number(format!("{time:?}"))));
            log.end(&CallEnd { status: "done".into(), results: results.into_iter().collect() });
        });
        reply
    }
}

/// Writes into a log.
pub(super) fn write<T>(calls: &Mutex<CallLog>, work: impl FnOnce(&mut CallLog) -> T) -> T {
    work(&mut calls.lock().unwrap_or_else(PoisonError::into_inner))
}

pub(super) fn ended(how: &str) -> CallEnd {
    CallEnd { status: how.into(), results: Vec::new() }
}
