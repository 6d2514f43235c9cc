//! FMI 2.0 for co-simulation, called (FMI 2.0.5, chapters 2.1 and 4.2).

use super::Loaded;
use super::library::symbols;
use super::log::{Log, Status, copy_text};
use crate::standard::{Experiment, Outcome, Refusal, Standard, judge, misfit, narrow};
use crate::value::Values;
use model_description::BaseType;
use std::ffi::{CString, c_char, c_int, c_uint, c_void};
use std::ops::ControlFlow;
use std::ptr;
use std::rc::Rc;
use std::sync::Arc;

type Component = *mut c_void;
type Simple = unsafe extern "C" fn(Component) -> Status;
type Get<T> = unsafe extern "C" fn(Component, *const c_uint, usize, *mut T) -> Status;
type Set<T> = unsafe extern "C" fn(Component, *const c_uint, usize, *const T) -> Status;

symbols! {
    /// The functions of FMI 2.0 that this importer calls.
    Functions {
        instantiate: "fmi2Instantiate" = unsafe extern "C" fn(
            *const c_char, c_int, *const c_char, *const c_char, *const Callbacks, c_int, c_int) -> Component,
        free: "fmi2FreeInstance" = unsafe extern "C" fn(Component),
        setup: "fmi2SetupExperiment" = unsafe extern "C" fn(Component, c_int, f64, f64, c_int, f64) -> Status,
        enter: "fmi2EnterInitializationMode" = Simple,
        exit: "fmi2ExitInitializationMode" = Simple,
        terminate: "fmi2Terminate" = Simple,
        reset: "fmi2Reset" = Simple,
        get_real: "fmi2GetReal" = Get<f64>,
        set_real: "fmi2SetReal" = Set<f64>,
        get_integer: "fmi2GetInteger" = Get<c_int>,
        set_integer: "fmi2SetInteger" = Set<c_int>,
        get_boolean: "fmi2GetBoolean" = Get<c_int>,
        set_boolean: "fmi2SetBoolean" = Set<c_int>,
        get_string: "fmi2GetString" = Get<*const c_char>,
        set_string: "fmi2SetString" = Set<*const c_char>,
        do_step: "fmi2DoStep" = unsafe extern "C" fn(Component, f64, f64, c_int) -> Status,
        ;
        // Some exporters leave these out; they are missed when they are called.
        set_debug_logging: "fmi2SetDebugLogging" = unsafe extern "C" fn(Component, c_int, usize, *const *const c_char) -> Status,
        get_boolean_status: "fmi2GetBooleanStatus" = unsafe extern "C" fn(Component, c_int, *mut c_int) -> Status,
        get_state: "fmi2GetFMUstate" = unsafe extern "C" fn(Component, *mut *mut c_void) -> Status,
        set_state: "fmi2SetFMUstate" = unsafe extern "C" fn(Component, *mut c_void) -> Status,
        free_state: "fmi2FreeFMUstate" = unsafe extern "C" fn(Component, *mut *mut c_void) -> Status,
        state_size: "fmi2SerializedFMUstateSize" = unsafe extern "C" fn(Component, *mut c_void, *mut usize) -> Status,
        serialize: "fmi2SerializeFMUstate" = unsafe extern "C" fn(Component, *mut c_void, *mut c_char, usize) -> Status,
        deserialize: "fmi2DeSerializeFMUstate" = unsafe extern "C" fn(Component, *const c_char, usize, *mut *mut c_void) -> Status,
    }
}

