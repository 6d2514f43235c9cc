//! Numbers for readers: a few significant digits. Files for programs have the shortest text that reads back exactly.

/// `x` with so many significant digits.
///
/// ```
/// assert_eq!(fmu_core::digits::rounded(1_234.567, 3), 1_230.0);
/// ```
pub fn rounded(x: f64, digits: usize) -> f64 {
    format!("{x:.*e}", digits - 1).parse().unwrap_or(x)
}

/// The text of `x` with at most this many significant digits: plain from 1e-4 to below `large`, otherwise with an exponent.
pub fn text(x: f64, digits: usize, large: f64) -> String {
    let x = rounded(x, digits);
    let plain = x == 0.0 || (1e-4..large).contains(&x.abs()) || !x.is_finite();
    if plain { x.to_string() } else { format!("{x:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_its_digits_and_no_more() {
        let texts =
            [0.1 + 0.2, 1e-12, 400.0, 1.0 / 3.0, -0.0, 123_456.7, f64::NAN, f64::INFINITY].map(|x| text(x, 6, 1e6));
        assert_eq!(texts, ["0.3", "1e-12", "400", "0.333333", "-0", "123457", "NaN", "inf"]);
        assert_eq!([9.9996e5, 1e6].map(|x| text(x, 4, 1e6)), ["1e6", "1e6"]);
        assert_eq!([0.0123, 1234.0].map(|x| rounded(x, 2).to_bits()), [0.012, 1200.0].map(f64::to_bits));
    }
}
