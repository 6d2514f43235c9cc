//! A map in colors over a plane: filled contours, lines and marks, drawn as SVG on light or dark paper.
//!
//! The areas above the levels are painted one over the other, from the lowest level up; points without a value stay blank. The
//! element carries the data that a script needs to locate a point of the plane: `data-area` (left, top, right and bottom of the
//! axes in pixels) and `data-window` (their ranges).

use crate::contour::{Field, Place};
use crate::error::Error;
use crate::ink::Ink;
use crate::svg::{Area, STYLE, count, seen, text};
use std::fmt::Write as _;

/// Width and height in pixels, and the space for the legend.
const SIZE: (f64, f64) = (900.0, 620.0);
const BESIDE: f64 = 124.0;
/// Minimum length in pixels of a labeled contour, and minimum distance of the label from the border.
const LONG: f64 = 70.0;
const BORDER: f64 = 14.0;

const OWN_STYLE: &str = "<style>.chart .edge{stroke:#1d2429}.chart .faint{stroke:#5c6a73}.chart text.on{fill:#1d2429;stroke:#fff;\
    stroke-width:3px;stroke-opacity:.8;paint-order:stroke}.chart .dot{fill:#fff;stroke:#1d2429}\
    @media (prefers-color-scheme:dark){.chart .edge{stroke:#e3e7ea}.chart .faint{stroke:#9aa7b0}\
    .chart text.on{fill:#1d2429}}</style>";

/// What the map shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Labels of the axes.
    pub labels: [String; 2],
    /// Range of the horizontal axis.
    pub window: (f64, f64),
    /// Range of the vertical axis.
    pub range: (f64, f64),
    /// The fields; adjacent fields share their levels.
    pub fields: Vec<Field>,
    /// Heading of the legend.
    pub legend: String,
    /// The levels in ascending order; the first may be minus infinity.
    pub bands: Vec<Band>,
    /// Lines over the areas.
    pub lines: Vec<Line>,
    /// Positions on the horizontal axis with a label each, in ascending order.
    pub marks: Vec<(f64, String)>,
    /// Points with a label each.
    pub dots: Vec<(Place, String)>,
}

/// The values from a level up to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Level.
    pub level: f64,
    /// Name on the contour; may be empty.
    pub name: String,
    /// Name in the legend.
    pub legend: String,
    /// Color.
    pub ink: Ink,
}

/// A line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Line {
    /// Its points.
    pub points: Vec<Place>,
    /// Thick, or thin and dashed.
    pub thick: bool,
    /// A label at its last point; may be empty.
    pub label: String,
}

