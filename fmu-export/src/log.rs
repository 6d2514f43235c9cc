//! Logging of an instance. Errors are always logged; other messages only if the importer enabled their category.

use crate::lifecycle::Standard;
use fmu_core::Fault;
use fmu_core::log::{ALL, CATEGORIES, DISCARD, ERROR, EVENTS, OWN, WARNING};

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

/// The bit of [`WARNING`] and the bits of the model's categories.
const WARNINGS: u32 = 1 << 1;
const OWNS: u32 = !0 << CATEGORIES.len();
const _: () = assert!(matches!(CATEGORIES[1].0.as_bytes(), b"logStatusWarning") && OWN + CATEGORIES.len() == 32);

/// The model's categories: names and descriptions.
pub type Categories = &'static [(&'static str, &'static str)];

/// The importer's logger.
pub trait Sink {
    /// Passes one message to the importer.
    fn write(&self, status: Status, category: &str, message: &str);

    /// Whether the importer passed a logger.
    fn hears(&self) -> bool;
}

/// The logger and the enabled categories.
pub struct Log {
    sink: Box<dyn Sink>,
    /// A bit for each category of [`CATEGORIES`], then of the model's categories.
    enabled: u32,
}

impl Log {
    /// A log with all categories on or off.
    pub fn new(sink: Box<dyn Sink>, on: bool) -> Self {
        Self { sink, enabled: if on { !0 } else { 0 } }
    }

    /// Logs why a call failed, even with logging off, because the status alone is not enough.
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

    /// Whether messages of the model are logged: warnings, and messages in its categories.
    #[inline]
    pub fn hears_model(&self, own: Categories) -> bool {
        let heard = if own.is_empty() { WARNINGS } else { WARNINGS | OWNS };
        self.enabled & heard != 0 && self.sink.hears()
    }

    /// Whether messages of this category are logged. An unknown category counts as a warning.
    pub(crate) fn hears(&self, category: &str, own: Categories) -> bool {
        self.enabled & position(category, own).map_or(WARNINGS, |i| 1 << i) != 0
    }

    /// Logs a message of the model in a call that succeeded: a warning, or a message in one of its categories.
    #[cold]
    pub(crate) fn said(&self, category: &str, own: Categories, message: &str) {
        match position(category, own) {
            Some(i) if i >= CATEGORIES.len() => self.sink.write(Status::Ok, category, message),
            Some(_) => self.sink.write(Status::Warning, WARNING, message),
            None => {
                let message = format!("{message} (the model names no log category {category:?})");
                self.sink.write(Status::Warning, WARNING, &message);
            }
        }
    }

    /// Logs an event; the message is built only if its category is enabled.
    pub fn event(&self, message: impl FnOnce() -> String) {
        if self.is_on(EVENTS) {
            self.sink.write(Status::Ok, EVENTS, &message());
        }
    }

    fn is_on(&self, category: &str) -> bool {
        position(category, &[]).is_some_and(|i| self.enabled & (1 << i) != 0) && self.sink.hears()
    }

    /// `SetDebugLogging`. No category means all. In FMI 2.0 the listed categories become the only ones (2.0.5, 2.1.5),
    /// in FMI 3.0 they are switched and the others stay (3.0.2, 2.3.1).
    ///
    /// # Errors
    /// A category does not exist; nothing changes.
    pub fn switch(&mut self, standard: Standard, on: bool, categories: &[&str], own: Categories) -> Result<(), Fault> {
        let mut listed = if categories.is_empty() { !0 } else { 0 };
        for &category in categories {
            match position(category, own) {
                Some(i) => listed |= 1 << i,
                None if category == ALL && standard == Standard::Fmi2 => listed = !0,
                None => return Err(unknown(category, standard, own)),
            }
        }
        self.enabled = match (on, standard) {
            (true, Standard::Fmi2) => listed,
            (true, Standard::Fmi3) => self.enabled | listed,
            (false, _) => self.enabled & !listed,
        };
        Ok(())
    }
}

fn position(category: &str, own: Categories) -> Option<usize> {
    CATEGORIES.iter().chain(own).position(|(name, _)| *name == category)
}

fn unknown(category: &str, standard: Standard, own: Categories) -> Fault {
    let mut names: Vec<&str> = CATEGORIES.iter().chain(own).map(|(name, _)| *name).collect();
    if standard == Standard::Fmi2 {
        names.push(ALL);
    }
    Fault::new(format!("log category {category:?} does not exist; these do: {}", names.join(", ")))
}
