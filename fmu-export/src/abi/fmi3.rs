//! FMI 3.0.2: its own calls, and the table of its functions.

use super::gate::{Entry, enter, open};
use super::logger::{Fmi3Logger, Fmi3Sink};
use super::pointer::{place, text};
use super::types::{Fmi3Boolean, Instance, Text};
use super::{Abi, credentials};
use crate::log::Log;
use fmu_core::{Fault, Model};
use std::ffi::{c_int, c_void};

/// # Safety
/// As in `calls.rs`.
#[allow(missing_docs, clippy::missing_safety_doc, reason = "named as in the standards; the section above covers all")]
impl<M: Model> Abi<M> {
    /// FMI 3.0.2, 2.3.1. `refused` names a requested feature that this FMU lacks.
    pub unsafe fn fmi3_instantiate(
        entry: Entry,
        name: Text,
        token: Text,
        logging_on: Fmi3Boolean,
        environment: *mut c_void,
        logger: Option<Fmi3Logger>,
        refused: Option<&str>,
    ) -> Instance {
        // SAFETY: the importer's texts, valid during this call.
        let (name, token) = unsafe { (text(name), text(token)) };
        let judged = credentials::<M>(name, token);
        let judged = judged.and_then(|name| refused.map_or(Ok(name), |why| Err(Fault::new(why))));
        open::<M>(entry, Log::new(Box::new(Fmi3Sink { logger, environment }), logging_on.0 != 0), judged)
    }

    pub unsafe fn fmi3_enter_initialization(
        entry: Entry,
        instance: Instance,
        start: f64,
        stop_defined: Fmi3Boolean,
        stop: f64,
    ) -> c_int {
        // SAFETY: the importer's instance.
        unsafe {
            enter::<M>(entry, instance, |instance| Ok(instance.set_up(start, (stop_defined.0 != 0).then_some(stop))?))
        }
    }

    /// FMI 3.0.2, 4.2.1. Without event mode and early return, only the time carries information.
    #[expect(clippy::too_many_arguments, reason = "the arguments of the standard")]
    pub unsafe fn fmi3_do_step(
        entry: Entry,
        instance: Instance,
        t: f64,
        h: f64,
        event_handling_needed: *mut Fmi3Boolean,
        terminate_simulation: *mut Fmi3Boolean,
        early_return: *mut Fmi3Boolean,
        last_successful_time: *mut f64,
    ) -> c_int {
        // SAFETY: the importer's variables.
        unsafe {
            enter::<M>(entry, instance, |instance| {
                let time = place(last_successful_time, "lastSuccessfulTime")?;
                place(event_handling_needed, "eventHandlingNeeded")?.write(Fmi3Boolean(0));
                place(terminate_simulation, "terminateSimulation")?.write(Fmi3Boolean(0));
                place(early_return, "earlyReturn")?.write(Fmi3Boolean(0));
                time.write(instance.current.end);
                instance.do_step(t, h)?;
                time.write(instance.current.end);
                Ok(())
            })
        }
    }
}

