//! The content of a figure: panels with curves. [`crate::svg`] and [`crate::page`] draw it.

use crate::ink::Ink;
use std::rc::Rc;

/// Panels under one title.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What the figure shows.
    pub title: String,
    /// Label of the horizontal axis.
    pub x: &'static str,
    /// Number of panels side by side.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// Title of the panel; may be empty.
    pub title: String,
    /// Label of the vertical axis: a unit, or a quantity with its unit.
    pub unit: String,
    /// Range of the horizontal axis.
    pub window: (f64, f64),
    /// Whether horizontal coordinates are decimal logarithms: the axis then shows the numbers themselves.
    pub log: bool,
    /// The curves, in the order in which they are drawn.
    pub curves: Vec<Curve>,
    /// Single points.
    pub dots: Vec<(f64, f64)>,
    /// Positions on the horizontal axis with a label each.
    pub marks: Vec<(f64, String)>,
}

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Color.
    pub ink: Ink,
    /// Opacity of the line, 0..1.
    pub opacity: f64,
    /// Opacity of the area between it and zero, 0..1.
    pub fill: f64,
    /// Whether the line is dashed.
    pub dashed: bool,
    /// Horizontal coordinates, in ascending order; curves may share them.
    pub x: Rc<[f64]>,
    /// Vertical coordinates, at most as many as `x`: a curve may end early. A value that is not finite is a gap.
    pub y: Vec<f64>,
    /// Whether the run that the curve shows was lost: a cross marks the end of the curve, and the legend explains it.
    pub lost: bool,
}

impl Curve {
    /// A solid line.
    pub fn new(name: impl Into<String>, ink: Ink, x: &Rc<[f64]>, y: Vec<f64>) -> Self {
        Self { name: name.into(), ink, opacity: 1.0, fill: 0.0, dashed: false, x: x.clone(), y, lost: false }
    }

    /// A line through points.
    pub fn through(name: impl Into<String>, ink: Ink, points: impl Iterator<Item = (f64, f64)>) -> Self {
        let (x, y): (Vec<_>, Vec<_>) = points.unzip();
        Self::new(name, ink, &x.into(), y)
    }

    /// The points of the curve.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.x.iter().copied().zip(self.y.iter().copied())
    }
}

impl Figure {
    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.panels.iter().all(|panel| panel.curves.iter().all(|c| c.y.is_empty()))
    }
}

/// About `most` round positions for the grid lines of an axis, and the number of decimals of their labels.
pub(crate) fn ticks(low: f64, high: f64, most: f64) -> (Vec<f64>, usize) {
    let rough = (high - low) / most;
    let power = 10_f64.powf(rough.log10().floor());
    let step = power * [1.0, 2.0, 5.0, 10.0].into_iter().find(|k| k * power >= 0.999 * rough).unwrap_or(10.0);
    let first = (low / step - 1e-9).ceil();
    let places = (0..50).map(|k| (first + f64::from(k)) * step).take_while(|x| *x <= high + 1e-9 * step).collect();
    let decimals = (-(step * 1.001).log10().floor()).clamp(0.0, 12.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..=12")]
    (places, decimals as usize)
}

/// Positions of the grid lines of a logarithmic axis between the logarithms `low` and `high`, each with its label; those between
/// powers of ten have none, unless the axis is short.
pub(crate) fn decades(low: f64, high: f64) -> Vec<(f64, String)> {
    #[expect(clippy::cast_possible_truncation, reason = "exponents of doubles")]
    let (first, last) = (low.floor() as i32, high.ceil() as i32);
    let short = high - low < 1.5;
    let inside = |x: &f64| (low - 1e-9..=high + 1e-9).contains(x);
    let lines = (first..=last.min(first + 30)).flat_map(|power| (1..10).map(move |digit| (power, digit)));
    let label = |power: i32, digit: i32| {
        let shown = digit == 1 || (short && [2, 5].contains(&digit));
        if shown { digits(f64::from(digit) * 10.0_f64.powi(power)) } else { String::new() }
    };
    lines.map(|(p, d)| (f64::from(p) + f64::from(d).log10(), label(p, d))).filter(|(x, _)| inside(x)).collect()
}

/// A number of one digit.
fn digits(x: f64) -> String {
    if !(9e-4..5e4).contains(&x) {
        return format!("{x:.0e}");
    }
    if x > 0.95 { format!("{x:.0}") } else { format!("{x:.3}").trim_end_matches('0').to_owned() }
}

#[cfg(test)]
mod tests {
    use super::{decades, ticks};

    #[test]
    fn decades_are_labeled() {
        let labels = |low: f64, high: f64| {
            let all = decades(low.log10(), high.log10());
            (all.len(), all.into_iter().map(|(_, label)| label).filter(|x| !x.is_empty()).collect::<Vec<_>>().join(" "))
        };
        assert_eq!(labels(0.1, 1000.0), (37, "0.1 1 10 100 1000".into()));
        assert_eq!(labels(30.0, 600.0), (13, "50 100 200 500".into()));
        assert_eq!(labels(1e-5, 1e6).1, "1e-5 1e-4 0.001 0.01 0.1 1 10 100 1000 10000 1e5 1e6");
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks(-0.03, 1.04, 5.0), (vec![0.0, 0.5, 1.0], 1));
        assert_eq!(ticks(980.0, 1020.0, 8.0).0.len(), 9);
        let (places, decimals) = ticks(0.1234, 0.1236, 4.0);
        assert_eq!((places.len(), decimals), (5, 5));
    }
}
