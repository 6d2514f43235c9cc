//! Instances with a call log: the gate finds them not free, and their calls pass here. The call is written, made again on the
//! instance, now free, and its end is written.

use super::gate::{Entry, FREE, Handle, LOGGED, ended, write};
use super::recorded::{Passed, arguments, results};
use crate::call_log::{CallLog, IS_POSSIBLE};
use crate::lifecycle::Standard;
use crate::log::Status;
use fmu_core::call_log::{CallEnd, LogHead, status};
use fmu_core::log::WARNING;
use fmu_core::{Exported, Model};
use std::ffi::{c_int, c_void};
use std::sync::Mutex;

/// A new instance with a call log, if the environment names a folder: see `call_log.rs`.
///
/// # Safety
/// The arguments follow the standard; `open` returns the pointer of `gate::open` for the same `E`.
pub unsafe fn open_logged<E: Exported>(
    entry: &'static Entry,
    passed: impl FnOnce() -> Vec<Passed>,
    open: impl FnOnce() -> *mut c_void,
) -> *mut c_void {
    let head = || LogHead {
        standard: if entry.standard == Standard::Fmi2 { "2.0" } else { "3.0" }.into(),
        model: E::Model::INFO.name.into(),
        version: E::Model::INFO.version.into(),
        token: E::TOKEN.as_str().into(),
    };
    let Some(asked) = CallLog::asked(head) else { return open() };
    let mut calls = asked.map(|mut log| {
        // SAFETY: the caller's promise.
        let values = unsafe { arguments(entry.name, &passed(), &mut log) };
        log.begin(None, entry.name, &values);
        log
    });
    let pointer = open();
    if let Ok(log) = &mut calls {
        log.end(&ended(if pointer.is_null() { "NULL" } else { "instance" }));
    }
    if !pointer.is_null() {
        // SAFETY: a new instance, unknown to the importer.
        unsafe {
            match calls {
                Ok(log) => Handle::<E>::keep_log(pointer, log),
                Err(why) => Handle::<E>::behind(pointer).warn(&why),
            }
        }
    }
    pointer
}

/// A call on an instance that is not free: refused if another call has it, and recorded if it has a log. `again` makes the call.
///
/// # Safety
/// As [`Abi::enter`](super::Abi::enter); the arguments follow the standard.
#[inline(never)]
pub unsafe fn record<E: Exported>(
    pointer: *mut c_void,
    entry: &Entry,
    passed: &[Passed],
    again: &dyn Fn() -> c_int,
) -> c_int {
    // SAFETY: the caller's promise; the gate refuses NULL.
    let handle = unsafe { Handle::<E>::behind(pointer) };
    match &handle.calls {
        Some(calls) if IS_POSSIBLE => handle.record(calls, entry, passed, again),
        _ => Status::Error as c_int,
    }
}

/// The answer of a C function whose instance is not free, in a separate function, so that the arguments stay in registers.
#[doc(hidden)]
#[macro_export]
macro_rules! unusual {
    ($exported:ty, $name:ident($instance:ident $(, $argument:ident: $type:ty)*)) => {{
        #[cold]
        #[inline(never)]
        unsafe extern "C" fn unusual($instance: InstancePointer $(, $argument: $type)*) -> c_int {
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::record::record::<$exported>(
                    $instance,
                    const { &<Here as $crate::abi::types::Function>::ENTRY },
                    &[$((stringify!($argument), CArgument::argument($argument))),*],
                    &|| $name($instance $(, $argument)*),
                )
            }
        }
        move || unusual($instance $(, $argument)*)
    }};
}

impl<E: Exported> Handle<E> {
    /// Writes a call into the log, and makes it if no other call has the instance.
    fn record(&self, calls: &Mutex<CallLog>, entry: &Entry, passed: &[Passed], again: &dyn Fn() -> c_int) -> c_int {
        let taken = self.take(LOGGED);
        // SAFETY: it is taken.
        let time = taken.then(|| unsafe { self.taken() }.current.end);
        write(calls, |log| {
            // SAFETY: what the standard demands of the importer.
            let values = unsafe { arguments(entry.name, passed, log) };
            log.begin(time, entry.name, &values);
        });
        let code = if taken { self.free_for(again) } else { Status::Error as c_int };
        let failure = write(calls, |log| {
            // SAFETY: the call succeeded, so it wrote its results into the importer's memory.
            let results = if code == Status::Ok as c_int { unsafe { results(passed, log) } } else { Vec::new() };
            log.end(&CallEnd { status: status(code), results });
            log.take_failure()
        });
        if taken {
            if let Some(why) = failure {
                self.warn(&why);
            }
            self.give_as(LOGGED);
        }
        code
    }

    /// A warning about the log.
    fn warn(&self, why: &str) {
        if self.take(FREE) {
            // SAFETY: it is taken.
            unsafe { self.taken() }.log.said(WARNING, &[], why);
            self.give_as(FREE);
        }
    }
}
