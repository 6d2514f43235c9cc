//! One number of a variable, in the variable's type.

use std::fmt;

/// One number, in the type of its variable: integers of 64 bits keep all their digits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Number {
    /// No number yet: the clock of the variable has not ticked.
    #[default]
    Missing,
    /// Value of a real variable.
    Real(f64),
    /// Value of an integer or an enumeration.
    Integer(i128),
    /// Value of a Boolean or a clock.
    Boolean(bool),
}

impl Number {
    /// The number as a double, for computations and plots: an integer beyond 2^53 is rounded, a missing number is NaN.
    pub fn real(self) -> f64 {
        match self {
            Self::Missing => f64::NAN,
            Self::Real(x) => x,
            #[expect(clippy::cast_precision_loss, reason = "says so")]
            Self::Integer(i) => i as f64,
            Self::Boolean(b) => f64::from(u8::from(b)),
        }
    }
}

impl From<f64> for Number {
    fn from(x: f64) -> Self {
        Self::Real(x)
    }
}

/// Writes a cell of CSV: digits that read back to the same number, 1 for true, empty for a missing number.
impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => Ok(()),
            Self::Real(x) => x.fmt(f),
            Self::Integer(i) => i.fmt(f),
            Self::Boolean(b) => u8::from(*b).fmt(f),
        }
    }
}
