//! Plays the calls of a log, one after another, and those that the importer made in callbacks in the same callbacks.

use super::memory::{In, Memory, Text};
use super::table;
use crate::abi::journal::{self, Call};
use crate::abi::log::Status;
use crate::abi::logger::{Called, Listener, logger};
use crate::abi::signatures::v2::{Callbacks, Instantiate, calloc, free};
use crate::abi::signatures::{FreeInstance, InstancePointer, v3};
use fmu_core::call_log::{CallEnd, LogValue, LoggedCall, NamedValue, status};
use libloading::Library;
use model_description::FmiVersion;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;
use std::sync::atomic::AtomicPtr;

/// What a repetition has shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Number of calls that were made.
    pub calls: usize,
    /// The first call that ended otherwise.
    pub difference: Option<Difference>,
    /// The call in which the log ends, with its status now: the process of the importer ended there.
    pub last: Option<String>,
}

/// A call that ended otherwise than in the log.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Its line.
    pub line: usize,
    /// The call.
    pub call: String,
    /// How it ended in the log.
    pub logged: String,
    /// How it ended now.
    pub now: String,
    /// The last message of the FMU in this call.
    pub message: Option<String>,
}

/// An importer that repeats a log.
pub(super) struct Player {
    library: Library,
    version: FmiVersion,
    resources: CString,
    instance: Cell<InstancePointer>,
    /// Addresses of the saved states, in the order of their appearance.
    states: RefCell<Vec<usize>>,
    /// What remains of the calls in progress: their callbacks in the log.
    inside: RefCell<Vec<VecDeque<LoggedCall>>>,
    message: RefCell<Option<String>>,
    outcome: RefCell<Replayed>,
    /// A call that cannot be repeated.
    failure: RefCell<Option<String>>,
}

impl Player {
    pub(super) fn new(library: Library, version: FmiVersion, resources: CString) -> Box<Self> {
        Box::new(Self {
            library,
            version,
            resources,
            instance: Cell::new(ptr::null_mut()),
            states: RefCell::default(),
            inside: RefCell::default(),
            message: RefCell::default(),
            outcome: RefCell::default(),
            failure: RefCell::default(),
        })
    }

    /// Makes all calls up to the first difference. The journal has the FMU by the number of its name.
    ///
    /// # Errors
    /// A line cannot be read, or its call cannot be repeated.
    pub(super) fn play_all(
        self: Box<Self>,
        name: u32,
        calls: impl Iterator<Item = Result<LoggedCall, String>>,
        note: &dyn Fn(&str),
    ) -> Result<Replayed, String> {
        for call in calls {
            let call = call?;
            journal::note(name, kind(&call.name));
            journal::reached(call.time.unwrap_or(f64::NAN));
            if call.ended.is_none() {
                note(&format!("line {}: the log ends in this call: {call}", call.line));
            }
            self.play(&call);
            if self.is_over() {
                break;
            }
        }
        self.free();
        match self.failure.take() {
            Some(why) => Err(why),
            None => Ok(self.outcome.take()),
        }
    }

    fn is_over(&self) -> bool {
        self.outcome.borrow().difference.is_some() || self.failure.borrow().is_some()
    }

    fn free(&self) {
        let instance = self.instance.replace(ptr::null_mut());
        if instance.is_null() {
            return;
        }
        let name = if self.version == FmiVersion::V2 { "fmi2FreeInstance" } else { "fmi3FreeInstance" };
        // SAFETY: the standard's type; an instance of this library that is not used again.
        if let Ok(free) = unsafe { self.library.get::<FreeInstance>(name) } {
            // SAFETY: as above.
            unsafe { free(instance) };
        }
    }

    /// Makes a call and compares its end.
    fn play(&self, call: &LoggedCall) {
        self.message.take();
        self.inside.borrow_mut().push(call.inside.iter().cloned().collect());
        let made = self.make(call);
        let left = self.inside.borrow_mut().pop().unwrap_or_default();
        self.outcome.borrow_mut().calls += 1;
        let now = match made {
            Ok(now) => now,
            Err(why) => {
                self.failure.borrow_mut().get_or_insert(format!("line {}: {why}", call.line));
                return;
            }
        };
        if let Some(callback) = left.iter().find(|inner| is_callback(&inner.name)) {
            self.differ(callback, "this callback", "none".into());
        }
        match &call.ended {
            None => self.outcome.borrow_mut().last = Some(format!("line {}: {call} -> {now}", call.line)),
            Some(ended) => {
                if let Some((logged, now)) = first_difference(ended, &now) {
                    self.differ(call, &logged, now);
                }
            }
        }
    }

    fn differ(&self, call: &LoggedCall, logged: &str, now: String) {
        let (line, call, logged, message) = (call.line, call.to_string(), logged.to_owned(), self.message.take());
        self.outcome.borrow_mut().difference.get_or_insert(Difference { line, call, logged, now, message });
    }

