//! The paper's Fig. 4 and Fig. 5, drawn in its own layout as SVG.

use super::scenario::Trace;
use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;

/// One curve of a panel.
struct Curve<'a> {
    name: &'static str,
    color: RGBColor,
    values: &'a [f64],
}

/// One panel of a figure.
struct Panel<'a> {
    title: &'static str,
    unit: &'static str,
    trace: &'a Trace,
    /// Time window in s.
    window: (f64, f64),
    curves: Vec<Curve<'a>>,
    /// A place where the legend hides no curve.
    legend: SeriesLabelPosition,
}

const BLUE_INK: RGBColor = RGBColor(0, 84, 166);
const RED_INK: RGBColor = RGBColor(200, 60, 40);
const GRAY: RGBColor = RGBColor(150, 150, 150);

/// Maximum number of points per curve; more would not be visible at the size of a panel.
const POINTS: usize = 600;
/// Maximum distance of a dropped point from the drawn curve, relative to the panel's width and height.
const UNSEEN: f64 = 5e-4;

impl Panel<'_> {
    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<()> {
        let t = &self.trace.t;
        let from = t.partition_point(|x| *x < self.window.0);
        let to = t.partition_point(|x| *x <= self.window.1);
        let inside = |c: &Curve<'_>| c.values[from..to].to_vec();
        let all: Vec<f64> = self.curves.iter().flat_map(inside).collect();
        let low = all.iter().copied().fold(f64::INFINITY, f64::min);
        let high = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let margin = (0.08 * (high - low)).max(1e-3);
        let mut chart = ChartBuilder::on(area)
            .caption(self.title, ("sans-serif", 18))
            .margin(8)
            .x_label_area_size(38)
            .y_label_area_size(64)
            .build_cartesian_2d(self.window.0..self.window.1, low - margin..high + margin)
            .map_err(drawing)?;
        chart
            .configure_mesh()
            .x_desc("t [s]")
            .y_desc(self.unit)
            .x_label_formatter(&tick)
            .y_label_formatter(&tick)
            .light_line_style(TRANSPARENT)
            .bold_line_style(RGBColor(225, 225, 225))
            .label_style(("sans-serif", 15))
            .draw()
            .map_err(drawing)?;
        let stride = (to - from).div_ceil(POINTS).max(1);
        for Curve { name, color, values } in &self.curves {
            let style = color.stroke_width(if *color == GRAY { 1 } else { 2 });
            let points: Vec<_> = (from..to).step_by(stride).map(|k| (t[k], values[k])).collect();
            let points = seen(&points, (self.window.1 - self.window.0, high - low + 2.0 * margin));
            let series = chart.draw_series(LineSeries::new(points, style)).map_err(drawing)?;
            series.label(*name).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style));
        }
        if self.curves.len() > 1 {
            chart
                .configure_series_labels()
                .position(self.legend.clone())
                .background_style(WHITE.mix(0.8))
                .border_style(GRAY)
                .label_font(("sans-serif", 15))
                .draw()
                .map_err(drawing)?;
        }
        Ok(())
    }
}

/// The points that preserve the shape of a curve (Douglas and Peucker 1973); `size` is that of the panel.
fn seen(points: &[(f64, f64)], size: (f64, f64)) -> Vec<(f64, f64)> {
    let [first, between @ .., last] = points else { return points.to_vec() };
    let place = |p: &(f64, f64)| ((p.0 - first.0) / size.0, (p.1 - first.1) / size.1);
    let (x, y) = place(last);
    let length = (x * x + y * y).sqrt().max(f64::MIN_POSITIVE);
    let distance = |p: &(f64, f64)| {
        let (a, b) = place(p);
        (a * y - b * x).abs() / length
    };
    let farthest = (0..between.len()).max_by(|a, b| distance(&between[*a]).total_cmp(&distance(&between[*b])));
    match farthest {
        Some(k) if distance(&between[k]) > UNSEEN => {
            let (mut left, right) = (seen(&points[..=k + 1], size), seen(&points[k + 1..], size));
            left.pop();
            left.extend(right);
            left
        }
        _ => vec![*first, *last],
    }
}

#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err requires")]
fn drawing<E: std::error::Error + Send + Sync>(error: DrawingAreaErrorKind<E>) -> anyhow::Error {
    anyhow!("drawing a plot: {error}")
}

/// A tick's number in its shortest form.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that plotters requires")]
pub(crate) fn tick(x: &f64) -> String {
    ((x * 1e6).round() / 1e6).to_string()
}

