//! The expected results of each experiment: the measured value, its expected value, and the verdict.
//!
//! Expected values and tolerances were computed with an independent model of the same drive (the paper prints curves,
//! no numbers, and its motor table is missing); they hold for the reference motor and the start values of the FMUs.

use super::experiment::Record;
use crate::expected::Expected::{self, AtLeast, AtMost, Near};

/// A number of the paper's figures, measured.
#[derive(Clone, Debug)]
pub struct PaperFigure {
    /// Figure of the paper.
    pub figure: &'static str,
    /// What was measured.
    pub quantity: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What is expected.
    pub expected: Expected,
    /// The result.
    pub measured: f64,
}

impl PaperFigure {
    /// Whether the number is as expected.
    pub fn holds(&self) -> bool {
        self.expected.holds(self.measured)
    }
}

/// A column of a record.
type Column = fn(&Record) -> &[f64];

const SPEED: Column = |r| &r.speed;
const ESTIMATE: Column = |r| &r.speed_est;
const ERROR: Column = |r| &r.error;
const I_D: Column = |r| &r.i_d;
const I_Q: Column = |r| &r.i_q;

/// The part of a record between two times.
struct Window<'a> {
    record: &'a Record,
    from: usize,
    to: usize,
}

/// The window of `record` from `from` to `to` (s).
fn window(record: &Record, from: f64, to: f64) -> Window<'_> {
    let index = |t: f64| record.t.partition_point(|x| *x < t - 1e-9);
    Window { record, from: index(from), to: index(to + 2e-9) }
}

impl<'a> Window<'a> {
    fn of(&self, column: Column) -> &'a [f64] {
        &column(self.record)[self.from..self.to]
    }

    fn max(&self, column: Column) -> f64 {
        self.of(column).iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    fn min(&self, column: Column) -> f64 {
        self.of(column).iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn peak(&self, column: Column) -> f64 {
        self.max(column).max(-self.min(column))
    }

    /// Time in s from the start of the window until `column` stays within `band` of `target`; infinite if it never does.
    fn settled(&self, column: Column, target: f64, band: f64) -> f64 {
        let values = self.of(column);
        let outside = values.iter().rposition(|x| (x - target).abs() >= band || x.is_nan());
        match outside {
            None => 0.0,
            Some(last) if last + 1 == values.len() => f64::INFINITY,
            Some(last) => self.record.t[self.from + last + 1] - self.record.t[self.from],
        }
    }

    /// Maximum distance from `target`.
    fn off(&self, column: Column, target: f64) -> f64 {
        (self.max(column) - target).max(target - self.min(column))
    }

    /// Overshoot of the maximum over `target` in percent.
    fn overshoot(&self, column: Column, target: f64) -> f64 {
        (self.max(column) / target - 1.0) * 100.0
    }

    /// Rise time in s: from the first crossing of 10 % of `target` to that of 90 %, both interpolated.
    fn rise(&self, column: Column, target: f64) -> f64 {
        self.passage(column, 0.9 * target) - self.passage(column, 0.1 * target)
    }

    fn passage(&self, column: Column, level: f64) -> f64 {
        let values = self.of(column);
        let Some(k) = values.iter().position(|x| *x >= level) else { return f64::NAN };
        if k == 0 {
            return self.record.t[self.from];
        }
        let (a, b) = (values[k - 1], values[k]);
        let (t_a, t_b) = (self.record.t[self.from + k - 1], self.record.t[self.from + k]);
        t_a + (t_b - t_a) * (level - a) / (b - a)
    }

    /// Mean of the last tenth of a second.
    fn steady(&self, column: Column) -> f64 {
        let end = self.record.t[self.to - 1];
        let last = window(self.record, end - 0.1, end);
        let values = last.of(column);
        let count = f64::from(u32::try_from(values.len()).unwrap_or(u32::MAX));
        values.iter().sum::<f64>() / count
    }
}

/// The first start of `start-180`, at 0.2 s.
fn first(record: &Record) -> Window<'_> {
    window(record, 0.2, 1.2)
}

/// The second start of `start-180`, at 2.2 s.
fn second(record: &Record) -> Window<'_> {
    window(record, 2.2, 3.2)
}

/// 20 rpm, from 0.3 s after the step on.
fn creep(record: &Record) -> Window<'_> {
    window(record, 0.4, 1.1)
}

/// A speed step at 0.1 s.
fn step(record: &Record) -> Window<'_> {
    window(record, 0.1, 1.1)
}

/// 2 N.m at 0 rpm from 0.5 s on.
fn rest(record: &Record) -> Window<'_> {
    window(record, 0.5, 6.5)
}

/// 2 N.m at 1000 rpm from 1 s on.
fn loaded(record: &Record) -> Window<'_> {
    window(record, 1.0, 2.0)
}

/// The estimated speed of the first start: its minimum, and the maximum before that.
fn swing(record: &Record) -> (f64, f64) {
    let estimate = first(record).of(ESTIMATE);
    let lowest = estimate.iter().enumerate().fold(0, |at, (k, x)| if *x < estimate[at] { k } else { at });
    (estimate[lowest], estimate[..=lowest].iter().copied().fold(f64::NEG_INFINITY, f64::max))
}

/// A figure: its quantity, its expected value, and its measurement.
struct Row {
    experiment: &'static str,
    figure: &'static str,
    quantity: &'static str,
    unit: &'static str,
    expected: Expected,
    measure: fn(&Record) -> f64,
}

