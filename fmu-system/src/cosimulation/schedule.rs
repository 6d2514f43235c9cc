//! Inputs over time.

use fmu_import::quantity::{convert, split};
use model_description::{Conversion, ModelDescription, ModelVariable};
use std::fmt;

/// Values of one input over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    points: Vec<(f64, f64)>,
    linear: bool,
    /// Unit of each value, if any has a unit; empty means the variable's unit.
    units: Vec<String>,
    /// Added to the values.
    sine: Option<Sine>,
}

/// The sine `amplitude sin(2 pi frequency (t - zero))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sine {
    /// In the unit of the variable.
    pub amplitude: f64,
    /// In Hz.
    pub frequency: f64,
    /// Time (s) of a rising zero crossing.
    pub zero: f64,
}

impl Sine {
    fn at(&self, t: f64) -> f64 {
        self.amplitude * (std::f64::consts::TAU * self.frequency * (t - self.zero)).sin()
    }
}

/// Instants closer than this (s) are the same: communication points are `start + k h`, rounded.
pub(super) const SAME: f64 = 1e-9;

impl Schedule {
    /// Steps: each value applies from its time (s) on; before the first time, the first value.
    ///
    /// # Errors
    /// There is no point, a number is not finite, or times do not increase.
    pub fn steps(points: Vec<(f64, f64)>) -> Result<Self, String> {
        Self::new(points, false)
    }

    /// Straight lines between the points; before the first and after the last point, their values apply.
    ///
    /// # Errors
    /// As [`steps`](Self::steps).
    pub fn lines(points: Vec<(f64, f64)>) -> Result<Self, String> {
        Self::new(points, true)
    }

    fn new(points: Vec<(f64, f64)>, linear: bool) -> Result<Self, String> {
        if points.is_empty() {
            return Err("has no point".into());
        }
        if let Some((t, x)) = points.iter().find(|(t, x)| !t.is_finite() || !x.is_finite()) {
            return Err(format!("{t}:{x} is not finite"));
        }
        if let Some(pair) = points.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            return Err(format!("the time {} does not follow {}", pair[1].0, pair[0].0));
        }
        Ok(Self { points, linear, units: Vec::new(), sine: None })
    }

    /// The largest magnitude of its points.
    pub(super) fn magnitude(&self) -> f64 {
        self.points.iter().map(|(_, x)| x.abs()).fold(0.0, f64::max)
    }

    /// With a sine added.
    pub(super) fn with_sine(self, sine: Sine) -> Self {
        Self { sine: Some(sine), ..self }
    }

    /// Lines whose value jumps where two points have the same time; the times do not decrease.
    pub(super) fn jumping(points: Vec<(f64, f64)>, unit: &str) -> Result<Self, String> {
        if let Some((t, x)) = points.iter().find(|(_, x)| !x.is_finite()) {
            return Err(format!("{t}:{x} is not finite"));
        }
        let units = vec![unit.to_owned(); points.len()];
        Ok(Self { points, linear: true, units: Vec::new(), sine: None }.with_units(units))
    }

    /// Converts the values to the unit of the `variable`.
    pub(super) fn in_unit_of(self, variable: &ModelVariable, description: &ModelDescription) -> Result<Self, String> {
        if self.units.is_empty() {
            return Ok(self);
        }
        let converted = |(&(t, x), unit): (&(f64, f64), &String)| Ok((t, convert(x, unit, variable, description)?));
        let points = self.points.iter().zip(&self.units).map(converted).collect::<Result<_, String>>()?;
        Ok(Self { points, units: Vec::new(), ..self })
    }

    /// Whether values have a unit that differs from the variable's.
    pub(crate) fn has_units(&self) -> bool {
        !self.units.is_empty()
    }

    /// All values, converted.
    pub(crate) fn through(self, conversion: &Conversion) -> Self {
        Self { points: self.points.iter().map(|(t, x)| (*t, conversion.apply(*x))).collect(), ..self }
    }

    /// With these units of the values, if any.
    fn with_units(self, units: Vec<String>) -> Self {
        let units = if units.iter().all(String::is_empty) { Vec::new() } else { units };
        Self { units, ..self }
    }

    /// `0:0,0.1:52.36` for steps, `0:0~0.1:500rpm` for straight lines; a single number is a constant.
    ///
    /// # Errors
    /// Names the text that is not a point; otherwise those of [`steps`](Self::steps).
    pub fn parse(text: &str) -> Result<Self, String> {
        let linear = text.contains('~');
        if linear && text.contains(',') {
            return Err("has both , for steps and ~ for lines".into());
        }
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("{:?} is not a number", text.trim()));
        let value = |text: &str| {
            let (x, unit) = split(text).ok_or_else(|| format!("{:?} is not a number", text.trim()))?;
            Ok::<_, String>((x, unit.to_owned()))
        };
        let point = |text: &str| match text.split_once(':') {
            Some((t, x)) => Ok((number(t)?, value(x)?)),
            None if !linear => Ok((0.0, value(text)?)),
            None => Err(format!("{text:?} is not TIME:VALUE")),
        };
        let parts: Vec<&str> = text.split([',', '~']).collect();
        if parts.len() > 1 && parts.iter().any(|p| !p.contains(':')) {
            return Err("needs TIME:VALUE for every point".into());
        }
        let points = parts.into_iter().map(point).collect::<Result<Vec<_>, _>>()?;
        let (points, units) = points.into_iter().map(|(t, (x, unit))| ((t, x), unit)).unzip();
        Ok(Self::new(points, linear)?.with_units(units))
    }

    /// Value at time `t` (s).
    pub fn at(&self, t: f64) -> f64 {
        self.base(t) + self.sine.map_or(0.0, |sine| sine.at(t))
    }

    /// Value at time `t` (s) without the sine.
    fn base(&self, t: f64) -> f64 {
        let after = last_before(&self.points, t);
        let (Some(&(t0, x0)), next) = (self.points.get(after.saturating_sub(1)), self.points.get(after)) else {
            return 0.0;
        };
        match next {
            Some(&(t1, x1)) if self.linear && after > 0 => x0 + (x1 - x0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0),
            _ => x0,
        }
    }
}

