//! The output of `reproduce`: the table on the terminal, CSV, plots and `report.html`.

use super::experiment::{Experiment, Record};
use super::figures::PaperFigure;
use drive_tools::error::Result;
use drive_tools::text_table::markdown;
use fmu_plot::figure::Figure;
use fmu_plot::page::{self, escape};
use std::fmt::Write as _;

/// The figures of both standards side by side.
pub(super) struct Table {
    /// Measured through the FMI 2.0 archives, by experiment.
    pub(super) fmi2: Vec<Vec<PaperFigure>>,
    /// Measured through the FMI 3.0 archives, by experiment.
    pub(super) fmi3: Vec<Vec<PaperFigure>>,
}

const HEADINGS: [&str; 6] = ["Fig.", "quantity", "expected", "FMI 2.0", "FMI 3.0", "verdict"];

impl Table {
    /// Whether every figure is as expected.
    pub(super) fn holds(&self) -> bool {
        self.fmi2.iter().chain(&self.fmi3).flatten().all(PaperFigure::holds)
    }

    fn rows(&self) -> impl Iterator<Item = Vec<String>> {
        self.fmi2.iter().flatten().zip(self.fmi3.iter().flatten()).map(|(a, b)| {
            let verdict = if a.holds() && b.holds() { "ok" } else { "OFF" };
            vec![
                a.figure.into(),
                a.quantity.into(),
                format!("{} {}", a.expected, a.unit),
                number(a.measured),
                number(b.measured),
                verdict.into(),
            ]
        })
    }

    /// The table in plain text (Markdown).
    pub(super) fn text(&self) -> String {
        let heads = HEADINGS.map(String::from).to_vec();
        markdown(&std::iter::once(heads).chain(self.rows()).collect::<Vec<_>>())
    }

    /// The figures of one experiment: a column for each quantity.
    fn html(&self, experiment: usize) -> String {
        let (fmi2, fmi3) = (&self.fmi2[experiment], &self.fmi3[experiment]);
        let row = |tag: &str, head: &str, cell: &dyn Fn(&PaperFigure) -> String, figures: &[PaperFigure]| {
            let cells: String = figures.iter().map(cell).collect();
            format!("<tr><{tag} class=\"name\">{head}</{tag}>{cells}</tr>\n")
        };
        let heading = |f: &PaperFigure| {
            let PaperFigure { figure, quantity, unit, .. } = f;
            format!(
                "<th class=\"number\">{}<br><small>Fig. {figure}</small><br><small>{unit}</small></th>",
                escape(quantity)
            )
        };
        let expected = |f: &PaperFigure| {
            format!("<td class=\"number\">{}</td>", escape(&f.expected.to_string()).replace('-', "−"))
        };
        let measured = |f: &PaperFigure| {
            let (class, mark) = if f.holds() { ("in", "✓") } else { ("out", "✗") };
            format!("<td class=\"number {class}\">{} {mark}</td>", number(f.measured).replace('-', "−"))
        };
        format!(
            "<div class=\"scroll\" tabindex=\"0\"><table>\n<thead>{}</thead>\n<tbody>\n{}{}{}</tbody></table></div>\n",
            row("th", "", &heading, fmi2),
            row("th", "expected", &expected, fmi2),
            row("th", "FMI 2.0", &measured, fmi2),
            row("th", "FMI 3.0", &measured, fmi3),
        )
    }
}

