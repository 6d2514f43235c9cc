//! Log messages of an FMU.

use std::collections::VecDeque;
use std::ffi::{CStr, c_char, c_void};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of stored messages, so that logging does not fill the memory.
const KEPT: usize = 10_000;

/// One message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Status that it was logged with.
    pub status: Status,
    /// Log category.
    pub category: String,
    /// The text; in FMI 2.0 it is not formatted, see `live`.
    pub text: String,
}

/// A status of either standard; the two agree up to `Fatal`.
#[derive(Clone, Copy, PartialEq, Eq)]
#[repr(transparent)]
pub struct Status(pub std::ffi::c_int);

impl Status {
    /// The call succeeded.
    pub const OK: Self = Self(0);
    /// The call succeeded with a warning.
    pub const WARNING: Self = Self(1);
    /// The call did nothing; the instance remains usable.
    pub const DISCARD: Self = Self(2);
    /// The call failed; only a reset, a restored state or freeing can follow.
    pub const ERROR: Self = Self(3);
    /// No instance of this FMU can be used any more.
    pub const FATAL: Self = Self(4);

    /// Whether the call succeeded: OK or Warning.
    #[inline]
    pub fn is_ok(self) -> bool {
        matches!(self, Self::OK | Self::WARNING)
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            0 => f.pad("OK"),
            1 => f.pad("Warning"),
            2 => f.pad("Discard"),
            3 => f.pad("Error"),
            4 => f.pad("Fatal"),
            5 => f.pad("Pending"),
            other => write!(f, "the unknown status {other}"),
        }
    }
}

impl fmt::Debug for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// The messages of one instance. Its address is the instance environment of the callbacks, so it is shared.
#[derive(Debug, Default)]
pub(crate) struct Log(Mutex<Messages>);

#[derive(Debug, Default)]
struct Messages {
    all: VecDeque<Message>,
    /// Number of latest messages that no error has reported yet.
    fresh: usize,
}

impl Log {
    /// First argument of the callbacks.
    pub(crate) fn environment(self: &Arc<Self>) -> *mut c_void {
        Arc::as_ptr(self).cast_mut().cast()
    }

    /// Takes all messages.
    pub(crate) fn take(&self) -> Vec<Message> {
        self.messages().all.drain(..).collect()
    }

    /// Message for an error: the last serious one since the previous error, otherwise the last of any status.
    pub(crate) fn reason(&self) -> Option<String> {
        let mut messages = self.messages();
        let fresh = std::mem::take(&mut messages.fresh);
        let mut fresh = messages.all.iter().rev().take(fresh).peekable();
        let last = fresh.peek().copied();
        let serious = fresh.find(|m| !matches!(m.status, Status::OK | Status::WARNING));
        serious.or(last).map(|m| m.text.clone())
    }

    fn messages(&self) -> std::sync::MutexGuard<'_, Messages> {
        // A callback never panics while it holds the lock; if it did, the messages would still be intact.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Receives a message from an FMU.
    ///
    /// # Safety
    /// `environment` is null or came from [`Log::environment`] of a log that is alive.
    pub(crate) unsafe fn receive(environment: *mut c_void, status: Status, category: String, text: String) {
        // SAFETY: the caller promises that the pointer is null or a living log; a log is only used by shared reference.
        let Some(log) = (unsafe { environment.cast::<Self>().as_ref() }) else { return };
        let mut messages = log.messages();
        if messages.all.len() == KEPT {
            messages.all.pop_front();
        }
        messages.fresh += 1;
        messages.all.push_back(Message { status, category, text });
    }
}

/// Copies a C string; null is the empty string, and what is not UTF-8 is replaced.
///
/// # Safety
/// `text` is null or ends with a null byte.
pub(crate) unsafe fn copy_text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null, and the caller promises the null byte.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_serious_message_counts() {
        let log = Arc::<Log>::default();
        for (status, text) in [(Status::OK, "hello"), (Status::ERROR, "h is negative"), (Status::OK, "bye")] {
            // SAFETY: the log is alive.
            unsafe { Log::receive(log.environment(), status, String::new(), text.into()) };
        }
        assert_eq!(log.reason().as_deref(), Some("h is negative"));
        assert_eq!(log.reason(), None, "reported once");
        assert_eq!(log.take().len(), 3);
    }

    #[test]
    fn an_fmu_that_forgets_its_environment_does_no_harm() {
        // SAFETY: null is allowed.
        unsafe { Log::receive(std::ptr::null_mut(), Status::OK, String::new(), String::new()) };
    }
}
