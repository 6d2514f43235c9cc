//! The normal distribution.

use std::f64::consts::SQRT_2;

/// Probability of less than `z` standard deviations above the mean.
pub(super) fn cumulated(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

/// The number of standard deviations above the mean for a probability `p` between 0 and 1: algorithm AS 241, PPND16 (Wichura,
/// *The percentage points of the normal distribution*, Applied Statistics 37, 1988), relative error 1e-16.
pub(super) fn quantile(p: f64) -> f64 {
    let q = p - 0.5;
    if q.abs() <= 0.425 {
        return q * ratio(0.180_625 - q * q, &CENTER);
    }
    let r = libm::sqrt(-libm::log(p.min(1.0 - p)));
    let z = if r <= 5.0 { ratio(r - 1.6, &SIDE) } else { ratio(r - 5.0, &TAIL) };
    if q < 0.0 { -z } else { z }
}

/// Numerator and denominator, from the constant term on.
type Fraction = [[f64; 8]; 2];

fn ratio(x: f64, [above, below]: &Fraction) -> f64 {
    let polynomial = |c: &[f64; 8]| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
    polynomial(above) / polynomial(below)
}

#[rustfmt::skip]
#[expect(clippy::excessive_precision, clippy::unreadable_literal, reason = "as in the paper")]
const CENTER: Fraction = [
    [3.3871328727963666080, 1.3314166789178437745e2, 1.9715909503065514427e3, 1.3731693765509461125e4,
     4.5921953931549871457e4, 6.7265770927008700853e4, 3.3430575583588128105e4, 2.5090809287301226727e3],
    [1.0, 4.2313330701600911252e1, 6.8718700749205790830e2, 5.3941960214247511077e3,
     2.1213794301586595867e4, 3.9307895800092710610e4, 2.8729085735721942674e4, 5.2264952788528545610e3],
];
#[rustfmt::skip]
#[expect(clippy::excessive_precision, clippy::unreadable_literal, reason = "as in the paper")]
const SIDE: Fraction = [
    [1.42343711074968357734, 4.63033784615654529590, 5.76949722146069140550, 3.64784832476320460504,
     1.27045825245236838258, 2.41780725177450611770e-1, 2.27238449892691845833e-2, 7.74545014278341407640e-4],
    [1.0, 2.05319162663775882187, 1.67638483018380384940, 6.89767334985100004550e-1,
     1.48103976427480074590e-1, 1.51986665636164571966e-2, 5.47593808499534494600e-4, 1.05075007164441684324e-9],
];
#[rustfmt::skip]
#[expect(clippy::excessive_precision, clippy::unreadable_literal, reason = "as in the paper")]
const TAIL: Fraction = [
    [6.65790464350110377720, 5.46378491116411436990, 1.78482653991729133580, 2.96560571828504891230e-1,
     2.65321895265761230930e-2, 1.24266094738807843860e-3, 2.71155556874348757815e-5, 2.01033439929228813265e-7],
    [1.0, 5.99832206555887937690e-1, 1.36929880922735805310e-1, 1.48753612908506148525e-2,
     7.86869131145613259100e-4, 1.84631831751005468180e-5, 1.42151175831644588870e-7, 2.04426310338993978564e-15],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.special.ndtri` of SciPy 1.17.1.
    #[rustfmt::skip]
    #[expect(clippy::unreadable_literal, reason = "as printed")]
    const SCIPY: [(f64, f64); 11] = [
        (1e-300, -37.0470962993612),
        (1e-20, -9.262340089798409),
        (1e-09, -5.9978070150076865),
        (0.0001, -3.7190164854556804),
        (0.01, -2.3263478740408408),
        (0.07, -1.4757910281791706),
        (0.075, -1.4395314709384563),
        (0.3, -0.5244005127080409),
        (0.5, 0.0),
        (0.8, 0.8416212335729143),
        (0.975, 1.959963984540054),
    ];

    #[test]
    fn quantiles_are_those_of_scipy() {
        for (p, z) in SCIPY {
            assert!(
                (quantile(p) / z - 1.0).abs() <= 4e-15 || (z == 0.0 && quantile(p) == 0.0),
                "{p}: {} {z}",
                quantile(p)
            );
        }
    }

    #[test]
    fn the_cumulated_probability_undoes_the_quantile() {
        for p in [1e-12, 1e-4, 0.02, 0.3, 0.5, 0.9, 0.999_999] {
            assert!((cumulated(quantile(p)) / p - 1.0).abs() < 1e-13, "{p}");
        }
    }
}
