//! Callbacks for the FMU that record their calls.

use super::super::log::Status;
use super::super::logger::{Called, Listener};
use super::super::signatures::v2::{calloc, free};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// A call of the log callback.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogCall {
    /// The first argument, a number that was given on instantiation.
    pub environment: usize,
    /// The instance's name (FMI 2.0 only).
    pub instance: Option<String>,
    /// The status.
    pub status: c_int,
    /// The category; `None` for NULL.
    pub category: Option<String>,
    /// The message; `None` for NULL and for text that is not UTF-8.
    pub text: Option<String>,
    /// The message that is not UTF-8, with replacement characters.
    pub broken: Option<String>,
    /// The format, if it has values (FMI 2.0 only).
    pub format: Option<String>,
    /// What is certainly wrong with the format or its arguments (FMI 2.0 only).
    pub fault: Option<String>,
    /// The FMU used a struct of callbacks that was no longer valid (FMI 2.0 only).
    pub late: bool,
}

static EVENTS: Mutex<Vec<LogCall>> = Mutex::new(Vec::new());
static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

/// Takes the messages so far.
pub fn take_events() -> Vec<LogCall> {
    std::mem::take(&mut *EVENTS.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Number of calls of the importer's memory functions.
pub fn allocations() -> usize {
    ALLOCATIONS.load(Ordering::Relaxed)
}

fn push(event: LogCall) {
    let mut events = EVENTS.lock().unwrap_or_else(PoisonError::into_inner);
    if events.len() < 100_000 {
        events.push(event);
    }
}

/// # Safety
/// `text` is NULL or a C string.
unsafe fn bytes(text: *const c_char) -> Option<Vec<u8>> {
    // SAFETY: the caller's promise.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) }.to_bytes().to_vec())
}

/// # Safety
/// `text` is NULL or a C string.
pub(super) unsafe fn optional(text: *const c_char) -> Option<String> {
    // SAFETY: the caller's promise.
    unsafe { bytes(text) }.and_then(|text| String::from_utf8(text).ok())
}

/// The text if it is UTF-8; otherwise its readable part.
fn readable(text: Option<Vec<u8>>) -> (Option<String>, Option<String>) {
    match text.map(String::from_utf8) {
        None => (None, None),
        Some(Ok(text)) => (Some(text), None),
        Some(Err(e)) => (None, Some(String::from_utf8_lossy(e.as_bytes()).into_owned())),
    }
}

/// Records the messages of FMI 2.0; `LATE`: through callbacks that are no longer valid.
pub(super) struct Recorder<const LATE: bool>;

impl<const LATE: bool> Listener for Recorder<LATE> {
    unsafe fn hear(called: Called) {
        // SAFETY: the FMU passes C strings.
        let (instance, category) = unsafe { (optional(called.instance), optional(called.category)) };
        let (text, fault) = called.text.map_or((None, None), |formatted| (Some(formatted.text), formatted.fault));
        let (text, broken) = readable(text);
        // SAFETY: the FMU passes a C string.
        let format = unsafe { bytes(called.format) }.map(|format| String::from_utf8_lossy(&format).into_owned());
        let format = format.filter(|format| format.replace("%%", "").contains('%') && format != "%s");
        let (environment, status) = (called.environment.addr(), called.status.0);
        push(LogCall { environment, instance, status, category, text, broken, format, fault, late: LATE });
    }
}

pub(super) unsafe extern "C" fn logger3(
    environment: *mut c_void,
    status: Status,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: the FMU passes C strings.
    let (category, text) = unsafe { (optional(category), bytes(text)) };
    let (text, broken) = readable(text);
    let (environment, status) = (environment.addr(), status.0);
    push(LogCall {
        environment,
        instance: None,
        status,
        category,
        text,
        broken,
        format: None,
        fault: None,
        late: false,
    });
}

pub(super) unsafe extern "C" fn allocate(count: usize, size: usize) -> *mut c_void {
    ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the C library's.
    unsafe { calloc(count, size) }
}

pub(super) unsafe extern "C" fn release(memory: *mut c_void) {
    ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
    // SAFETY: the FMU passes a pointer from `allocate`, or NULL.
    unsafe { free(memory) }
}
