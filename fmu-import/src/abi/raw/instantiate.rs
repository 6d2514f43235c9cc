//! Instantiation with arbitrary arguments.

use super::super::calls::{Request, Updates};
use super::super::logger::logger;
use super::super::signatures::v2::Callbacks;
use super::callbacks::{Recorder, allocate, logger3, release};
use super::library::Raw;
use super::names::Interface;
use super::owned::Handle;
use super::updates::{clock_update, intermediate_update, lock_preemption, unlock_preemption};
use std::ffi::{CString, c_void};
use std::ptr;

/// The arguments of an instantiation.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "the arguments of the standards")]
pub struct Arguments {
    /// Instance name.
    pub name: Option<CString>,
    /// Token.
    pub token: Option<CString>,
    /// Path or URI of the resources.
    pub resources: Option<CString>,
    /// Kind of FMU.
    pub interface: Interface,
    /// Whether there is a log callback.
    pub logger: bool,
    /// Whether there is a struct of callbacks (FMI 2.0 only).
    pub callbacks: bool,
    /// Whether there are memory functions (FMI 2.0 only).
    pub memory: bool,
    /// Whether the struct of callbacks stays valid after the call (FMI 2.0 only).
    pub lasting: bool,
    /// Whether logging is on.
    pub logging: bool,
    /// Whether event mode is used (FMI 3.0 only).
    pub event_mode: bool,
    /// Whether `DoStep` may return early (FMI 3.0 only).
    pub early_return: bool,
    /// The environment, which the callbacks receive unchanged.
    pub environment: usize,
    /// The variables that the importer uses inside steps; `None` for no `intermediateUpdate` (FMI 3.0 only).
    pub intermediate: Option<Vec<u32>>,
    /// Whether there are `lockPreemption` and `unlockPreemption` (Scheduled Execution only, which always has `clockUpdate`).
    pub locks: bool,
}

impl Raw {
    /// Creates an instance; `None` for NULL.
    ///
    /// # Errors
    /// The function is missing.
    pub fn instantiate(&self, arguments: &Arguments) -> Result<Option<Handle>, String> {
        let a = arguments;
        let environment: *mut c_void = ptr::without_provenance_mut(a.environment);
        // Leaked on purpose: an FMU made before FMI 2.0.5 may keep the pointer.
        let callbacks = Box::leak(Box::new(Callbacks {
            logger: a.logger.then_some(logger::<Recorder<false>>),
            allocate: a.memory.then_some(allocate),
            free: a.memory.then_some(release),
            step_finished: None,
            environment: environment.into(),
        }));
        let lasting = ptr::from_mut(callbacks);
        let request = Request {
            texts: [&a.name, &a.token, &a.resources].map(|text| text.as_deref()),
            interface: a.interface,
            logging: a.logging,
            visible: false,
            event_mode: a.event_mode,
            early_return: a.early_return,
            callbacks: if a.callbacks { lasting } else { ptr::null() },
            logger: if a.logger { Some(logger3) } else { None },
            environment,
            updates: Updates {
                intermediate: a.intermediate.as_ref().map(|_| intermediate_update as _),
                required: a.intermediate.as_deref().unwrap_or_default(),
                clocks: Some(clock_update),
                preemption: [a.locks.then_some(lock_preemption as _), a.locks.then_some(unlock_preemption as _)],
            },
        };
        // SAFETY: the struct of callbacks lives on; no callback dereferences the environment.
        let (name, made) = unsafe { self.calls.instantiate(&request) };
        if !a.lasting {
            // The struct still has valid functions: an FMU that reads it again is detected and does not crash.
            // SAFETY: ours, and not in use, since no call is in progress.
            unsafe { (*lasting).logger = Some(logger::<Recorder<true>>) };
        }
        let made = made.ok_or_else(|| format!("the function {name} is missing"))?;
        Ok(self.owned().take_instance(made))
    }
}
