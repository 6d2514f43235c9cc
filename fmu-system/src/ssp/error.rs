//! Errors of a system from files.

use std::fmt::Display;

/// One line that names the file, the location in it, and the cause.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An FMU, or a feature that it lacks.
    #[error(transparent)]
    Fmu(#[from] fmu_import::Error),
    /// An FMU that refuses the content of a file.
    #[error("{place}: {error}")]
    Refused {
        /// The file, and the line in it.
        place: String,
        /// The refusal of the FMU.
        error: fmu_import::Error,
    },
    /// An invalid file or name.
    #[error("{0}")]
    Invalid(String),
}

impl Error {
    /// The error of the FMU in it.
    pub fn of_fmu(&self) -> Option<&fmu_import::Error> {
        match self {
            Self::Fmu(error) | Self::Refused { error, .. } => Some(error),
            Self::Invalid(_) => None,
        }
    }

    /// Adds the place.
    pub(super) fn at(self, place: impl Display) -> Self {
        match self {
            Self::Fmu(error) => Self::Refused { place: place.to_string(), error },
            Self::Refused { place: within, error } => Self::Refused { place: format!("{place}: {within}"), error },
            Self::Invalid(cause) => Self::Invalid(format!("{place}: {cause}")),
        }
    }
}

/// An error with its text.
pub(super) fn invalid<T>(text: impl Into<String>) -> Result<T, Error> {
    Err(Error::Invalid(text.into()))
}