/// A number with four significant digits; values below 1e-6 are negligible for every figure and show as 0.
fn number(x: f64) -> String {
    if x.abs() < 1e-6 {
        return "0".into();
    }
    let decimals = (3.0 - x.abs().log10().floor()).clamp(0.0, 9.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0..=9")]
    let decimals = decimals as usize;
    format!("{x:.decimals$}")
}

/// A record as CSV with a heading line; doubles in the shortest form that reads back exactly.
pub(super) fn csv(record: &Record) -> String {
    let columns = record.columns();
    let mut text = columns.map(|(name, _)| format!("\"{name}\"")).join(",");
    text.push('\n');
    for k in 0..record.t.len() {
        for (c, (_, values)) in columns.iter().enumerate() {
            let comma = if c == 0 { "" } else { "," };
            let _ = write!(text, "{comma}{}", values[k]);
        }
        text.push('\n');
    }
    text
}

/// One sentence each on the figures and on the agreement of the two standards.
pub(super) fn verdict(holds: bool, identical: bool) -> String {
    let figures = if holds { "Every figure is inside its tolerance." } else { "Some figures are OFF." };
    let same = if identical { "are equal bit for bit" } else { "DIFFER" };
    format!("{figures} The traces of FMI 2.0 and FMI 3.0 {same}.")
}

/// The page: tables and plots, self-contained; `plots` come with the names of their SVG files.
pub(super) fn html(
    table: &Table,
    identical: bool,
    plots: &[(&str, Figure)],
    experiments: &[Experiment],
) -> Result<String> {
    let class = if table.holds() && identical { "" } else { " off" };
    let mut html = format!(
        "<p>H. Rasmussen, Bulletin of the Polish Academy of Sciences, Technical Sciences 54 (3), 2006, run with the packed \
         FMUs <b>PmsmPlant</b> and <b>SensorlessController</b> in co-simulation with steps of 0.1 ms. The paper's motor \
         table is missing: the motor here is an assumed one of the same class, and expected values are those of an \
         independent model of the same drive.</p>\n<p class=\"verdict{class}\">{}</p>\n\
         <p><span class=\"in\">✓</span> inside, <span class=\"out\">✗</span> outside the tolerance. All numbers as text: \
         <a href=\"table.md\">table.md</a>.</p>\n",
        verdict(table.holds(), identical)
    );
    for (k, s) in experiments.iter().enumerate() {
        let csv = format!("<a href=\"{0}.csv\">{0}.csv</a>", s.id);
        let (figure, title, duration) = (s.figure, escape(s.title), s.duration);
        let _ = write!(html, "<h2>Fig. {figure}: {title}, {duration} s <small>{csv}</small></h2>\n{}", table.html(k));
    }
    for (name, plot) in plots {
        let svg = format!("<a href=\"{name}\">{name}</a>");
        let drawn = page::figure(plot, &format!("The plot without JavaScript: {svg}."))?;
        let _ = write!(html, "<h2>{} <small>{svg}</small></h2>\n{drawn}", escape(&plot.title));
    }
    Ok(page::page("Sensorless speed control including zero speed, reproduced", &html))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expected::Expected;
    use crate::reproduce::experiment::REST;
    use fmu_plot::figure::{Curve, Panel};
    use fmu_plot::ink::REFERENCE;

    #[test]
    fn numbers_have_four_digits() {
        let cases = [(-338.92, "-338.9"), (0.1404, "0.1404"), (36.3412, "36.34"), (1e-12, "0"), (0.012_345, "0.01235")];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn one_figure_off_is_enough() {
        let figure = |measured| PaperFigure {
            figure: "5a",
            quantity: "dip",
            unit: "rpm",
            expected: Expected::Near(1.0, 0.1),
            measured,
        };
        let table = Table { fmi2: vec![vec![figure(1.05)]], fmi3: vec![vec![figure(1.2)]] };
        assert!(!table.holds() && table.text().contains("OFF"));
        let curve = Curve::through("speed", REFERENCE, [(0.0, 1.0), (1.0, 2.0)].into_iter());
        let panels = vec![Panel { window: (0.0, 1.0), curves: vec![curve], ..Panel::default() }];
        let plot = Figure { title: "Fig. 4".into(), x: "time in s", columns: 1, panels };
        let page = html(&table, true, &[("f.svg", plot)], &[Experiment { id: "dip", ..REST }]).unwrap();
        let parts = [
            "in\">1.050 ✓</td>",
            "out\">1.200 ✗</td>",
            "verdict off",
            "<small>rpm</small></th>",
            "href=\"dip.csv\"",
            "href=\"f.svg\"",
        ];
        assert!(parts.iter().all(|part| page.contains(part)), "{page}");
        assert!(!Expected::AtMost(1.0).holds(f64::NAN) && !Expected::Near(1.0, 0.1).holds(f64::NAN));
    }
}