    /// Makes a call; returns how it ended.
    fn make(&self, call: &LoggedCall) -> Result<CallEnd, String> {
        let ended = |status: &str| CallEnd { status: status.into(), results: Vec::new() };
        let name = call.name.as_str();
        if name.contains("Instantiate") {
            self.free();
            let instance = self.instantiate(call)?;
            self.instance.set(instance);
            return Ok(ended(if instance.is_null() { "NULL" } else { "instance" }));
        }
        if self.instance.get().is_null() {
            return Err(format!("{name}: there is no instance"));
        }
        if name.ends_with("FreeInstance") {
            if self.inside.borrow().len() > 1 {
                return Ok(ended("ignored"));
            }
            self.free();
            return Ok(ended("done"));
        }
        let mut memory = Memory::new(call, &self.states)?;
        // SAFETY: our instance.
        let code = unsafe { table::call(&self.library, name, self.instance.get(), &mut memory)? };
        let logged = call.ended.as_ref().map_or(&[][..], |ended| &ended.results);
        // SAFETY: the call succeeded.
        let results = if Status(code) == Status::OK { unsafe { memory.results(logged) } } else { Vec::new() };
        Ok(CallEnd { status: status(code), results })
    }

    fn instantiate(&self, call: &LoggedCall) -> Result<InstancePointer, String> {
        let states = RefCell::default();
        let mut memory = Memory::new(call, &states)?;
        let given = |name: &str| call.arguments.iter().any(|(of, value)| of == name && *value == LogValue::Given);
        let environment: *mut c_void = ptr::from_ref(self).cast_mut().cast();
        let (name, token): (Text, Text) = (memory.pass("name")?, memory.pass("token")?);
        let resources = call.arguments.iter().find(|(of, _)| of == "resources");
        let is_null = resources.is_none_or(|(_, value)| *value == LogValue::Null);
        let resources = if is_null { ptr::null() } else { self.resources.as_ptr() };
        let log: Option<v3::LogMessage> = given("logger").then_some(hear as _);
        let missing = |_| format!("the FMU has no function {}", call.name);
        // SAFETY: the standards' types; texts live during the call, the callbacks and their environment as long as the instance.
        unsafe {
            if call.name == "fmi2Instantiate" {
                let f = *self.library.get::<Instantiate>("fmi2Instantiate").map_err(missing)?;
                let (kind, visible, on) = (memory.pass("type")?, memory.pass("visible")?, memory.pass("logging_on")?);
                // Leaked on purpose: an FMU made before FMI 2.0.5 may keep the pointer.
                let callbacks = Box::leak(Box::new(Callbacks {
                    logger: given("logger").then_some(logger::<Ear>),
                    allocate: Some(calloc),
                    free: Some(free),
                    step_finished: None,
                    environment: AtomicPtr::new(environment),
                }));
                let callbacks = if given("callbacks") { ptr::from_mut(callbacks).cast_const() } else { ptr::null() };
                return Ok(f(name.pointer(), kind, token.pointer(), resources, callbacks, visible, on));
            }
            let mut flag = |of| memory.pass::<u8>(of).map(|flag| flag != 0);
            let (visible, on) = (flag("visible")?, flag("logging_on")?);
            let (name, token) = (name.pointer(), token.pointer());
            match call.name.as_str() {
                "fmi3InstantiateCoSimulation" => {
                    let f = *self.library.get::<v3::InstantiateCoSimulation>(call.name.as_str()).map_err(missing)?;
                    let (event_mode, early) = (flag("event_mode_used")?, flag("early_return_allowed")?);
                    let (required, n): (In<u32>, usize) = (memory.pass("required")?, memory.pass("n")?);
                    let update: Option<v3::IntermediateUpdate> = given("intermediate").then_some(update as _);
                    let required = required.pointer();
                    Ok(f(name, token, resources, visible, on, event_mode, early, required, n, environment, log, update))
                }
                "fmi3InstantiateModelExchange" => {
                    let f = *self.library.get::<v3::InstantiateModelExchange>(call.name.as_str()).map_err(missing)?;
                    Ok(f(name, token, resources, visible, on, environment, log))
                }
                "fmi3InstantiateScheduledExecution" => {
                    let f =
                        *self.library.get::<v3::InstantiateScheduledExecution>(call.name.as_str()).map_err(missing)?;
                    let clocks: Option<v3::ClockUpdate> = given("clock_update").then_some(tick as _);
                    let lock = |of| given(of).then_some(nothing as v3::Preemption);
                    let (lock, unlock) = (lock("lock"), lock("unlock"));
                    Ok(f(name, token, resources, visible, on, environment, log, clocks, lock, unlock))
                }
                _ => Err(format!("{} is not a function of FMI 2.0 or 3.0", call.name)),
            }
        }
    }

