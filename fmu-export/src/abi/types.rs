//! The C types of both standards that the signatures need.

pub use super::callbacks::{Callbacks, Fmi3ClockUpdate, Fmi3IntermediateUpdate, Fmi3Preemption};
pub use super::gate::{Entry, Function};
pub use super::logger::{Fmi2Logger, Fmi3Logger};
pub use crate::lifecycle::{Call, Standard};
pub use crate::value::{Fmi2Boolean, Fmi2Integer, Fmi3Boolean};
pub use fmu_core::Exported;
pub use fmu_core::Interface;
pub use std::ffi::{c_char, c_int, c_void};
#[doc(hidden)]
pub use std::ptr::null;

/// `fmi2Component`, `fmi3Instance`.
pub type InstancePointer = *mut c_void;
/// `fmi2FMUstate`, `fmi3FMUState`.
pub type FmuState = *mut c_void;
/// `const fmi2ValueReference[]`, `const fmi3ValueReference[]`.
pub type References = *const u32;
/// `fmi2String`, `fmi3String`.
pub type Text = *const c_char;

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
