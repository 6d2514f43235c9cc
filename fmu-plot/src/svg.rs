//! Draws a [`Figure`] as SVG, on light or dark paper as the reader's system prefers.

use crate::error::Error;
use crate::figure::{Curve, Figure, Panel, decades, ticks};
use crate::ink::REFERENCE;
use std::fmt::Write as _;

/// Width and height of a panel in pixels: in one column, in several.
const SIZE: [(f64, f64); 2] = [(1060.0, 240.0), (520.0, 270.0)];
/// Space for the legend: next to the panels of one column, above those of several.
const BESIDE: f64 = 240.0;
const ABOVE: f64 = 22.0;
/// Vertical distance of two names.
const LINE: f64 = 17.0;
/// Maximum number of points drawn per curve: the highest and lowest point of as many intervals as the picture resolves.
const STRETCHES: usize = 1000;
/// Maximum distance in pixels of a dropped point from the drawn curve.
const UNSEEN: f64 = 0.08;

/// The library that draws PNG reads attributes; a browser also reads these rules.
pub(crate) const STYLE: &str = "<style>@media (prefers-color-scheme:dark){.plot text{fill:#e3e7ea}.plot .paper{fill:#15191c}\
    .plot .grid{stroke:#374047}.plot .dot{fill:#e3e7ea}}</style>";

/// Draws an SVG.
///
/// # Errors
/// There is nothing to draw.
pub fn draw(figure: &Figure) -> Result<String, Error> {
    if figure.is_empty() {
        return Err(Error::Empty);
    }
    let (width, height) = SIZE[usize::from(figure.columns > 1)];
    let beside = figure.columns == 1;
    // As high as the names beside it require.
    let height_of = |panel: &Panel| if beside { height.max(LINE * count(panel.curves.len()) + 20.0) } else { height };
    let all_width = width * count(figure.columns.min(figure.panels.len()));
    let all_height: f64 = figure.panels.iter().step_by(figure.columns).map(height_of).sum();
    let mut top = 0.0;
    let mut svg = format!(
        "<svg class=\"plot\" xmlns=\"http://www.w3.org/2000/svg\" width=\"{all_width}\" height=\"{all_height}\" \
         viewBox=\"0 0 {all_width} {all_height}\" font-family=\"sans-serif\" font-size=\"12\">\n{STYLE}\n\
         <rect class=\"paper\" width=\"{all_width}\" height=\"{all_height}\" fill=\"#ffffff\"/>\n"
    );
    for (k, panel) in figure.panels.iter().enumerate() {
        let (x, y, height) = (width * count(k % figure.columns), top, height_of(panel));
        if (k + 1) % figure.columns == 0 {
            top += height;
        }
        let above = if panel.title.is_empty() { 0.0 } else { 18.0 } + if beside { 10.0 } else { ABOVE };
        let right = if beside { BESIDE } else { 14.0 };
        let area = Area::new(panel, [x + 66.0, y + above, x + width - right, y + height - 40.0]);
        area.draw(panel, figure.x, &mut svg);
        if !panel.title.is_empty() {
            text(&mut svg, (area.left, y + 15.0), "start\" font-weight=\"bold", &panel.title);
        }
        let mut at = if beside { (area.right + 14.0, area.top + 10.0) } else { (area.left, area.top - 8.0) };
        for Curve { name, ink, opacity, fill, dashed, lost, .. } in &panel.curves {
            let (dash, wide) =
                (if *dashed { " stroke-dasharray=\"5 3\"" } else { "" }, if *fill < 1.0 { 2.5 } else { 9.0 });
            let _ = writeln!(
                svg,
                "<path d=\"M{:.1} {:.1}h18\" stroke=\"{ink}\" stroke-opacity=\"{opacity}\" stroke-width=\"{wide}\"{dash}/>",
                at.0,
                at.1 - 4.0
            );
            let label = if *lost { format!("{name} ✕ lost") } else { name.clone() };
            text(&mut svg, (at.0 + 24.0, at.1), "start", &label);
            // A letter is about 6.2 pixels wide.
            at = if beside { (at.0, at.1 + LINE) } else { (at.0 + 42.0 + 6.2 * count(label.chars().count()), at.1) };
        }
    }
    Ok(svg + "</svg>\n")
}

/// Text at a position; `anchor` may close its attribute and open others.
pub(crate) fn text(svg: &mut String, (x, y): (f64, f64), anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{words}</text>");
}

pub(crate) fn count(n: usize) -> f64 {
    u32::try_from(n).map_or(f64::MAX, f64::from)
}