    /// A callback of the FMU: compares it with the next one of the log, repeats the calls in it, and returns the requested end of
    /// the step.
    fn answer(&self, name: &str, time: Option<f64>, arguments: &[(String, LogValue)]) -> Option<f64> {
        if self.is_over() {
            return None;
        }
        let next = {
            let mut frames = self.inside.borrow_mut();
            let frame = frames.last_mut()?;
            // Calls from the logger, which the FMU refuses.
            while frame.front().is_some_and(|inner| !is_callback(&inner.name)) {
                frame.pop_front();
            }
            frame.pop_front()
        };
        let now = fmu_core::call_log::begun(time, name, arguments);
        let Some(logged) = next else {
            *self.failure.borrow_mut() = Some(format!("the FMU now makes a callback that the log lacks: {now}"));
            return None;
        };
        let same_time = time.is_none() || time.map(f64::to_bits) == logged.time.map(f64::to_bits);
        if logged.name != name || logged.arguments != arguments || !same_time {
            self.differ(&logged, &logged.to_string(), now);
            return None;
        }
        for inner in &logged.inside {
            self.play(inner);
            if self.is_over() {
                return None;
            }
        }
        let results = logged.ended.map(|ended| ended.results).unwrap_or_default();
        match results.first() {
            Some((_, LogValue::Number(time))) => time.parse().ok(),
            _ => None,
        }
    }
}

/// The first difference between two ends of a call: what the log has, and what came now.
fn first_difference(logged: &CallEnd, now: &CallEnd) -> Option<(String, String)> {
    if logged.status != now.status || logged.results.len() != now.results.len() {
        return Some((logged.to_string(), now.to_string()));
    }
    let differs = |((name, a), (other, b)): (&NamedValue, &NamedValue)| match (a, b) {
        _ if name == other && a == b => None,
        (LogValue::List(a), LogValue::List(b)) if name == other && a.len() == b.len() => {
            let i = a.iter().zip(b).position(|(a, b)| a != b)?;
            Some((format!("{name}[{i}]={}", a[i]), format!("{name}[{i}]={}", b[i])))
        }
        _ => Some((format!("{name}={a}"), format!("{other}={b}"))),
    };
    logged.results.iter().zip(&now.results).find_map(differs)
}

/// The kind of a call in the journal.
fn kind(name: &str) -> Call {
    let kinds = [
        ("DoStep", Call::Step),
        ("Continuous", Call::Evaluation),
        ("Discrete", Call::Events),
        ("Instantiate", Call::Instantiate),
        ("FreeInstance", Call::Free),
        ("State", Call::State),
        ("state", Call::State),
        ("SetupExperiment", Call::Setup),
        ("EnterInitialization", Call::EnterInitialization),
        ("ExitInitialization", Call::ExitInitialization),
        ("Terminate", Call::Terminate),
        ("Reset", Call::Reset),
        ("Get", Call::Get),
        ("Set", Call::Set),
    ];
    kinds.iter().find(|(part, _)| name.contains(part)).map_or(Call::Evaluation, |(_, kind)| *kind)
}

/// Whether the FMU calls the importer.
fn is_callback(name: &str) -> bool {
    ["intermediateUpdate", "clockUpdate"].contains(&name)
}

/// # Safety
/// The FMU passes the environment that it was given.
unsafe fn player<'a>(environment: *mut c_void) -> Option<&'a Player> {
    // SAFETY: the player lives as long as the instance.
    unsafe { environment.cast_const().cast::<Player>().as_ref() }
}

/// The logger of FMI 2.0.
struct Ear;

impl Listener for Ear {
    unsafe fn hear(called: Called) {
        let text = called.text.map(|formatted| String::from_utf8_lossy(&formatted.text).into_owned());
        // SAFETY: the FMU passes the environment that it was given.
        if let Some(player) = unsafe { player(called.environment) } {
            *player.message.borrow_mut() = text;
        }
    }
}

/// The logger of FMI 3.0.
unsafe extern "C" fn hear(environment: *mut c_void, _: Status, _: *const c_char, text: *const c_char) {
    // SAFETY: a C string of the FMU; the environment that it was given.
    unsafe {
        if let Some(player) = player(environment)
            && !text.is_null()
        {
            *player.message.borrow_mut() = Some(CStr::from_ptr(text).to_string_lossy().into_owned());
        }
    }
}

unsafe extern "C" fn update(
    environment: *mut c_void,
    time: f64,
    _set_requested: u8,
    _get_allowed: u8,
    _finished: u8,
    can_return: u8,
    return_requested: *mut u8,
    return_time: *mut f64,
) {
    let can_return = ("can_return".to_owned(), LogValue::Number(can_return.to_string()));
    // SAFETY: the environment that the FMU was given.
    let end = unsafe { player(environment) }
        .and_then(|player| player.answer("intermediateUpdate", Some(time), &[can_return]));
    // SAFETY: NULL, or variables of the FMU, as the standard prescribes.
    unsafe {
        if let Some(requested) = return_requested.as_mut() {
            *requested = end.is_some().into();
        }
        if let (Some(end), Some(place)) = (end, return_time.as_mut()) {
            *place = end;
        }
    }
}

unsafe extern "C" fn tick(environment: *mut c_void) {
    // SAFETY: the environment that the FMU was given.
    if let Some(player) = unsafe { player(environment) } {
        player.answer("clockUpdate", None, &[]);
    }
}

/// A scheduler that nothing interrupts.
unsafe extern "C" fn nothing() {}
