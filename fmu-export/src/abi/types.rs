//! The C types of both standards that the signatures need.

pub use super::callbacks::{Callbacks, Fmi3ClockUpdate, Fmi3IntermediateUpdate, Fmi3Preemption};
pub use super::gate::{Entry, Function};
pub use super::logger::{Fmi2Logger, Fmi3Logger};
pub use super::recorded::{Argument, CArgument};
pub use super::structs::{Fmi2Callbacks, Fmi2EventInfo};
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
