//! Error messages of a model: one sentence with the variable, its value and the allowed values.

use std::fmt::Display;

/// An error of the caller or of the model, with a message for users who do not know the code.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Fault {
    #[expect(clippy::box_collection, reason = "one pointer: a result returns in a register")]
    message: Box<String>,
}

impl Fault {
    /// A fault with free text.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: Box::new(message.into()) }
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
