//! Variation of one variable: maps a number between 0 and 1, or the number of a level, to its value.

use super::normal;
use crate::definition::{SetValue, Vary};
use fmu_import::Number;

/// A checked [`Vary`].
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Source {
    Uniform {
        low: f64,
        high: f64,
    },
    Log {
        low: f64,
        high: f64,
    },
    /// Truncated to `low..high`, with the probabilities `from` and `to`.
    Normal {
        mean: f64,
        deviation: f64,
        low: f64,
        high: f64,
        from: f64,
        to: f64,
    },
    Levels(Vec<Number>),
    /// Column `of` times a factor.
    Same {
        of: String,
        times: f64,
    },
}

impl Source {
    /// `number` reads a text as the variable's number.
    pub(super) fn new(vary: &Vary, number: &dyn Fn(&str) -> Result<Number, String>) -> Result<Self, String> {
        let finite = |what: &str, x: &[f64]| match x.iter().find(|x| !x.is_finite()) {
            Some(x) => Err(format!("{what} has {x}, expected finite numbers")),
            None => Ok(()),
        };
        let rising = |what: &str, [low, high]: [f64; 2]| {
            finite(what, &[low, high])?;
            if low < high { Ok(()) } else { Err(format!("{what} = [{low}, {high}], expected the lower bound first")) }
        };
        let Vary { uniform, log, normal, within, values, from, to, count, same, times } = vary;
        if within.is_some() && normal.is_none() {
            return Err("within belongs to normal".into());
        }
        if times.is_some() && same.is_none() {
            return Err("times belongs to same".into());
        }
        let spaced = from.is_some() || to.is_some() || count.is_some();
        let kinds = [uniform.is_some(), log.is_some(), normal.is_some(), values.is_some(), spaced, same.is_some()];
        if kinds.iter().filter(|given| **given).count() != 1 {
            return Err("expected one of uniform, log, normal, values, from with to and count, same".into());
        }
        if let Some([low, high]) = *uniform {
            rising("uniform", [low, high])?;
            return Ok(Self::Uniform { low, high });
        }
        if let Some([low, high]) = *log {
            rising("log", [low, high])?;
            if low <= 0.0 {
                return Err(format!("log = [{low}, {high}], expected positive bounds"));
            }
            return Ok(Self::Log { low, high });
        }
        if let Some([mean, deviation]) = *normal {
            finite("normal", &[mean, deviation])?;
            if deviation <= 0.0 {
                return Err(format!("normal = [{mean}, {deviation}], expected a positive standard deviation"));
            }
            let (mut low, mut high, mut bounds) = (f64::NEG_INFINITY, f64::INFINITY, [0.0, 1.0]);
            if let Some(within) = *within {
                rising("within", within)?;
                [low, high] = within;
                bounds = within.map(|x| normal::cumulated((x - mean) / deviation));
            }
            let [from, to] = bounds;
            if to - from < 1e-12 {
                return Err(format!("within = [{low}, {high}] is too far from the mean {mean} of normal"));
            }
            return Ok(Self::Normal { mean, deviation, low, high, from, to });
        }
        if let Some(values) = values {
            if values.is_empty() {
                return Err("values is empty".into());
            }
            let read = |value: &SetValue| match value {
                SetValue::Number(x) => Ok(Number::Real(*x)),
                other => number(&other.to_string()),
            };
            return Ok(Self::Levels(values.iter().map(read).collect::<Result<_, _>>()?));
        }
        if let Some(of) = same {
            let times = times.unwrap_or(1.0);
            finite("times", &[times])?;
            return Ok(Self::Same { of: of.clone(), times });
        }
        let (Some(from), Some(to), Some(count)) = (*from, *to, *count) else {
            return Err("give from, to and count together".into());
        };
        finite("from or to", &[from, to])?;
        if !(1..=MOST_LEVELS).contains(&count) || (count == 1 && from.to_bits() != to.to_bits()) {
            return Err(format!("count = {count}, expected 2 to {MOST_LEVELS}, or 1 with from equal to to"));
        }
        // Both ends are exact.
        let level = |k: u32| {
            if k + 1 == count { to } else { from + (to - from) * f64::from(k) / f64::from(count - 1) }
        };
        Ok(Self::Levels((0..count).map(|k| Number::Real(level(k))).collect()))
    }

