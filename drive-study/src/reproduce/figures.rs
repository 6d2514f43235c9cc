//! The expected results of each experiment: a measured number, its expected value, and the verdict.
//!
//! Expected values and tolerances were computed with an independent model of the same drive (the paper prints curves,
//! no numbers, and its motor table is missing); they hold for the reference motor and the start values of the FMUs.

use super::scenario::Trace;

/// The expected value of a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// Within a tolerance of a value.
    Near(f64, f64),
    /// At most this.
    AtMost(f64),
    /// At least this.
    AtLeast(f64),
}

impl Expected {
    /// Whether `x` is as expected; false for NaN.
    pub fn holds(&self, x: f64) -> bool {
        match *self {
            Self::Near(value, tolerance) => (x - value).abs() <= tolerance,
            Self::AtMost(bound) => x <= bound,
            Self::AtLeast(bound) => x >= bound,
        }
    }
}

impl std::fmt::Display for Expected {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Near(value, tolerance) => write!(f, "{value} ±{tolerance}"),
            Self::AtMost(bound) => write!(f, "≤ {bound}"),
            Self::AtLeast(bound) => write!(f, "≥ {bound}"),
        }
    }
}

/// A measured number beside its expectation.
#[derive(Clone, Debug)]
pub struct Figure {
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

impl Figure {
    /// Whether the number is as expected.
    pub fn holds(&self) -> bool {
        self.expected.holds(self.measured)
    }
}

/// Measures numbers in a trace between two times.
struct Window<'a> {
    trace: &'a Trace,
    from: usize,
    to: usize,
}

impl<'a> Window<'a> {
    fn new(trace: &'a Trace, from: f64, to: f64) -> Self {
        let index = |t: f64| trace.t.partition_point(|x| *x < t - 1e-9);
        Self { trace, from: index(from), to: index(to + 2e-9) }
    }

