//! The C functions of a library, each with its type and its name in both standards, found when it is opened.

use super::arguments::Answer;
use super::log::Status;
use super::raw::{Simple, Vector};
use super::signatures::{
    Deserialize, FreeInstance, GetVector, OfInstance, Serialize, SetState, SetTime, SetVector, StatePlace, StateSize,
    v2, v3,
};
use crate::folder::Folder;
use libloading::Library;
use model_description::FmiVersion;
use std::sync::Arc;

/// A function with its full name; `None` if the library lacks it.
pub(super) struct Function<T>(pub(super) &'static str, pub(super) Option<T>);

impl<T: Copy> Function<T> {
    /// Calls it.
    #[inline]
    pub(super) fn call(&self, call: impl FnOnce(T) -> Status) -> Answer {
        Answer(self.0, self.1.map(|function| (call(function), ())))
    }

    /// Calls it and returns its result, which is `value` before the call.
    #[inline]
    pub(super) fn write<V>(&self, mut value: V, call: impl FnOnce(T, &mut V) -> Status) -> Answer<V> {
        Answer(self.0, self.1.map(|function| (call(function, &mut value), value)))
    }
}

/// The C types of getters and setters in FMI 2.0.
const TYPES_2: [[&str; 2]; 4] = [
    ["fmi2GetReal", "fmi2SetReal"],
    ["fmi2GetInteger", "fmi2SetInteger"],
    ["fmi2GetBoolean", "fmi2SetBoolean"],
    ["fmi2GetString", "fmi2SetString"],
];

/// The C types of getters and setters in FMI 3.0, except those with other arguments.
const TYPES_3: [[&str; 2]; 12] = [
    ["fmi3GetFloat64", "fmi3SetFloat64"],
    ["fmi3GetFloat32", "fmi3SetFloat32"],
    ["fmi3GetInt8", "fmi3SetInt8"],
    ["fmi3GetUInt8", "fmi3SetUInt8"],
    ["fmi3GetInt16", "fmi3SetInt16"],
    ["fmi3GetUInt16", "fmi3SetUInt16"],
    ["fmi3GetInt32", "fmi3SetInt32"],
    ["fmi3GetUInt32", "fmi3SetUInt32"],
    ["fmi3GetInt64", "fmi3SetInt64"],
    ["fmi3GetUInt64", "fmi3SetUInt64"],
    ["fmi3GetBoolean", "fmi3SetBoolean"],
    ["fmi3GetString", "fmi3SetString"],
];

/// A C type that has a getter and a setter.
#[derive(Clone, Copy)]
pub(super) struct CType(pub(super) usize);

impl CType {
    /// `fmi2Real`, `fmi3Float64`.
    pub(super) const DOUBLE: Self = Self(0);

    /// By its name without prefix.
    pub(super) fn named(name: &str, version: FmiVersion) -> Option<Self> {
        let types: &[[&str; 2]] = if version == FmiVersion::V2 { &TYPES_2 } else { &TYPES_3 };
        types.iter().position(|[get, _]| &get["fmi3Get".len()..] == name).map(Self)
    }
}

/// Whether a call gets or sets: the column in the table of types.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Get,
    Set,
}

/// Declares the functions, each with its C type and its names in FMI 2.0 and FMI 3.0; "" where the standard lacks it.
macro_rules! functions {
    ($($field:ident: $kind:ty = $two:literal $three:literal,)*) => {
        /// A loaded library with its functions, and its folder, if that must be kept.
        pub(super) struct Calls {
            pub(super) version: FmiVersion,
            $(pub(super) $field: Function<$kind>,)*
            pub(super) simple: [Function<OfInstance>; Simple::ALL.len()],
            pub(super) vectors: [Function<GetVector>; Vector::ALL.len()],
            pub(super) transfer_2: [[Function<v2::Transfer>; 2]; TYPES_2.len()],
            pub(super) transfer_3: [[Function<v3::Transfer>; 2]; TYPES_3.len()],
            // After the functions; the folder after the library.
            pub(super) library: Library,
            _folder: Option<Arc<Folder>>,
        }

        impl Calls {
            /// # Safety
            /// Every function of the standard in the library has the standard's type.
            pub(super) unsafe fn new(library: Library, version: FmiVersion, folder: Option<Arc<Folder>>) -> Self {
                /// # Safety
                /// As for `new`, and that is type `T`.
                unsafe fn find<T: Copy>(library: &Library, name: &'static str) -> Function<T> {
                    // SAFETY: the caller promises the type.
                    let symbol = if name.is_empty() { None } else { unsafe { library.get::<T>(name) }.ok() };
                    Function(name, symbol.map(|symbol| *symbol))
                }
                let (v, l) = (usize::from(version == FmiVersion::V3), &library);
                // SAFETY: every name is listed with its type in the standards.
                unsafe {
                    Self {
                        version,
                        $($field: find(l, [$two, $three][v]),)*
                        simple: Simple::ALL.map(|names| find(l, names[v])),
                        vectors: Vector::ALL.map(|names| find(l, names[v])),
                        transfer_2: TYPES_2.map(|ways| ways.map(|name| find(l, name))),
                        transfer_3: TYPES_3.map(|ways| ways.map(|name| find(l, name))),
                        library,
                        _folder: folder,
                    }
                }
            }
        }
    };
}

