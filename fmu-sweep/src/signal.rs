//! The signal of a measure: a sum of variables.

use crate::definition::SetValue;
use fmu_import::Number;
use std::f64::consts::PI;

/// A sum as written in the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sum {
    /// Factors and names.
    pub(crate) terms: Vec<(f64, String)>,
}

impl Sum {
    /// Reads `[number *] variable` terms joined by ` + ` or ` - `; the spaces are required because names may contain signs. A name
    /// with spaces is the longest known one.
    pub(crate) fn parse(text: &str, known: &dyn Fn(&str) -> bool) -> Result<Self, String> {
        let mut terms = Vec::new();
        let mut sign = Some(1.0);
        let mut factor = None;
        let mut rest = text.trim();
        while let Some(word) = rest.split_whitespace().next() {
            let ends = rest.match_indices(char::is_whitespace).map(|(at, _)| at).chain([rest.len()]);
            // A name stands where a term begins, and not before its factor.
            let name = ends.filter(|&at| sign.is_some() && known(rest[..at].trim_end())).last();
            let word = name.map_or(word, |at| rest[..at].trim_end());
            rest = rest[word.len()..].trim_start();
            let next = rest.split_whitespace().next();
            let wrong = || format!("{text:?}: {word:?} is not expected; write [number *] variable + ..., with spaces");
            let Some(of_term) = sign else {
                sign = Some(match word {
                    "+" => 1.0,
                    "-" => -1.0,
                    _ => return Err(wrong()),
                });
                continue;
            };
            if factor.is_none() && terms.is_empty() && word == "-" {
                sign = Some(-of_term);
            } else if next == Some("*") && name.is_none() {
                if factor.is_some() {
                    return Err(wrong());
                }
                factor = Some(word.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(wrong)?);
                rest = rest[1..].trim_start();
            } else if name.is_none() && ["+", "-", "*"].contains(&word) {
                return Err(wrong());
            } else {
                terms.push((of_term * factor.take().unwrap_or(1.0), word.to_owned()));
                sign = None;
            }
        }
        if sign.is_some() {
            return Err(format!("{text:?} ends before a variable"));
        }
        Ok(Self { terms })
    }
}

/// A sum of recorded values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Signal {
    /// Factors and columns.
    terms: Vec<(f64, usize)>,
    /// Period of the wrapping.
    wrap: Option<f64>,
}

impl Signal {
    /// `column` returns the position of a variable among the recorded values.
    pub(crate) fn new(sum: &Sum, wrap: Option<f64>, mut column: impl FnMut(&str) -> usize) -> Self {
        Self { terms: sum.terms.iter().map(|(factor, name)| (*factor, column(name))).collect(), wrap }
    }

    /// Whether it is wrapped.
    pub(crate) fn wraps(&self) -> bool {
        self.wrap.is_some()
    }

    /// The value at a communication point: an integer where all terms are integers with whole factors, else a double.
    pub(crate) fn at(&self, values: &[Number]) -> Number {
        if self.terms.iter().any(|(_, column)| values[*column] == Number::Missing) {
            return Number::Missing;
        }
        if self.wrap.is_none()
            && let Some(sum) = self.whole(values)
        {
            return sum;
        }
        let sum = self.terms.iter().fold(0.0, |sum, (factor, column)| sum + factor * values[*column].real());
        Number::Real(self.wrap.map_or(sum, |period| sum - period * (sum / period).round()))
    }

    /// The sum of integers with all digits.
    fn whole(&self, values: &[Number]) -> Option<Number> {
        let term = |(factor, column): &(f64, usize)| match values[*column] {
            #[expect(clippy::cast_possible_truncation, reason = "whole, and checked")]
            Number::Integer(i) if factor.fract() == 0.0 && factor.abs() < 1e15 => i.checked_mul(*factor as i128),
            _ => None,
        };
        let sum = self.terms.iter().try_fold(0_i128, |sum, of| sum.checked_add(term(of)?));
        sum.map(Number::Integer)
    }
}

/// A period: `6.28`, `"2pi"`, `"pi"`.
pub(crate) fn period(wrap: &SetValue) -> Result<f64, String> {
    let text = wrap.to_string();
    let number = match text.trim().strip_suffix("pi").map(str::trim) {
        Some("") => Some(PI),
        Some(factor) => factor.trim_end_matches('*').trim_end().parse::<f64>().ok().map(|x| x * PI),
        None => text.trim().parse().ok(),
    };
    number
        .filter(|x| x.is_finite() && *x > 0.0)
        .ok_or_else(|| format!("wrap = {text:?}, expected a period like \"2pi\" or 360"))
}

