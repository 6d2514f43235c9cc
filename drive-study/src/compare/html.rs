//! The grid as one self-contained page.

use super::plots::Plot;
use super::{Cell, table};
use std::fmt::Write as _;

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

const STYLE: &str = "body{font-family:sans-serif;max-width:1240px;margin:2em auto;padding:0 1em;color:#222;line-height:1.45}\
    table{border-collapse:collapse;font-size:.86em}td,th{border-bottom:1px solid #ddd;padding:.25em .7em;text-align:left;\
    vertical-align:top}th{background:#f3f3f3}th small{font-weight:normal;color:#555}td.off{background:#fdd}\
    td{font-variant-numeric:tabular-nums;white-space:nowrap}svg{max-width:100%;height:auto}ul{font-size:.86em;color:#444}";

/// The page with its plots.
pub fn page(cells: &[Cell], plots: &[Plot]) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Estimators compared</title>\
         <style>{STYLE}</style></head><body>\n<h1>Estimators of the rotor angle, compared</h1>\n\
         <p>S.-K. Sul and S. Kim's review, ICEMS 2011, every estimator in closed loop. {}</p>\n<p>{}</p>\n\
         <p>✓ inside, ✗ outside the tolerance of the figure there is for it; a number without a mark has none.</p>\n",
        escape(table::MACHINES),
        escape(&table::starts(cells))
    );
    let _ = writeln!(html, "<pre>{}</pre>", escape(&table::verdict(cells)));
    for block in table::blocks(cells) {
        let _ = write!(html, "<h2>{}</h2>\n<table><thead><tr><th>estimator</th>", escape(block.title));
        for (id, names) in &block.headings {
            let names = names.split(", ").map(escape).collect::<Vec<_>>().join("<br>");
            let _ = write!(html, "<th>{}<br><small>{names}</small></th>", escape(id));
        }
        html.push_str("</tr></thead><tbody>\n");
        for (name, cells) in &block.rows {
            let _ = write!(html, "<tr><td>{name}</td>");
            for (text, holds) in cells {
                let class = if *holds { "" } else { " class=\"off\"" };
                let _ = write!(html, "<td{class}>{}</td>", escape(text));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody></table>\n<ul>\n");
        for note in &block.notes {
            let _ = writeln!(html, "<li>{}</li>", escape(note));
        }
        html.push_str("</ul>\n");
    }
    for plot in plots {
        let _ = write!(html, "<h2>{}</h2>\n{}\n", escape(&plot.title), plot.svg);
    }
    html.push_str("</body></html>\n");
    html
}
