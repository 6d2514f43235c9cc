//! Errors of an FMU: in its file, in its use, or in a call.

use crate::Status;
use crate::quantity::similar;
use model_description::ModelDescription;
use std::error::Error as StdError;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// One line that names the file or the instance, and the cause.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Error {
    /// The file is not an FMU that can be run here.
    File {
        /// Path of the file that cannot be used.
        path: PathBuf,
        /// The fault.
        cause: String,
        /// The error behind it, if there is one: of the file system, the archive or the XML. Its text is part of `cause`.
        source: Option<Arc<dyn StdError + Send + Sync>>,
    },
    /// The FMU has no variable of this name.
    Variable {
        /// Name of the instance, or of the model.
        instance: String,
        /// The name.
        name: String,
        /// Names that resemble it, the nearest first.
        similar: Vec<String>,
    },
    /// A type, a value or a call that the FMU does not accept or does not have.
    Usage {
        /// Name of the instance.
        instance: String,
        /// What is wrong.
        cause: String,
    },
    /// The FMU refused a call.
    Call {
        /// Name of the instance.
        instance: String,
        /// The C function.
        function: &'static str,
        /// Its status, in words.
        status: String,
        /// The last message that the FMU logged during the call, without the names of instance and function before it.
        message: Option<String>,
    },
}

/// A fault in an archive whose path is not known here.
#[derive(Clone, Debug)]
pub struct EntryError {
    cause: String,
    /// The error behind it, if there is one: its text is part of `cause`.
    source: Option<Arc<dyn StdError + Send + Sync>>,
}

impl EntryError {
    /// An entry that cannot be read: `what` and the text of the error.
    pub(crate) fn from_source(what: &str, source: impl StdError + Send + Sync + 'static) -> Self {
        Self { cause: format!("{what}: {source}"), source: Some(Arc::new(source)) }
    }

    /// The error of the archive with this path.
    pub(crate) fn of(self, path: &Path) -> Error {
        Error::File { path: path.into(), cause: one_line(&self.cause), source: self.source }
    }
}

impl From<String> for EntryError {
    fn from(cause: String) -> Self {
        Self { cause, source: None }
    }
}

impl fmt::Display for EntryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.cause)
    }
}

impl StdError for EntryError {
    fn source(&self) -> Option<&(dyn StdError + 'static)> {
        self.source.as_ref().map(|source| &**source as &(dyn StdError + 'static))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, cause, .. } => write!(f, "{}: {cause}", path.display()),
            Self::Variable { instance, .. } => write!(f, "{instance}: {}", self.cause()),
            Self::Usage { instance, cause } => write!(f, "{instance}: {cause}"),
            Self::Call { instance, function, status, message } => {
                write!(f, "{instance}: {function} returned {status}{}", said(message.as_deref()))
            }
        }
    }
}

impl StdError for Error {
    fn source(&self) -> Option<&(dyn StdError + 'static)> {
        match self {
            Self::File { source: Some(source), .. } => Some(&**source),
            _ => None,
        }
    }
}

/// Errors are equal if their texts are.
impl PartialEq for Error {
    fn eq(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other) && self.to_string() == other.to_string()
    }
}

impl Eq for Error {}

