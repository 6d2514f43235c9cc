//! Instantiation with arbitrary arguments.

use super::super::signatures::{v2, v3};
use super::callbacks::{allocate, logger2, logger3, release};
use super::{Handle, Raw};
use model_description::FmiVersion;
use std::ffi::{CString, c_char, c_int, c_void};
use std::ptr;

/// Interface type of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// Co-simulation.
    CoSimulation,
    /// Model exchange.
    ModelExchange,
    /// Scheduled execution (FMI 3.0 only).
    ScheduledExecution,
}

/// The arguments of an instantiation.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "the arguments of the standards")]
pub struct Arguments {
    /// Instance name.
    pub name: Option<CString>,
    /// Token.
    pub token: Option<CString>,
    /// Path or URI of the resources.
    pub resources: Option<CString>,
    /// Kind of FMU.
    pub interface: Interface,
    /// Whether there is a log callback.
    pub logger: bool,
    /// Whether there is a struct of callbacks (FMI 2.0 only).
    pub callbacks: bool,
    /// Whether there are memory functions (FMI 2.0 only).
    pub memory: bool,
    /// Whether the struct of callbacks stays valid after the call (FMI 2.0 only).
    pub lasting: bool,
    /// Whether logging is on.
    pub logging: bool,
    /// Whether event mode is used (FMI 3.0 only).
    pub event_mode: bool,
    /// Whether `DoStep` may return early (FMI 3.0 only).
    pub early_return: bool,
    /// The environment, which the callbacks receive unchanged.
    pub environment: usize,
}

impl Raw {
    /// Creates an instance; `None` for NULL.
    ///
    /// # Errors
    /// The function is missing.
    pub fn instantiate(&self, arguments: &Arguments) -> Result<Option<Handle>, String> {
        fn text(text: Option<&CString>) -> *const c_char {
            text.map_or(ptr::null(), |t| t.as_ptr())
        }
        let (name, token) = (text(arguments.name.as_ref()), text(arguments.token.as_ref()));
        let resources = text(arguments.resources.as_ref());
        let environment: *mut c_void = ptr::without_provenance_mut(arguments.environment);
        let pointer = match self.version {
            FmiVersion::V2 => self.instantiate2(arguments, [name, token, resources], environment),
            FmiVersion::V3 => self.instantiate3(arguments, [name, token, resources], environment),
        };
        Ok(self.owned().take_instance(pointer?))
    }

    fn instantiate2(
        &self,
        b: &Arguments,
        texts: [*const c_char; 3],
        environment: *mut c_void,
    ) -> Result<*mut c_void, String> {
        let f: v2::Instantiate = self.function("Instantiate").ok_or("the function fmi2Instantiate is missing")?;
        // Leaked on purpose: an FMU made before FMI 2.0.5 may keep the pointer.
        let callbacks = Box::leak(Box::new(v2::Callbacks {
            logger: b.logger.then_some(logger2::<false>),
            allocate: b.memory.then_some(allocate),
            free: b.memory.then_some(release),
            step_finished: None,
            environment: environment.into(),
        }));
        let kind = c_int::from(b.interface == Interface::CoSimulation);
        let given = if b.callbacks { ptr::from_mut(callbacks) } else { ptr::null_mut() };
        // SAFETY: texts are NULL or C strings that outlive the call; the struct lives on.
        let made = unsafe { f(texts[0], kind, texts[1], texts[2], given, 0, c_int::from(b.logging)) };
        if !b.lasting {
            // The struct still has valid functions: an FMU that reads it again is detected and does not crash.
            // SAFETY: ours, and not in use, since no call is in progress.
            unsafe { (*ptr::from_mut(callbacks)).logger = Some(logger2::<true>) };
        }
        Ok(made)
    }

    fn instantiate3(
        &self,
        b: &Arguments,
        texts: [*const c_char; 3],
        environment: *mut c_void,
    ) -> Result<*mut c_void, String> {
        let logger: Option<v3::LogMessage> = if b.logger { Some(logger3) } else { None };
        let [name, token, resources] = texts;
        let missing = |name: &str| format!("the function fmi3{name} is missing");
        // SAFETY: of all three: the standard's types; texts are NULL or C strings that outlive the call.
        unsafe {
            match b.interface {
                Interface::CoSimulation => {
                    let name_of = "InstantiateCoSimulation";
                    let f: v3::InstantiateCoSimulation = self.function(name_of).ok_or_else(|| missing(name_of))?;
                    Ok(f(
                        name,
                        token,
                        resources,
                        false,
                        b.logging,
                        b.event_mode,
                        b.early_return,
                        ptr::null(),
                        0,
                        environment,
                        logger,
                        ptr::null(),
                    ))
                }
                Interface::ModelExchange => {
                    let name_of = "InstantiateModelExchange";
                    let f: v3::InstantiateModelExchange = self.function(name_of).ok_or_else(|| missing(name_of))?;
                    Ok(f(name, token, resources, false, b.logging, environment, logger))
                }
                Interface::ScheduledExecution => {
                    let name_of = "InstantiateScheduledExecution";
                    let f: v3::InstantiateScheduledExecution =
                        self.function(name_of).ok_or_else(|| missing(name_of))?;
                    let none = ptr::null();
                    Ok(f(name, token, resources, false, b.logging, environment, logger, none, none, none))
                }
            }
        }
    }
}
