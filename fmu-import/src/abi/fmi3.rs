//! Calls of FMI 3.0 (FMI 3.0.2, 2.2, 2.3, 3.2 and 4.2), without clocks and intermediate update.

mod equations;

use super::Loaded;
use super::library::symbols;
use super::log::{Log, Status, copy_text};
use super::shared::{SharedInstance, missing};
use super::signatures::v3::{
    CompletedIntegratorStep, Count, DoStep, EnterInitializationMode, Get, InstantiateCoSimulation,
    InstantiateModelExchange, OutputDerivatives, Sensitivity, Set, SetDebugLogging, UpdateDiscreteStates,
};
use crate::instance::Stepped;
use crate::standard::{Experiment, Kind, Outcome, Refusal, Standard, judge, misfit, narrow};
use crate::value::Values;
use model_description::BaseType;
use std::ffi::{CString, c_char, c_void};
use std::ptr;
use std::sync::Arc;

symbols! {
    /// The functions of FMI 3.0 that this importer calls and FMI 2.0 does not have with the same type.
    Functions {
        enter: "fmi3EnterInitializationMode" = EnterInitializationMode,
        get_float64: "fmi3GetFloat64" = Get<f64>,
        set_float64: "fmi3SetFloat64" = Set<f64>,
        ;
        // Interfaces that an FMU need not have; see `CO_SIMULATION`, `EVENT_MODE`, `MODEL_EXCHANGE`.
        co_simulation: "fmi3InstantiateCoSimulation" = InstantiateCoSimulation,
        do_step: "fmi3DoStep" = DoStep,
        model_exchange: "fmi3InstantiateModelExchange" = InstantiateModelExchange,
        update_discrete_states: "fmi3UpdateDiscreteStates" = UpdateDiscreteStates,
        completed_integrator_step: "fmi3CompletedIntegratorStep" = CompletedIntegratorStep,
        number_of_states: "fmi3GetNumberOfContinuousStates" = Count,
        number_of_indicators: "fmi3GetNumberOfEventIndicators" = Count,
        get_directional_derivative: "fmi3GetDirectionalDerivative" = Sensitivity,
        get_adjoint_derivative: "fmi3GetAdjointDerivative" = Sensitivity,
        get_output_derivatives: "fmi3GetOutputDerivatives" = OutputDerivatives,
        // The standard requires all of these; a call reports one that an FMU omits.
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
        set_debug_logging: "fmi3SetDebugLogging" = SetDebugLogging,
    }
}

/// Functions that a description with Co-Simulation promises.
pub(super) const CO_SIMULATION: &[&str] = &["fmi3InstantiateCoSimulation", "fmi3DoStep"];
/// Functions that `hasEventMode` promises.
pub(super) const EVENT_MODE: &[&str] = &["fmi3EnterEventMode", "fmi3UpdateDiscreteStates", "fmi3EnterStepMode"];
/// Functions that a description with Model Exchange promises.
pub(super) const MODEL_EXCHANGE: &[&str] = &[
    "fmi3InstantiateModelExchange",
    "fmi3EnterEventMode",
    "fmi3UpdateDiscreteStates",
    "fmi3EnterContinuousTimeMode",
    "fmi3CompletedIntegratorStep",
    "fmi3SetTime",
    "fmi3SetContinuousStates",
    "fmi3GetContinuousStateDerivatives",
    "fmi3GetEventIndicators",
    "fmi3GetContinuousStates",
    "fmi3GetNominalsOfContinuousStates",
    "fmi3GetNumberOfContinuousStates",
    "fmi3GetNumberOfEventIndicators",
];

unsafe extern "C" fn log_message(
    environment: *mut c_void,
    status: Status,
    category: *const c_char,
    message: *const c_char,
) {
    // SAFETY: the FMU passes the environment that it was instantiated with, and C strings.
    unsafe { Log::receive(environment, status, copy_text(category), copy_text(message)) };
}

/// An instance.
pub(crate) struct Instance {
    // First, so that the instance is freed before the library.
    shared: SharedInstance,
    functions: Arc<Loaded<Functions>>,
    /// FMI 3.0 receives the times on entering initialization mode.
    experiment: Experiment,
    /// `lastSuccessfulTime` of the last step.
    last_successful_time: f64,
}

/// Borrows a function that may be missing.
macro_rules! function {
    ($self:ident.$field:ident, $name:literal) => {
        $self.functions.api.$field.ok_or_else(|| missing($name))?
    };
}