/// The area of a panel's curves, in pixels, and the range shown there.
pub(crate) struct Area {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) right: f64,
    pub(crate) bottom: f64,
    pub(crate) window: (f64, f64),
    pub(crate) log: bool,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Area {
    fn new(panel: &Panel, [left, top, right, bottom]: [f64; 4]) -> Self {
        let curves =
            panel.curves.iter().flat_map(|c| c.points().chain((c.fill > 0.0).then_some((panel.window.0, 0.0))));
        let seen = |(x, y): &(f64, f64)| y.is_finite() && (panel.window.0..=panel.window.1).contains(x);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (_, y) in curves.chain(panel.dots.iter().copied()).filter(seen) {
            (low, high) = (low.min(y), high.max(y));
        }
        if low > high {
            (low, high) = (0.0, 0.0);
        }
        let flat = 1e-3 * high.abs().max(low.abs());
        let margin = (0.06 * (high - low)).max(if flat > 0.0 { flat } else { 1.0 });
        let (low, high) = (low - margin, high + margin);
        Self { left, top, right, bottom, window: panel.window, log: panel.log, low, high }
    }

    pub(crate) fn x(&self, x: f64) -> f64 {
        self.left
            + (self.right - self.left) * (x - self.window.0) / (self.window.1 - self.window.0).max(f64::MIN_POSITIVE)
    }

    pub(crate) fn y(&self, y: f64) -> f64 {
        self.bottom - (self.bottom - self.top) * (y - self.low) / (self.high - self.low)
    }

    /// Grid lines with their numbers, and the labels of both axes.
    pub(crate) fn axes(&self, label: &str, unit: &str, svg: &mut String) {
        let Self { left, top, right, bottom, .. } = *self;
        let (places, decimals) = ticks(self.low, self.high, 5.0);
        for place in places {
            let y = self.y(place);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{left:.1} {y:.1}H{right:.1}\" stroke=\"#e1e1e1\"/>");
            text(svg, (left - 8.0, y + 4.0), "end", &number(place, decimals));
        }
        let lines = if self.log {
            decades(self.window.0, self.window.1)
        } else {
            let (places, decimals) = ticks(self.window.0, self.window.1, (right - left) / 75.0);
            places.into_iter().map(|place| (place, number(place, decimals))).collect()
        };
        for (place, label) in lines {
            let x = self.x(place);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{x:.1} {top:.1}V{bottom:.1}\" stroke=\"#e1e1e1\"/>");
            if !label.is_empty() {
                text(svg, (x, bottom + 16.0), "middle", &label);
            }
        }
        text(svg, (0.5 * (left + right), bottom + 32.0), "middle", label);
        let (x, y) = (left - 52.0, 0.5 * (top + bottom));
        text(svg, (x, y), &format!("middle\" transform=\"rotate(-90 {x:.1} {y:.1})"), unit);
    }

    fn draw(&self, panel: &Panel, label: &str, svg: &mut String) {
        let Self { top, bottom, .. } = *self;
        self.axes(label, &panel.unit, svg);
        for (place, words) in &panel.marks {
            let x = self.x(*place);
            let _ = writeln!(svg, "<path d=\"M{x:.1} {top:.1}V{bottom:.1}\" stroke=\"{REFERENCE}\"/>");
            text(svg, (x + 3.0, top - 3.0), "start", words);
        }
        panel.curves.iter().for_each(|curve| self.curve(curve, svg));
        for (x, y) in &panel.dots {
            let (x, y) = (self.x(*x), self.y(*y));
            let _ = writeln!(svg, "<circle class=\"dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3\"/>");
        }
    }

    fn curve(&self, curve: &Curve, svg: &mut String) {
        let Curve { ink, opacity, fill, dashed, .. } = curve;
        let visible: Vec<_> = curve.points().filter(|(x, _)| (self.window.0..=self.window.1).contains(x)).collect();
        for stretch in visible.split(|(_, y)| !y.is_finite()).filter(|stretch| !stretch.is_empty()) {
            let points: Vec<_> = thin(stretch).into_iter().map(|(x, y)| (self.x(x), self.y(y))).collect();
            let line = seen(&points).iter().map(|(x, y)| format!("{x:.2} {y:.2}")).collect::<Vec<_>>().join("L");
            if *fill > 0.0 {
                let (zero, first, last) = (self.y(0.0), points[0].0, points[points.len() - 1].0);
                let area = format!("M{first:.2} {zero:.2}L{line}L{last:.2} {zero:.2}Z");
                let _ = writeln!(svg, "<path d=\"{area}\" fill=\"{ink}\" fill-opacity=\"{fill}\"/>");
            }
            let dash = if *dashed { " stroke-dasharray=\"5 3\"" } else { "" };
            let _ = writeln!(
                svg,
                "<path d=\"M{line}\" fill=\"none\" stroke=\"{ink}\" stroke-width=\"1.5\" stroke-linejoin=\"round\" \
                 stroke-opacity=\"{opacity}\"{dash}/>"
            );
        }
        let end = visible.iter().rfind(|(_, y)| y.is_finite()).filter(|_| curve.lost);
        if let Some((x, y)) = end.map(|(x, y)| (self.x(*x), self.y(*y))) {
            let _ = writeln!(
                svg,
                "<path d=\"M{:.1} {:.1}l10 10m0-10l-10 10\" stroke=\"{ink}\" stroke-width=\"2.5\"/>",
                x - 5.0,
                y - 5.0
            );
        }
    }
}

