//! What a model says when something is wrong: one sentence that names the thing, its value and what was allowed.

use std::fmt::Display;

/// A fault of the caller or of the model, with a message for a person who does not know the code.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Fault {
    message: String,
}

impl Fault {
    /// A fault in free words.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into() }
    }

    /// A variable with a value that is not allowed.
    pub fn value(name: &str, value: impl Display, allowed: impl Display) -> Self {
        Self::new(format!("{name} = {value} is not allowed: {allowed}"))
    }

    /// The message.
    pub fn message(&self) -> &str {
        &self.message
    }
}
