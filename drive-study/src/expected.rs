//! The expected value of a measured number.

/// The expected value of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// Within a tolerance of a value.
    Near(f64, f64),
    /// At most this.
    AtMost(f64),
    /// At least this.
    AtLeast(f64),
}

impl Expected {
    /// Whether `x` is as expected; false for NaN.
    pub fn holds(&self, x: f64) -> bool {
        match *self {
            Self::Near(value, tolerance) => (x - value).abs() <= tolerance,
            Self::AtMost(bound) => x <= bound,
            Self::AtLeast(bound) => x >= bound,
        }
    }
}

impl std::fmt::Display for Expected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Near(value, tolerance) => write!(f, "{value} ±{tolerance}"),
            Self::AtMost(bound) => write!(f, "≤ {bound}"),
            Self::AtLeast(bound) => write!(f, "≥ {bound}"),
        }
    }
}