/// Draws an SVG.
///
/// # Errors
/// There is nothing to draw.
pub fn draw(chart: &Chart) -> Result<String, Error> {
    if chart.fields.iter().all(|field| field.values.iter().all(|x| !x.is_finite())) {
        return Err(Error::Empty);
    }
    let (width, height) = SIZE;
    let (window, (low, high)) = (chart.window, chart.range);
    let (right, bottom) = (width - BESIDE, height - 44.0);
    let area = Area { left: 66.0, top: 34.0, right, bottom, window, log: false, low, high };
    let Area { left, top, right, bottom, .. } = area;
    let mut svg = format!(
        "<svg class=\"plot chart\" xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" font-size=\"12\" data-area=\"{left} {top} {right} {bottom}\" \
         data-window=\"{} {} {low} {high}\">\n{STYLE}\n{OWN_STYLE}\n\
         <rect class=\"paper\" width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n",
        window.0, window.1
    );
    area.axes(&chart.labels[0], &chart.labels[1], &mut svg);
    text(&mut svg, (left, 18.0), "start\" font-weight=\"bold", &chart.title);
    let marks = chart.marks.iter().map(|(place, _)| area.x(*place)).collect();
    let mut labels = Labels { area: &area, marks, placed: Vec::new(), texts: String::new() };
    for band in &chart.bands {
        fill(chart, band, &area, &mut labels, &mut svg);
    }
    for line in &chart.lines {
        let points: Vec<Place> = line.points.iter().map(|p| (area.x(p.0), area.y(p.1))).collect();
        let style = if line.thick {
            "class=\"edge\" stroke=\"#1d2429\" stroke-width=\"2\""
        } else {
            "class=\"faint\" stroke=\"#5c6a73\" stroke-width=\"0.8\" stroke-dasharray=\"4 3\""
        };
        let path = path(&points);
        if !line.thick {
            // A light line below the dashes, for dark areas.
            let _ = writeln!(
                svg,
                "<path d=\"{path}\" fill=\"none\" stroke=\"#ffffff\" stroke-opacity=\"0.4\" stroke-width=\"1.6\"/>"
            );
        }
        let _ = writeln!(svg, "<path d=\"{path}\" fill=\"none\" {style}/>");
        if let Some(&(x, y)) = points.last().filter(|_| !line.label.is_empty()) {
            // Beside the end of the line, away from the middle of the picture.
            let y = if y > 0.5 * (top + bottom) { y + 11.0 } else { y };
            labels.put((x, y), "middle", &line.label);
        }
    }
    for (k, (place, words)) in chart.marks.iter().enumerate() {
        let x = area.x(*place);
        let crowded = k > 0 && x - area.x(chart.marks[k - 1].0) < 17.0;
        let _ = writeln!(
            svg,
            "<path d=\"M{x:.1} {top:.1}V{bottom:.1}\" class=\"edge\" stroke=\"#1d2429\" stroke-width=\"1\" \
             stroke-dasharray=\"7 3 1.5 3\"/>"
        );
        let x = if crowded { x + 13.0 } else { x - 4.0 };
        labels.put((x, top + 6.0), &format!("end\" transform=\"rotate(-90 {x:.1} {:.1})", top + 6.0), words);
    }
    for ((x, y), words) in &chart.dots {
        let (x, y) = (area.x(*x), area.y(*y));
        let _ = writeln!(
            svg,
            "<circle class=\"dot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"#fff\" stroke=\"#1d2429\"/>"
        );
        // A letter is about 6.2 pixels wide.
        let outside = x + 7.0 + 6.2 * count(words.chars().count()) > right;
        let (x, anchor) = if outside { (x - 7.0, "end") } else { (x + 7.0, "start") };
        labels.put((x, y + 4.0), anchor, words);
    }
    svg.push_str(&labels.texts);
    text(&mut svg, (right + 16.0, top + 10.0), "start\" font-weight=\"bold", &chart.legend);
    for (k, band) in chart.bands.iter().rev().enumerate() {
        let y = top + 22.0 + 21.0 * count(k);
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{y:.1}\" width=\"24\" height=\"21\" fill=\"{}\"/>",
            right + 16.0,
            band.ink
        );
        text(&mut svg, (right + 46.0, y + 15.0), "start", &band.legend);
    }
    Ok(svg + "</svg>\n")
}

/// Paints the areas of a band, draws their contours and labels the longest of each field.
fn fill(chart: &Chart, band: &Band, area: &Area, labels: &mut Labels<'_>, svg: &mut String) {
    let (mut areas, mut contours) = (String::new(), String::new());
    for field in &chart.fields {
        let above = field.above(band.level);
        let pixels = |line: &[Place]| line.iter().map(|p| (area.x(p.0), area.y(p.1))).collect::<Vec<Place>>();
        for ring in &above.rings {
            areas += &closed(&pixels(ring));
        }
        let lines: Vec<Vec<Place>> = above.lines.iter().map(|line| pixels(line)).collect();
        contours.extend(lines.iter().map(|line| path(line)));
        let longest = lines.iter().max_by(|a, b| length(a).total_cmp(&length(b)));
        if let Some(line) = longest.filter(|line| length(line) > LONG && !band.name.is_empty()) {
            labels.along(line, &band.name);
        }
    }
    if !areas.is_empty() {
        let _ = writeln!(svg, "<path d=\"{areas}\" fill=\"{}\"/>", band.ink);
    }
    if !contours.is_empty() {
        let _ = writeln!(svg, "<path d=\"{contours}\" fill=\"none\" stroke=\"#1d2429\" stroke-width=\"0.7\"/>");
    }
}

/// Labels on the areas, drawn last.
struct Labels<'a> {
    area: &'a Area,
    marks: Vec<f64>,
    placed: Vec<Place>,
    texts: String,
}