    /// The value at `u` between 0 and 1.
    pub(super) fn at(&self, u: f64) -> Number {
        Number::Real(match self {
            Self::Uniform { low, high } => (low + (high - low) * u).clamp(*low, *high),
            Self::Log { low, high } => (low * libm::exp(libm::log(high / low) * u)).clamp(*low, *high),
            Self::Normal { mean, deviation, low, high, from, to } => {
                (mean + deviation * normal::quantile(from + (to - from) * u)).clamp(*low, *high)
            }
            Self::Levels(values) => {
                #[expect(
                    clippy::cast_precision_loss,
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "far fewer levels than 2^52, u is positive"
                )]
                let index = (values.len() as f64 * u) as usize;
                return values[index.min(values.len() - 1)];
            }
            Self::Same { .. } => f64::NAN,
        })
    }
}

const MOST_LEVELS: u32 = 1_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    fn number(text: &str) -> Result<Number, String> {
        text.parse().map(Number::Real).map_err(|_| format!("{text} is not a number"))
    }

    fn source(vary: &Vary) -> Result<Source, String> {
        Source::new(vary, &number)
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "exact at the ends")]
    fn values_stay_where_they_belong() {
        let uniform = source(&Vary { uniform: Some([2.0, 4.0]), ..Vary::default() }).unwrap();
        assert_eq!([0.0, 0.25, 1.0].map(|u| uniform.at(u).real()), [2.0, 2.5, 4.0]);
        let log = source(&Vary { log: Some([1.0, 100.0]), ..Vary::default() }).unwrap();
        assert!((log.at(0.5).real() - 10.0).abs() < 1e-14 && log.at(0.0).real() == 1.0 && log.at(1.0).real() == 100.0);
        let normal = Vary { normal: Some([3.0, 0.15]), within: Some([2.5, 3.2]), ..Vary::default() };
        let normal = source(&normal).unwrap();
        let all: Vec<f64> = (0..=1000).map(|k| normal.at(f64::from(k) / 1000.0).real()).collect();
        assert!(all.windows(2).all(|w| w[0] <= w[1]) && all[0] >= 2.5 && all[1000] <= 3.2);
        assert!(all[999] > 3.19 && all[1] < 2.62);
        let levels = source(&Vary { from: Some(0.0), to: Some(0.3), count: Some(4), ..Vary::default() }).unwrap();
        assert_eq!(
            [0.0, 0.3, 0.6, 0.9, 1.0].map(|u| levels.at(u).real()),
            [0.0, 0.3 * 1.0 / 3.0, 0.3 * 2.0 / 3.0, 0.3, 0.3]
        );
    }

    #[test]
    fn nonsense_is_told() {
        let v = Vary::default;
        for (vary, part) in [
            (v(), "expected one of uniform"),
            (Vary { uniform: Some([0.0, 1.0]), log: Some([1.0, 2.0]), ..v() }, "expected one of uniform"),
            (Vary { uniform: Some([1.0, 1.0]), ..v() }, "uniform = [1, 1], expected the lower bound first"),
            (Vary { uniform: Some([0.0, f64::NAN]), ..v() }, "uniform has NaN, expected finite"),
            (Vary { log: Some([0.0, 1.0]), ..v() }, "log = [0, 1], expected positive bounds"),
            (Vary { normal: Some([0.0, 0.0]), ..v() }, "normal = [0, 0], expected a positive standard deviation"),
            (Vary { normal: Some([0.0, 1.0]), within: Some([50.0, 51.0]), ..v() }, "too far from the mean"),
            (Vary { uniform: Some([0.0, 1.0]), within: Some([0.0, 1.0]), ..v() }, "within belongs to normal"),
            (Vary { values: Some(vec![]), ..v() }, "values is empty"),
            (Vary { values: Some(vec![SetValue::Text("x".into())]), ..v() }, "x is not a number"),
            (Vary { from: Some(0.0), to: Some(1.0), count: Some(0), ..v() }, "count = 0, expected 2 to"),
            (Vary { from: Some(0.0), ..v() }, "give from, to and count together"),
            (Vary { uniform: Some([0.0, 1.0]), times: Some(2.0), ..v() }, "times belongs to same"),
        ] {
            let error = source(&vary).unwrap_err();
            assert!(error.contains(part), "{vary:?}: {error}");
        }
    }
}