impl Instance {
    pub(super) fn new(
        functions: Arc<Loaded<Functions>>,
        name: &CString,
        token: &CString,
        resources: &CString,
        log: &Arc<Log>,
        logging: bool,
        kind: Kind,
    ) -> Outcome<Self> {
        let (name, token, resources) = (name.as_ptr(), token.as_ptr(), resources.as_ptr());
        let (function, component) = match kind {
            Kind::CoSimulation { event_mode, early_return } => {
                let function = "fmi3InstantiateCoSimulation";
                let instantiate = functions.api.co_simulation.ok_or_else(|| missing(function))?;
                let (environment, log) = (log.environment(), Some(log_message as _));
                let none = ptr::null();
                // SAFETY: the strings outlive the call, the log outlives the instance; no intermediate variables, no
                // callback.
                (function, unsafe {
                    instantiate(
                        name,
                        token,
                        resources,
                        false,
                        logging,
                        event_mode,
                        early_return,
                        none,
                        0,
                        environment,
                        log,
                        ptr::null(),
                    )
                })
            }
            Kind::ModelExchange => {
                let function = "fmi3InstantiateModelExchange";
                let instantiate = functions.api.model_exchange.ok_or_else(|| missing(function))?;
                // SAFETY: as above.
                (function, unsafe {
                    instantiate(name, token, resources, false, logging, log.environment(), Some(log_message))
                })
            }
        };
        // SAFETY: the instance is of this library, which `functions` keeps loaded.
        let shared = unsafe { SharedInstance::new(function, &functions.shared, component) }?;
        let experiment = Experiment { start: 0.0, stop: None, tolerance: None };
        Ok(Self { shared, functions, experiment, last_successful_time: 0.0 })
    }

    #[inline]
    fn read<T>(&self, name: &'static str, f: Get<T>, references: &[u32], values: &mut [T]) -> Outcome {
        let (n, count) = (references.len(), values.len());
        // SAFETY: the instance is alive; both arrays have the lengths that are passed.
        judge(name, unsafe { f(self.shared.pointer(), references.as_ptr(), n, values.as_mut_ptr(), count) })
    }

    #[inline]
    fn write<T>(&self, name: &'static str, f: Set<T>, references: &[u32], values: &[T]) -> Outcome {
        let (n, count) = (references.len(), values.len());
        // SAFETY: the instance is alive; both arrays have the lengths that are passed.
        judge(name, unsafe { f(self.shared.pointer(), references.as_ptr(), n, values.as_ptr(), count) })
    }

    fn get_all<T>(&self, name: &'static str, f: Get<T>, reference: u32, mut values: Vec<T>) -> Outcome<Vec<T>> {
        self.read(name, f, &[reference], &mut values).map(|()| values)
    }
}

/// Expands to `$body` with the getter or setter of an integer type: `fmi3Enumeration` travels as a 64-bit integer.
macro_rules! by_integer_type {
    ($self:ident, $base:ident, $i8:ident, $u8:ident, $i16:ident, $u16:ident, $i32:ident, $u32:ident, $i64:ident, $u64:ident,
     $direction:literal, |$name:ident, $function:ident| $body:expr, else $other:expr) => {
        by_integer_type!(@arms $self, $base, $direction, |$name, $function| $body, else $other,
            Int8 $i8 "Int8", UInt8 $u8 "UInt8", Int16 $i16 "Int16", UInt16 $u16 "UInt16", Int32 $i32 "Int32",
            UInt32 $u32 "UInt32", Int64 $i64 "Int64", Enumeration $i64 "Int64", UInt64 $u64 "UInt64")
    };
    (@arms $self:ident, $base:ident, $direction:literal, |$name:ident, $function:ident| $body:expr, else $other:expr,
     $($variant:ident $field:ident $suffix:literal),*) => {
        match $base {
            $(BaseType::$variant => {
                let $name = concat!("fmi3", $direction, $suffix);
                let $function = $self.functions.api.$field
                    .ok_or_else(|| missing($name))?;
                $body
            })*
            _ => $other,
        }
    };
}

fn wide<T: Into<i128>>(values: Vec<T>) -> Values {
    Values::Integers(values.into_iter().map(Into::into).collect())
}

impl Instance {
    #[inline]
    pub(super) fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        let n = references.len().min(values.len());
        self.read("fmi3GetFloat64", self.functions.api.get_float64, &references[..n], &mut values[..n])
    }

    #[inline]
    pub(super) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        let n = references.len().min(values.len());
        self.write("fmi3SetFloat64", self.functions.api.set_float64, &references[..n], &values[..n])
    }

    #[inline]
    pub(super) fn do_step(&mut self, t: f64, h: f64) -> Outcome<Stepped> {
        let do_step = function!(self.do_step, "fmi3DoStep");
        let (mut event, mut terminate, mut early, mut last) = (0, 0, 0, t);
        // SAFETY: the instance is alive, there is room for each result. "No set state before this point" is false: a
        // state may be set at any time.
        let status = unsafe {
            do_step(
                self.shared.pointer(),
                t,
                h,
                false,
                &raw mut event,
                &raw mut terminate,
                &raw mut early,
                &raw mut last,
            )
        };
        judge("fmi3DoStep", status)?;
        self.last_successful_time = last;
        Ok(Stepped { terminate: terminate != 0, event: event != 0, early: early != 0, last })
    }
}

