//! Measures: one number from a run, computed while it runs.
//!
//! Sums are accumulated in the order of time, so a measure has the same bits on every thread and machine.

use crate::definition::{MeasureDefinition, MeasureFunction};
use crate::signal::Signal;
use fmu_import::Number;
use fmu_system::cosimulation::Settings;

/// Instants closer than this (s) are the same: communication points are `start + k h`, rounded.
const SAME: f64 = 1e-9;

/// A measure that has been checked, with its signal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Measure {
    pub(crate) signal: Signal,
    /// The sum as it was written, for errors.
    of: String,
    after: f64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Final,
    Min,
    Max,
    MaxAbs,
    Mean,
    Rms,
    Integral,
    At(f64),
    Rise { from: f64, to: f64 },
    Settling { target: f64, band: f64 },
}

/// Distance from the first level of a rise, as a share of the rise, within which a value begins at that level.
const AT_LEVEL: f64 = 1e-3;

/// The state of a measure during a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    /// Number of values.
    count: f64,
    /// Extremum, sum, or last value.
    x: f64,
    /// The integer that is the last value or the extremum.
    whole: Option<i128>,
    /// Previous time and value.
    before: (f64, f64),
    /// Time of an event: a crossing of `from`, or the return into the band.
    since: Option<f64>,
    /// Time of the end of a rise.
    until: Option<f64>,
    /// Time of the first value that counts.
    begun: f64,
    /// First value that is not finite, with its time.
    bad: Option<(f64, f64)>,
}

impl Measure {
    pub(crate) fn new(definition: &MeasureDefinition, signal: Signal, settings: &Settings) -> Result<Self, String> {
        let MeasureDefinition { of, is, after, time, from, to, target, band, .. } = definition;
        let kind = match is {
            MeasureFunction::Final => Kind::Final,
            MeasureFunction::Min => Kind::Min,
            MeasureFunction::Max => Kind::Max,
            MeasureFunction::MaxAbs => Kind::MaxAbs,
            MeasureFunction::Mean => Kind::Mean,
            MeasureFunction::Rms => Kind::Rms,
            MeasureFunction::Integral => Kind::Integral,
            MeasureFunction::At => Kind::At(time.ok_or("at needs time")?),
            MeasureFunction::Rise => {
                Kind::Rise { from: from.ok_or("rise needs from")?, to: to.ok_or("rise needs to")? }
            }
            MeasureFunction::Settling => Kind::Settling {
                target: target.ok_or("settling needs target")?,
                band: band.ok_or("settling needs band")?,
            },
        };
        let of_others = [
            ("time", time, matches!(kind, Kind::At(_))),
            ("from", from, matches!(kind, Kind::Rise { .. })),
            ("to", to, matches!(kind, Kind::Rise { .. })),
            ("target", target, matches!(kind, Kind::Settling { .. })),
            ("band", band, matches!(kind, Kind::Settling { .. })),
        ];
        for (name, value, belongs) in of_others {
            if let Some(value) = value.filter(|value| !belongs || !value.is_finite()) {
                let expected =
                    if belongs { "expected a finite number" } else { "which does not belong to this measure" };
                return Err(format!("{name} = {value}, {expected}"));
            }
        }
        let Settings { start, stop, .. } = *settings;
        let inside = |name: &str, t: f64| {
            let inside = (start - SAME..=stop + SAME).contains(&t);
            if inside { Ok(()) } else { Err(format!("{name} = {t} s, expected a time from {start} to {stop} s")) }
        };
        let after = after.unwrap_or(start);
        inside("after", after)?;
        match kind {
            Kind::At(time) => inside("time", time)?,
            Kind::Settling { band, .. } if band <= 0.0 => {
                return Err(format!("band = {band}, expected a positive number"));
            }
            Kind::Rise { from, to } if from.to_bits() == to.to_bits() => {
                return Err(format!("from = {from} and to = {to}, expected two levels"));
            }
            _ => {}
        }
        Ok(Self { signal, of: of.clone(), after: if let Kind::At(time) = kind { time } else { after }, kind })
    }

    /// Whether the measure equals one of the values of its signal.
    pub(crate) fn is_a_value(&self) -> bool {
        matches!(self.kind, Kind::Final | Kind::At(_) | Kind::Min | Kind::Max) && !self.signal.wraps()
    }

    /// Unit of the measure of a signal in `unit`.
    pub(crate) fn unit(&self, unit: &str) -> String {
        match self.kind {
            Kind::Rise { .. } | Kind::Settling { .. } => "s".into(),
            Kind::Integral if unit.is_empty() => "s".into(),
            Kind::Integral => format!("{unit}.s"),
            _ => unit.into(),
        }
    }

