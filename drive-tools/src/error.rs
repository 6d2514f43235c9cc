//! The error of the tools and of the studies.

use std::fmt::{Display, Formatter};

/// A fallible value.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// One line that states the object, its value and the expected one; its source is the cause. `{:#}` adds the causes to the line.
#[derive(Debug)]
pub struct Error {
    text: String,
    cause: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Error {
    /// An error without a cause.
    pub fn new(text: impl Display) -> Self {
        Self { text: text.to_string(), cause: None }
    }
}

impl Display for Error {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)?;
        let first = std::error::Error::source(self).filter(|_| f.alternate());
        std::iter::successors(first, |cause| cause.source()).try_for_each(|cause| write!(f, ": {cause}"))
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as _)
    }
}

/// An error of another crate keeps its text.
macro_rules! of_others {
    ($($other:ty),+ $(,)?) => {$(
        impl From<$other> for Error {
            fn from(error: $other) -> Self {
                Self::new(error)
            }
        }
    )+};
}

of_others!(
    fmu_core::Fault,
    fmu_import::Error,
    fmu_plot::Error,
    serde_json::Error,
    std::io::Error,
    std::num::TryFromIntError,
    zip::result::ZipError
);

/// Says what failed.
pub trait WithContext<T> {
    /// An error with this text; the error of a [`Result`] becomes its cause.
    ///
    /// # Errors
    /// There is no value.
    fn with_context<D: Display>(self, text: impl FnOnce() -> D) -> Result<T>;

    /// [`with_context`](Self::with_context) with a fixed text.
    ///
    /// # Errors
    /// There is no value.
    fn context(self, text: &str) -> Result<T>
    where
        Self: Sized,
    {
        self.with_context(|| text.to_owned())
    }
}

impl<T> WithContext<T> for Option<T> {
    fn with_context<D: Display>(self, text: impl FnOnce() -> D) -> Result<T> {
        self.ok_or_else(|| Error::new(text()))
    }
}

impl<T, E: Into<Box<dyn std::error::Error + Send + Sync>>> WithContext<T> for Result<T, E> {
    fn with_context<D: Display>(self, text: impl FnOnce() -> D) -> Result<T> {
        self.map_err(|error| Error { text: text().to_string(), cause: Some(error.into()) })
    }
}

/// Returns an error with a formatted text.
#[macro_export]
macro_rules! bail {
    ($($text:tt)+) => { return Err($crate::error::Error::new(format_args!($($text)+))) };
}

/// Returns an error with a formatted text unless a condition holds.
#[macro_export]
macro_rules! ensure {
    ($condition:expr, $($text:tt)+) => {
        if $condition {} else { $crate::bail!($($text)+) }
    };
}

pub use crate::{bail, ensure};

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(x: f64) -> Result<f64> {
        ensure!(x > 0.0, "x = {x} must be above 0");
        Ok(x)
    }

    #[test]
    fn the_alternate_form_has_the_causes() {
        assert_eq!(checked(1.0).unwrap().to_bits(), 1.0_f64.to_bits());
        let of_nan = checked(f64::NAN).unwrap_err();
        assert_eq!(format!("{of_nan} {of_nan:#}"), "x = NaN must be above 0 x = NaN must be above 0");
        let outer = checked(-1.0).with_context(|| format!("{}:1", "m.toml")).context("reading").unwrap_err();
        assert_eq!(outer.to_string(), "reading");
        assert_eq!(format!("{outer:#}"), "reading: m.toml:1: x = -1 must be above 0");
        assert_eq!(None::<f64>.context("nothing").unwrap_err().to_string(), "nothing");
    }
}
