//! Errors before a run, and errors of files. An error within a run is part of its row: [`RunResult`](crate::RunResult).

use std::path::{Path, PathBuf};

/// One line that states the object, its value and the expected one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An FMU, or a feature that it lacks.
    #[error(transparent)]
    Fmu(#[from] fmu_import::Error),
    /// An invalid definition or table.
    #[error("{0}")]
    Invalid(String),
    /// The caller stopped.
    #[error("interrupted")]
    Interrupted,
    /// A file that cannot be read or written, or does not match.
    #[error("{}: {cause}", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The cause.
        cause: String,
    },
}

impl Error {
    pub(crate) fn file(path: &Path, cause: impl std::fmt::Display) -> Self {
        Self::File { path: path.into(), cause: cause.to_string() }
    }
}

impl From<fmu_system::ssp::Error> for Error {
    fn from(error: fmu_system::ssp::Error) -> Self {
        match error {
            fmu_system::ssp::Error::Fmu(error) => Self::Fmu(error),
            other => Self::Invalid(other.to_string()),
        }
    }
}

/// An error of a definition.
pub(crate) fn invalid<T>(text: impl Into<String>) -> Result<T, Error> {
    Err(Error::Invalid(text.into()))
}
