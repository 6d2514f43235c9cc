//! The comparison as one self-contained page.

use super::candidate::Entry;
use super::machine::OnMachine;
use super::measure::Outcome;
use super::plots::Plot;
use super::run::Run;
use super::table;
use super::table::{Block, mark, number};
use crate::ink;
use drive_tools::error::Result;
use drive_tools::tune::setting::Unsuited;
use fmu_plot::page::{self, escape};
use std::fmt::Write as _;

/// The page with its plots.
///
/// # Errors
/// Those of [`page::figure`].
pub fn page(cells: &[Run], plots: &[Plot]) -> Result<String> {
    let class = if cells.iter().all(Run::holds) { "" } else { " off" };
    let mut html = format!(
        "<p class=\"verdict{class}\">{}</p>\n\
         <p>S.-K. Sul and S. Kim's review, ICEMS 2011, every estimator in closed loop. {}</p>\n<p>{}</p>\n\
         <p><span class=\"in\">✓</span> inside, <span class=\"out\">✗</span> outside the tolerance of the figure there is for it; \
         a number without a mark has none. Every number with its tolerance: <a href=\"compare.csv\">compare.csv</a>; the tables as \
         text: <a href=\"compare.md\">compare.md</a>.</p>\n<nav>\n",
        escape(table::verdict(cells).trim_end()),
        escape(table::MACHINES),
        escape(&table::starts_of(cells))
    );
    let blocks = table::blocks(cells);
    for (k, block) in blocks.iter().enumerate() {
        let _ = writeln!(html, "<a href=\"#table-{k}\">{}</a>", escape(block.title));
    }
    if let Some(plot) = plots.first() {
        let _ = writeln!(html, "<a href=\"#{}\">Plots</a>", plot.name);
    }
    html.push_str("</nav>\n");
    Ok(page::page("Estimators of the rotor angle, compared", &(html + &body(&blocks, plots)?)))
}

/// Tables and plots.
fn body(blocks: &[Block<'_>], plots: &[Plot]) -> Result<String> {
    let mut html = String::new();
    for (k, block) in blocks.iter().enumerate() {
        let _ =
            write!(html, "<h2 id=\"table-{k}\">{}</h2>\n{}<ul class=\"notes\">\n", escape(block.title), grid(block));
        for note in &block.notes {
            let _ = writeln!(html, "<li>{}</li>", escape(note));
        }
        html.push_str("</ul>\n");
    }
    for Plot { name, figure } in plots {
        let svg = format!("<a href=\"{name}.svg\">{name}.svg</a>");
        let drawn = page::figure(figure, &format!("The plot without JavaScript: {svg}."))?;
        let title = escape(&figure.title);
        let _ = write!(html, "<h2 id=\"{name}\">Plot {name} <small>{svg}</small></h2>\n<p>{title}</p>\n{drawn}");
    }
    Ok(html)
}

/// The page of one machine.
///
/// # Errors
/// Those of [`page::figure`].
pub fn machine_page(compared: &OnMachine, plots: &[Plot]) -> Result<String> {
    let mut html = format!(
        "<p>{}</p>\n<p>{}</p>\n<p>Every number: <a href=\"compare.csv\">compare.csv</a>; the tables as text: <a \
         href=\"compare.md\">compare.md</a>.</p>\n",
        escape(&compared.machine),
        escape(&compared.starts)
    );
    if !compared.refused.is_empty() {
        html.push_str("<h2>Methods that the machine does not suit</h2>\n<ul class=\"notes\">\n");
        for Unsuited { estimator, reason } in &compared.refused {
            let _ = writeln!(html, "<li>{}: {}</li>", estimator.name(), escape(reason));
        }
        html.push_str("</ul>\n");
    }
    html += &body(&table::blocks(&compared.runs), plots)?;
    html.push_str("<h2>Processor time of a sample</h2>\n<ul class=\"notes\">\n");
    for (kind, nanoseconds) in &compared.nanoseconds {
        let _ = writeln!(html, "<li>{}: {nanoseconds:.0} ns on this machine</li>", kind.name());
    }
    html.push_str("</ul>\n");
    Ok(page::page("Estimators compared on one machine", &html))
}

/// A table with a column for each quantity of each scenario.
fn grid(block: &Block<'_>) -> String {
    // With the focus, the arrow keys scroll it.
    let mut html = format!(
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\"><table>\n\
         <thead><tr><th class=\"name\" rowspan=\"2\">estimator</th>",
        escape(block.title)
    );
    for (id, measures) in &block.headings {
        let _ = write!(html, "<th class=\"first\" colspan=\"{}\">{id}</th>", measures.len().max(1));
    }
    html.push_str("</tr>\n<tr>");
    let first = |k: usize| if k == 0 { "number first" } else { "number" };
    for (_, measures) in &block.headings {
        for (k, m) in measures.iter().enumerate() {
            let _ =
                write!(html, "<th class=\"{}\">{}<br><small>{}</small></th>", first(k), escape(m.name), escape(m.unit));
        }
        if measures.is_empty() {
            html.push_str("<th class=\"first\"></th>");
        }
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for (entry, cells) in &block.rows {
        let _ = write!(html, "<tr><th class=\"name\">{}</th>", name(entry));
        for (cell, (_, heads)) in cells.iter().zip(&block.headings) {
            let whole = |class: &str, text: &str| {
                format!("<td class=\"first{class}\" colspan=\"{}\">{text}</td>", heads.len().max(1))
            };
            match cell.map(|cell| (&cell.outcome, cell.holds())) {
                None => html += &whole("", ""),
                Some((Outcome::NotApplicable(_), _)) => html += &whole("", "–"),
                Some((Outcome::Refused(_), _)) => html += &whole(" out", "refused ✗"),
                Some((Outcome::Measured(measures, _), holds)) if measures.iter().all(|m| m.value.is_infinite()) => {
                    html += &if holds { whole("", "lost") } else { whole(" out", "lost ✗") };
                }
                Some((Outcome::Measured(measures, _), _)) => {
                    for (k, head) in heads.iter().enumerate() {
                        let Some(m) = measures.iter().find(|m| m.name == head.name) else {
                            html.push_str("<td></td>");
                            continue;
                        };
                        let mark = mark(m, m.expected.is_some());
                        let class = match mark {
                            "✓" => " in",
                            "✗" => " out",
                            _ => "",
                        };
                        let title = m.expected.map(|e| format!(" title=\"expected {e}\"")).unwrap_or_default();
                        let number = number(m).replace('-', "−");
                        let _ = write!(html, "<td class=\"{}{class}\"{title}>{number} {mark}</td>", first(k));
                    }
                }
            }
        }
        html.push_str("</tr>\n");
    }
    html + "</tbody></table></div>\n"
}

/// The name of an estimator next to its color; a narrow page may break it before a capital letter.
fn name(entry: &Entry) -> String {
    let mut name = page::swatch(ink::of(entry.kind));
    let mut last = ' ';
    for c in escape(&entry.label()).chars() {
        if last.is_ascii_lowercase() && c.is_ascii_uppercase() {
            name.push_str("<wbr>");
        }
        name.push(c);
        last = c;
    }
    name
}
