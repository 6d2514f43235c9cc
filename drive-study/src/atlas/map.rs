//! The map of a drive: a panel per scenario, start angle, speed and load; R^/R to the right, psi^/psi upwards; red where
//! the drive is lost, a dot where `lock_lost` is wrong. A legend explains this.

use super::cell::{Cell, Course};
use super::run::Atlas;
use std::fmt::Write as _;

/// Side of a cell in pixels.
const SIDE: f64 = 13.0;
/// Space around a panel for its labels.
const LEFT: f64 = 44.0;
const TOP: f64 = 20.0;
const BELOW: f64 = 22.0;
/// Width of the longest title, with and without an angle.
const TITLE: f64 = 150.0;
const SHORT_TITLE: f64 = 110.0;
/// Height of a heading.
const HEADING: f64 = 34.0;

const STYLE: &str = ".atlas text{fill:#1d2429;font:11px system-ui,sans-serif}.atlas .head{font-weight:600;font-size:13px}\
    .atlas .paper{fill:#fff}.atlas .h{fill:#cfe3d6}.atlas .l{fill:#d03030}.atlas .d{fill:#fff}.atlas .h+.d{fill:#d03030}\
    @media (prefers-color-scheme:dark){.atlas text{fill:#e3e7ea}.atlas .paper{fill:#15191c}.atlas .h{fill:#2c4a3a}\
    .atlas .l{fill:#d84848}.atlas .h+.d{fill:#f07070}}";

/// Class of a cell, whether it has a dot, and the meaning.
const LEGEND: [(&str, bool, &str); 4] = [
    ("h", false, "held"),
    ("l", false, "lost, and lock_lost reports it: it is 1 or more within 1 s"),
    ("l", true, "white dot: lost, and lock_lost does not report it within 1 s"),
    ("h", true, "red dot: held although lock_lost is 1 or more (false alarm)"),
];
/// Height of a line of the legend, and width of its longest.
const LINE: f64 = 18.0;
const LEGEND_WIDTH: f64 = 450.0;

/// A cell with its upper left corner at `(x, y)`.
fn square((x, y): (f64, f64), class: &str, dot: bool) -> String {
    let side = SIDE - 1.0;
    let mut text = format!("<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{side}\" height=\"{side}\"/>");
    if dot {
        let (x, y) = (x + 0.5 * side, y + 0.5 * side);
        let _ = write!(text, "\n<circle class=\"d\" cx=\"{x}\" cy=\"{y}\" r=\"3\"/>");
    }
    text + "\n"
}

/// The different values in ascending order.
fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

fn index(values: &[f64], x: f64) -> f64 {
    let at = values.iter().position(|v| v.to_bits() == x.to_bits()).unwrap_or_default();
    u32::try_from(at).map_or(0.0, f64::from)
}

fn count(values: &[f64]) -> f64 {
    u32::try_from(values.len()).map_or(0.0, f64::from)
}

/// A share in percent with one decimal, or none.
pub(super) fn percent(share: f64) -> String {
    let text = format!("{:.1}", 100.0 * share);
    format!("{} %", text.strip_suffix(".0").unwrap_or(&text))
}

/// Title and axes of the panel with its upper left corner at `(x, y)`.
fn labels((x, y): (f64, f64), title: &str, R: &[f64], psi: &[f64]) -> String {
    let ends = |values: &[f64]| (values[0], values[values.len() - 1]);
    let ((low, high), (least, most)) = (ends(R), ends(psi));
    let (right, bottom) = (x + SIDE * count(R), y + SIDE * count(psi));
    let text = |x: f64, y: f64, anchor: &str, text: &str| {
        format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>")
    };
    [
        text(x, y - 5.0, "start", title),
        text(x, bottom + 12.0, "start", &low.to_string()),
        text(0.5 * (x + right), bottom + 12.0, "middle", "R̂/R"),
        text(right, bottom + 12.0, "end", &high.to_string()),
        text(x - 4.0, y + 10.0, "end", &most.to_string()),
        text(x - 4.0, 0.5 * (y + bottom) + 4.0, "end", "ψ̂/ψ"),
        text(x - 4.0, bottom - 2.0, "end", &least.to_string()),
    ]
    .concat()
        + "\n"
}

/// Draws the map as SVG.
pub fn svg(atlas: &Atlas) -> String {
    let axis = |of: fn(&Cell) -> f64| sorted(atlas.runs.iter().map(|(cell, _)| of(cell)));
    let [R, psi, loads, speeds, angles] =
        [axis(|c| c.R), axis(|c| c.psi), axis(|c| c.load), axis(|c| c.speed), axis(|c| c.theta)];
    let has = |s: &&Course| atlas.runs.iter().any(|(cell, _)| cell.scenario == **s);
    let scenarios: Vec<Course> = Course::ALL.iter().filter(has).copied().collect();
    // No title may reach into the next panel.
    let title = if angles.len() > 1 { TITLE } else { SHORT_TITLE };
    let (panel_width, panel_height) = (LEFT + (SIDE * count(&R)).max(title), TOP + SIDE * count(&psi) + BELOW);
    let rows = count(&speeds) * count(&angles);
    let block = HEADING + rows * panel_height;
    let (width, mut height) = ((panel_width * count(&loads) + 10.0).max(LEGEND_WIDTH), 10.0);
    let mut body = String::new();
    for (class, dot, meaning) in LEGEND {
        body += &square((6.0, height), class, dot);
        let _ = writeln!(body, "<text x=\"26\" y=\"{}\">{meaning}</text>", height + 10.0);
        height += LINE;
    }
    for scenario in scenarios {
        let _ = writeln!(
            body,
            "<text class=\"head\" x=\"6\" y=\"{}\">{}: {}</text>",
            height + 20.0,
            scenario.name(),
            scenario.title()
        );
        let corner = |cell: &Cell| {
            let row = index(&angles, cell.theta) * count(&speeds) + index(&speeds, cell.speed);
            (panel_width * index(&loads, cell.load) + LEFT, height + HEADING + row * panel_height + TOP)
        };
        for &theta in &angles {
            for &speed in &speeds {
                for &load in &loads {
                    let at = corner(&Cell { scenario, R: 1.0, psi: 1.0, load, speed, theta });
                    let angle = if angles.len() > 1 { format!(", {theta}°") } else { String::new() };
                    let title = format!("n {}, load {}{angle}", percent(speed), percent(load));
                    body.push_str(&labels(at, &title, &R, &psi));
                }
            }
        }
        for (cell, verdict) in atlas.runs.iter().filter(|(cell, _)| cell.scenario == scenario) {
            let (x, y) = corner(cell);
            let x = x + SIDE * index(&R, cell.R);
            let y = y + SIDE * (count(&psi) - 1.0 - index(&psi, cell.psi));
            let class = if verdict.lost.is_some() { "l" } else { "h" };
            body += &square((x, y), class, !verdict.lock_lost_is_right());
        }
        height += block + 10.0;
    }
    format!(
        "<svg class=\"atlas\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" role=\"img\" aria-label=\"Map of lost cells\">\n<style>{STYLE}</style>\n\
         <rect class=\"paper\" width=\"{width}\" height=\"{height}\"/>\n{body}</svg>\n"
    )
}
