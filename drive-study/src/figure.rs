//! What a plot shows, for the two that draw it: [`crate::plot`] as SVG, [`crate::page`] as a page with zoom.

use crate::ink::{self, Ink};
use crate::overview;
use fmu_import::cosimulation::Recording;
use std::rc::Rc;

/// Panels of one title.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Figure {
    /// What it shows.
    pub title: String,
    /// Label of the horizontal axis.
    pub x: &'static str,
    /// Panels side by side.
    pub columns: usize,
    /// The panels, row by row.
    pub panels: Vec<Panel>,
}

/// Curves of one unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Panel {
    /// What it shows; may be empty.
    pub title: String,
    /// Label of the vertical axis: a unit, or a quantity with its unit.
    pub unit: String,
    /// Range of the horizontal axis.
    pub window: (f64, f64),
    /// The curves, in the order in which they are drawn.
    pub curves: Vec<Curve>,
    /// Single points.
    pub dots: Vec<(f64, f64)>,
    /// Places on the horizontal axis with a label each.
    pub marks: Vec<(f64, String)>,
}

/// A curve.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Name in the legend.
    pub name: String,
    /// Its color.
    pub ink: Ink,
    /// Opacity of the line, 0..1.
    pub opacity: f64,
    /// Opacity of the area between it and zero, 0..1.
    pub fill: f64,
    /// Whether the line is dashed.
    pub dashed: bool,
    /// Horizontal coordinates, in ascending order; curves may share them.
    pub x: Rc<[f64]>,
    /// Vertical coordinates, at most as many: a curve may end early. What is not finite is a gap.
    pub y: Vec<f64>,
    /// Whether it ends because the drive was lost, which is marked.
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

    /// Its points.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.x.iter().copied().zip(self.y.iter().copied())
    }
}

impl Figure {
    /// One panel per display unit, time on the horizontal axis. The reference of a curve has its color, dashed.
    pub fn of(recording: &Recording) -> Self {
        let time: Rc<[f64]> = recording.time.as_slice().into();
        let window = (time.first().copied().unwrap_or_default(), time.last().copied().unwrap_or_default());
        let mut panels: Vec<Panel> = Vec::new();
        for column in &recording.columns {
            let unit = if column.shown_unit().is_empty() { "no unit" } else { column.shown_unit() };
            let at = panels.iter().position(|panel| panel.unit == unit).unwrap_or_else(|| {
                panels.push(Panel { unit: unit.into(), window, ..Panel::default() });
                panels.len() - 1
            });
            let shown = |x: &f64| column.display.as_ref().map_or(*x, |display| display.show(*x));
            let y = column.values.iter().map(shown).collect();
            panels[at].curves.push(Curve::new(column.name.as_str(), ink::REFERENCE, &time, y));
        }
        for panel in &mut panels {
            color(&mut panel.curves);
        }
        Self { title: String::new(), x: "time in s", columns: 1, panels }
    }

    /// Whether there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.panels.iter().all(|panel| panel.curves.iter().all(|c| c.y.is_empty()))
    }
}

/// When the colors are used up, they repeat in a paler tone.
fn color(curves: &mut [Curve]) {
    let names: Vec<String> = curves.iter().map(|curve| curve.name.clone()).collect();
    let (mut colors, mut place) = (Vec::<(Ink, f64)>::new(), 0);
    // The reference of a variable may be of another instance.
    let base = |name: &str| {
        let base = name.strip_suffix("_ref")?;
        let same = names.iter().position(|other| other == base);
        same.or_else(|| names.iter().position(|other| overview::last(other) == overview::last(base)))
    };
    for name in &names {
        colors.push((ink::CURVES[place % 6], if place < 6 { 1.0 } else { 0.5 }));
        place += usize::from(base(name).is_none());
    }
    for (k, curve) in curves.iter_mut().enumerate() {
        let of = base(&names[k]);
        (curve.ink, curve.opacity) = colors[of.unwrap_or(k)];
        curve.dashed = of.is_some();
    }
}

/// Round places for the lines of an axis, and the decimals of their numbers.
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

#[cfg(test)]
mod tests {
    use super::*;
    use fmu_import::cosimulation::Column;

    #[test]
    fn a_panel_for_each_unit_and_a_reference_in_the_color_of_its_curve() {
        let column = |name: &str, unit: &str| Column {
            name: name.into(),
            unit: unit.into(),
            display: None,
            items: Vec::new(),
            values: vec![0.0, 1.0, f64::NAN],
        };
        let columns = vec![column("c.i_a_ref", "A"), column("p.speed", ""), column("p.i_q", "A"), column("p.i_a", "A")];
        let figure = Figure::of(&Recording { time: vec![0.0, 0.5, 1.0], columns, ended_by: None });
        let [currents, speed] = &figure.panels[..] else { panic!("{figure:?}") };
        assert_eq!((currents.unit.as_str(), speed.unit.as_str(), speed.window), ("A", "no unit", (0.0, 1.0)));
        let shown: Vec<_> = currents.curves.iter().map(|c| (c.ink, c.dashed)).collect();
        assert_eq!(shown, [(ink::CURVES[1], true), (ink::CURVES[0], false), (ink::CURVES[1], false)]);
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks(-0.03, 1.04, 5.0), (vec![0.0, 0.5, 1.0], 1));
        assert_eq!(ticks(980.0, 1020.0, 8.0).0.len(), 9);
        let (places, decimals) = ticks(0.1234, 0.1236, 4.0);
        assert_eq!((places.len(), decimals), (5, 5));
    }
}
