//! The output of `reproduce`: the table on the terminal, CSV, plots and `report.html`.

use super::figures::Figure;
use super::scenario::{Scenario, Trace};
use std::fmt::Write as _;

/// The figures of both standards side by side.
pub(super) struct Table {
    /// Measured through the FMI 2.0 archives.
    pub(super) fmi2: Vec<Figure>,
    /// Measured through the FMI 3.0 archives.
    pub(super) fmi3: Vec<Figure>,
}

const HEADINGS: [&str; 6] = ["Fig.", "quantity", "expected", "FMI 2.0", "FMI 3.0", "verdict"];

impl Table {
    /// Whether every figure is as expected.
    pub(super) fn holds(&self) -> bool {
        self.fmi2.iter().chain(&self.fmi3).all(Figure::holds)
    }

    fn rows(&self) -> impl Iterator<Item = ([String; 6], bool)> {
        self.fmi2.iter().zip(&self.fmi3).map(|(a, b)| {
            let holds = a.holds() && b.holds();
            let verdict = if holds { "ok" } else { "OFF" };
            let row = [
                a.figure.into(),
                a.quantity.into(),
                format!("{} {}", a.expected, a.unit),
                number(a.measured),
                number(b.measured),
                verdict.into(),
            ];
            (row, holds)
        })
    }

    /// The table in plain text (Markdown).
    pub(super) fn text(&self) -> String {
        let mut rows = vec![HEADINGS.map(String::from)];
        rows.extend(self.rows().map(|(row, _)| row));
        let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; 6] = std::array::from_fn(width);
        let mut text = String::new();
        for (k, row) in rows.iter().enumerate() {
            for (cell, width) in row.iter().zip(widths) {
                let _ = write!(text, "| {cell}{} ", " ".repeat(width - cell.chars().count()));
            }
            text.push_str("|\n");
            if k == 0 {
                for width in widths {
                    let _ = write!(text, "|{}", "-".repeat(width + 2));
                }
                text.push_str("|\n");
            }
        }
        text
    }

    fn html(&self) -> String {
        let mut html = String::from("<table><thead><tr>");
        for heading in HEADINGS {
            let _ = write!(html, "<th>{heading}</th>");
        }
        html.push_str("</tr></thead><tbody>\n");
        for (row, holds) in self.rows() {
            html.push_str(if holds { "<tr>" } else { "<tr class=\"off\">" });
            for cell in row {
                let _ = write!(html, "<td>{}</td>", escape(&cell));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table>\n");
        html
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

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// A trace as CSV with a heading line; doubles in the shortest form that reads back exactly.
pub(super) fn csv(trace: &Trace) -> String {
    let columns = trace.columns();
    let mut text = columns.map(|(name, _)| format!("\"{name}\"")).join(",");
    text.push('\n');
    for k in 0..trace.t.len() {
        for (c, (_, values)) in columns.iter().enumerate() {
            let comma = if c == 0 { "" } else { "," };
            let _ = write!(text, "{comma}{}", values[k]);
        }
        text.push('\n');
    }
    text
}

/// The verdicts on the figures and on the agreement of the two standards, one sentence each.
pub(super) fn verdict(holds: bool, identical: bool) -> String {
    let figures = if holds { "Every figure is inside its tolerance." } else { "Some figures are OFF." };
    let same = if identical { "are equal bit for bit" } else { "DIFFER" };
    format!("{figures} The traces of FMI 2.0 and FMI 3.0 {same}.")
}

/// The page: the table and the plots, self-contained.
pub(super) fn html(table: &Table, identical: bool, plots: &[(&str, &str)], scenarios: &[Scenario]) -> String {
    let verdict = verdict(table.holds(), identical);
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Rasmussen 2006, reproduced</title>\n\
         <style>body{{font-family:sans-serif;max-width:1040px;margin:2em auto;padding:0 1em;color:#222;line-height:1.45}}\
         table{{border-collapse:collapse;font-size:.92em}}td,th{{border-bottom:1px solid #ddd;padding:.25em .7em;\
         text-align:left}}th{{background:#f3f3f3}}tr.off td{{background:#fdd}}svg{{max-width:100%;height:auto}}</style>\
         </head><body>\n<h1>Sensorless speed control including zero speed, reproduced</h1>\n\
         <p>H. Rasmussen, Bulletin of the Polish Academy of Sciences, Technical Sciences 54 (3), 2006, run with the packed \
         FMUs <b>PmsmPlant</b> and <b>SensorlessController</b> in co-simulation with steps of 0.1 ms. The paper's motor \
         table is missing: the motor here is an assumed one of the same class, and expected values are those of an \
         independent model of the same drive. {verdict}</p>\n",
    );
    html.push_str(&table.html());
    for (title, svg) in plots {
        let _ = write!(html, "<h2>{title}</h2>\n{svg}\n");
    }
    html.push_str("<h2>Experiments</h2>\n<ul>\n");
    for s in scenarios {
        let _ = writeln!(html, "<li>Fig. {}: {}, {} s (<code>{}.csv</code>)</li>", s.figure, s.title, s.duration, s.id);
    }
    html.push_str("</ul>\n</body></html>\n");
    html
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::figures::Expected;

    #[test]
    fn numbers_have_four_digits() {
        let cases = [(-338.92, "-338.9"), (0.1404, "0.1404"), (36.3412, "36.34"), (1e-12, "0"), (0.012_345, "0.01235")];
        for (x, text) in cases {
            assert_eq!(number(x), text);
        }
    }

    #[test]
    fn one_figure_off_is_enough() {
        let figure = |measured| Figure {
            figure: "5a",
            quantity: "dip",
            unit: "rpm",
            expected: Expected::Near(1.0, 0.1),
            measured,
        };
        let table = Table { fmi2: vec![figure(1.05)], fmi3: vec![figure(1.2)] };
        assert!(!table.holds() && table.text().contains("OFF"));
        assert!(!Expected::AtMost(1.0).holds(f64::NAN) && !Expected::Near(1.0, 0.1).holds(f64::NAN));
    }
}
