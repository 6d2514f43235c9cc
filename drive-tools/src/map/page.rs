//! The map as a page: a picture for each voltage and temperature, values at the cursor, the tables.

use super::report::Report;
use super::{Map, picture, short};
use crate::error::Result;
use drive::plant::losses::Losses;
use fmu_core::digits::rounded;
use fmu_plot::chart;
use fmu_plot::page::{self, escape};
use serde_json::{Value, json};
use std::fmt::Write as _;

const SCRIPT: &str = include_str!("page.js");
const STYLE: &str = include_str!("page.css");

/// The page.
///
/// # Errors
/// A sheet has no point.
pub fn page(map: &Map, report: &Report) -> Result<String> {
    // A page loads nothing and links to nothing outside: addresses stay as text.
    let mut html = format!("<p>{}</p>\n", escape(&map.source.replace("https://", "")));
    if map.sheets.len() > 1 {
        html.push_str("<p class=\"choose\"><label>DC link and temperature <select id=\"sheet\">\n");
        for (k, sheet) in map.sheets.iter().enumerate() {
            let selected = if k == map.shown { " selected" } else { "" };
            let _ = writeln!(html, "<option value=\"{k}\"{selected}>{}</option>", escape(&map.title(sheet)));
        }
        html.push_str("</select></label></p>\n");
    }
    for (k, sheet) in map.sheets.iter().enumerate() {
        let hidden = if k == map.shown { "" } else { " hidden" };
        let drawn = chart::draw(&picture::chart(map, k))?;
        let title = escape(&map.title(sheet));
        let _ = writeln!(
            html,
            "<figure class=\"map\" data-sheet=\"{k}\"{hidden}><div class=\"scroll\" tabindex=\"0\" role=\"region\" \
             aria-label=\"Efficiency map, {title}\">{drawn}</div></figure>"
        );
    }
    html.push_str(
        "<table class=\"readings\" hidden><tbody></tbody></table>\n\
         <p class=\"notes\">Point at the map, or focus it and use the arrow keys: values at the cursor, read from the grid of the \
         map. Dashed: constant power at the shaft. Points: the best efficiency of the motor, and the rated point. No color: out of \
         reach.</p>\n",
    );
    for (title, rows) in &report.tables {
        let _ = writeln!(html, "<h2>{title}</h2>\n{}", table(title, rows));
    }
    html.push_str("<h2>Notes</h2>\n<ul class=\"notes\">\n");
    for note in &report.notes {
        let _ = writeln!(html, "<li>{}</li>", escape(note));
    }
    html.push_str(
        "</ul>\n<p>Files: <a href=\"map.csv\">map.csv</a>, <a href=\"envelope.csv\">envelope.csv</a>, \
         <a href=\"map.npz\">map.npz</a>, <a href=\"map.svg\">map.svg</a>.</p>\n",
    );
    // Without '<', no text can end the element.
    let data = data(map).to_string().replace('<', "\\u003c");
    let _ = write!(
        html,
        "<style>{STYLE}</style>\n<script type=\"application/json\" id=\"map\">{data}</script>\n<script>\n{SCRIPT}</script>\n"
    );
    Ok(page::page(&format!("Efficiency map of {}", map.name), &html))
}

fn table(title: &str, rows: &[Vec<String>]) -> String {
    let mut html = format!("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\"><table>\n");
    for (k, row) in rows.iter().enumerate() {
        let name = if k == 0 { "th" } else { "td" };
        html.push_str("<tr>");
        for (column, cell) in row.iter().enumerate() {
            let class = if column == 0 { "name" } else { "number" };
            let _ = write!(html, "<{name} class=\"{class}\">{}</{name}>", escape(cell).replace('-', "−"));
        }
        html.push_str("</tr>\n");
    }
    html + "</table></div>\n"
}

/// The grid and the losses of every sheet, for the script: six digits, null out of reach.
fn data(map: &Map) -> Value {
    let all = |values: &[f64]| values.iter().map(|x| short(*x)).collect::<Vec<f64>>();
    let sheet = |sheet: &super::sheet::Sheet| {
        let losses = |point: &drive::steady::Point| {
            let Losses { cu, iron, cond, sw, friction } = point.powers.losses;
            json!([cu, iron, cond, sw, friction].map(digits))
        };
        let points: Vec<Value> = sheet.points.iter().map(|p| p.as_ref().map_or(Value::Null, losses)).collect();
        json!({ "limits": sheet.limits.iter().map(|l| all(l)).collect::<Vec<_>>(), "losses": points })
    };
    json!({ "speed": all(&map.axes.speed), "x": all(&map.axes.x), "sheets": map.sheets.iter().map(sheet).collect::<Vec<_>>() })
}

/// A power with four digits: more cannot be read from the plot.
fn digits(x: f64) -> f64 {
    rounded(x, 4)
}
