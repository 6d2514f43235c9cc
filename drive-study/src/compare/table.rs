//! The comparison as text, Markdown and CSV: estimators as rows, scenarios as columns, one table per group of scenarios.

use super::candidate::Entry;
use super::measure::{Measure, Outcome};
use super::run::Run;
use crate::compare::candidate::Class;
use drive_tools::text_table::{self, aligned};
use std::fmt::Write as _;

/// A group of scenarios with its runs.
#[derive(Debug)]
pub struct Block<'a> {
    /// Common settings of the scenarios.
    pub title: &'static str,
    /// The scenarios, each with its quantities; their values belong to one estimator.
    pub headings: Vec<(&'static str, &'a [Measure])>,
    /// The estimators with their runs, one for each scenario.
    pub rows: Vec<(&'a Entry, Vec<Option<&'a Run>>)>,
    /// Notes under the table.
    pub notes: Vec<String>,
}

impl Block<'_> {
    /// The quantities of a scenario, in one line.
    fn quantities(measures: &[Measure]) -> String {
        measures.iter().map(|m| format!("{} [{}]", m.name, m.unit)).collect::<Vec<_>>().join(", ")
    }

    /// The rows as texts.
    fn texts(&self) -> impl Iterator<Item = Vec<String>> {
        self.rows.iter().map(|(entry, cells)| {
            let texts = cells.iter().map(|cell| cell.map_or(String::new(), cell_text));
            std::iter::once(entry.label()).chain(texts).collect()
        })
    }
}

/// A number with the digits appropriate to its unit.
pub fn number(m: &Measure) -> String {
    if m.value.is_infinite() {
        return if m.name == "settling time" { "never" } else { "lost" }.into();
    }
    let decimals = match m.unit {
        "deg" | "pu" | "n_b" | "1" | "s" | "W" | "A" => 3 - usize::from(m.unit == "deg" || m.unit == "s"),
        "Hz" => 1,
        _ => 0,
    };
    // No -0.00.
    let text = format!("{:.decimals$}", m.value);
    if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') { text.replace('-', "") } else { text }
}

/// A cell: its numbers, with a mark at each that has an expected value.
fn cell_text(cell: &Run) -> String {
    match &cell.outcome {
        Outcome::NotApplicable(_) => "-".into(),
        Outcome::Refused(_) => "REFUSED".into(),
        Outcome::Measured(measures, _) if measures.iter().all(|m| m.value.is_infinite()) => {
            format!("lost{}", mark(&measures[0], measures.iter().any(|m| m.expected.is_some())))
        }
        Outcome::Measured(measures, _) => {
            let one = |m: &Measure| format!("{}{}", number(m), mark(m, m.expected.is_some()));
            measures.iter().map(one).collect::<Vec<_>>().join("  ")
        }
    }
}

/// Inside or outside the expected tolerance; empty without an expected value.
pub(super) fn mark(m: &Measure, expected: bool) -> &'static str {
    match (expected, m.expected.is_none_or(|e| e.holds(m.value)) && m.value.is_finite()) {
        (false, _) => "",
        (true, true) => "✓",
        (true, false) => "✗",
    }
}

/// The tables of the runs.
pub fn blocks(cells: &[Run]) -> Vec<Block<'_>> {
    let mut groups: Vec<&'static str> = Vec::new();
    for cell in cells {
        if !groups.contains(&cell.scenario.group) {
            groups.push(cell.scenario.group);
        }
    }
    groups.into_iter().map(|group| block(group, cells)).collect()
}

