//! The log categories, by the standards' own names (FMI 2.0.5, 2.2.4; FMI 3.0.2, 2.4.5).

/// Events, when a step or a set call succeeded.
pub const EVENTS: &str = "logEvents";
/// A status Warning.
pub const WARNING: &str = "logStatusWarning";
/// A status Discard.
pub const DISCARD: &str = "logStatusDiscard";
/// A status Error.
pub const ERROR: &str = "logStatusError";
/// A status Fatal.
pub const FATAL: &str = "logStatusFatal";

/// Every message category: its name and its description. Messages use no other category.
pub const CATEGORIES: &[(&str, &str)] = &[
    (EVENTS, "Successful calls"),
    (WARNING, "Messages that come with the status Warning"),
    (DISCARD, "Messages that come with the status Discard"),
    (ERROR, "Messages that come with the status Error"),
    (FATAL, "Messages that come with the status Fatal"),
];

/// In FMI 2.0 only: all categories at once.
pub const ALL: &str = "logAll";

/// Maximum number of a model's categories.
pub const OWN: usize = 32 - CATEGORIES.len();

/// A message of a model: its category, a key that identifies it, and a closure that formats it.
pub type Said<'a> = (&'static str, &'static str, &'a dyn Fn() -> String);

/// Receives a model's warnings, and messages in the categories that it declares.
pub struct Warnings<'a>(&'a mut dyn FnMut(Said<'_>));

impl<'a> Warnings<'a> {
    /// Messages that `sink` receives.
    pub fn to(sink: &'a mut dyn FnMut(Said<'_>)) -> Self {
        Self(sink)
    }

    /// Warns with the text that `message` formats; warnings with one `key` appear at most once in a second.
    pub fn warn(&mut self, key: &'static str, message: impl Fn() -> String) {
        (self.0)((WARNING, key, &message));
    }

    /// Logs into one of the categories of [`Info::categories`](crate::Info::categories) the text that `message` formats;
    /// messages with one `key` appear at most once in a second.
    pub fn log(&mut self, category: &'static str, key: &'static str, message: impl Fn() -> String) {
        (self.0)((category, key, &message));
    }
}
