//! Errors of an FMU: in its file, in its use, or in a call.

use crate::Status;
use std::path::{Path, PathBuf};

/// One line that names the file or the instance, and the cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The file is not an FMU that can be run here.
    #[error("{}: {cause}", path.display())]
    File {
        /// Path of the file that cannot be used.
        path: PathBuf,
        /// The fault.
        cause: String,
    },
    /// A name, a type or a value that does not exist in the FMU or that it does not accept.
    #[error("{instance}: {cause}")]
    Usage {
        /// Name of the instance.
        instance: String,
        /// What is wrong.
        cause: String,
    },
    /// The FMU refused a call.
    #[error("{instance}: {function} returned {status}{}", said(message.as_deref()))]
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

impl Error {
    /// An unusable file; the cause becomes one line.
    pub fn file(path: &Path, cause: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), cause: one_line(&cause.to_string()) }
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
            Self::File { .. } => self,
        }
    }

    /// The cause without file, instance or function.
    pub fn cause(&self) -> String {
        match self {
            Self::File { cause, .. } | Self::Usage { cause, .. } => cause.clone(),
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
