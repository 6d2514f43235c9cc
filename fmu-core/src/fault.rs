//! Error messages of a model: one sentence with the variable, its value and the allowed values; and the message that ends the
//! simulation without an error.

use crate::Elapsed;
use std::fmt::{self, Display};

/// An error of the caller or of the model, with a message for users unfamiliar with the code.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault(
    /// One pointer: a result returns in a register.
    Box<Content>,
);

#[derive(Clone, Debug, PartialEq)]
struct Content {
    message: String,
    /// The simulation ends here.
    end: Option<Elapsed>,
}

impl Fault {
    /// A fault with free text.
    pub fn new(message: impl Into<String>) -> Self {
        Self(Box::new(Content { message: message.into(), end: None }))
    }

    /// A variable with a value that is not allowed.
    pub fn value(name: &str, value: impl Display, allowed: impl Display) -> Self {
        Self::new(format!("{name} = {value} is not allowed: {allowed}"))
    }

    /// Not an error: the model has reached its end, and the simulation ends at `at`. [`Model::advance`](crate::Model::advance)
    /// returns it with the state of that instant; the importer is informed as its standard prescribes, and steps no further.
    pub fn end(at: Elapsed) -> Self {
        let message = format!("the model ends the simulation {} s after the start", at.seconds());
        Self(Box::new(Content { message, end: Some(at) }))
    }

    /// The instant of the end, if this is not an error.
    pub fn ends(&self) -> Option<Elapsed> {
        self.0.end
    }

    /// The message.
    pub fn message(&self) -> &str {
        &self.0.message
    }
}

impl Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.message)
    }
}

impl std::error::Error for Fault {}