    pub(crate) fn begin() -> Reading {
        Reading {
            count: 0.0,
            x: f64::NAN,
            whole: None,
            before: (0.0, 0.0),
            since: None,
            until: None,
            begun: 0.0,
            bad: None,
        }
    }

    /// Processes the values of a communication point.
    pub(crate) fn take(&self, s: &mut Reading, t: f64, values: &[Number]) {
        if t < self.after - SAME || s.bad.is_some() {
            return;
        }
        let value = self.signal.at(values);
        let x = value.real();
        let first = s.count == 0.0;
        // A variable whose clock has not ticked has no value yet.
        if (matches!(self.kind, Kind::At(_)) && !first) || value == Number::Missing {
            return;
        }
        if let Number::Integer(i) = value {
            s.whole = Some(match (self.kind, s.whole) {
                (Kind::Min, Some(other)) => other.min(i),
                (Kind::Max, Some(other)) => other.max(i),
                (Kind::MaxAbs, other) => other.unwrap_or(0).max(i.abs()),
                _ => i,
            });
        }
        if !x.is_finite() {
            s.bad = Some((t, x));
            return;
        }
        if first {
            s.begun = t;
        }
        s.count += 1.0;
        match self.kind {
            Kind::Final | Kind::At(_) => s.x = x,
            Kind::Min => s.x = s.x.min(x),
            Kind::Max => s.x = s.x.max(x),
            Kind::MaxAbs => s.x = s.x.max(x.abs()),
            Kind::Mean => s.x = if first { x } else { s.x + x },
            Kind::Rms => s.x = if first { x * x } else { s.x + x * x },
            Kind::Integral => {
                let piece = if first { 0.0 } else { 0.5 * (t - s.before.0) * (x + s.before.1) };
                s.x = if first { 0.0 } else { s.x + piece };
            }
            Kind::Rise { from, to } => {
                let passes = |x: f64, level: f64| if to > from { x >= level } else { x <= level };
                let passed = |level: f64| passes(x, level);
                let passage = |level: f64| {
                    let (t_0, x_0) = s.before;
                    if first || x.to_bits() == x_0.to_bits() {
                        t
                    } else {
                        t_0 + (t - t_0) * ((level - x_0) / (x - x_0)).clamp(0.0, 1.0)
                    }
                };
                // A value that begins beyond the first level has not crossed it.
                let before =
                    if first { (x - from).abs() <= AT_LEVEL * (to - from).abs() } else { !passes(s.before.1, from) };
                if s.since.is_none() && before && passed(from) {
                    s.since = Some(passage(from));
                }
                if s.since.is_some() && s.until.is_none() && passed(to) {
                    s.until = Some(passage(to));
                }
            }
            Kind::Settling { target, band } => {
                let within = (x - target).abs() <= band;
                s.since = if within { s.since.or(Some(t)) } else { None };
            }
        }
        s.before = (t, x);
    }