/// The functions of `fmi3Functions.h`, in the form of the table of FMI 2.0.
#[doc(hidden)]
#[macro_export]
macro_rules! export_fmi3 {
    ($model:ty) => {
        #[unsafe(no_mangle)]
        pub(crate) extern "C" fn fmi3GetVersion() -> Text {
            c"3.0".as_ptr()
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateCoSimulation(
            name: Text,
            token: Text,
            _resources: Text,
            _visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            event_mode_used: Fmi3Boolean,
            _early_return_allowed: Fmi3Boolean,
            _intermediate: References,
            n_intermediate: usize,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
            _intermediate_update: *const c_void,
        ) -> Instance {
            $crate::abi::quiet();
            const ENTRY: Entry = Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateCoSimulation");
            let refused = match (event_mode_used.0 != 0, n_intermediate) {
                (true, _) => Some("eventModeUsed = true is not allowed: hasEventMode = false"),
                (_, 1..) => Some("nRequiredIntermediateVariables must be 0: providesIntermediateUpdate = false"),
                _ => None,
            };
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$model>::fmi3_instantiate(
                    ENTRY, name, token, logging_on, environment, logger, refused,
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateModelExchange(
            name: Text,
            token: Text,
            _resources: Text,
            _visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
        ) -> Instance {
            $crate::abi::quiet();
            const ENTRY: Entry = Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateModelExchange");
            let refused = Some("not supported: Model Exchange; this FMU is for Co-Simulation");
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$model>::fmi3_instantiate(
                    ENTRY, name, token, logging_on, environment, logger, refused,
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3InstantiateScheduledExecution(
            name: Text,
            token: Text,
            _resources: Text,
            _visible: Fmi3Boolean,
            logging_on: Fmi3Boolean,
            environment: *mut c_void,
            logger: Option<Fmi3Logger>,
            _clock_update: *const c_void,
            _lock_preemption: *const c_void,
            _unlock_preemption: *const c_void,
        ) -> Instance {
            $crate::abi::quiet();
            const ENTRY: Entry = Entry::new(Standard::Fmi3, Call::Instantiate, "fmi3InstantiateScheduledExecution");
            let refused = Some("not supported: Scheduled Execution; this FMU is for Co-Simulation");
            // SAFETY: what the standard demands of the importer.
            unsafe {
                $crate::abi::Abi::<$model>::fmi3_instantiate(
                    ENTRY, name, token, logging_on, environment, logger, refused,
                )
            }
        }

        #[unsafe(no_mangle)]
        pub(crate) unsafe extern "C" fn fmi3FreeInstance(instance: Instance) {
            // SAFETY: what the standard demands of the importer.
            unsafe { $crate::abi::Abi::<$model>::free_instance(instance) }
        }

        $crate::functions! { Fmi3 $model;
            fmi3SetDebugLogging(on: Fmi3Boolean, n: usize, categories: *const Text)
                => SetDebugLogging: set_debug_logging(on.0 != 0, n, categories);
            fmi3EnterInitializationMode(_tolerance_defined: Fmi3Boolean, _tolerance: f64, start: f64, stop_defined: Fmi3Boolean, stop: f64)
                => EnterInitialization: fmi3_enter_initialization(start, stop_defined, stop);
            fmi3ExitInitializationMode() => ExitInitialization: exit_initialization();
            fmi3Terminate() => Terminate: terminate();
            fmi3Reset() => Reset: reset();

            fmi3GetFloat64(vr: References, n: usize, values: *mut f64, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt32(vr: References, n: usize, values: *mut i32, m: usize) => Get: get(vr, n, values, m);
            fmi3GetInt64(vr: References, n: usize, values: *mut i64, m: usize) => Get: get(vr, n, values, m);
            fmi3GetBoolean(vr: References, n: usize, values: *mut Fmi3Boolean, m: usize) => Get: get(vr, n, values, m);
            fmi3GetFloat32(vr: References, n: usize, _v: *mut f32, m: usize) => Get: none(vr, n, m, "a Float32");
            fmi3GetInt8(vr: References, n: usize, _v: *mut i8, m: usize) => Get: none(vr, n, m, "an Int8");
            fmi3GetUInt8(vr: References, n: usize, _v: *mut u8, m: usize) => Get: none(vr, n, m, "a UInt8");
            fmi3GetInt16(vr: References, n: usize, _v: *mut i16, m: usize) => Get: none(vr, n, m, "an Int16");
            fmi3GetUInt16(vr: References, n: usize, _v: *mut u16, m: usize) => Get: none(vr, n, m, "a UInt16");
            fmi3GetUInt32(vr: References, n: usize, _v: *mut u32, m: usize) => Get: none(vr, n, m, "a UInt32");
            fmi3GetUInt64(vr: References, n: usize, _v: *mut u64, m: usize) => Get: none(vr, n, m, "a UInt64");
            fmi3GetString(vr: References, n: usize, _v: *mut Text, m: usize) => Get: none(vr, n, m, "a text");
            fmi3GetBinary(vr: References, n: usize, _sizes: *mut usize, _v: *mut *const u8, m: usize)
                => Get: none(vr, n, m, "bytes");
            fmi3GetClock(_vr: References, _n: usize, _v: *mut Fmi3Boolean) => Unsupported: unsupported("clocks");

            fmi3SetFloat64(vr: References, n: usize, values: *const f64, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt32(vr: References, n: usize, values: *const i32, m: usize) => Set: set(vr, n, values, m);
            fmi3SetInt64(vr: References, n: usize, values: *const i64, m: usize) => Set: set(vr, n, values, m);
            fmi3SetBoolean(vr: References, n: usize, values: *const Fmi3Boolean, m: usize) => Set: set(vr, n, values, m);
            fmi3SetFloat32(vr: References, n: usize, _v: *const f32, m: usize) => Set: none(vr, n, m, "a Float32");
            fmi3SetInt8(vr: References, n: usize, _v: *const i8, m: usize) => Set: none(vr, n, m, "an Int8");
            fmi3SetUInt8(vr: References, n: usize, _v: *const u8, m: usize) => Set: none(vr, n, m, "a UInt8");
            fmi3SetInt16(vr: References, n: usize, _v: *const i16, m: usize) => Set: none(vr, n, m, "an Int16");
            fmi3SetUInt16(vr: References, n: usize, _v: *const u16, m: usize) => Set: none(vr, n, m, "a UInt16");
            fmi3SetUInt32(vr: References, n: usize, _v: *const u32, m: usize) => Set: none(vr, n, m, "a UInt32");
            fmi3SetUInt64(vr: References, n: usize, _v: *const u64, m: usize) => Set: none(vr, n, m, "a UInt64");
            fmi3SetString(vr: References, n: usize, _v: *const Text, m: usize) => Set: none(vr, n, m, "a text");
            fmi3SetBinary(vr: References, n: usize, _sizes: *const usize, _v: *const *const u8, m: usize)
                => Set: none(vr, n, m, "bytes");
            fmi3SetClock(_vr: References, _n: usize, _v: *const Fmi3Boolean) => Unsupported: unsupported("clocks");

            fmi3GetFMUState(state: *mut FmuState) => SaveState: save_state(state);
            fmi3SetFMUState(state: FmuState) => RestoreState: restore_state(state);
            fmi3FreeFMUState(state: *mut FmuState) => UseState: free_state(state);
            fmi3SerializedFMUStateSize(state: FmuState, size: *mut usize) => UseState: serialized_size(state, size);
            fmi3SerializeFMUState(state: FmuState, bytes: *mut u8, size: usize) => UseState: serialize(state, bytes, size);
            fmi3DeserializeFMUState(bytes: *const u8, size: usize, state: *mut FmuState)
                => UseState: deserialize(bytes, size, state);

            fmi3DoStep(
                t: f64, h: f64, _no_set_state_prior: Fmi3Boolean, event_handling_needed: *mut Fmi3Boolean,
                terminate_simulation: *mut Fmi3Boolean, early_return: *mut Fmi3Boolean, last_successful_time: *mut f64
            ) => DoStep: fmi3_do_step(t, h, event_handling_needed, terminate_simulation, early_return, last_successful_time);
            fmi3EnterStepMode() => Unsupported: unsupported("hasEventMode = false");
            fmi3EnterEventMode() => Unsupported: unsupported("hasEventMode = false");
            fmi3EvaluateDiscreteStates() => Unsupported: unsupported("hasEventMode = false");
            fmi3UpdateDiscreteStates(
                _update: *mut Fmi3Boolean, _end: *mut Fmi3Boolean, _nominals: *mut Fmi3Boolean,
                _values: *mut Fmi3Boolean, _next_defined: *mut Fmi3Boolean, _next: *mut f64
            ) => Unsupported: unsupported("hasEventMode = false");
            fmi3GetOutputDerivatives(_vr: References, _n: usize, _orders: *const i32, _v: *mut f64, _m: usize)
                => Unsupported: unsupported("maxOutputDerivativeOrder = 0");
            fmi3GetDirectionalDerivative(
                _unknowns: References, _n_unknowns: usize, _knowns: References, _n_knowns: usize,
                _seed: *const f64, _n_seed: usize, _sensitivity: *mut f64, _n_sensitivity: usize
            ) => Unsupported: unsupported("providesDirectionalDerivatives = false");
            fmi3GetAdjointDerivative(
                _unknowns: References, _n_unknowns: usize, _knowns: References, _n_knowns: usize,
                _seed: *const f64, _n_seed: usize, _sensitivity: *mut f64, _n_sensitivity: usize
            ) => Unsupported: unsupported("providesAdjointDerivatives = false");
            fmi3GetNumberOfVariableDependencies(_vr: u32, _n: *mut usize)
                => Unsupported: unsupported("providesPerElementDependencies = false");
            fmi3GetVariableDependencies(
                _dependent: u32, _elements: *mut usize, _independents: *mut u32, _of_independents: *mut usize,
                _kinds: *mut c_int, _n: usize
            ) => Unsupported: unsupported("providesPerElementDependencies = false");
            fmi3EnterConfigurationMode() => Unsupported: unsupported("there are no structural parameters");
            fmi3ExitConfigurationMode() => Unsupported: unsupported("there are no structural parameters");

            fmi3GetIntervalDecimal(_vr: References, _n: usize, _intervals: *mut f64, _qualifiers: *mut c_int)
                => Unsupported: unsupported("clocks");
            fmi3GetIntervalFraction(
                _vr: References, _n: usize, _counters: *mut u64, _resolutions: *mut u64, _qualifiers: *mut c_int
            ) => Unsupported: unsupported("clocks");
            fmi3GetShiftDecimal(_vr: References, _n: usize, _shifts: *mut f64) => Unsupported: unsupported("clocks");
            fmi3GetShiftFraction(_vr: References, _n: usize, _counters: *mut u64, _resolutions: *mut u64)
                => Unsupported: unsupported("clocks");
            fmi3SetIntervalDecimal(_vr: References, _n: usize, _intervals: *const f64) => Unsupported: unsupported("clocks");
            fmi3SetIntervalFraction(_vr: References, _n: usize, _counters: *const u64, _resolutions: *const u64)
                => Unsupported: unsupported("clocks");
            fmi3SetShiftDecimal(_vr: References, _n: usize, _shifts: *const f64) => Unsupported: unsupported("clocks");
            fmi3SetShiftFraction(_vr: References, _n: usize, _counters: *const u64, _resolutions: *const u64)
                => Unsupported: unsupported("clocks");
            fmi3ActivateModelPartition(_clock: u32, _time: f64) => Unsupported: unsupported("Scheduled Execution");

            fmi3EnterContinuousTimeMode() => Unsupported: unsupported("Model Exchange");
            fmi3CompletedIntegratorStep(_no_set_state_prior: Fmi3Boolean, _event: *mut Fmi3Boolean, _end: *mut Fmi3Boolean)
                => Unsupported: unsupported("Model Exchange");
            fmi3SetTime(_time: f64) => Unsupported: unsupported("Model Exchange");
            fmi3SetContinuousStates(_x: *const f64, _n: usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetContinuousStateDerivatives(_x: *mut f64, _n: usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetEventIndicators(_x: *mut f64, _n: usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetContinuousStates(_x: *mut f64, _n: usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetNominalsOfContinuousStates(_x: *mut f64, _n: usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetNumberOfEventIndicators(_n: *mut usize) => Unsupported: unsupported("Model Exchange");
            fmi3GetNumberOfContinuousStates(_n: *mut usize) => Unsupported: unsupported("Model Exchange");
        }
    };
}