/// `fmi2CoSimulation`.
const CO_SIMULATION: c_int = 1;
/// `fmi2Terminated`, a status kind.
const TERMINATED: c_int = 3;

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub(super) struct Callbacks {
    logger: unsafe extern "C" fn(*mut c_void, *const c_char, Status, *const c_char, *const c_char, *const c_char),
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: Option<unsafe extern "C" fn(*mut c_void, Status)>,
    environment: *mut c_void,
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// The logger. In C it is variadic, which a Rust function cannot be. On x86_64 and 64-bit ARM, Linux and Windows, a variadic
/// call passes its arguments where any call passes them and the caller cleans up, so the first six can be received as fixed
/// ones; what is beyond is never looked at. (Apple's ARM passes the variadic ones elsewhere: there only five are.)
///
/// The message is shown unformatted, but for the two forms that need no formatter: `%%`, and `%s` alone with its text.
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

/// An instance. Owns what the FMU may keep pointers to.
pub(super) struct Instance {
    functions: Arc<Loaded<Functions>>,
    component: Component,
    // FMI 2.0 before its revision 5 let the FMU keep the pointer to the callbacks.
    _callbacks: Rc<Callbacks>,
}

/// Borrows a function that may be missing.
macro_rules! function {
    ($self:ident.$field:ident, $name:literal) => {
        $self.functions.api.$field.ok_or_else(|| Refusal::Impossible(format!("the function {} is missing", $name)))?
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
    ) -> Outcome<Self> {
        let callbacks =
            Rc::new(Callbacks { logger, allocate: calloc, free, step_finished: None, environment: log.environment() });
        // SAFETY: the strings and the callbacks outlive the call, the callbacks and the log outlive the instance.
        let component = unsafe {
            (functions.api.instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                token.as_ptr(),
                resources.as_ptr(),
                Rc::as_ptr(&callbacks),
                0,
                c_int::from(logging),
            )
        };
        if component.is_null() {
            return Err(Refusal::Null("fmi2Instantiate"));
        }
        Ok(Self { functions, component, _callbacks: callbacks })
    }

    fn simple(&self, name: &'static str, function: Simple) -> Outcome {
        // SAFETY: the component is alive.
        judge(name, unsafe { function(self.component) })
    }

    fn get_one<T: Copy>(&self, name: &'static str, function: Get<T>, reference: u32, mut value: T) -> Outcome<T> {
        // SAFETY: the component is alive; one reference, room for one value.
        let status = unsafe { function(self.component, &raw const reference, 1, &raw mut value) };
        judge(name, status).map(|()| value)
    }

    fn set_one<T: Copy>(&self, name: &'static str, function: Set<T>, reference: u32, value: T) -> Outcome {
        // SAFETY: the component is alive; one reference, one value.
        judge(name, unsafe { function(self.component, &raw const reference, 1, &raw const value) })
    }
}

impl Standard for Instance {
    fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: the component is alive; both slices have at least n elements.
        let status =
            unsafe { (self.functions.api.get_real)(self.component, references.as_ptr(), n, values.as_mut_ptr()) };
        judge("fmi2GetReal", status)
    }

    fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        let n = references.len().min(values.len());
        // SAFETY: as above.
        let status = unsafe { (self.functions.api.set_real)(self.component, references.as_ptr(), n, values.as_ptr()) };
        judge("fmi2SetReal", status)
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
                self.set_one("fmi2SetReal", api.set_real, reference, x[0])
            }
            (BaseType::Int32 | BaseType::Enumeration, Values::Integers(x)) if x.len() == 1 => {
                self.set_one("fmi2SetInteger", api.set_integer, reference, narrow::<c_int>(base, x)?[0])
            }
            (BaseType::Boolean, Values::Booleans(x)) if x.len() == 1 => {
                self.set_one("fmi2SetBoolean", api.set_boolean, reference, c_int::from(x[0]))
            }
            (BaseType::String, Values::Strings(x)) if x.len() == 1 => {
                let text = CString::new(x[0].as_str()).map_err(|_| misfit(base, values))?;
                self.set_one("fmi2SetString", api.set_string, reference, text.as_ptr())
            }
            _ => Err(misfit(base, values)),
        }
    }

    fn set_debug_logging(&mut self, on: bool) -> Outcome {
        let function = function!(self.set_debug_logging, "fmi2SetDebugLogging");
        // SAFETY: the component is alive; no categories, so no array.
        judge("fmi2SetDebugLogging", unsafe { function(self.component, c_int::from(on), 0, ptr::null()) })
    }

    fn setup(&mut self, x: Experiment) -> Outcome {
        let (tolerance, stop) = (x.tolerance.unwrap_or(0.0), x.stop.unwrap_or(0.0));
        let (with_tolerance, with_stop) = (c_int::from(x.tolerance.is_some()), c_int::from(x.stop.is_some()));
        // SAFETY: the component is alive.
        let status =
            unsafe { (self.functions.api.setup)(self.component, with_tolerance, tolerance, x.start, with_stop, stop) };
        judge("fmi2SetupExperiment", status)
    }

    fn enter_initialization(&mut self) -> Outcome {
        self.simple("fmi2EnterInitializationMode", self.functions.api.enter)
    }

    fn exit_initialization(&mut self) -> Outcome {
        self.simple("fmi2ExitInitializationMode", self.functions.api.exit)
    }

    fn do_step(&mut self, t: f64, h: f64) -> Outcome<ControlFlow<()>> {
        // SAFETY: the component is alive. "No set state before this point" is false: a state may be set at any time.
        let status = unsafe { (self.functions.api.do_step)(self.component, t, h, 0) };
        if let (Status::DISCARD, Some(function)) = (status, self.functions.api.get_boolean_status) {
            let mut ended = 0;
            // SAFETY: the component is alive, there is room for one value.
            let asked = unsafe { function(self.component, TERMINATED, &raw mut ended) };
            if asked == Status::OK && ended != 0 {
                return Ok(ControlFlow::Break(()));
            }
        }
        judge("fmi2DoStep", status).map(ControlFlow::Continue)
    }

    fn terminate(&mut self) -> Outcome {
        self.simple("fmi2Terminate", self.functions.api.terminate)
    }

    fn reset(&mut self) -> Outcome {
        self.simple("fmi2Reset", self.functions.api.reset)
    }

    fn get_state(&mut self) -> Outcome<*mut c_void> {
        let (function, mut state) = (function!(self.get_state, "fmi2GetFMUstate"), ptr::null_mut());
        // SAFETY: the component is alive; a null state asks for a new one.
        judge("fmi2GetFMUstate", unsafe { function(self.component, &raw mut state) }).map(|()| state)
    }

    fn set_state(&mut self, state: *mut c_void) -> Outcome {
        let function = function!(self.set_state, "fmi2SetFMUstate");
        // SAFETY: the component is alive; the facade only passes states that it got and has not freed.
        judge("fmi2SetFMUstate", unsafe { function(self.component, state) })
    }

    fn free_state(&mut self, mut state: *mut c_void) -> Outcome {
        let function = function!(self.free_state, "fmi2FreeFMUstate");
        // SAFETY: as above; the facade forgets the state.
        judge("fmi2FreeFMUstate", unsafe { function(self.component, &raw mut state) })
    }

    fn serialize(&mut self, state: *mut c_void) -> Outcome<Vec<u8>> {
        let size_of = function!(self.state_size, "fmi2SerializedFMUstateSize");
        let function = function!(self.serialize, "fmi2SerializeFMUstate");
        let mut size = 0;
        // SAFETY: the component and the state are alive, there is room for the size.
        judge("fmi2SerializedFMUstateSize", unsafe { size_of(self.component, state, &raw mut size) })?;
        let mut bytes = vec![0_u8; size];
        // SAFETY: as above; the buffer has the size that the FMU asked for.
        let status = unsafe { function(self.component, state, bytes.as_mut_ptr().cast(), size) };
        judge("fmi2SerializeFMUstate", status).map(|()| bytes)
    }

    fn deserialize(&mut self, bytes: &[u8]) -> Outcome<*mut c_void> {
        let (function, mut state) = (function!(self.deserialize, "fmi2DeSerializeFMUstate"), ptr::null_mut());
        // SAFETY: the component is alive, the bytes are as many as said.
        let status = unsafe { function(self.component, bytes.as_ptr().cast(), bytes.len(), &raw mut state) };
        judge("fmi2DeSerializeFMUstate", status).map(|()| state)
    }

    fn abandon(&mut self) {
        self.component = ptr::null_mut();
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if !self.component.is_null() {
            // SAFETY: the component is alive, and nobody uses it after this.
            unsafe { (self.functions.api.free)(self.component) };
        }
    }
}