/// A number of an axis, with a true minus.
fn number(x: f64, decimals: usize) -> String {
    let large = x.abs() >= 1e6 || (decimals > 5 && x != 0.0);
    let text = if large { format!("{x:.3e}") } else { format!("{:.decimals$}", x + 0.0) };
    text.replace('-', "−")
}

/// Drops invisible points and keeps every peak.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let length = points.len().div_ceil(STRETCHES);
    let mut kept = Vec::new();
    for stretch in points.chunks(length) {
        let by_value = |a: &usize, b: &usize| stretch[*a].1.total_cmp(&stretch[*b].1);
        let all = 0..stretch.len();
        let mut ends: Vec<usize> = all.clone().min_by(by_value).into_iter().chain(all.max_by(by_value)).collect();
        ends.sort_unstable();
        ends.dedup();
        kept.extend(ends.into_iter().map(|i| stretch[i]));
    }
    kept
}

/// The points that preserve the shape of a curve (Douglas and Peucker 1973), in pixels.
pub(crate) fn seen(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let [first, between @ .., last] = points else { return points.to_vec() };
    let (x, y) = (last.0 - first.0, last.1 - first.1);
    let length = (x * x + y * y).sqrt().max(f64::MIN_POSITIVE);
    let distance = |p: &(f64, f64)| ((p.0 - first.0) * y - (p.1 - first.1) * x).abs() / length;
    let farthest = (0..between.len()).max_by(|a, b| distance(&between[*a]).total_cmp(&distance(&between[*b])));
    match farthest {
        Some(k) if distance(&between[k]) > UNSEEN => {
            let (mut left, right) = (seen(&points[..=k + 1]), seen(&points[k + 1..]));
            left.pop();
            left.extend(right);
            left
        }
        _ => vec![*first, *last],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ink::CURVES;

    #[test]
    fn peaks_survive_thinning() {
        let mut points: Vec<_> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[77_777].1 = 5.0;
        let kept = thin(&points);
        assert!(kept.len() <= 2 * STRETCHES && kept.contains(&(77_777.0, 5.0)));
    }

    #[test]
    fn a_thinned_curve_keeps_its_corners() {
        let curve: Vec<_> = (0..=100).map(|k| (f64::from(k), f64::from((k - 40).max(0)))).collect();
        assert_eq!(seen(&curve), [(0.0, 0.0), (40.0, 0.0), (100.0, 60.0)]);
        let peak: Vec<_> = (0..=100).map(|k| (f64::from(k), if k == 7 { 1.0 } else { 0.0 })).collect();
        assert!(seen(&peak).contains(&(7.0, 1.0)));
        assert_eq!(seen(&curve[..1]), curve[..1]);
    }

    #[test]
    fn a_gap_a_reference_and_the_end_of_a_lost_run() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 2.0)];
        let mut curve = Curve::through("a & b", CURVES[0], points.into_iter());
        (curve.lost, curve.dashed) = (true, true);
        let panel = Panel { unit: "A".into(), window: (0.0, 4.0), curves: vec![curve], ..Panel::default() };
        let figure = |panels| Figure { title: "x".into(), x: "time in s", columns: 1, panels };
        let text = draw(&figure(vec![panel])).unwrap();
        assert_eq!(text.matches("fill=\"none\"").count(), 2, "{text}");
        assert!(text.contains("a &amp; b ✕ lost") && text.contains("stroke-dasharray") && !text.contains("NaN"));
        assert!(text.contains("l10 10m0-10l-10 10"), "{text}");
        assert!(draw(&figure(Vec::new())).is_err());
    }

    #[test]
    fn a_panel_is_as_high_as_its_names() {
        let curve = |k: usize| Curve::through(format!("x{k}"), CURVES[0], [(0.0, 1.0), (1.0, 2.0)].into_iter());
        let panel = |n: usize| Panel { window: (0.0, 1.0), curves: (0..n).map(curve).collect(), ..Panel::default() };
        let figure = Figure { x: "time in s", columns: 1, panels: vec![panel(20), panel(2)], ..Figure::default() };
        let text = draw(&figure).unwrap();
        // 20 names of 17 pixels and 20 around them, then a panel of the usual height.
        assert!(text.contains("height=\"600\"") && text.matches(">x19</text>").count() == 1, "{text}");
        let places = text.match_indices("text-anchor=\"start\">x").map(|(at, _)| {
            let before = &text[..at];
            before.rsplit("y=\"").next().unwrap().split('"').next().unwrap().parse::<f64>().unwrap()
        });
        let places: Vec<f64> = places.collect();
        assert!(places.windows(2).all(|pair| pair[1] - pair[0] >= 17.0), "{places:?}");
    }
}
