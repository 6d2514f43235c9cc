//! The functions of both standards with their arguments, named as in a call log.

use super::memory::{Blob, BlobOut, BytesOut, EventInfo, In, Memory, Out, Place, Saved, Texts, TextsOut};
use crate::abi::signatures::InstancePointer;
use libloading::Library;
use std::ffi::c_int;

/// Declares the functions whose status is an integer: `names(argument: type, ...)`.
macro_rules! functions {
    ($($($name:literal)+ ($($argument:ident: $type:ty),*);)*) => {
        /// Calls a function of the library with the arguments in this memory.
        ///
        /// # Errors
        /// The name is not one of a function, the library lacks it, or an argument is missing or of another type.
        ///
        /// # Safety
        /// The instance is one of this library.
        pub(super) unsafe fn call(
            library: &Library,
            name: &str,
            instance: InstancePointer,
            memory: &mut Memory<'_>,
        ) -> Result<c_int, String> {
            match name {
                $($($name)|+ => {
                    type Function = unsafe extern "C" fn(InstancePointer, $($type),*) -> c_int;
                    // SAFETY: the standard gives this name that type.
                    let function = unsafe { library.get::<Function>(name) };
                    let function = function.map_err(|_| format!("the FMU has no function {name}"))?;
                    $(let $argument = memory.pass::<$type>(stringify!($argument))?;)*
                    // SAFETY: the standard's type; every array is NULL or as long as the largest count of the call.
                    Ok(unsafe { function(instance, $($argument),*) })
                })*
                _ => Err(format!("{name} is not a function of FMI 2.0 or 3.0 with an instance")),
            }
        }
    };
}

