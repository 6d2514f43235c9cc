//! The numbers measured in a run. Angle errors are theta - theta^ in deg, speeds are in pu.

use crate::expected::Expected;
use crate::runner::{Moment, Statistics};

/// A number measured in a run. It is infinite if the value was never reached or the rotor was lost.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Name of the quantity.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The value.
    pub value: f64,
    /// The expected value, if there is a figure.
    pub expected: Option<Expected>,
}

impl Measure {
    /// A number without an expected value.
    pub fn new(name: &'static str, unit: &'static str, value: f64) -> Self {
        Self { name, unit, value: if value.is_finite() { value } else { f64::INFINITY }, expected: None }
    }
}

/// A run over time, thinned to a millisecond.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Time in s.
    pub t: Vec<f64>,
    /// Speed reference in pu.
    pub reference: Vec<f64>,
    /// True speed in pu.
    pub speed: Vec<f64>,
    /// Angle error in deg.
    pub error: Vec<f64>,
    /// Stator current in A, alpha and beta, at every sample; only for an injected signal.
    pub current: Vec<[f64; 2]>,
    /// Electrical angle in deg, true and estimated, at the same samples.
    pub angles: Vec<[f64; 2]>,
    /// Time in s at which the rotor was lost.
    pub lost: Option<f64>,
}

/// Angle error in deg beyond which the rotor counts as lost because the torque vanishes.
const LOST: f64 = 90.0;
/// Band in pu within which a speed has settled.
const BAND: f64 = 0.02;

/// Follows a run against its reference.
#[derive(Clone, Debug, Default)]
pub struct Follow {
    /// Deviation of the speed from its reference in pu.
    pub speed: Statistics,
    /// Angle error in deg.
    pub angle: Statistics,
    /// Largest drop of the speed below its reference, in the direction of the reference, in pu.
    pub dip: f64,
    last_outside: Option<f64>,
    last: f64,
    trace: Trace,
}

impl Follow {
    /// Measures a moment.
    pub fn add(&mut self, moment: &Moment<'_>) {
        let (t, error, off) = (moment.t, moment.error(), moment.deviation());
        if self.trace.lost.is_none() && (error.is_nan() || error.abs() > LOST) {
            self.trace.lost = Some(t);
        }
        self.speed.add(off);
        self.angle.add(error);
        self.dip = self.dip.max(if moment.reference < 0.0 { off } else { -off });
        if off.abs() >= BAND {
            self.last_outside = Some(t);
        }
        self.last = t;
    }

    /// Records a moment for the plot.
    pub fn trace(&mut self, moment: &Moment<'_>) {
        if self.trace.t.last().is_none_or(|last| moment.t - last > 1e-3 - 1e-9) {
            self.trace.t.push(moment.t);
            self.trace.reference.push(moment.reference);
            self.trace.speed.push(moment.speed);
            self.trace.error.push(moment.error());
        }
    }

    /// Ends the plot at the time `end` (s).
    pub fn show_until(&mut self, end: f64) {
        let Trace { t, reference, speed, error, .. } = &mut self.trace;
        let kept = t.partition_point(|t| *t <= end);
        for values in [t, reference, speed, error] {
            values.truncate(kept);
        }
    }

    /// Whether the rotor was lost or nothing was measured.
    pub fn lost(&self) -> bool {
        let angle = self.angle.peak;
        self.speed.count() == 0.0 || angle.is_nan() || angle > LOST || !self.speed.rms().is_finite()
    }

    /// Whether the drive follows speed and rotor: within 30 deg, and 2 % of rated speed.
    pub fn holds(&self) -> bool {
        !self.lost() && self.angle.peak < 30.0 && self.last_outside.is_none()
    }

    fn or_lost(&self, x: f64) -> f64 {
        if self.lost() { f64::INFINITY } else { x }
    }

    /// Root mean square of the speed error.
    pub fn rms(&self) -> Measure {
        Measure::new("rms speed error", "pu", self.or_lost(self.speed.rms()))
    }

    /// Maximum angle error.
    pub fn peak(&self) -> Measure {
        Measure::new("peak angle error", "deg", self.or_lost(self.angle.peak))
    }

    /// Mean angle error as the quantity `name`.
    pub fn mean(&self, name: &'static str) -> Measure {
        Measure::new(name, "deg", self.or_lost(self.angle.mean()))
    }

    /// Standard deviation of the angle error.
    pub fn std(&self) -> Measure {
        Measure::new("std of the angle error", "deg", self.or_lost(self.angle.std()))
    }

    /// Time from `from` (s) until the speed stays within 2 % of rated; infinite if it never does.
    pub fn settled(&self, from: f64) -> Measure {
        Measure::new("settling time", "s", self.or_lost(self.settling_time(from)))
    }

    /// The settling time in s, whether or not the angle was lost: for a start, where the initial angle error does not count.
    pub fn settling_time(&self, from: f64) -> f64 {
        match self.last_outside {
            Some(t) if t >= self.last - 1e-9 => f64::INFINITY,
            Some(t) => (t - from).max(0.0),
            None => 0.0,
        }
    }

    /// Returns the run over time; from a failed step on, the run counts as lost.
    pub fn into_trace(mut self, survived: bool) -> Trace {
        if !survived {
            self.trace.lost = self.trace.lost.or(self.trace.t.last().copied());
        }
        self.trace
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive::Pair;

    /// At a reference of 0.5 pu, with an angle error in deg.
    fn at(t: f64, speed: f64, error: f64, see: impl FnOnce(&Moment<'_>)) {
        see(&Moment { t, reference: 0.5, speed, theta_tilde: error.to_radians(), pair: &Pair::default() });
    }

    #[test]
    fn settles_where_it_last_leaves_the_band() {
        let mut f = Follow::default();
        for (t, speed) in [(1.0, 0.5), (1.1, 0.4), (1.2, 0.47), (1.3, 0.49), (1.4, 0.5)] {
            at(t, speed, 3.0, |moment| f.add(moment));
        }
        assert!((f.settled(1.0).value - 0.2).abs() < 1e-12 && (f.dip - 0.1).abs() < 1e-12);
        assert!((f.peak().value - 3.0).abs() < 1e-9 && !f.lost());
        at(1.5, 0.0, 0.0, |moment| f.add(moment));
        assert!(f.settled(1.0).value.is_infinite());
    }

    #[test]
    fn a_lost_rotor_has_no_numbers() {
        let mut f = Follow::default();
        assert!(f.lost());
        at(0.0, 0.5, 120.0, |moment| f.add(moment));
        assert!(f.lost() && f.rms().value.is_infinite() && f.peak().value.is_infinite());
        at(0.1, 0.5, 3.0, |moment| f.add(moment));
        assert_eq!(f.into_trace(true).lost, Some(0.0), "where it was lost first");
        let mut f = Follow::default();
        at(0.2, 0.5, 3.0, |moment| f.trace(moment));
        assert_eq!((f.clone().into_trace(true).lost, f.into_trace(false).lost), (None, Some(0.2)));
    }
}

/// The result of one estimator in one scenario.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// Numbers, and the run over time if it is worth a plot.
    Measured(Vec<Measure>, Option<Trace>),
    /// Why the scenario does not apply to this estimator.
    NotApplicable(&'static str),
    /// The drive could not be started: the message about inconsistent parameters.
    Refused(String),
}

/// Extent of the comparison. The reduced one is for a test that runs in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// 24 starts, all speeds.
    Full,
    /// 4 starts, some speeds, no bandwidths.
    Reduced,
}