const fn row(
    experiment: &'static str,
    figure: &'static str,
    quantity: &'static str,
    unit: &'static str,
    expected: Expected,
    measure: fn(&Record) -> f64,
) -> Row {
    Row { experiment, figure, quantity, unit, expected, measure }
}

const RISE: &str = "10-90 % rise time";

#[rustfmt::skip]
const FIGURES: &[Row] = &[
    row("start-180", "4a", "first start: lowest true speed", "rpm", Near(-340.0, 15.0), |r| first(r).min(SPEED)),
    row("start-180", "4a", "first start: first peak of the estimated speed", "rpm", Near(152.0, 10.0), |r| swing(r).1),
    row("start-180", "4a", "first start: then its lowest value", "rpm", Near(-99.0, 10.0), |r| swing(r).0),
    row("start-180", "4b", "first start: angle error below 5° after", "s", Near(0.14, 0.03), |r| first(r).settled(ERROR, 0.0, 5.0)),
    row("start-180", "4b", "first start: angle error below 1° after", "s", AtMost(0.30), |r| first(r).settled(ERROR, 0.0, 1.0)),
    row("start-180", "4b", "first start: final angle error", "deg", AtMost(0.05), |r| first(r).steady(ERROR).abs()),
    row("start-180", "3.2", "second start: peak angle error", "deg", Near(3.9, 1.0), |r| second(r).peak(ERROR)),
    row("start-180", "3.2", "second start: lowest true speed", "rpm", AtLeast(-1.0), |r| second(r).min(SPEED)),
    row("step-20", "4c", "20 rpm: greatest deviation from 0.3 s after the step on", "rpm", AtMost(5.0), |r| creep(r).off(SPEED, 20.0)),
    row("step-20", "4c", "20 rpm: steady angle error", "deg", Near(-6.0, 0.3), |r| creep(r).steady(ERROR)),
    row("step-500", "4d", RISE, "s", Near(0.059, 0.0059), |r| step(r).rise(SPEED, 500.0)),
    row("step-500", "4d", "overshoot", "%", AtMost(1.0), |r| step(r).overshoot(SPEED, 500.0)),
    row("step-500", "4d", "peak angle error", "deg", Near(3.9, 1.0), |r| step(r).peak(ERROR)),
    row("step-500", "4d", "final angle error", "deg", AtMost(0.02), |r| step(r).steady(ERROR).abs()),
    row("step-1000", "4e", RISE, "s", Near(0.07, 0.007), |r| step(r).rise(SPEED, 1000.0)),
    row("step-1000", "4e", "overshoot", "%", AtMost(1.0), |r| step(r).overshoot(SPEED, 1000.0)),
    row("step-1000", "4e", "peak angle error", "deg", Near(6.0, 1.0), |r| step(r).peak(ERROR)),
    row("step-1000", "4e", "final angle error", "deg", AtMost(0.02), |r| step(r).steady(ERROR).abs()),
    row("step-1500", "4f", RISE, "s", Near(0.08, 0.008), |r| step(r).rise(SPEED, 1500.0)),
    row("step-1500", "4f", "overshoot", "%", AtMost(1.0), |r| step(r).overshoot(SPEED, 1500.0)),
    row("step-1500", "4f", "peak angle error", "deg", Near(6.9, 1.0), |r| step(r).peak(ERROR)),
    row("step-1500", "4f", "final angle error", "deg", AtMost(0.02), |r| step(r).steady(ERROR).abs()),
    row("load-0", "5a", "2 N.m at 0 rpm: lowest speed", "rpm", Near(-127.0, 8.0), |r| rest(r).min(SPEED)),
    row("load-0", "5a", "2 N.m at 0 rpm: within 0.5 rpm after", "s", AtMost(3.5), |r| rest(r).settled(SPEED, 0.0, 0.5)),
    row("load-0", "5c", "2 N.m at 0 rpm: steady i_sd", "A", Near(5.0, 0.02), |r| rest(r).steady(I_D)),
    row("load-0", "5c", "2 N.m at 0 rpm: steady magnitude of i_sq", "A", AtMost(0.02), |r| rest(r).steady(I_Q).abs()),
    row("load-0", "5e", "2 N.m at 0 rpm: steady angle error", "deg", Near(36.34, 0.3), |r| rest(r).steady(ERROR)),
    row("load-1000", "5b", "2 N.m at 1000 rpm: dip", "rpm", Near(118.0, 6.0), |r| 1000.0 - loaded(r).min(SPEED)),
    row("load-1000", "5b", "2 N.m at 1000 rpm: within 2 % after", "s", Near(0.105, 0.0105), |r| loaded(r).settled(SPEED, 1000.0, 20.0)),
    row("load-1000", "5d", "2 N.m at 1000 rpm: steady magnitude of i_sd", "A", AtMost(0.01), |r| loaded(r).steady(I_D).abs()),
    row("load-1000", "5f", "2 N.m at 1000 rpm: steady angle error", "deg", Near(0.12, 0.03), |r| loaded(r).steady(ERROR)),
];

/// The figures of the experiment with this id.
pub fn of(id: &str, record: &Record) -> Vec<PaperFigure> {
    let one = |&Row { figure, quantity, unit, expected, measure, .. }: &Row| PaperFigure {
        figure,
        quantity,
        unit,
        expected,
        measured: measure(record),
    };
    FIGURES.iter().filter(|row| row.experiment == id).map(one).collect()
}