    fn of(&self, column: fn(&Trace) -> &Vec<f64>) -> &'a [f64] {
        &column(self.trace)[self.from..self.to]
    }

    fn max(&self, column: fn(&Trace) -> &Vec<f64>) -> f64 {
        self.of(column).iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    fn min(&self, column: fn(&Trace) -> &Vec<f64>) -> f64 {
        self.of(column).iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn peak(&self, column: fn(&Trace) -> &Vec<f64>) -> f64 {
        self.max(column).max(-self.min(column))
    }

    /// Time in s from the start of the window until `column` stays within `band` of `target`; infinite if it never does.
    fn settled(&self, column: fn(&Trace) -> &Vec<f64>, target: f64, band: f64) -> f64 {
        let values = self.of(column);
        let outside = values.iter().rposition(|x| (x - target).abs() >= band || x.is_nan());
        match outside {
            None => 0.0,
            Some(last) if last + 1 == values.len() => f64::INFINITY,
            Some(last) => self.trace.t[self.from + last + 1] - self.trace.t[self.from],
        }
    }

    /// Time in s from the first passage of `low` to the first passage of `high`, both interpolated.
    fn rise(&self, column: fn(&Trace) -> &Vec<f64>, low: f64, high: f64) -> f64 {
        self.passage(column, high) - self.passage(column, low)
    }

    fn passage(&self, column: fn(&Trace) -> &Vec<f64>, level: f64) -> f64 {
        let values = self.of(column);
        let Some(k) = values.iter().position(|x| *x >= level) else { return f64::NAN };
        if k == 0 {
            return self.trace.t[self.from];
        }
        let (a, b) = (values[k - 1], values[k]);
        let (t_a, t_b) = (self.trace.t[self.from + k - 1], self.trace.t[self.from + k]);
        t_a + (t_b - t_a) * (level - a) / (b - a)
    }

    /// Mean of the last tenth of a second.
    fn steady(&self, column: fn(&Trace) -> &Vec<f64>) -> f64 {
        let end = self.trace.t[self.to - 1];
        let last = Window::new(self.trace, end - 0.1, end);
        let values = last.of(column);
        let count = f64::from(u32::try_from(values.len()).unwrap_or(u32::MAX));
        values.iter().sum::<f64>() / count
    }
}

/// Within 10 % of a value.
fn within_a_tenth(value: f64) -> Expected {
    Expected::Near(value, (value * 1e5).round() / 1e6)
}

type Row = (&'static str, &'static str, Expected, f64);

fn list(figure: &'static str, rows: Vec<Row>) -> Vec<Figure> {
    rows.into_iter()
        .map(|(quantity, unit, expected, measured)| Figure { figure, quantity, unit, expected, measured })
        .collect()
}

/// Start from 180 deg at t = 0.2 s, stop at 1.2 s, second start at 2.2 s.
pub fn start(trace: &Trace) -> Vec<Figure> {
    let first = Window::new(trace, 0.2, 1.2);
    let second = Window::new(trace, 2.2, 3.2);
    let estimate = first.of(|t| &t.speed_est);
    let lowest = estimate.iter().enumerate().fold(0, |at, (k, x)| if *x < estimate[at] { k } else { at });
    let before = estimate[..=lowest].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut figures = list(
        "4a",
        vec![
            ("first start: lowest true speed", "rpm", Expected::Near(-340.0, 15.0), first.min(|t| &t.speed)),
            ("first start: first peak of the estimated speed", "rpm", Expected::Near(152.0, 10.0), before),
            ("first start: then its lowest value", "rpm", Expected::Near(-99.0, 10.0), estimate[lowest]),
        ],
    );
    figures.extend(list(
        "4b",
        vec![
            (
                "first start: angle error below 5° after",
                "s",
                Expected::Near(0.14, 0.03),
                first.settled(|t| &t.error, 0.0, 5.0),
            ),
            (
                "first start: angle error below 1° after",
                "s",
                Expected::AtMost(0.30),
                first.settled(|t| &t.error, 0.0, 1.0),
            ),
            ("first start: final angle error", "deg", Expected::AtMost(0.05), first.steady(|t| &t.error).abs()),
        ],
    ));
    figures.extend(list(
        "3.2",
        vec![
            ("second start: peak angle error", "deg", Expected::Near(3.9, 1.0), second.peak(|t| &t.error)),
            ("second start: lowest true speed", "rpm", Expected::AtLeast(-1.0), second.min(|t| &t.speed)),
        ],
    ));
    figures
}

/// Step to 20 rpm at t = 0.1 s.
pub fn step_20(trace: &Trace) -> Vec<Figure> {
    let settled = Window::new(trace, 0.4, 1.1);
    let off = (settled.max(|t| &t.speed) - 20.0).max(20.0 - settled.min(|t| &t.speed));
    list(
        "4c",
        vec![
            ("20 rpm: greatest deviation from 0.3 s after the step on", "rpm", Expected::AtMost(5.0), off),
            ("20 rpm: steady angle error", "deg", Expected::Near(-6.0, 0.3), settled.steady(|t| &t.error)),
        ],
    )
}

/// Step to `speed` (rpm) at t = 0.1 s with the expected rise time (s) and peak error (deg).
pub fn step(figure: &'static str, trace: &Trace, speed: f64, rise: f64, peak: f64) -> Vec<Figure> {
    let w = Window::new(trace, 0.1, 1.1);
    let overshoot = (w.max(|t| &t.speed) / speed - 1.0) * 100.0;
    list(
        figure,
        vec![
            ("10-90 % rise time", "s", within_a_tenth(rise), w.rise(|t| &t.speed, 0.1 * speed, 0.9 * speed)),
            ("overshoot", "%", Expected::AtMost(1.0), overshoot),
            ("peak angle error", "deg", Expected::Near(peak, 1.0), w.peak(|t| &t.error)),
            ("final angle error", "deg", Expected::AtMost(0.02), w.steady(|t| &t.error).abs()),
        ],
    )
}

/// 2 N.m at 0 rpm from t = 0.5 s on.
pub fn load_0(trace: &Trace) -> Vec<Figure> {
    let w = Window::new(trace, 0.5, 6.5);
    let mut figures = list(
        "5a",
        vec![
            ("2 N.m at 0 rpm: lowest speed", "rpm", Expected::Near(-127.0, 8.0), w.min(|t| &t.speed)),
            ("2 N.m at 0 rpm: within 0.5 rpm after", "s", Expected::AtMost(3.5), w.settled(|t| &t.speed, 0.0, 0.5)),
        ],
    );
    figures.extend(list(
        "5c",
        vec![
            ("2 N.m at 0 rpm: steady i_sd", "A", Expected::Near(5.0, 0.02), w.steady(|t| &t.i_d)),
            ("2 N.m at 0 rpm: steady magnitude of i_sq", "A", Expected::AtMost(0.02), w.steady(|t| &t.i_q).abs()),
        ],
    ));
    let error = w.steady(|t| &t.error);
    figures.extend(list("5e", vec![("2 N.m at 0 rpm: steady angle error", "deg", Expected::Near(36.34, 0.3), error)]));
    figures
}

/// 2 N.m at 1000 rpm from t = 1 s on.
pub fn load_1000(trace: &Trace) -> Vec<Figure> {
    let w = Window::new(trace, 1.0, 2.0);
    let mut figures = list(
        "5b",
        vec![
            ("2 N.m at 1000 rpm: dip", "rpm", Expected::Near(118.0, 6.0), 1000.0 - w.min(|t| &t.speed)),
            ("2 N.m at 1000 rpm: within 2 % after", "s", within_a_tenth(0.105), w.settled(|t| &t.speed, 1000.0, 20.0)),
        ],
    );
    let i_d = w.steady(|t| &t.i_d).abs();
    figures.extend(list("5d", vec![("2 N.m at 1000 rpm: steady magnitude of i_sd", "A", Expected::AtMost(0.01), i_d)]));
    let error = w.steady(|t| &t.error);
    figures
        .extend(list("5f", vec![("2 N.m at 1000 rpm: steady angle error", "deg", Expected::Near(0.12, 0.03), error)]));
    figures
}

/// The figures of the experiment with this id.
pub fn of(id: &str, trace: &Trace) -> Vec<Figure> {
    match id {
        "start-180" => start(trace),
        "step-20" => step_20(trace),
        "step-500" => step("4d", trace, 500.0, 0.059, 3.9),
        "step-1000" => step("4e", trace, 1000.0, 0.070, 6.0),
        "step-1500" => step("4f", trace, 1500.0, 0.080, 6.9),
        "load-0" => load_0(trace),
        "load-1000" => load_1000(trace),
        _ => Vec::new(),
    }
}
