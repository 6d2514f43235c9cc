//! Why an FMU or a part of it could not be built.

use std::error::Error as Cause;

/// Why an FMU or a part of it could not be built. [`source`](Cause::source) is the cause unless the text already contains it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A compiler fails; it has printed the reason.
    #[error("{0}")]
    Failed(String),
    /// An invalid input: the object, its value, and the allowed values.
    #[error("{0}")]
    Invalid(String),
    /// A file or a program cannot be used: names it.
    #[error("{what}")]
    Of {
        /// The file or action concerned.
        what: String,
        /// Why it failed.
        source: Box<dyn Cause + Send + Sync>,
    },
    /// A system call fails.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// An FMU cannot be read, or fails.
    #[error(transparent)]
    Fmu(#[from] fmu_import::Error),
    /// A description cannot be read.
    #[error(transparent)]
    Description(#[from] model_description::Error),
    /// JSON cannot be written.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// An archive cannot be written.
    #[error(transparent)]
    Zip(#[from] zip::result::ZipError),
}

impl Error {
    /// The error of an FMU that this one wraps.
    pub fn of_fmu(&self) -> Option<&fmu_import::Error> {
        if let Self::Fmu(error) = self { Some(error) } else { None }
    }

    /// Whether a call of the operating system failed, because the disk is full or cannot be read, for example, or whether an FMU makes no
    /// instance, for which a file that it cannot read is a reason.
    pub(crate) fn is_before_the_run(&self) -> bool {
        let failed = |e: &std::io::Error| e.raw_os_error().is_some();
        let refused = |e: &fmu_import::Error| matches!(e, fmu_import::Error::Call { function, .. } if function.contains("nstantiate"));
        let mut is = match self {
            Self::Io(e) => failed(e),
            Self::Fmu(e) => refused(e),
            _ => false,
        };
        let mut next = self.source();
        while let Some(cause) = next {
            is |= cause.downcast_ref().is_some_and(failed)
                || cause.downcast_ref().is_some_and(refused)
                || cause.downcast_ref::<Self>().is_some_and(Self::is_before_the_run);
            next = cause.source();
        }
        is
    }

    /// The text with all causes, separated by colons.
    pub(crate) fn whole(&self) -> String {
        let (mut text, mut next) = (self.to_string(), self.source());
        while let Some(cause) = next {
            text = format!("{text}: {cause}");
            next = cause.source();
        }
        text
    }
}

/// The result of this crate's functions.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// The file or tool in use when an error occurred, or the missing one.
pub(crate) trait Context<T> {
    fn with_context<W: Into<String>>(self, what: impl FnOnce() -> W) -> Result<T>;

    fn context(self, what: impl Into<String>) -> Result<T>
    where
        Self: Sized,
    {
        self.with_context(|| what)
    }
}

impl<T, E: Into<Box<dyn Cause + Send + Sync>>> Context<T> for Result<T, E> {
    fn with_context<W: Into<String>>(self, what: impl FnOnce() -> W) -> Result<T> {
        self.map_err(|source| Error::Of { what: what().into(), source: source.into() })
    }
}

impl<T> Context<T> for Option<T> {
    fn with_context<W: Into<String>>(self, what: impl FnOnce() -> W) -> Result<T> {
        self.ok_or_else(|| Error::Invalid(what().into()))
    }
}

/// The error that something does not fit.
macro_rules! invalid {
    ($($text:tt)*) => { $crate::error::Error::Invalid(format!($($text)*)) };
}

/// Returns the error that something does not fit unless the condition is true.
macro_rules! ensure {
    ($condition:expr, $($text:tt)*) => {
        if !$condition {
            return Err($crate::error::invalid!($($text)*));
        }
    };
}

pub(crate) use {ensure, invalid};