impl Labels<'_> {
    fn put(&mut self, at: Place, anchor: &str, words: &str) {
        self.placed.push(at);
        text(&mut self.texts, at, &format!("{anchor}\" class=\"on"), words);
    }

    /// A label on the point of a line that is farthest from other labels, from marks and from the border.
    fn along(&mut self, line: &[Place], words: &str) {
        let Area { left, top, right, bottom, .. } = *self.area;
        let room = |p: &Place| {
            let border = [p.0 - left, right - p.0, p.1 - top, bottom - p.1].into_iter().fold(f64::INFINITY, f64::min);
            let others = self.placed.iter().map(|q| (q.0 - p.0).hypot(q.1 - p.1)).fold(f64::INFINITY, f64::min);
            let marks = self.marks.iter().map(|x| 2.0 * (x - p.0).abs()).fold(f64::INFINITY, f64::min);
            others.min(border).min(marks)
        };
        let best = line.iter().max_by(|a, b| room(a).total_cmp(&room(b))).filter(|p| room(p) > BORDER);
        if let Some(&(x, y)) = best {
            self.put((x, y + 4.0), "middle", words);
        }
    }
}

fn length(line: &[Place]) -> f64 {
    line.windows(2).map(|pair| (pair[1].0 - pair[0].0).hypot(pair[1].1 - pair[0].1)).sum()
}

/// An open path without its invisible points. A closed line is cut where it is farthest from its start.
fn path(points: &[Place]) -> String {
    let [first, .., last] = points else { return String::new() };
    let kept = if first == last {
        let distance = |k: &usize| (points[*k].0 - first.0).hypot(points[*k].1 - first.1);
        let far = (1..points.len() - 1).max_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        let (mut there, back) = (seen(&points[..=far]), seen(&points[far..]));
        there.pop();
        there.extend(back);
        there
    } else {
        seen(points)
    };
    format!("M{}", kept.iter().map(|(x, y)| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join("L"))
}

fn closed(ring: &[Place]) -> String {
    let around: Vec<Place> = ring.iter().chain(ring.first()).copied().collect();
    path(&around) + "Z"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        let places: Vec<Place> = (0..441).map(|k| (f64::from(k % 21), f64::from(k / 21))).collect();
        let values = places.iter().map(|&(x, y)| if y > 18.0 { f64::NAN } else { 100.0 - (x - 10.0).hypot(y - 9.0) });
        let field = Field { columns: 21, values: values.collect(), places };
        let band = |level: f64, name: &str, ink| Band { level, name: name.into(), legend: format!("{name} %"), ink };
        Chart {
            title: "a <b>".into(),
            labels: ["x".into(), "y".into()],
            window: (0.0, 20.0),
            range: (0.0, 20.0),
            fields: vec![field],
            bands: vec![band(f64::NEG_INFINITY, "", "#440154"), band(95.0, "95", "#35b779")],
            lines: vec![Line { points: vec![(0.0, 0.0), (5.0, 19.0)], thick: false, label: "2 kW".into() }],
            marks: vec![(6.0, "base speed".into()), (6.2, "MTPV".into())],
            dots: vec![((10.0, 9.0), "best".into())],
            ..Chart::default()
        }
    }

    #[test]
    fn a_map_has_areas_contours_labels_and_marks() {
        let svg = draw(&chart()).unwrap();
        assert!(svg.contains("a &lt;b&gt;") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!((svg.matches("fill=\"#440154\"").count(), svg.matches("fill=\"#35b779\"").count()), (2, 2));
        for words in
            [">95</text>", ">2 kW</text>", ">base speed</text>", ">MTPV</text>", ">best</text>", ">95 %</text>"]
        {
            assert_eq!(svg.matches(words).count(), 1, "{words}");
        }
        assert!(svg.contains("data-area=\"66 34 776 576\" data-window=\"0 20 0 20\""));
        // The area without field values, above y = 18, stays blank.
        let painted = svg.split("<path d=\"M").nth(1).unwrap();
        assert!(painted.starts_with("66.0 "), "{painted}");
        let top = 576.0 - 542.0 * 18.0 / 20.0;
        let ends = painted.split('"').next().unwrap().trim_end_matches('Z').split('L');
        let highest = ends.map(|p| p.split(' ').nth(1).unwrap().parse::<f64>().unwrap()).fold(f64::INFINITY, f64::min);
        assert!((highest - top).abs() < 0.06, "{highest}, not {top}");
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        let mut empty = chart();
        empty.fields[0].values.fill(f64::NAN);
        assert!(draw(&empty).is_err());
    }
}
