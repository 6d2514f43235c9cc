//! The functions of FMI 3.0 (fmi3FunctionTypes.h), as C has them.

use crate::abi::library::symbols;
use crate::abi::log::Status;
use std::ffi::{c_char, c_void};

pub(super) type Component = *mut c_void;
pub(super) type Simple = unsafe extern "C" fn(Component) -> Status;
pub(super) type Get<T> = unsafe extern "C" fn(Component, *const u32, usize, *mut T, usize) -> Status;
pub(super) type Set<T> = unsafe extern "C" fn(Component, *const u32, usize, *const T, usize) -> Status;
pub(super) type LogMessage = unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char);

symbols! {
    /// The functions of FMI 3.0 that this importer calls. `fmi3Boolean` is C's `bool`; it is received as a byte, for an FMU
    /// may return another value than 0 and 1.
    Functions {
        instantiate: "fmi3InstantiateCoSimulation" = unsafe extern "C" fn(
            *const c_char, *const c_char, *const c_char, bool, bool, bool, bool, *const u32, usize, *mut c_void,
            LogMessage, *const c_void) -> Component,
        free: "fmi3FreeInstance" = unsafe extern "C" fn(Component),
        enter: "fmi3EnterInitializationMode" = unsafe extern "C" fn(Component, bool, f64, f64, bool, f64) -> Status,
        exit: "fmi3ExitInitializationMode" = Simple,
        terminate: "fmi3Terminate" = Simple,
        reset: "fmi3Reset" = Simple,
        get_float64: "fmi3GetFloat64" = Get<f64>,
        set_float64: "fmi3SetFloat64" = Set<f64>,
        do_step: "fmi3DoStep" = unsafe extern "C" fn(
            Component, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> Status,
        ;
        // The standard wants all of these; what an FMU leaves out is missed when it is called.
        get_float32: "fmi3GetFloat32" = Get<f32>,
        set_float32: "fmi3SetFloat32" = Set<f32>,
        get_int8: "fmi3GetInt8" = Get<i8>,
        set_int8: "fmi3SetInt8" = Set<i8>,
        get_uint8: "fmi3GetUInt8" = Get<u8>,
        set_uint8: "fmi3SetUInt8" = Set<u8>,
        get_int16: "fmi3GetInt16" = Get<i16>,
        set_int16: "fmi3SetInt16" = Set<i16>,
        get_uint16: "fmi3GetUInt16" = Get<u16>,
        set_uint16: "fmi3SetUInt16" = Set<u16>,
        get_int32: "fmi3GetInt32" = Get<i32>,
        set_int32: "fmi3SetInt32" = Set<i32>,
        get_uint32: "fmi3GetUInt32" = Get<u32>,
        set_uint32: "fmi3SetUInt32" = Set<u32>,
        get_int64: "fmi3GetInt64" = Get<i64>,
        set_int64: "fmi3SetInt64" = Set<i64>,
        get_uint64: "fmi3GetUInt64" = Get<u64>,
        set_uint64: "fmi3SetUInt64" = Set<u64>,
        get_boolean: "fmi3GetBoolean" = Get<u8>,
        set_boolean: "fmi3SetBoolean" = Set<u8>,
        get_string: "fmi3GetString" = Get<*const c_char>,
        set_string: "fmi3SetString" = Set<*const c_char>,
        set_debug_logging: "fmi3SetDebugLogging" = unsafe extern "C" fn(Component, bool, usize, *const *const c_char) -> Status,
        get_state: "fmi3GetFMUState" = unsafe extern "C" fn(Component, *mut *mut c_void) -> Status,
        set_state: "fmi3SetFMUState" = unsafe extern "C" fn(Component, *mut c_void) -> Status,
        free_state: "fmi3FreeFMUState" = unsafe extern "C" fn(Component, *mut *mut c_void) -> Status,
        state_size: "fmi3SerializedFMUStateSize" = unsafe extern "C" fn(Component, *mut c_void, *mut usize) -> Status,
        serialize: "fmi3SerializeFMUState" = unsafe extern "C" fn(Component, *mut c_void, *mut u8, usize) -> Status,
        deserialize: "fmi3DeserializeFMUState" = unsafe extern "C" fn(Component, *const u8, usize, *mut *mut c_void) -> Status,
    }
}