/// A note about a period that does not belong to this unit: an angle in rad repeats after a multiple of pi, no other unit has pi.
pub(crate) fn doubt(wrap: &SetValue, unit: &str) -> Option<String> {
    let period = period(wrap).ok()?;
    let has_pi = (2.0 * period / PI - (2.0 * period / PI).round()).abs() < 1e-3;
    let degrees = period.to_bits() == 360.0_f64.to_bits() && !["deg", "degree", "°"].contains(&unit);
    (!unit.is_empty() && (has_pi != (unit == "rad") || degrees))
        .then(|| format!("wrap = {wrap} is not a period of values in {unit}: 2pi is one in rad, 360 in deg"))
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact")]
mod tests {
    use super::*;

    #[test]
    fn sums_are_read() {
        let none = |_: &str| false;
        let terms = |text| Sum::parse(text, &none).unwrap().terms;
        let term = |factor, name: &str| (factor, name.to_owned());
        assert_eq!(terms("p.x-1[2]"), [term(1.0, "p.x-1[2]")]);
        assert_eq!(terms("c.theta_est - p.theta_e"), [term(1.0, "c.theta_est"), term(-1.0, "p.theta_e")]);
        assert_eq!(terms("- 9.5 * a + b - 2e-1 * c"), [term(-9.5, "a"), term(1.0, "b"), term(-0.2, "c")]);
        let known = |name: &str| ["größe 温度", "'c d'", "größe"].contains(&name);
        let named = Sum::parse("größe 温度 - 2 * 'c d' + größe", &known).unwrap().terms;
        assert_eq!(named, [term(1.0, "größe 温度"), term(-2.0, "'c d'"), term(1.0, "größe")]);
        for text in ["", "a b", "a +", "2 * ", "a * b", "* a", "a + - b", "2 * 3 * a", "a - - b", "NaN * a"] {
            assert!(Sum::parse(text, &none).is_err(), "{text}: {:?}", Sum::parse(text, &none));
        }
    }

    #[test]
    fn a_signal_is_wrapped_around_zero() {
        let sum = Sum::parse("a - 2 * b", &|_| false).unwrap();
        let signal = Signal::new(&sum, Some(360.0), |name| usize::from(name == "b"));
        assert_eq!(
            [[10.0, 0.0], [350.0, 0.0], [0.0, 90.5], [730.0, 0.0]].map(|v| signal.at(&v.map(Number::Real)).real()),
            [10.0, -10.0, 179.0, 10.0]
        );
    }

    #[test]
    fn integers_keep_their_digits() {
        let of = |text: &str, a: i128, b: i128| {
            let signal = Signal::new(&Sum::parse(text, &|_| false).unwrap(), None, |name| usize::from(name == "b"));
            signal.at(&[Number::Integer(a), Number::Integer(b)])
        };
        let large = 9_007_199_254_740_993;
        assert_eq!(of("a", large, 0), Number::Integer(large));
        assert_eq!(of("a - 2 * b", large, 1), Number::Integer(large - 2));
        assert_eq!(of("a - 0.5 * b", 3, 1), Number::Real(2.5));
    }

    #[test]
    fn a_period_belongs_to_its_unit() {
        let doubted = |wrap: &str, unit: &str| doubt(&SetValue::Text(wrap.into()), unit).is_some();
        for (wrap, unit) in
            [("2pi", "rad"), ("6.2832", "rad"), ("pi", "rad"), ("360", "deg"), ("1", "rev"), ("2pi", "")]
        {
            assert!(!doubted(wrap, unit), "{wrap} {unit}");
        }
        for (wrap, unit) in [("360", "rad"), ("2pi", "deg"), ("2pi", "rad/s"), ("360", "rad/s"), ("1", "rad")] {
            assert!(doubted(wrap, unit), "{wrap} {unit}");
        }
    }

    #[test]
    fn periods_are_numbers_or_have_pi() {
        let text = |text: &str| period(&SetValue::Text(text.into()));
        assert_eq!(
            (text("2pi"), text("pi"), text("0.5 pi"), text("360")),
            (Ok(2.0 * PI), Ok(PI), Ok(0.5 * PI), Ok(360.0))
        );
        assert_eq!(period(&SetValue::Integer(360)), Ok(360.0));
        assert!(text("0").is_err() && text("x").is_err() && text("-2pi").is_err() && text("").is_err());
    }
}
