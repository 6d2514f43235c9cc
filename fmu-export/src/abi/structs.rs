//! The structs of FMI 2.0.

use super::logger::Fmi2Logger;
use crate::value::Fmi2Boolean;
use std::ffi::c_void;

/// `fmi2CallbackFunctions`. The memory functions are not used: the model description states this
/// (`canNotUseMemoryManagementFunctions`).
#[derive(Clone, Copy)]
#[repr(C)]
pub struct Fmi2Callbacks {
    /// The logger, may be NULL.
    pub logger: Option<Fmi2Logger>,
    /// Not used.
    pub allocate_memory: *const c_void,
    /// Not used.
    pub free_memory: *const c_void,
    /// Not used: a step is never asynchronous.
    pub step_finished: *const c_void,
    /// Passed back to the logger.
    pub environment: *mut c_void,
}

/// `fmi2EventInfo`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Fmi2EventInfo {
    /// Another update is needed before time advances.
    pub new_discrete_states_needed: Fmi2Boolean,
    /// The simulation must end.
    pub terminate_simulation: Fmi2Boolean,
    /// The nominal values changed; always false.
    pub nominals_of_continuous_states_changed: Fmi2Boolean,
    /// A state has changed.
    pub values_of_continuous_states_changed: Fmi2Boolean,
    /// There is a next time event.
    pub next_event_time_defined: Fmi2Boolean,
    /// Its time in s.
    pub next_event_time: f64,
}
