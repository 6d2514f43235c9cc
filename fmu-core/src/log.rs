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

/// Where a model puts its warnings.
pub struct Warnings<'a>(&'a mut dyn FnMut(&'static str, &dyn Fn() -> String));

impl<'a> Warnings<'a> {
    /// Warnings that `sink` receives: a key that identifies the message, and a closure that formats it.
    pub fn to(sink: &'a mut dyn FnMut(&'static str, &dyn Fn() -> String)) -> Self {
        Self(sink)
    }

    /// Warns with the text that `message` formats; warnings with one `key` appear at most once in a second.
    pub fn warn(&mut self, key: &'static str, message: impl Fn() -> String) {
        (self.0)(key, &message);
    }
}
