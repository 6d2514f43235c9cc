//! Log messages of an FMU.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, c_char, c_void};
use std::fmt;
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

/// Maximum number of stored messages, so that logging does not fill the memory.
const KEPT: usize = 10_000;

/// One message.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Message {
    /// Status that it was logged with.
    pub status: Status,
    /// Log category.
    pub category: String,
    /// The text.
    pub text: String,
}

/// The messages that an instance requests from its FMU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Logging {
    /// Errors, which an FMU logs without being asked.
    #[default]
    Errors,
    /// Warnings too, if the FMU lists the standards' category for them (`logStatusWarning`).
    Warnings,
    /// All categories.
    All,
}

impl From<bool> for Logging {
    fn from(all: bool) -> Self {
        if all { Self::All } else { Self::Errors }
    }
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
    /// The call had no effect; the instance remains usable.
    pub const DISCARD: Self = Self(2);
    /// The call failed; only a reset, a restored state or freeing can follow.
    pub const ERROR: Self = Self(3);
    /// No instance of this FMU can be used any more.
    pub const FATAL: Self = Self(4);

    /// The step continues (FMI 2.0).
    pub const PENDING: Self = Self(5);

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

/// The messages of one instance. The callbacks receive a number as the instance environment and use it to look up the log: an FMU
/// may pass another pointer, or call back after its instance was freed, so that pointer is never dereferenced.
#[derive(Debug, Default)]
pub(crate) struct Log(Mutex<Messages>);

#[derive(Debug, Default)]
struct Messages {
    all: VecDeque<Message>,
    /// Number of the latest messages that no error has included yet.
    fresh: usize,
}

/// The logs that are alive, by the number that their FMU received.
static LOGS: Mutex<BTreeMap<usize, Weak<Log>>> = Mutex::new(BTreeMap::new());

/// A callback never panics while it holds a lock; if it did, the content would still be intact.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Log {
    /// A new log, known to the callbacks as long as it lives.
    pub(crate) fn new() -> Arc<Self> {
        let log = Arc::<Self>::default();
        locked(&LOGS).insert(log.number(), Arc::downgrade(&log));
        log
    }

    /// Its address, which is unique among living logs.
    fn number(&self) -> usize {
        ptr::from_ref(self).addr()
    }

    /// First argument of the callbacks.
    pub(crate) fn environment(&self) -> *mut c_void {
        ptr::without_provenance_mut(self.number())
    }

    /// Takes all messages.
    pub(crate) fn take(&self) -> Vec<Message> {
        locked(&self.0).all.drain(..).collect()
    }

    /// Message for an error: the last serious one since the previous error, otherwise the last of any status.
    pub(crate) fn reason(&self) -> Option<String> {
        let mut messages = locked(&self.0);
        let fresh = std::mem::take(&mut messages.fresh);
        let mut fresh = messages.all.iter().rev().take(fresh).peekable();
        let last = fresh.peek().copied();
        let serious = fresh.find(|m| !matches!(m.status, Status::OK | Status::WARNING));
        serious.or(last).map(|m| m.text.clone())
    }

    /// Receives a message from an FMU. A message with an unknown environment goes to the only living log, if there is exactly
    /// one; otherwise its sender is unknown, and it is dropped.
    pub(crate) fn receive(environment: *mut c_void, message: Message) {
        let log = {
            let logs = locked(&LOGS);
            let only = || logs.values().next().filter(|_| logs.len() == 1);
            logs.get(&environment.addr()).or_else(only).and_then(Weak::upgrade)
        };
        let Some(log) = log else { return };
        let mut messages = locked(&log.0);
        if messages.all.len() == KEPT {
            messages.all.pop_front();
        }
        messages.fresh += 1;
        messages.all.push_back(message);
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        locked(&LOGS).remove(&self.number());
    }
}

/// Copies a C string; null is the empty string, and invalid UTF-8 is replaced.
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

    fn message(status: Status, text: &str) -> Message {
        Message { status, category: String::new(), text: text.into() }
    }

    /// One test, because the logs of a process are counted.
    #[test]
    fn messages_find_their_log_by_value() {
        let log = Log::new();
        for (status, text) in [(Status::OK, "hello"), (Status::ERROR, "h is negative"), (Status::OK, "bye")] {
            Log::receive(log.environment(), message(status, text));
        }
        assert_eq!(log.reason().as_deref(), Some("h is negative"));
        assert_eq!(log.reason(), None, "reported once");
        assert_eq!(log.take().len(), 3);

        let strange = [ptr::null_mut(), ptr::without_provenance_mut(3), ptr::without_provenance_mut(usize::MAX)];
        for environment in strange {
            Log::receive(environment, message(Status::OK, "whose?"));
        }
        assert_eq!(log.take().len(), 3, "there is no other log");

        let other = Log::new();
        Log::receive(strange[1], message(Status::OK, "whose?"));
        Log::receive(other.environment(), message(Status::OK, "mine"));
        assert_eq!((log.take().len(), other.take().len()), (0, 1), "the sender is unknown");

        let gone = log.environment();
        drop(log);
        Log::receive(gone, message(Status::OK, "late"));
        assert_eq!(other.take().len(), 1, "a freed instance is like any other number");
    }
}
