//! The C types of the functions of FMI 2.0 (fmi2FunctionTypes.h) and FMI 3.0 (fmi3FunctionTypes.h), each declared once.
//!
//! A function without prefix has the same type in both standards. `fmi3Boolean` is C's `bool`; results are received as bytes,
//! because an FMU may write other values than 0 and 1.

use super::log::Status;
use std::ffi::{c_char, c_int, c_void};

/// `fmi2Component`, `fmi3Instance`: the FMU's pointer to an instance.
pub(super) type InstancePointer = *mut c_void;
/// `fmi2FMUstate`, `fmi3FMUState`: the FMU's pointer to a saved state.
pub(super) type StatePointer = *mut c_void;

pub(super) type OfInstance = unsafe extern "C" fn(InstancePointer) -> Status;
pub(super) type FreeInstance = unsafe extern "C" fn(InstancePointer);
/// `GetVersion`, `GetTypesPlatform`.
pub(super) type Text = unsafe extern "C" fn() -> *const c_char;
/// `GetFMUState`, `FreeFMUState`.
pub(super) type StatePlace = unsafe extern "C" fn(InstancePointer, *mut StatePointer) -> Status;
pub(super) type SetState = unsafe extern "C" fn(InstancePointer, StatePointer) -> Status;
pub(super) type StateSize = unsafe extern "C" fn(InstancePointer, StatePointer, *mut usize) -> Status;
pub(super) type Serialize = unsafe extern "C" fn(InstancePointer, StatePointer, *mut u8, usize) -> Status;
pub(super) type Deserialize = unsafe extern "C" fn(InstancePointer, *const u8, usize, *mut StatePointer) -> Status;

pub(super) type SetTime = unsafe extern "C" fn(InstancePointer, f64) -> Status;
/// States, derivatives, event indicators, nominals: an array and its length.
pub(super) type GetVector = unsafe extern "C" fn(InstancePointer, *mut f64, usize) -> Status;
pub(super) type SetVector = unsafe extern "C" fn(InstancePointer, *const f64, usize) -> Status;

/// FMI 2.0.
pub(super) mod v2 {
    use super::super::logger::Logger;
    use super::{InstancePointer, Status, c_char, c_int, c_void};
    use std::sync::atomic::AtomicPtr;

    pub(in crate::abi) type Instantiate = unsafe extern "C" fn(
        *const c_char,
        c_int,
        *const c_char,
        *const c_char,
        *const Callbacks,
        c_int,
        c_int,
    ) -> InstancePointer;
    pub(in crate::abi) type SetupExperiment =
        unsafe extern "C" fn(InstancePointer, c_int, f64, f64, c_int, f64) -> Status;
    /// A getter or a setter of any type; a setter only reads the values.
    pub(in crate::abi) type Transfer = unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut c_void) -> Status;
    pub(in crate::abi) type DoStep = unsafe extern "C" fn(InstancePointer, f64, f64, c_int) -> Status;
    pub(in crate::abi) type SetDebugLogging =
        unsafe extern "C" fn(InstancePointer, c_int, usize, *const *const c_char) -> Status;
    /// `fmi2GetStatus` and its variants for each type.
    pub(in crate::abi) type GetStatus<T> = unsafe extern "C" fn(InstancePointer, c_int, *mut T) -> Status;
    pub(in crate::abi) type OutputDerivatives =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const c_int, *mut f64) -> Status;
    pub(in crate::abi) type InputDerivatives =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const c_int, *const f64) -> Status;
    pub(in crate::abi) type NewDiscreteStates = unsafe extern "C" fn(InstancePointer, *mut EventInfo) -> Status;
    pub(in crate::abi) type CompletedIntegratorStep =
        unsafe extern "C" fn(InstancePointer, c_int, *mut c_int, *mut c_int) -> Status;
    /// `fmi2GetDirectionalDerivative`: unknowns, knowns, seed, sensitivity.
    pub(in crate::abi) type Sensitivity =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const u32, usize, *const f64, *mut f64) -> Status;

    /// `fmi2EventInfo`.
    #[repr(C)]
    pub(in crate::abi) struct EventInfo {
        pub(in crate::abi) new_discrete_states_needed: c_int,
        pub(in crate::abi) terminate_simulation: c_int,
        pub(in crate::abi) nominals_changed: c_int,
        pub(in crate::abi) states_changed: c_int,
        pub(in crate::abi) next_event_time_defined: c_int,
        pub(in crate::abi) next_event_time: f64,
    }

    /// `fmi2CallbackFunctions`.
    #[repr(C)]
    pub(in crate::abi) struct Callbacks {
        pub(in crate::abi) logger: Option<Logger>,
        pub(in crate::abi) allocate: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
        pub(in crate::abi) free: Option<unsafe extern "C" fn(*mut c_void)>,
        pub(in crate::abi) step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
        /// A C pointer, atomic because instances with these callbacks may move between threads.
        pub(in crate::abi) environment: AtomicPtr<c_void>,
    }

    // The C library's, which `Callbacks` passes on.
    unsafe extern "C" {
        pub(in crate::abi) fn calloc(count: usize, size: usize) -> *mut c_void;
        pub(in crate::abi) fn free(memory: *mut c_void);
    }
}