fn block<'a>(group: &'static str, cells: &'a [Run]) -> Block<'a> {
    let inside: Vec<&'a Run> = cells.iter().filter(|c| c.scenario.group == group).collect();
    let (mut scenarios, mut estimators, mut notes) = (Vec::new(), Vec::<&Entry>::new(), Vec::new());
    for cell in &inside {
        if !scenarios.contains(&cell.scenario.id) {
            scenarios.push(cell.scenario.id);
            notes.push(format!("{}: {}", cell.scenario.id, cell.scenario.title));
        }
        if !estimators.iter().any(|entry| entry.name == cell.entry.name) {
            estimators.push(&cell.entry);
        }
    }
    let of = |id: &'static str| inside.iter().copied().filter(move |c| c.scenario.id == id);
    let heading = |id: &'static str| (id, of(id).map(Run::measures).find(|m| !m.is_empty()).unwrap_or_default());
    let row =
        |entry: &&'a Entry| (*entry, scenarios.iter().map(|id| of(id).find(|c| c.entry.name == entry.name)).collect());
    let mut reasons: Vec<(&str, Vec<String>)> = Vec::new();
    for cell in &inside {
        let (Outcome::NotApplicable(why), who) = (&cell.outcome, cell.entry.name) else { continue };
        match reasons.iter_mut().find(|(w, _)| w == why) {
            Some((_, names)) if names.iter().any(|n| n == who) => {}
            Some((_, names)) => names.push(who.into()),
            None => reasons.push((why, vec![who.into()])),
        }
    }
    notes.extend(reasons.into_iter().map(|(why, names)| format!("-: {why} ({})", names.join(", "))));
    for cell in &inside {
        if let Outcome::Refused(message) = &cell.outcome {
            notes.push(format!("REFUSED: {}, {}: {message}", cell.entry.name, cell.scenario.id));
        }
    }
    Block {
        title: group,
        headings: scenarios.iter().map(|id| heading(id)).collect(),
        rows: estimators.iter().map(row).collect(),
        notes,
    }
}

/// The tables in plain text, with a list of the numbers outside their tolerances.
pub fn text(cells: &[Run]) -> String {
    tables(cells) + &verdict(cells)
}

/// The tables in plain text.
pub fn tables(cells: &[Run]) -> String {
    let mut text = String::new();
    for block in blocks(cells) {
        let heads = block.headings.iter().map(|h| h.0.into());
        let mut rows: Vec<Vec<String>> = vec![std::iter::once(String::new()).chain(heads).collect()];
        rows.extend(block.texts());
        let _ = writeln!(text, "{}", block.title);
        text.push_str(&aligned(&rows, ["  ", "   ", ""], |_| String::new()));
        for (id, measures) in block.headings.iter().filter(|h| !h.1.is_empty()) {
            let _ = writeln!(text, "  {id}: {}", Block::quantities(measures));
        }
        text.push('\n');
    }
    text
}

/// The number of figures, and those that are not as expected.
pub fn verdict(cells: &[Run]) -> String {
    let figures = cells.iter().flat_map(Run::measures).filter(|m| m.expected.is_some()).count();
    let outside: Vec<_> = cells.iter().flat_map(|c| c.outside().map(move |m| (c, m))).collect();
    let mut text = format!("{} of {figures} figures are inside their tolerance.\n", figures - outside.len());
    for (cell, m) in outside {
        let expected = m.expected.map(|e| e.to_string()).unwrap_or_default();
        let name = cell.entry.name;
        let _ = writeln!(
            text,
            "OUTSIDE: {name}, {}, {}: {} {}, expected {expected}",
            cell.scenario.id,
            m.name,
            number(m),
            m.unit
        );
    }
    text + &refusals(cells)
}

/// The runs that could not be started, with the reason.
pub fn refusals(cells: &[Run]) -> String {
    let mut text = String::new();
    for cell in cells {
        if let Outcome::Refused(message) = &cell.outcome {
            let _ = writeln!(text, "REFUSED: {}, {}: {message}", cell.entry.name, cell.scenario.id);
        }
    }
    text
}

/// The machine of each estimator, in one sentence each.
pub const MACHINES: &str = "All on the 2.2 kW machine with interior magnets (R 3.6 ohm, L_d 36 mH, L_q 51 mH, psi 0.545 Wb, \
     1 pu = 1500 rpm and 14 N.m), 10 kHz, 10 mA of current noise, 12 bit, I-f starts to 0.15 pu; Rasmussen, which is for machines without saliency, \
     on its own reference motor (assumed; 1 pu = 1500 rpm and 2 N.m) with R^ = 0.9 R and without noise. \
     Angle errors are theta - theta^: positive where the rotor is ahead of the estimate.";