/// Panels in rows of two.
fn page(panels: &[Panel<'_>]) -> Result<String> {
    let mut svg = String::new();
    {
        let rows = panels.len().div_ceil(2);
        let height = u32::try_from(rows * 260)?;
        let root = SVGBackend::with_string(&mut svg, (1000, height)).into_drawing_area();
        root.fill(&WHITE).map_err(drawing)?;
        for (panel, area) in panels.iter().zip(root.split_evenly((rows, 2))) {
            panel.draw(&area)?;
        }
        root.present().map_err(drawing)?;
    }
    Ok(svg)
}

fn speed<'a>(title: &'static str, trace: &'a Trace, window: (f64, f64)) -> Panel<'a> {
    let curves = vec![
        Curve { name: "reference", color: GRAY, values: &trace.speed_ref },
        Curve { name: "true", color: RED_INK, values: &trace.speed },
        Curve { name: "estimated", color: BLUE_INK, values: &trace.speed_est },
    ];
    Panel { title, unit: "rpm", trace, window, curves, legend: SeriesLabelPosition::LowerRight }
}

fn currents<'a>(title: &'static str, trace: &'a Trace, window: (f64, f64)) -> Panel<'a> {
    let curves = vec![
        Curve { name: "i_sd", color: BLUE_INK, values: &trace.i_d },
        Curve { name: "i_sq", color: RED_INK, values: &trace.i_q },
    ];
    Panel { title, unit: "A", trace, window, curves, legend: SeriesLabelPosition::MiddleRight }
}

fn error<'a>(title: &'static str, trace: &'a Trace, window: (f64, f64)) -> Panel<'a> {
    let curves = vec![Curve { name: "error", color: BLUE_INK, values: &trace.error }];
    Panel { title, unit: "deg", trace, window, curves, legend: SeriesLabelPosition::UpperRight }
}

/// Fig. 4: start from 180 deg (speed, angle) and the four speed steps.
///
/// # Errors
/// When drawing fails.
pub fn figure_4(start: &Trace, steps: [&Trace; 4]) -> Result<String> {
    let angles = vec![
        Curve { name: "true", color: RED_INK, values: &start.theta_e },
        Curve { name: "estimated", color: BLUE_INK, values: &start.theta_est },
    ];
    let (window, title) = ((0.15, 0.5), "(b) start from 180°: electrical rotor angle");
    let legend = SeriesLabelPosition::LowerLeft;
    let angle = Panel { title, unit: "deg", trace: start, window, curves: angles, legend };
    page(&[
        speed("(a) start from 180°: speed", start, (0.1, 1.0)),
        angle,
        speed("(c) 0 - 20 rpm", steps[0], (0.0, 1.0)),
        speed("(d) 0 - 500 rpm", steps[1], (0.0, 0.6)),
        speed("(e) 0 - 1000 rpm", steps[2], (0.0, 0.6)),
        speed("(f) 0 - 1500 rpm", steps[3], (0.0, 0.6)),
    ])
}

/// Section 3.2: the second start after a return to zero speed.
///
/// # Errors
/// When drawing fails.
pub(super) fn second_start(start: &Trace) -> Result<String> {
    page(&[
        speed("first start, stop, second start: speed", start, (0.0, 3.2)),
        error("first start, stop, second start: angle error", start, (0.0, 3.2)),
    ])
}

/// Fig. 5: load steps at 0 rpm (left) and 1000 rpm (right).
///
/// # Errors
/// When drawing fails.
pub fn figure_5(at_0: &Trace, at_1000: &Trace) -> Result<String> {
    let (left, right) = ((0.3, 2.5), (0.8, 2.0));
    page(&[
        speed("(a) 2 N.m at 0 rpm: speed", at_0, left),
        speed("(b) 2 N.m at 1000 rpm: speed", at_1000, right),
        currents("(c) currents", at_0, left),
        currents("(d) currents", at_1000, right),
        error("(e) angle error", at_0, left),
        error("(f) angle error", at_1000, right),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_curve_keeps_its_corners() {
        let curve: Vec<_> = (0..=100).map(|k| (f64::from(k), f64::from((k - 40).max(0)))).collect();
        assert_eq!(seen(&curve, (100.0, 60.0)), [(0.0, 0.0), (40.0, 0.0), (100.0, 60.0)]);
        let peak: Vec<_> = (0..=100).map(|k| (f64::from(k), if k == 7 { 1.0 } else { 0.0 })).collect();
        assert!(seen(&peak, (100.0, 1.0)).contains(&(7.0, 1.0)));
        assert_eq!(seen(&curve[..1], (1.0, 1.0)), curve[..1]);
    }
}