impl Error {
    /// An unusable file; the cause becomes one line.
    pub fn file(path: &Path, cause: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), cause: one_line(&cause.to_string()), source: None }
    }

    /// An unusable file, with the error behind it; `what` precedes its text.
    pub(crate) fn file_from(path: &Path, what: &str, source: impl StdError + Send + Sync + 'static) -> Self {
        let cause = one_line(&format!("{what}{source}"));
        Self::File { path: path.into(), cause, source: Some(Arc::new(source)) }
    }

    /// A variable that does not exist, with the names that resemble it.
    pub fn variable(instance: &str, name: &str, description: &ModelDescription) -> Self {
        let names = description.variables.iter().map(|v| v.name.as_str());
        let similar = similar(name, names).into_iter().map(Into::into).collect();
        Self::Variable { instance: instance.into(), name: name.into(), similar }
    }

    /// An impossible use of an instance; the cause becomes one line.
    pub fn usage(instance: &str, cause: impl std::fmt::Display) -> Self {
        Self::Usage { instance: instance.into(), cause: one_line(&cause.to_string()) }
    }

    /// A refused call. Many FMUs begin a message with the function or the instance, which the error already names.
    pub(crate) fn call(instance: String, function: &'static str, status: String, message: Option<String>) -> Self {
        let message = message.map(|text| {
            let mut rest = text.as_str();
            while let Some(short) =
                [function, &instance].iter().find_map(|name| rest.strip_prefix(name)?.strip_prefix(':'))
            {
                rest = short.trim_start();
            }
            rest.to_owned()
        });
        Self::Call { instance, function, status, message: message.filter(|text| !text.is_empty()) }
    }

    /// Adds the attempted action to the error.
    pub fn during(self, what: &str) -> Self {
        match self {
            Self::Call { instance, function, status, message } => {
                let message = Some(message.map_or_else(|| what.to_owned(), |said| format!("{what}: {said}")));
                Self::Call { instance, function, status, message }
            }
            Self::Usage { instance, cause } => Self::usage(&instance, format!("{what}: {cause}")),
            Self::File { .. } | Self::Variable { .. } => self,
        }
    }

    /// The cause without file, instance or function.
    pub fn cause(&self) -> String {
        match self {
            Self::File { cause, .. } | Self::Usage { cause, .. } => cause.clone(),
            Self::Variable { name, similar, .. } => {
                let meant = if similar.is_empty() {
                    String::new()
                } else {
                    format!("; did you mean {}?", similar.join(" or "))
                };
                format!("has no variable {name}{meant}")
            }
            Self::Call { .. } => self.to_string(),
        }
    }

    /// Whether the FMU discarded the call, without effect; the instance remains usable.
    pub fn is_discard(&self) -> bool {
        matches!(self, Self::Call { status, .. } if *status == Status::DISCARD.to_string())
    }

    /// Whether the FMU itself refused, rather than a file or a setting being wrong.
    pub fn is_of_the_run(&self) -> bool {
        matches!(self, Self::Call { .. })
    }
}

fn said(message: Option<&str>) -> String {
    message.map(|m| format!(": {}", one_line(m))).unwrap_or_default()
}

/// Joins the lines of a message: an error has one line.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_of_a_file_has_its_source() {
        let error = Error::file_from(Path::new("a.fmu"), "", std::io::Error::from(std::io::ErrorKind::NotFound));
        let source = error.source().and_then(|source| source.downcast_ref::<std::io::Error>());
        assert_eq!(source.map(std::io::Error::kind), Some(std::io::ErrorKind::NotFound));
        assert!(
            error == Error::file(Path::new("a.fmu"), "entity not found") && error.to_string().starts_with("a.fmu: ")
        );
    }

    #[test]
    fn an_error_is_one_line() {
        let error = Error::Call {
            instance: "plant".into(),
            function: "fmi2DoStep",
            status: "Error".into(),
            message: Some("the step\n  is negative\n".into()),
        };
        assert_eq!(error.to_string(), "plant: fmi2DoStep returned Error: the step is negative");
        assert_eq!(Error::file(Path::new("a.fmu"), "no\nthing").to_string(), "a.fmu: no thing");
    }

    #[test]
    fn an_error_names_instance_and_function_once() {
        for (logged, shown) in [
            ("fmi3DoStep: h = -1", ": h = -1"),
            ("plant: fmi3DoStep: h = -1", ": h = -1"),
            ("fmi3DoStep:", ""),
            ("fmi3DoStepping: h = -1", ": fmi3DoStepping: h = -1"),
            ("plants: h = -1", ": plants: h = -1"),
        ] {
            let error = Error::call("plant".into(), "fmi3DoStep", "Error".into(), Some(logged.into()));
            assert_eq!(error.to_string(), format!("plant: fmi3DoStep returned Error{shown}"));
            let during = error.during("the step at 1 s").to_string();
            assert_eq!(during, format!("plant: fmi3DoStep returned Error: the step at 1 s{shown}"));
        }
    }
}