/// Ways of starting, in words.
pub(super) const ITSELF: &str = "by itself, from any angle";
pub(super) const I_F: &str = "I-f start";
pub(super) const INJECTION: &str = "initial position by injection, polarity by voltage pulses";
pub(super) const SENSOR: &str = "by its sensor";

/// How the estimators of the review start, in words.
pub fn starts_of(cells: &[Run]) -> String {
    starts(cells.iter().map(|cell| {
        let way = match cell.entry.kind.class() {
            Class::FluxObserver => ITSELF,
            Class::BackEmf => I_F,
            Class::Injection | Class::Hybrid => INJECTION,
            Class::Sensored => SENSOR,
        };
        (cell.entry.name, way)
    }))
}

/// How estimators start, from the name and the way of each, in words.
pub(super) fn starts<'a>(each: impl Iterator<Item = (&'a str, &'a str)>) -> String {
    let mut ways: Vec<(&str, Vec<&str>)> = Vec::new();
    for (name, way) in each {
        match ways.iter_mut().find(|(w, _)| *w == way) {
            Some((_, names)) if names.contains(&name) => {}
            Some((_, names)) => names.push(name),
            None => ways.push((way, vec![name])),
        }
    }
    let sentence = |(way, names): &(&str, Vec<&str>)| format!("{}: {way}", names.join(", "));
    format!("How they start: {}.", ways.iter().map(sentence).collect::<Vec<_>>().join("; "))
}

/// The tables in Markdown.
pub fn markdown(cells: &[Run]) -> String {
    let marks = "✓: inside the tolerance of its expected figure; ✗: outside; no mark: no expected figure.";
    let words = [MACHINES, &starts_of(cells), marks];
    format!("{}## Verdict\n\n{}\n", markdown_under("Estimators compared", &words, cells), verdict(cells))
}

/// The tables in Markdown, under a title and some paragraphs.
pub fn markdown_under(title: &str, words: &[&str], cells: &[Run]) -> String {
    let mut text = format!("# {title}\n\n{}\n\n", words.join("\n\n"));
    for block in blocks(cells) {
        let _ = writeln!(text, "## {}\n", block.title);
        let heading = |(id, measures): &(&str, &[Measure])| match measures {
            [] => (*id).to_owned(),
            measures => format!("{id}: {}", Block::quantities(measures)),
        };
        let heads = block.headings.iter().map(heading);
        let mut rows: Vec<Vec<String>> = vec![std::iter::once("estimator".to_owned()).chain(heads).collect()];
        rows.extend(block.texts());
        text.push_str(&text_table::markdown(&rows));
        text.push('\n');
        block.notes.iter().for_each(|note| {
            let _ = writeln!(text, "- {note}");
        });
        text.push('\n');
    }
    text
}

/// Every number with its expected value, one per line.
pub fn csv(cells: &[Run]) -> String {
    let mut text = String::from("estimator,scenario,measure,unit,value,expected,verdict,machine\n");
    for cell in cells {
        let (name, id, machine) = (cell.entry.name, cell.scenario.id, cell.entry.machine);
        match &cell.outcome {
            Outcome::NotApplicable(why) => {
                let _ = writeln!(text, "{name},{id},,,,,\"not applicable: {why}\",\"{machine}\"");
            }
            Outcome::Refused(message) => {
                let _ = writeln!(text, "{name},{id},,,,,\"refused: {}\",\"{machine}\"", message.replace('"', "'"));
            }
            Outcome::Measured(measures, _) => {
                for m in measures {
                    let expected = m.expected.map(|e| e.to_string()).unwrap_or_default();
                    let verdict = m.expected.map_or("", |e| if e.holds(m.value) { "inside" } else { "outside" });
                    let Measure { name: measure, unit, value, .. } = m;
                    let _ = writeln!(text, "{name},{id},{measure},{unit},{value},{expected},{verdict},\"{machine}\"");
                }
            }
        }
    }
    text
}