    /// The number; NaN if no communication point counted.
    pub(crate) fn end(&self, s: &Reading) -> Result<Number, String> {
        if let Some((t, x)) = s.bad {
            return Err(format!("{} is {x} at {t} s", self.of));
        }
        if let (Kind::Final | Kind::At(_) | Kind::Min | Kind::Max | Kind::MaxAbs, Some(i)) = (self.kind, s.whole) {
            return Ok(Number::Integer(i));
        }
        Ok(Number::Real(match self.kind {
            _ if s.count == 0.0 => f64::NAN,
            Kind::Mean => s.x / s.count,
            Kind::Rms => libm::sqrt(s.x / s.count),
            Kind::Rise { .. } => s.since.zip(s.until).map_or(f64::INFINITY, |(since, until)| until - since),
            Kind::Settling { .. } => s.since.map_or(f64::INFINITY, |since| since - s.begun),
            _ => s.x,
        }))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact if nothing is rounded")]
mod tests {
    use super::*;
    use crate::signal::Sum;

    fn measure(text: &str) -> Result<Measure, String> {
        let definition = crate::Definition::parse(&format!("[measure]\nm = {{ of = 'x', {text} }}"))?;
        let settings = Settings { start: 0.0, stop: 4.0, step: 1.0, sequential: false };
        let signal = Signal::new(&Sum::parse("x", &|_| false).unwrap(), None, |_| 0);
        Measure::new(definition.measure.values().next().unwrap(), signal, &settings)
    }

    fn of(text: &str, values: &[f64]) -> Result<f64, String> {
        let (measure, mut state) = (measure(text).unwrap(), Measure::begin());
        for (t, x) in [0.0, 1.0, 2.0, 3.0, 4.0].into_iter().zip(values) {
            measure.take(&mut state, t, &[Number::Real(*x)]);
        }
        measure.end(&state).map(Number::real)
    }

    #[test]
    fn each_measure_by_hand() {
        let x = [0.0, 3.0, -4.0, 2.0, 1.0];
        for (text, expected) in [
            ("is = 'final'", 1.0),
            ("is = 'min'", -4.0),
            ("is = 'min', after = 3", 1.0),
            ("is = 'max'", 3.0),
            ("is = 'max_abs'", 4.0),
            ("is = 'mean'", 0.4),
            ("is = 'rms'", 6.0_f64.sqrt()),
            ("is = 'rms', after = 3.5", 1.0),
            ("is = 'integral'", 1.5),
            ("is = 'integral', after = 2.5", 1.5),
            ("is = 'at', time = 1.5", -4.0),
            ("is = 'at', time = 2.0000000001", -4.0),
            ("is = 'rise', from = 0.3, to = 2.7", 0.8),
            ("is = 'rise', from = 2, to = -3, after = 1", 6.0 / 7.0 - 1.0 / 7.0),
            ("is = 'rise', from = 1, to = 5", f64::INFINITY),
            // It begins below both levels, and first falls to them later; it begins at the first one.
            ("is = 'rise', from = 2.5, to = -1", 1.0 + 4.0 / 7.0 - (1.0 + 0.5 / 7.0)),
            ("is = 'rise', from = -1, to = -3", 2.0 / 7.0),
            ("is = 'rise', from = 4, to = 3.5", f64::INFINITY),
            ("is = 'rise', from = 0, to = 1.5", 0.5),
            ("is = 'settling', target = 1.5, band = 0.5", 3.0),
            ("is = 'settling', target = 1.5, band = 0.5, after = 2", 1.0),
            ("is = 'settling', target = 1.5, band = 9", 0.0),
            ("is = 'settling', target = 9, band = 1", f64::INFINITY),
        ] {
            let found = of(text, &x).unwrap();
            assert!(found == expected || (found - expected).abs() < 1e-15, "{text}: {found}, expected {expected}");
        }
    }

    #[test]
    fn integers_keep_their_digits_and_missing_values_do_not_count() {
        let large = 9_007_199_254_740_993;
        let of = |text: &str| {
            let (measure, mut state) = (measure(text).unwrap(), Measure::begin());
            let values =
                [Number::Missing, Number::Integer(large), Number::Integer(-large - 1), Number::Integer(large - 1)];
            (0..4_u8).zip(values).for_each(|(t, x)| measure.take(&mut state, f64::from(t), &[x]));
            measure.end(&state).unwrap()
        };
        let texts = ["final", "max", "min", "max_abs"].map(|is| of(&format!("is = '{is}'")));
        assert_eq!(texts, [large - 1, large, -large - 1, large + 1].map(Number::Integer));
        assert_eq!(of("is = 'mean'"), Number::Real(3_002_399_751_580_330.0));
    }

    #[test]
    fn a_value_that_is_not_finite_is_an_error_where_it_counts() {
        let x = [0.0, f64::NAN, 1.0, f64::INFINITY, 2.0];
        assert_eq!(of("is = 'max'", &x).unwrap_err(), "x is NaN at 1 s");
        assert_eq!(of("is = 'max', after = 2", &x).unwrap_err(), "x is inf at 3 s");
        assert_eq!((of("is = 'max', after = 4", &x), of("is = 'at', time = 2", &x)), (Ok(2.0), Ok(1.0)));
        assert!(of("is = 'mean', after = 3", &[1.0]).unwrap().is_nan(), "the run ended before");
    }

    #[test]
    fn nonsense_is_told() {
        for (text, part) in [
            ("is = 'at'", "at needs time"),
            ("is = 'at', time = 5", "time = 5 s, expected a time from 0 to 4 s"),
            ("is = 'max', after = -1", "after = -1 s, expected a time from 0 to 4 s"),
            ("is = 'max', band = 1", "band = 1, which does not belong"),
            ("is = 'settling', target = 1", "settling needs band"),
            ("is = 'settling', target = 1, band = 0", "band = 0, expected a positive number"),
            ("is = 'settling', target = nan, band = 1", "target = NaN, expected a finite number"),
            ("is = 'rise', from = 1, to = 1", "from = 1 and to = 1, expected two levels"),
        ] {
            let error = measure(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
