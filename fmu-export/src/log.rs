//! Logging of an instance. Errors are always logged; other messages only if the importer enabled their category.

use crate::lifecycle::Standard;
use fmu_core::Fault;
use fmu_core::log::{ALL, CATEGORIES, DISCARD, ERROR, EVENTS, WARNING};

/// A status as both standards number it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// The call succeeded.
    Ok = 0,
    /// Only messages have this status; no call returns it.
    Warning = 1,
    /// The call could not be fulfilled; nothing changed and the instance remains usable.
    Discard = 2,
    /// The call failed; see [`State::Error`](crate::lifecycle::State::Error).
    Error = 3,
}

/// Position of [`WARNING`] in [`CATEGORIES`].
const WARNINGS: usize = 1;
const _: () = assert!(matches!(CATEGORIES[WARNINGS].0.as_bytes(), b"logStatusWarning"));

/// The importer's logger.
pub trait Sink {
    /// Passes one message to the importer.
    fn write(&self, status: Status, category: &str, message: &str);

    /// Whether there is a logger at all.
    fn hears(&self) -> bool;
}

/// The logger and the enabled categories.
pub struct Log {
    sink: Box<dyn Sink>,
    /// One flag per category of [`CATEGORIES`].
    enabled: [bool; CATEGORIES.len()],
}

impl Log {
    /// A log with all categories on or off.
    pub fn new(sink: Box<dyn Sink>, on: bool) -> Self {
        Self { sink, enabled: [on; CATEGORIES.len()] }
    }

    /// Logs why a call failed, even with logging off: the status alone does not help.
    #[cold]
    pub fn error(&self, message: &str) {
        self.sink.write(Status::Error, ERROR, message);
    }

    /// Logs why a call was discarded.
    #[cold]
    pub fn discard(&self, message: &str) {
        if self.is_on(DISCARD) {
            self.sink.write(Status::Discard, DISCARD, message);
        }
    }

    /// Whether anyone hears warnings.
    #[inline]
    pub fn hears_warnings(&self) -> bool {
        self.enabled[WARNINGS] && self.sink.hears()
    }

    /// Logs a warning that comes from a call that succeeded.
    #[cold]
    pub fn warning(&self, message: &str) {
        self.sink.write(Status::Warning, WARNING, message);
    }

    /// Logs an event; the message is built only if its category is enabled.
    pub fn event(&self, message: impl FnOnce() -> String) {
        if self.is_on(EVENTS) {
            self.sink.write(Status::Ok, EVENTS, &message());
        }
    }

    fn is_on(&self, category: &str) -> bool {
        position(category).is_some_and(|i| self.enabled[i]) && self.sink.hears()
    }

    /// `SetDebugLogging`. No category means all. In FMI 2.0 the listed categories become the only ones (2.0.5, 2.1.5),
    /// in FMI 3.0 they are switched and the others stay (3.0.2, 2.3.1).
    ///
    /// # Errors
    /// Names a category that does not exist; then nothing changes.
    pub fn switch(&mut self, standard: Standard, on: bool, categories: &[&str]) -> Result<(), Fault> {
        let mut listed = [categories.is_empty(); CATEGORIES.len()];
        for &category in categories {
            match position(category) {
                Some(i) => listed[i] = true,
                None if category == ALL && standard == Standard::Fmi2 => listed = [true; CATEGORIES.len()],
                None => return Err(unknown(category, standard)),
            }
        }
        for (enabled, listed) in self.enabled.iter_mut().zip(listed) {
            match (listed, standard) {
                (true, _) => *enabled = on,
                (false, Standard::Fmi2) => *enabled = *enabled && !on,
                (false, Standard::Fmi3) => {}
            }
        }
        Ok(())
    }
}

fn position(category: &str) -> Option<usize> {
    CATEGORIES.iter().position(|(name, _)| *name == category)
}

fn unknown(category: &str, standard: Standard) -> Fault {
    let mut names: Vec<&str> = CATEGORIES.iter().map(|(name, _)| *name).collect();
    if standard == Standard::Fmi2 {
        names.push(ALL);
    }
    Fault::new(format!("log category {category:?} does not exist; these do: {}", names.join(", ")))
}
