//! Elementary functions from the `libm` crate: identical bits on every platform; the C library does not guarantee this.

/// Sine and cosine of `x` (rad).
#[inline]
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}

/// Angle of the point (`x`, `y`) in rad, in (-pi, pi].
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// e to the power of `x`.
#[inline]
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm of `x`.
#[inline]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Hyperbolic tangent of `x`.
#[inline]
pub fn tanh(x: f64) -> f64 {
    libm::tanh(x)
}

/// The angle `x` (rad) wrapped to (-pi, pi].
pub fn wrap(x: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if x > -PI && x <= PI {
        return x;
    }
    let turned = x - TAU * (x / TAU).round();
    if turned <= -PI { turned + TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn wrap_is_half_open() {
        assert!((wrap(PI) - PI).abs() < 1e-15 && (wrap(-PI) - PI).abs() < 1e-15);
        assert!((wrap(3.0 * PI) - PI).abs() < 1e-14 && (wrap(-7.0) - (-7.0 + 2.0 * PI)).abs() < 1e-14);
        for i in -1000..1000 {
            let x = wrap(0.37 * f64::from(i));
            assert!(x > -PI && x <= PI);
            assert!((sin_cos(x).0 - sin_cos(0.37 * f64::from(i)).0).abs() < 1e-12);
        }
    }
}
