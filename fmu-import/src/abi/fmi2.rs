//! Calls of FMI 2.0 for co-simulation (FMI 2.0.5, 2.1 and 4.2).

use super::Loaded;
use super::library::symbols;
use super::log::{Log, Status, copy_text};
use super::shared::{SharedInstance, missing};
use super::signatures::OfInstance;
use super::signatures::v2::{
    Callbacks, DoStep, Get, GetStatus, Instantiate, Set, SetDebugLogging, SetupExperiment, calloc, free,
};
use crate::standard::{Experiment, Outcome, Standard, judge, misfit, narrow};
use crate::value::Values;
use model_description::BaseType;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ops::ControlFlow;
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
        do_step: "fmi2DoStep" = DoStep,
        ;
        // Some exporters omit these; a call reports it.
        set_debug_logging: "fmi2SetDebugLogging" = SetDebugLogging,
        get_boolean_status: "fmi2GetBooleanStatus" = GetStatus<c_int>,
        get_real_status: "fmi2GetRealStatus" = GetStatus<f64>,
    }
}

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
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
pub(super) struct Instance {
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
    ) -> Outcome<Self> {
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
                CO_SIMULATION,
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
    fn read<T>(&self, name: &'static str, function: Get<T>, references: &[u32], values: &mut [T]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: the instance is alive; both slices have at least n elements.
        judge(name, unsafe { function(self.shared.pointer(), references.as_ptr(), n, values.as_mut_ptr()) })
    }

    /// Writes scalars, as many as both slices have.
    fn write<T>(&self, name: &'static str, function: Set<T>, references: &[u32], values: &[T]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: the instance is alive; both slices have at least n elements.
        judge(name, unsafe { function(self.shared.pointer(), references.as_ptr(), n, values.as_ptr()) })
    }

    fn get_one<T: Copy>(&self, name: &'static str, function: Get<T>, reference: u32, mut value: T) -> Outcome<T> {
        self.read(name, function, &[reference], slice::from_mut(&mut value)).map(|()| value)
    }
}

impl Standard for Instance {
    fn shared(&mut self) -> &mut SharedInstance {
        &mut self.shared
    }

    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        self.read("fmi2GetReal", self.functions.api.get_real, references, values)
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        self.write("fmi2SetReal", self.functions.api.set_real, references, values)
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

    fn do_step(&mut self, t: f64, h: f64) -> Outcome<ControlFlow<()>> {
        // SAFETY: the instance is alive. "No set state before this point" is false: a state may be set at any time.
        let status = unsafe { (self.functions.api.do_step)(self.shared.pointer(), t, h, 0) };
        if let (Status::DISCARD, Some(function)) = (status, self.functions.api.get_boolean_status) {
            let mut ended = 0;
            // SAFETY: the instance is alive, there is room for one value.
            let asked = unsafe { function(self.shared.pointer(), TERMINATED, &raw mut ended) };
            if asked == Status::OK && ended != 0 {
                return Ok(ControlFlow::Break(()));
            }
        }
        judge("fmi2DoStep", status).map(ControlFlow::Continue)
    }
    fn last_successful_time(&mut self) -> Outcome<f64> {
        let function = self.functions.api.get_real_status.ok_or_else(|| missing("fmi2GetRealStatus"))?;
        let mut time = 0.0;
        // SAFETY: the instance is alive, there is room for one value.
        let status = unsafe { function(self.shared.pointer(), LAST_SUCCESSFUL_TIME, &raw mut time) };
        judge("fmi2GetRealStatus", status).map(|()| time)
    }
}