functions! {
    instantiate: v2::Instantiate = "fmi2Instantiate" "",
    co_simulation: v3::InstantiateCoSimulation = "" "fmi3InstantiateCoSimulation",
    model_exchange: v3::InstantiateModelExchange = "" "fmi3InstantiateModelExchange",
    scheduled_execution: v3::InstantiateScheduledExecution = "" "fmi3InstantiateScheduledExecution",
    free: FreeInstance = "fmi2FreeInstance" "fmi3FreeInstance",
    setup_2: v2::SetupExperiment = "fmi2SetupExperiment" "",
    enter_3: v3::EnterInitializationMode = "" "fmi3EnterInitializationMode",
    debug_logging_2: v2::SetDebugLogging = "fmi2SetDebugLogging" "",
    debug_logging_3: v3::SetDebugLogging = "" "fmi3SetDebugLogging",
    do_step_2: v2::DoStep = "fmi2DoStep" "",
    do_step_3: v3::DoStep = "" "fmi3DoStep",
    get_binary_3: v3::GetBinary = "" "fmi3GetBinary",
    set_binary_3: v3::SetBinary = "" "fmi3SetBinary",
    get_state: StatePlace = "fmi2GetFMUstate" "fmi3GetFMUState",
    free_state: StatePlace = "fmi2FreeFMUstate" "fmi3FreeFMUState",
    set_state: SetState = "fmi2SetFMUstate" "fmi3SetFMUState",
    state_size: StateSize = "fmi2SerializedFMUstateSize" "fmi3SerializedFMUStateSize",
    serialize: Serialize = "fmi2SerializeFMUstate" "fmi3SerializeFMUState",
    deserialize: Deserialize = "fmi2DeSerializeFMUstate" "fmi3DeserializeFMUState",
    update_2: v2::NewDiscreteStates = "fmi2NewDiscreteStates" "",
    update_3: v3::UpdateDiscreteStates = "" "fmi3UpdateDiscreteStates",
    completed_2: v2::CompletedIntegratorStep = "fmi2CompletedIntegratorStep" "",
    completed_3: v3::CompletedIntegratorStep = "" "fmi3CompletedIntegratorStep",
    set_time: SetTime = "fmi2SetTime" "fmi3SetTime",
    set_states: SetVector = "fmi2SetContinuousStates" "fmi3SetContinuousStates",
    number_of_states: v3::Count = "" "fmi3GetNumberOfContinuousStates",
    number_of_indicators: v3::Count = "" "fmi3GetNumberOfEventIndicators",
    directional_2: v2::Sensitivity = "fmi2GetDirectionalDerivative" "",
    directional_3: v3::Sensitivity = "" "fmi3GetDirectionalDerivative",
    adjoint_3: v3::Sensitivity = "" "fmi3GetAdjointDerivative",
    output_derivatives_2: v2::OutputDerivatives = "fmi2GetRealOutputDerivatives" "",
    output_derivatives_3: v3::OutputDerivatives = "" "fmi3GetOutputDerivatives",
    get_clock: v3::GetClock = "" "fmi3GetClock",
    set_clock: v3::SetClock = "" "fmi3SetClock",
    get_interval: v3::GetInterval = "" "fmi3GetIntervalDecimal",
    set_interval: v3::SetInterval = "" "fmi3SetIntervalDecimal",
    activate_partition: v3::ActivateModelPartition = "" "fmi3ActivateModelPartition",
    get_shift: v3::GetShift = "" "fmi3GetShiftDecimal",
    input_derivatives_2: v2::InputDerivatives = "fmi2SetRealInputDerivatives" "",
}