impl Standard for Instance {
    fn shared(&mut self) -> &mut SharedInstance {
        &mut self.shared
    }

    fn get(&mut self, base: BaseType, reference: u32, count: usize) -> Outcome<Values> {
        match base {
            BaseType::Float64 => {
                let function = self.functions.api.get_float64;
                self.get_all("fmi3GetFloat64", function, reference, vec![0.0; count]).map(Values::Reals)
            }
            BaseType::Float32 => {
                let function = function!(self.get_float32, "fmi3GetFloat32");
                let values = self.get_all("fmi3GetFloat32", function, reference, vec![0.0; count])?;
                Ok(Values::Reals(values.into_iter().map(f64::from).collect()))
            }
            BaseType::Boolean => {
                let function = function!(self.get_boolean, "fmi3GetBoolean");
                let values = self.get_all("fmi3GetBoolean", function, reference, vec![0_u8; count])?;
                Ok(Values::Booleans(values.into_iter().map(|x| x != 0).collect()))
            }
            BaseType::String => {
                let function = function!(self.get_string, "fmi3GetString");
                let texts = self.get_all("fmi3GetString", function, reference, vec![ptr::null(); count])?;
                // SAFETY: the FMU's strings live until its next call.
                Ok(Values::Strings(texts.into_iter().map(|t| unsafe { copy_text(t) }).collect()))
            }
            _ => by_integer_type!(
                self, base, get_int8, get_uint8, get_int16, get_uint16, get_int32, get_uint32, get_int64, get_uint64,
                "Get", |name, function| self.get_all(name, function, reference, vec![0; count]).map(wide),
                else Err(Refusal::Impossible(format!("values of the type {base} are not supported")))
            ),
        }
    }

    fn set(&mut self, base: BaseType, reference: u32, values: &Values) -> Outcome {
        match (base, values) {
            (BaseType::Float64, Values::Reals(x)) => {
                self.write("fmi3SetFloat64", self.functions.api.set_float64, &[reference], x)
            }
            (BaseType::Float32, Values::Reals(x)) => {
                #[expect(clippy::cast_possible_truncation, reason = "the FMU takes single precision")]
                let x: Vec<f32> = x.iter().map(|&x| x as f32).collect();
                self.write("fmi3SetFloat32", function!(self.set_float32, "fmi3SetFloat32"), &[reference], &x)
            }
            (BaseType::Boolean, Values::Booleans(x)) => {
                let x: Vec<u8> = x.iter().map(|&x| u8::from(x)).collect();
                self.write("fmi3SetBoolean", function!(self.set_boolean, "fmi3SetBoolean"), &[reference], &x)
            }
            (BaseType::String, Values::Strings(x)) => {
                let texts: Result<Vec<CString>, _> = x.iter().map(|x| CString::new(x.as_str())).collect();
                let texts = texts.map_err(|_| misfit(base, values))?;
                let pointers: Vec<_> = texts.iter().map(|t| t.as_ptr()).collect();
                self.write("fmi3SetString", function!(self.set_string, "fmi3SetString"), &[reference], &pointers)
            }
            (_, Values::Integers(x)) => by_integer_type!(
                self, base, set_int8, set_uint8, set_int16, set_uint16, set_int32, set_uint32, set_int64, set_uint64,
                "Set", |name, function| self.write(name, function, &[reference], &narrow(base, x)?),
                else Err(misfit(base, values))
            ),
            _ => Err(misfit(base, values)),
        }
    }

    fn set_debug_logging(&mut self, on: bool) -> Outcome {
        let function = function!(self.set_debug_logging, "fmi3SetDebugLogging");
        // SAFETY: the instance is alive; no categories, so no array.
        judge("fmi3SetDebugLogging", unsafe { function(self.shared.pointer(), on, 0, ptr::null()) })
    }

    fn setup(&mut self, experiment: Experiment) -> Outcome {
        self.experiment = experiment;
        Ok(())
    }

    fn enter_initialization(&mut self) -> Outcome {
        let (x, enter) = (self.experiment, self.functions.api.enter);
        let (tolerance, stop) = (x.tolerance.unwrap_or(0.0), x.stop.unwrap_or(0.0));
        // SAFETY: the instance is alive.
        let status =
            unsafe { enter(self.shared.pointer(), x.tolerance.is_some(), tolerance, x.start, x.stop.is_some(), stop) };
        judge("fmi3EnterInitializationMode", status)
    }

    fn last_successful_time(&mut self) -> Outcome<f64> {
        Ok(self.last_successful_time)
    }
}