functions! {
    "fmi2EnterInitializationMode" "fmi2ExitInitializationMode" "fmi2Terminate" "fmi2Reset" "fmi2CancelStep"
    "fmi2EnterEventMode" "fmi2EnterContinuousTimeMode" "fmi3ExitInitializationMode" "fmi3Terminate" "fmi3Reset"
    "fmi3EnterStepMode" "fmi3EnterEventMode" "fmi3EvaluateDiscreteStates" "fmi3EnterConfigurationMode"
    "fmi3ExitConfigurationMode" "fmi3EnterContinuousTimeMode" ();
    "fmi2SetDebugLogging" (on: c_int, n: usize, categories: Texts);
    "fmi3SetDebugLogging" (on: u8, n: usize, categories: Texts);
    "fmi2SetupExperiment" (tolerance_defined: c_int, tolerance: f64, start: f64, stop_defined: c_int, stop: f64);
    "fmi3EnterInitializationMode" (tolerance_defined: u8, tolerance: f64, start: f64, stop_defined: u8, stop: f64);

    "fmi2GetReal" (vr: In<u32>, n: usize, values: Out<f64>);
    "fmi2GetInteger" "fmi2GetBoolean" (vr: In<u32>, n: usize, values: Out<c_int>);
    "fmi2GetString" (vr: In<u32>, n: usize, values: TextsOut);
    "fmi2SetReal" (vr: In<u32>, n: usize, values: In<f64>);
    "fmi2SetInteger" "fmi2SetBoolean" (vr: In<u32>, n: usize, values: In<c_int>);
    "fmi2SetString" (vr: In<u32>, n: usize, values: Texts);
    "fmi3GetFloat64" (vr: In<u32>, n: usize, values: Out<f64>, m: usize);
    "fmi3GetFloat32" (vr: In<u32>, n: usize, values: Out<f32>, m: usize);
    "fmi3GetInt8" (vr: In<u32>, n: usize, values: Out<i8>, m: usize);
    "fmi3GetUInt8" "fmi3GetBoolean" (vr: In<u32>, n: usize, values: Out<u8>, m: usize);
    "fmi3GetInt16" (vr: In<u32>, n: usize, values: Out<i16>, m: usize);
    "fmi3GetUInt16" (vr: In<u32>, n: usize, values: Out<u16>, m: usize);
    "fmi3GetInt32" (vr: In<u32>, n: usize, values: Out<i32>, m: usize);
    "fmi3GetUInt32" (vr: In<u32>, n: usize, values: Out<u32>, m: usize);
    "fmi3GetInt64" (vr: In<u32>, n: usize, values: Out<i64>, m: usize);
    "fmi3GetUInt64" (vr: In<u32>, n: usize, values: Out<u64>, m: usize);
    "fmi3GetString" (vr: In<u32>, n: usize, values: TextsOut, m: usize);
    "fmi3GetBinary" (vr: In<u32>, n: usize, sizes: Out<usize>, values: BytesOut, m: usize);
    "fmi3GetClock" (vr: In<u32>, n: usize, values: Out<u8>);
    "fmi3SetFloat64" (vr: In<u32>, n: usize, values: In<f64>, m: usize);
    "fmi3SetFloat32" (vr: In<u32>, n: usize, values: In<f32>, m: usize);
    "fmi3SetInt8" (vr: In<u32>, n: usize, values: In<i8>, m: usize);
    "fmi3SetUInt8" "fmi3SetBoolean" (vr: In<u32>, n: usize, values: In<u8>, m: usize);
    "fmi3SetInt16" (vr: In<u32>, n: usize, values: In<i16>, m: usize);
    "fmi3SetUInt16" (vr: In<u32>, n: usize, values: In<u16>, m: usize);
    "fmi3SetInt32" (vr: In<u32>, n: usize, values: In<i32>, m: usize);
    "fmi3SetUInt32" (vr: In<u32>, n: usize, values: In<u32>, m: usize);
    "fmi3SetInt64" (vr: In<u32>, n: usize, values: In<i64>, m: usize);
    "fmi3SetUInt64" (vr: In<u32>, n: usize, values: In<u64>, m: usize);
    "fmi3SetString" (vr: In<u32>, n: usize, values: Texts, m: usize);
    "fmi3SetBinary" (vr: In<u32>, n: usize, sizes: In<usize>, values: Texts, m: usize);
    "fmi3SetClock" (vr: In<u32>, n: usize, values: In<u8>);

    "fmi2GetFMUstate" "fmi2FreeFMUstate" "fmi3GetFMUState" "fmi3FreeFMUState" (state: Place);
    "fmi2SetFMUstate" "fmi3SetFMUState" (state: Saved);
    "fmi2SerializedFMUstateSize" "fmi3SerializedFMUStateSize" (state: Saved, size: Out<usize>);
    "fmi2SerializeFMUstate" "fmi3SerializeFMUState" (state: Saved, bytes: BlobOut, size: usize);
    "fmi2DeSerializeFMUstate" "fmi3DeserializeFMUState" (bytes: Blob, size: usize, state: Place);

    "fmi2DoStep" (t: f64, h: f64, no_set_state_prior: c_int);
    "fmi3DoStep" (
        t: f64, h: f64, no_set_state_prior: u8, event_handling_needed: Out<u8>, terminate_simulation: Out<u8>,
        early_return: Out<u8>, last_successful_time: Out<f64>
    );
    "fmi2GetStatus" "fmi2GetIntegerStatus" "fmi2GetBooleanStatus" (kind: c_int, value: Out<c_int>);
    "fmi2GetRealStatus" (kind: c_int, value: Out<f64>);
    "fmi2GetStringStatus" (kind: c_int, value: TextsOut);
    "fmi2SetRealInputDerivatives" (vr: In<u32>, n: usize, orders: In<c_int>, values: In<f64>);
    "fmi2GetRealOutputDerivatives" (vr: In<u32>, n: usize, orders: In<c_int>, values: Out<f64>);
    "fmi3GetOutputDerivatives" (vr: In<u32>, n: usize, orders: In<c_int>, values: Out<f64>, m: usize);
    "fmi2GetDirectionalDerivative" (
        unknowns: In<u32>, n_unknowns: usize, knowns: In<u32>, n_knowns: usize, seed: In<f64>, sensitivity: Out<f64>
    );
    "fmi3GetDirectionalDerivative" "fmi3GetAdjointDerivative" (
        unknowns: In<u32>, n_unknowns: usize, knowns: In<u32>, n_knowns: usize, seed: In<f64>, n_seed: usize,
        sensitivity: Out<f64>, n_sensitivity: usize
    );
    "fmi3GetNumberOfVariableDependencies" (vr: u32, n: Out<usize>);
    "fmi3GetVariableDependencies" (
        dependent: u32, elements: Out<usize>, independents: Out<u32>, of_independents: Out<usize>, kinds: Out<c_int>,
        n: usize
    );

    "fmi2NewDiscreteStates" (info: EventInfo);
    "fmi3UpdateDiscreteStates" (
        again: Out<u8>, terminate: Out<u8>, nominals: Out<u8>, values: Out<u8>, next_defined: Out<u8>, next: Out<f64>
    );
    "fmi2CompletedIntegratorStep" (no_set_state_prior: c_int, event: Out<c_int>, end: Out<c_int>);
    "fmi3CompletedIntegratorStep" (no_set_state_prior: u8, event: Out<u8>, end: Out<u8>);
    "fmi2SetTime" "fmi3SetTime" (time: f64);
    "fmi2SetContinuousStates" "fmi3SetContinuousStates" (x: In<f64>, n: usize);
    "fmi2GetDerivatives" "fmi3GetContinuousStateDerivatives" (dx: Out<f64>, n: usize);
    "fmi2GetEventIndicators" "fmi3GetEventIndicators" (z: Out<f64>, n: usize);
    "fmi2GetContinuousStates" "fmi2GetNominalsOfContinuousStates" "fmi3GetContinuousStates"
    "fmi3GetNominalsOfContinuousStates" (x: Out<f64>, n: usize);
    "fmi3GetNumberOfEventIndicators" "fmi3GetNumberOfContinuousStates" (n: Out<usize>);

    "fmi3GetIntervalDecimal" (vr: In<u32>, n: usize, intervals: Out<f64>, qualifiers: Out<c_int>);
    "fmi3GetIntervalFraction" (
        vr: In<u32>, n: usize, counters: Out<u64>, resolutions: Out<u64>, qualifiers: Out<c_int>
    );
    "fmi3GetShiftDecimal" (vr: In<u32>, n: usize, shifts: Out<f64>);
    "fmi3GetShiftFraction" (vr: In<u32>, n: usize, counters: Out<u64>, resolutions: Out<u64>);
    "fmi3SetIntervalDecimal" (vr: In<u32>, n: usize, intervals: In<f64>);
    "fmi3SetIntervalFraction" (vr: In<u32>, n: usize, counters: In<u64>, resolutions: In<u64>);
    "fmi3SetShiftDecimal" (vr: In<u32>, n: usize, shifts: In<f64>);
    "fmi3SetShiftFraction" (vr: In<u32>, n: usize, counters: In<u64>, resolutions: In<u64>);
    "fmi3ActivateModelPartition" (clock: u32, t: f64);
}