impl Schedule {
    /// Value at time `t` (s) of a run whose last event was at `since`: every point is an event, so a step keeps its value until
    /// the next one.
    pub(super) fn held(&self, since: f64, t: f64) -> f64 {
        self.base(if self.linear { t } else { since }) + self.sine.map_or(0.0, |sine| sine.at(t))
    }

    /// Times (s) at which the value jumps.
    pub(super) fn jumps(&self) -> impl Iterator<Item = f64> {
        let linear = self.linear;
        let jumps = move |pair: &&[(f64, f64)]| {
            pair[0].1.to_bits() != pair[1].1.to_bits() && (!linear || pair[1].0 <= pair[0].0)
        };
        self.points.windows(2).filter(jumps).map(|pair| pair[1].0)
    }

    /// Time (s) of the first point after `t`.
    pub(super) fn next_point(&self, t: f64) -> Option<f64> {
        self.points.get(last_before(&self.points, t)).map(|(time, _)| *time)
    }
}

/// Number of points up to time `t` (s).
pub(super) fn last_before<T>(points: &[(f64, T)], t: f64) -> usize {
    points.partition_point(|(time, _)| *time <= t + SAME)
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let points: Vec<_> = self.points.iter().map(|(t, x)| format!("{t}:{x}")).collect();
        f.write_str(&points.join(if self.linear { "~" } else { "," }))
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact if nothing is rounded")]
mod tests {
    use super::*;

    #[test]
    fn steps_hold_and_lines_connect() {
        let steps = Schedule::parse("0:0, 0.1:52.36").unwrap();
        assert_eq!(steps.to_string(), "0:0,0.1:52.36");
        assert_eq!(Schedule::parse("0:0~1:2").unwrap().to_string(), "0:0~1:2");
        let values = [-1.0, 0.0, 0.099, 0.1, 0.1 - 1e-12, 9.0].map(|t| steps.at(t));
        assert_eq!(values, [0.0, 0.0, 0.0, 52.36, 52.36, 52.36]);
        let lines = Schedule::parse("1:0~2:10~3:10").unwrap();
        assert_eq!([0.0, 1.0, 1.5, 2.0, 2.5, 4.0].map(|t| lines.at(t)), [0.0, 0.0, 5.0, 10.0, 10.0, 10.0]);
        assert_eq!(Schedule::parse("325").unwrap().at(-7.0), 325.0);
    }

    #[test]
    fn steps_hold_until_their_event() {
        let steps = Schedule::parse("0:1, 0.1:2").unwrap();
        assert_eq!((steps.held(0.0, 0.1), steps.held(0.1, 0.1)), (1.0, 2.0));
        assert_eq!([-1.0, 0.0, 0.1 - 1e-12, 0.2].map(|t| steps.next_point(t)), [Some(0.0), Some(0.1), None, None]);
        let lines = Schedule::parse("0:1~0.1:2").unwrap();
        assert_eq!((lines.held(0.0, 0.05), lines.held(0.0, 0.1)), (1.5, 2.0));
    }

    #[test]
    fn a_sine_is_added_at_every_time() {
        let sine = Sine { amplitude: 2.0, frequency: 10.0, zero: 1.0 };
        let steps = Schedule::parse("0:1, 0.5:3").unwrap().with_sine(sine);
        for (t, base) in [(0.025, 1.0), (0.525, 3.0), (1.025, 3.0)] {
            assert!((steps.at(t) - base - 2.0).abs() < 1e-12, "{}", steps.at(t));
        }
        // A step is constant until its event; the sine continues.
        assert!((steps.held(0.0, 0.525) - 3.0).abs() < 1e-12);
        assert_eq!(steps.jumps().collect::<Vec<_>>(), [0.5]);
    }

    #[test]
    fn what_is_no_schedule_is_told() {
        for (text, cause) in [
            ("", "\"\" is not a number"),
            ("a:1", "\"a\" is not a number"),
            ("0:1,0:2", "the time 0 does not follow 0"),
            ("0:1,2", "needs TIME:VALUE for every point"),
            ("0:1~1:2,3:4", "has both , for steps and ~ for lines"),
            ("0:NaN", "0:NaN is not finite"),
        ] {
            assert_eq!(Schedule::parse(text).unwrap_err(), cause, "{text:?}");
        }
    }
}
