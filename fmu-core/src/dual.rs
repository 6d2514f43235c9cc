//! Dual numbers: a value and its change, so an equation written once also yields its exact derivative.
//!
//! (a + b e)(c + d e) = ac + (ad + bc) e with e^2 = 0. An equation that is generic over [`Scalar`] runs with `f64`, to
//! the last bit as if it were written for it, and with [`Dual`].

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// A real number, with or without its change.
pub trait Scalar:
    Copy
    + From<f64>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
{
    /// The number itself: for comparisons, which select the branch to differentiate.
    fn value(self) -> f64;

    /// A function of this number: its `value` here, and its `slope` here, by the chain rule.
    fn chain(self, value: f64, slope: f64) -> Self;
}

impl Scalar for f64 {
    #[inline]
    fn value(self) -> f64 {
        self
    }

    #[inline]
    fn chain(self, value: f64, _slope: f64) -> f64 {
        value
    }
}

/// A number and its change along a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual {
    /// The number.
    pub value: f64,
    /// Its change.
    pub change: f64,
}

impl Dual {
    /// A number with its change.
    #[inline]
    pub const fn new(value: f64, change: f64) -> Self {
        Self { value, change }
    }
}

impl From<f64> for Dual {
    #[inline]
    fn from(value: f64) -> Self {
        Self::new(value, 0.0)
    }
}

impl Scalar for Dual {
    #[inline]
    fn value(self) -> f64 {
        self.value
    }

    #[inline]
    fn chain(self, value: f64, slope: f64) -> Self {
        Self::new(value, slope * self.change)
    }
}

impl Add for Dual {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.change + other.change)
    }
}

impl AddAssign for Dual {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Dual {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.value - other.value, self.change - other.change)
    }
}

impl Mul for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        Self::new(self.value * other.value, self.change * other.value + self.value * other.change)
    }
}

impl Mul<f64> for Dual {
    type Output = Self;
    #[inline]
    fn mul(self, k: f64) -> Self {
        Self::new(self.value * k, self.change * k)
    }
}

impl Div for Dual {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        Self::new(quotient, (self.change - quotient * other.change) / other.value)
    }
}

impl Neg for Dual {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.value, -self.change)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn equation<S: Scalar>(x: S, y: S) -> S {
        let sin = x.chain(x.value().sin(), x.value().cos());
        -(sin * y - x / (y * y + S::from(1.0))) * 3.0
    }

    #[test]
    fn the_change_is_the_derivative() {
        let (x, y, h) = (0.7, -1.3, 1e-5);
        for (dx, dy) in [(1.0, 0.0), (0.0, 1.0), (-2.0, 0.5)] {
            let exact = equation(Dual::new(x, dx), Dual::new(y, dy));
            let difference = (equation(x + h * dx, y + h * dy) - equation(x - h * dx, y - h * dy)) / (2.0 * h);
            assert!((exact.change - difference).abs() < 1e-9, "{exact:?} {difference}");
            assert_eq!(exact.value.to_bits(), equation(x, y).to_bits());
        }
    }
}