/// FMI 3.0.
pub(super) mod v3 {
    use super::{InstancePointer, Status, c_char, c_int, c_void};

    pub(in crate::abi) type LogMessage = unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char);
    /// Flags of one byte, and pointers to `earlyReturnRequested` and `earlyReturnTime`.
    pub(in crate::abi) type IntermediateUpdate =
        unsafe extern "C" fn(*mut c_void, f64, u8, u8, u8, u8, *mut u8, *mut f64);
    pub(in crate::abi) type ClockUpdate = unsafe extern "C" fn(*mut c_void);
    /// `fmi3LockPreemptionCallback`, `fmi3UnlockPreemptionCallback`.
    pub(in crate::abi) type Preemption = unsafe extern "C" fn();
    pub(in crate::abi) type InstantiateCoSimulation = unsafe extern "C" fn(
        *const c_char,
        *const c_char,
        *const c_char,
        bool,
        bool,
        bool,
        bool,
        *const u32,
        usize,
        *mut c_void,
        Option<LogMessage>,
        Option<IntermediateUpdate>,
    ) -> InstancePointer;
    pub(in crate::abi) type InstantiateModelExchange = unsafe extern "C" fn(
        *const c_char,
        *const c_char,
        *const c_char,
        bool,
        bool,
        *mut c_void,
        Option<LogMessage>,
    ) -> InstancePointer;
    pub(in crate::abi) type InstantiateScheduledExecution = unsafe extern "C" fn(
        *const c_char,
        *const c_char,
        *const c_char,
        bool,
        bool,
        *mut c_void,
        Option<LogMessage>,
        Option<ClockUpdate>,
        Option<Preemption>,
        Option<Preemption>,
    ) -> InstancePointer;
    pub(in crate::abi) type EnterInitializationMode =
        unsafe extern "C" fn(InstancePointer, bool, f64, f64, bool, f64) -> Status;
    /// A getter or a setter of any type; a setter only reads the values.
    pub(in crate::abi) type Transfer =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut c_void, usize) -> Status;
    /// `fmi3GetBinary`: sizes and values.
    pub(in crate::abi) type GetBinary =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut usize, *mut *const u8, usize) -> Status;
    pub(in crate::abi) type SetBinary =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const usize, *const *const u8, usize) -> Status;
    pub(in crate::abi) type DoStep =
        unsafe extern "C" fn(InstancePointer, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> Status;
    pub(in crate::abi) type SetDebugLogging =
        unsafe extern "C" fn(InstancePointer, bool, usize, *const *const c_char) -> Status;
    pub(in crate::abi) type OutputDerivatives =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const c_int, *mut f64, usize) -> Status;
    pub(in crate::abi) type CompletedIntegratorStep =
        unsafe extern "C" fn(InstancePointer, bool, *mut u8, *mut u8) -> Status;
    pub(in crate::abi) type GetClock = unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut u8) -> Status;
    pub(in crate::abi) type SetClock = unsafe extern "C" fn(InstancePointer, *const u32, usize, *const u8) -> Status;
    pub(in crate::abi) type GetInterval =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut f64, *mut c_int) -> Status;
    pub(in crate::abi) type SetInterval =
        unsafe extern "C" fn(InstancePointer, *const u32, usize, *const f64) -> Status;
    pub(in crate::abi) type ActivateModelPartition = unsafe extern "C" fn(InstancePointer, u32, f64) -> Status;
    pub(in crate::abi) type GetShift = unsafe extern "C" fn(InstancePointer, *const u32, usize, *mut f64) -> Status;
    /// Number of states, of event indicators.
    pub(in crate::abi) type Count = unsafe extern "C" fn(InstancePointer, *mut usize) -> Status;
    /// `fmi3GetDirectionalDerivative`, `fmi3GetAdjointDerivative`: unknowns, knowns, seed, sensitivity.
    pub(in crate::abi) type Sensitivity = unsafe extern "C" fn(
        InstancePointer,
        *const u32,
        usize,
        *const u32,
        usize,
        *const f64,
        usize,
        *mut f64,
        usize,
    ) -> Status;
    pub(in crate::abi) type UpdateDiscreteStates =
        unsafe extern "C" fn(InstancePointer, *mut u8, *mut u8, *mut u8, *mut u8, *mut u8, *mut f64) -> Status;
}
