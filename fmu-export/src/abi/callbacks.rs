//! The importer's callbacks, during which the importer may call the instance. The gate runs them while no part of the instance is borrowed.

use super::types::Fmi3Boolean;
use crate::inside::{Pause, Reply};
use std::ffi::c_void;

/// `fmi3IntermediateUpdateCallback`.
pub type Fmi3IntermediateUpdate = unsafe extern "C" fn(
    environment: *mut c_void,
    time: f64,
    set_requested: Fmi3Boolean,
    get_allowed: Fmi3Boolean,
    step_finished: Fmi3Boolean,
    can_return_early: Fmi3Boolean,
    return_requested: *mut Fmi3Boolean,
    return_time: *mut f64,
);

/// `fmi3ClockUpdateCallback`.
pub type Fmi3ClockUpdate = unsafe extern "C" fn(environment: *mut c_void);

/// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`.
pub type Fmi3Preemption = unsafe extern "C" fn();

/// Reason for a callback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Request {
    /// A part of a step is done.
    Intermediate(Pause),
    /// A clock has ticked, or the time of its next tick is known.
    Clocks,
}

/// The callbacks of an instance.
#[derive(Clone, Copy, Debug)]
pub struct Callbacks {
    /// Passed back to them.
    pub environment: *mut c_void,
    /// `intermediateUpdate`.
    pub intermediate: Option<Fmi3IntermediateUpdate>,
    /// `clockUpdate`.
    pub clock_update: Option<Fmi3ClockUpdate>,
    /// `lockPreemption` and `unlockPreemption`, if both are given.
    pub preemption: Option<[Fmi3Preemption; 2]>,
}

impl Callbacks {
    /// No callback.
    pub const NONE: Self =
        Self { environment: std::ptr::null_mut(), intermediate: None, clock_update: None, preemption: None };

    /// Calls the importer.
    pub(crate) fn call(&self, request: Request) -> Reply {
        match request {
            Request::Intermediate(update) => self.intermediate(update),
            Request::Clocks => {
                if let Some(callback) = self.clock_update {
                    // SAFETY: the importer's function of this type.
                    unsafe { callback(self.environment) }
                }
                None
            }
        }
    }

    /// Keeps the importer's scheduler from interrupting the instance, until the lock is dropped.
    pub(crate) fn lock(&self) -> Option<Lock> {
        let [lock, unlock] = self.preemption?;
        // SAFETY: the importer's function of this type.
        unsafe { lock() };
        Some(Lock(unlock))
    }

    /// Calls `intermediateUpdate` at the end of a part of a step.
    fn intermediate(&self, update: Pause) -> Reply {
        let callback = self.intermediate?;
        let (mut requested, mut time) = (Fmi3Boolean(0), update.time);
        let yes = Fmi3Boolean(1);
        // SAFETY: the importer's function of this type; it returns before the two variables end.
        unsafe {
            callback(
                self.environment,
                update.time,
                yes,
                yes,
                yes,
                update.can_return.into(),
                &raw mut requested,
                &raw mut time,
            );
        }
        (requested.0 != 0 && update.can_return).then_some(time)
    }
}

/// The scheduler does not interrupt.
pub(crate) struct Lock(Fmi3Preemption);

impl Drop for Lock {
    fn drop(&mut self) {
        // SAFETY: the importer's function of this type.
        unsafe { (self.0)() }
    }
}
