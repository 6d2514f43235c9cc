//! Calls of FMI 2.0 (FMI 2.0.5, 2.1, 3.2 and 4.2).

mod equations;

use super::Loaded;
use super::library::symbols;
use super::log::{Log, Status, copy_text};
use super::shared::{SharedInstance, missing};
use super::signatures::OfInstance;
use super::signatures::v2::{
    Callbacks, CompletedIntegratorStep, DoStep, Get, GetStatus, InputDerivatives, Instantiate, NewDiscreteStates,
    OutputDerivatives, Sensitivity, Set, SetDebugLogging, SetupExperiment, calloc, free,
};
use crate::instance::Stepped;
use crate::standard::{Experiment, Kind, Outcome, Standard, judge, misfit, narrow};
use crate::value::Values;
use model_description::BaseType;
use std::ffi::{CString, c_char, c_int, c_void};
use std::sync::Arc;
use std::sync::atomic::AtomicPtr;
use std::{ptr, slice};

symbols! {
    /// The functions of FMI 2.0 that this importer calls.
    Functions {
        instantiate: "fmi2Instantiate" = Instantiate,
        setup: "fmi2SetupExperiment" = SetupExperiment,
        enter: "fmi2EnterInitializationMode" = OfInstance,
        get_real: "fmi2GetReal" = Get<f64>,
        set_real: "fmi2SetReal" = Set<f64>,
        get_integer: "fmi2GetInteger" = Get<c_int>,
        set_integer: "fmi2SetInteger" = Set<c_int>,
        get_boolean: "fmi2GetBoolean" = Get<c_int>,
        set_boolean: "fmi2SetBoolean" = Set<c_int>,
        get_string: "fmi2GetString" = Get<*const c_char>,
        set_string: "fmi2SetString" = Set<*const c_char>,
        ;
        // Interfaces that an FMU need not have; see `PROMISED`.
        do_step: "fmi2DoStep" = DoStep,
        new_discrete_states: "fmi2NewDiscreteStates" = NewDiscreteStates,
        completed_integrator_step: "fmi2CompletedIntegratorStep" = CompletedIntegratorStep,
        // Some exporters omit these; a call reports it.
        set_debug_logging: "fmi2SetDebugLogging" = SetDebugLogging,
        get_boolean_status: "fmi2GetBooleanStatus" = GetStatus<c_int>,
        get_real_status: "fmi2GetRealStatus" = GetStatus<f64>,
        get_directional_derivative: "fmi2GetDirectionalDerivative" = Sensitivity,
        get_output_derivatives: "fmi2GetRealOutputDerivatives" = OutputDerivatives,
        set_input_derivatives: "fmi2SetRealInputDerivatives" = InputDerivatives,
    }
}

/// Functions that a description with Co-Simulation promises.
pub(super) const CO_SIMULATION: &[&str] = &["fmi2Instantiate", "fmi2DoStep"];
/// Functions that a description with Model Exchange promises.
pub(super) const MODEL_EXCHANGE: &[&str] = &[
    "fmi2Instantiate",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
];

/// `fmi2ModelExchange`, a type of FMU.
const TYPE_MODEL_EXCHANGE: c_int = 0;
/// `fmi2CoSimulation`, a type of FMU.
const TYPE_CO_SIMULATION: c_int = 1;
/// `fmi2LastSuccessfulTime`, a status kind.
const LAST_SUCCESSFUL_TIME: c_int = 2;
/// `fmi2Terminated`, a status kind.
const TERMINATED: c_int = 3;

/// A [`Logger`](super::signatures::v2::Logger). Keeps the message unformatted except for the two forms that need no
/// formatter: `%%`, and `%s` alone with its text.
unsafe extern "C" fn logger(
    environment: *mut c_void,
    _instance: *const c_char,
    status: Status,
    category: *const c_char,
    format: *const c_char,
    first: *const c_char,
) {
    let with_text = cfg!(not(target_vendor = "apple"));
    // SAFETY: the FMU passes the environment that it got in the callbacks, and C strings; a format "%s" comes with a text.
    unsafe {
        let format = copy_text(format);
        let message = if with_text && format == "%s" { copy_text(first) } else { format.replace("%%", "%") };
        Log::receive(environment, status, copy_text(category), message);
    };
}

/// An instance. Owns the data that the FMU may keep pointers to.
pub(crate) struct Instance {
    // First, so that the instance is freed before the library and the callbacks.
    shared: SharedInstance,
    functions: Arc<Loaded<Functions>>,
    // FMI 2.0 before its revision 5 let the FMU keep the pointer to the callbacks.
    _callbacks: Arc<Callbacks>,
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
        let fmu_type = match kind {
            Kind::CoSimulation { .. } => TYPE_CO_SIMULATION,
            Kind::ModelExchange => TYPE_MODEL_EXCHANGE,
        };
        let callbacks = Arc::new(Callbacks {
            logger: Some(logger),
            allocate: Some(calloc),
            free: Some(free),
            step_finished: None,
            environment: AtomicPtr::new(log.environment()),
        });
        // SAFETY: the strings and the callbacks outlive the call, the callbacks and the log outlive the instance.
        let component = unsafe {
            (functions.api.instantiate)(
                name.as_ptr(),
                fmu_type,
                token.as_ptr(),
                resources.as_ptr(),
                Arc::as_ptr(&callbacks),
                0,
                c_int::from(logging),
            )
        };
        // SAFETY: the instance is of this library, which `functions` keeps loaded.
        let shared = unsafe { SharedInstance::new("fmi2Instantiate", &functions.shared, component) }?;
        Ok(Self { shared, functions, _callbacks: callbacks })
    }

    /// Reads scalars, as many as both slices have.
    #[inline]
    fn read<T>(&self, name: &'static str, function: Get<T>, references: &[u32], values: &mut [T]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: the instance is alive; both slices have at least n elements.
        judge(name, unsafe { function(self.shared.pointer(), references.as_ptr(), n, values.as_mut_ptr()) })
    }

    /// Writes scalars, as many as both slices have.
    #[inline]
    fn write<T>(&self, name: &'static str, function: Set<T>, references: &[u32], values: &[T]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: the instance is alive; both slices have at least n elements.
        judge(name, unsafe { function(self.shared.pointer(), references.as_ptr(), n, values.as_ptr()) })
    }

    fn get_one<T: Copy>(&self, name: &'static str, function: Get<T>, reference: u32, mut value: T) -> Outcome<T> {
        self.read(name, function, &[reference], slice::from_mut(&mut value)).map(|()| value)
    }
}

impl Instance {
    #[inline]
    pub(super) fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        self.read("fmi2GetReal", self.functions.api.get_real, references, values)
    }

    #[inline]
    pub(super) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        self.write("fmi2SetReal", self.functions.api.set_real, references, values)
    }

    #[inline]
    pub(super) fn do_step(&mut self, t: f64, h: f64) -> Outcome<Stepped> {
        let do_step = self.functions.api.do_step.ok_or_else(|| missing("fmi2DoStep"))?;
        // SAFETY: the instance is alive. "No set state before this point" is false: a state may be set at any time.
        let status = unsafe { do_step(self.shared.pointer(), t, h, 0) };
        let stepped = Stepped { terminate: false, event: false, early: false, last: t + h };
        if let (Status::DISCARD, Some(function)) = (status, self.functions.api.get_boolean_status) {
            let mut ended = 0;
            // SAFETY: the instance is alive, there is room for one value.
            let asked = unsafe { function(self.shared.pointer(), TERMINATED, &raw mut ended) };
            if asked == Status::OK && ended != 0 {
                return Ok(Stepped { terminate: true, ..stepped });
            }
        }
        judge("fmi2DoStep", status).map(|()| stepped)
    }
}

impl Standard for Instance {
    fn shared(&mut self) -> &mut SharedInstance {
        &mut self.shared
    }

    fn get(&mut self, base: BaseType, reference: u32, _count: usize) -> Outcome<Values> {
        let api = &self.functions.api;
        match base {
            BaseType::Float64 => {
                self.get_one("fmi2GetReal", api.get_real, reference, 0.0).map(|x| Values::Reals(vec![x]))
            }
            BaseType::Boolean => {
                self.get_one("fmi2GetBoolean", api.get_boolean, reference, 0).map(|x| Values::Booleans(vec![x != 0]))
            }
            BaseType::String => {
                let text = self.get_one("fmi2GetString", api.get_string, reference, ptr::null())?;
                // SAFETY: the FMU's string lives until its next call.
                Ok(Values::Strings(vec![unsafe { copy_text(text) }]))
            }
            _ => {
                self.get_one("fmi2GetInteger", api.get_integer, reference, 0).map(|x| Values::Integers(vec![x.into()]))
            }
        }
    }

    fn set(&mut self, base: BaseType, reference: u32, values: &Values) -> Outcome {
        let api = &self.functions.api;
        match (base, values) {
            (BaseType::Float64, Values::Reals(x)) if x.len() == 1 => {
                self.write("fmi2SetReal", api.set_real, &[reference], x)
            }
            (BaseType::Int32 | BaseType::Enumeration, Values::Integers(x)) if x.len() == 1 => {
                self.write("fmi2SetInteger", api.set_integer, &[reference], &narrow(base, x)?)
            }
            (BaseType::Boolean, Values::Booleans(x)) if x.len() == 1 => {
                self.write("fmi2SetBoolean", api.set_boolean, &[reference], &[c_int::from(x[0])])
            }
            (BaseType::String, Values::Strings(x)) if x.len() == 1 => {
                let text = CString::new(x[0].as_str()).map_err(|_| misfit(base, values))?;
                self.write("fmi2SetString", api.set_string, &[reference], &[text.as_ptr()])
            }
            _ => Err(misfit(base, values)),
        }
    }

    fn set_debug_logging(&mut self, on: bool) -> Outcome {
        let function = self.functions.api.set_debug_logging.ok_or_else(|| missing("fmi2SetDebugLogging"))?;
        // SAFETY: the instance is alive; no categories, so no array.
        judge("fmi2SetDebugLogging", unsafe { function(self.shared.pointer(), c_int::from(on), 0, ptr::null()) })
    }

    fn setup(&mut self, x: Experiment) -> Outcome {
        let (tolerance, stop) = (x.tolerance.unwrap_or(0.0), x.stop.unwrap_or(0.0));
        let (with_tolerance, with_stop) = (c_int::from(x.tolerance.is_some()), c_int::from(x.stop.is_some()));
        // SAFETY: the instance is alive.
        let status = unsafe {
            (self.functions.api.setup)(self.shared.pointer(), with_tolerance, tolerance, x.start, with_stop, stop)
        };
        judge("fmi2SetupExperiment", status)
    }

    fn enter_initialization(&mut self) -> Outcome {
        self.shared.call("fmi2EnterInitializationMode", self.functions.api.enter)
    }

    fn last_successful_time(&mut self) -> Outcome<f64> {
        let function = self.functions.api.get_real_status.ok_or_else(|| missing("fmi2GetRealStatus"))?;
        let mut time = 0.0;
        // SAFETY: the instance is alive, there is room for one value.
        let status = unsafe { function(self.shared.pointer(), LAST_SUCCESSFUL_TIME, &raw mut time) };
        judge("fmi2GetRealStatus", status).map(|()| time)
    }
}
