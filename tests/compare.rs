//! The grid of estimators and scenarios: its reduced form against the golden copy, its figures, its command line.
#![allow(missing_docs)]

mod common;

use common::shows::shows;
use drive::estimator::Kind;
use drive_study::compare::candidate::{Class, Entry};
use drive_study::compare::measure::Measure;
use drive_study::compare::plots::{self, Plot};
use drive_study::compare::scenario::{Effort, SCENARIOS};
use drive_study::compare::{self, Run, Selection, html, table};
use drive_study::ink;
use fmu_plot::svg;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output};
use std::sync::OnceLock;

/// The reduced grid, run once for each test program.
fn grid() -> &'static [Run] {
    static GRID: OnceLock<Vec<Run>> = OnceLock::new();
    GRID.get_or_init(|| compare::run(&Selection::all(Effort::Reduced), || ()))
}

/// The cells of these estimators in these scenarios.
fn of(cells: &[Run], estimators: &[&str], scenarios: &[&str]) -> Vec<Run> {
    let wanted = |c: &&Run| estimators.contains(&c.entry.name) && scenarios.contains(&c.scenario.id);
    cells.iter().filter(wanted).cloned().collect()
}

/// Value or reason of each estimator, scenario and measure of a CSV.
fn values(csv: &str) -> BTreeMap<String, String> {
    let line = |line: &str| {
        let fields: Vec<&str> = line.splitn(7, ',').collect();
        // A reason is followed by the machine.
        let reason = || fields[6].rsplit_once(",\"").map_or(fields[6], |(reason, _)| reason);
        let value = if fields[2].is_empty() { reason() } else { fields[4] };
        (fields[..3].join(", "), value.to_owned())
    };
    csv.lines().skip(1).map(line).collect()
}

/// Equal, or numbers with a negligible difference.
fn alike(a: &str, b: &str) -> bool {
    let numbers = a.parse::<f64>().ok().zip(b.parse::<f64>().ok());
    a == b || numbers.is_some_and(|(a, b)| (a - b).abs() <= 1e-3 * a.abs().max(b.abs()) + 1e-3)
}

#[test]
fn the_grid_is_that_of_the_golden_copy() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/compare.csv");
    let now = table::csv(grid());
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &now).unwrap();
        return;
    }
    let (golden, now) = (values(&std::fs::read_to_string(&path).unwrap()), values(&now));
    let mut differences = Vec::new();
    for (key, value) in &golden {
        match now.get(key) {
            None => differences.push(format!("{key}: gone, was {value}")),
            Some(other) if !alike(value, other) => differences.push(format!("{key}: {other}, was {value}")),
            Some(_) => {}
        }
    }
    differences.extend(now.keys().filter(|key| !golden.contains_key(*key)).map(|key| format!("{key}: new")));
    let list = differences.join("\n");
    assert!(
        differences.is_empty(),
        "tests/golden/compare.csv differs from what fmu compare gives now:\n{list}\nIf you meant to change the drive, UPDATE_GOLDEN=1 \
         cargo test --test compare accepts the changes"
    );
}

#[test]
fn every_figure_is_inside_its_tolerance() {
    let outside: Vec<_> = grid().iter().filter(|cell| !cell.holds()).collect();
    assert!(outside.is_empty(), "{}", table::verdict(grid()));
    assert!(grid().iter().flat_map(Run::measures).filter(|m| m.expected.is_some()).count() > 100);
}

/// The table of estimators in the documentation has the numbers that `fmu compare` prints, at full effort.
#[test]
fn the_limits_of_the_estimators_are_those_of_the_grid() {
    const FULL: [&str; 3] = ["lowest", "lowest-dead", "arriving"];
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("drive/control/docs/limits.html");
    let page = std::fs::read_to_string(&path).unwrap();
    let entries: Vec<Entry> =
        Entry::all().into_iter().filter(|e| !["Rasmussen", "Sensored"].contains(&e.name)).collect();
    let scenarios = SCENARIOS.iter().filter(|s| FULL.contains(&s.id)).collect();
    let full = compare::run(&Selection { entries: entries.clone(), scenarios, effort: Effort::Full }, || ());
    let shown = |name: &str, scenario: &str, measures: &[&str]| -> String {
        let cells = if FULL.contains(&scenario) { &full } else { grid() };
        let [cell] = &of(cells, &[name], &[scenario])[..] else { panic!("{name}, {scenario}") };
        let value = |m: &Measure| {
            let text = table::number(m).replace('-', "−");
            if m.unit == "deg" && m.value.is_finite() { text + "°" } else { text }
        };
        if cell.measures().is_empty() {
            return "–".into();
        }
        let of = |measure: &&str| value(cell.measures().iter().find(|m| m.name == *measure).unwrap());
        measures.iter().map(of).collect::<Vec<_>>().join(" / ")
    };
    let held = ["held down to"];
    let rows = entries.iter().map(|e| {
        let cells = [
            e.name.to_owned(),
            shown(e.name, "lowest", &held),
            shown(e.name, "lowest-dead", &held),
            shown(e.name, "as-printed", &held),
            shown(e.name, "arriving", &held),
            shown(e.name, "generating-0.02", &["mean angle error"]),
            shown(e.name, "generating-0.05", &["mean angle error"]),
            shown(e.name, "generating-0.1", &["mean angle error"]),
            shown(e.name, "wrong-l-q", &["+20 %", "-20 %"]),
            shown(e.name, "load-0.5", &["dip", "peak angle error"]),
            shown(e.name, "load-0", &["dip", "peak angle error"]),
        ];
        format!("<tr><td>{}</td></tr>\n", cells.join("</td><td>"))
    });
    let rows: String = rows.collect();
    let (before, rest) = page.split_once("full at 0</th></tr>\n").expect("the heading of the table");
    let (kept, after) = rest.split_once("</table>").unwrap();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, format!("{before}full at 0</th></tr>\n{rows}</table>{after}")).unwrap();
        return;
    }
    let old = kept.lines().zip(rows.lines()).find(|(kept, row)| kept != row);
    assert!(
        kept == rows,
        "the table in drive/control/docs/limits.html is not what fmu compare gives now; the first row that differs: {old:#?}\n\
         UPDATE_GOLDEN=1 cargo test --test compare writes the table"
    );
    let both_ways = shown("Hybrid", "reversal", &["peak angle error"]);
    shows("drive/control/docs/limits.html", &page, &format!("under 0.8 of the load: error {both_ways}"));
}

/// The results page shows the output of the command; `UPDATE_GOLDEN=1` writes it.
#[test]
fn the_results_page_shows_what_is_printed() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/results.md");
    let mut page = std::fs::read_to_string(&path).unwrap();
    let load_steps = ["Rasmussen", "ExtendedEmf", "VoltageModel", "SquareWaveInjection", "Sensored"];
    let beyond: Vec<_> = Entry::all().iter().filter(|e| e.kind.class() != Class::Injection).map(|e| e.name).collect();
    for (estimators, scenarios) in
        [(&load_steps[..], &["load-0", "load-0.1", "load-0.5", "load-1"][..]), (&beyond, &["weakening"])]
    {
        let text = table::text(&of(grid(), estimators, scenarios));
        let end = format!("\n  {}: ", scenarios[0]);
        let (printed, _) = text.split_once(&end).unwrap();
        if std::env::var_os("UPDATE_GOLDEN").is_some() {
            let begin = format!("```text\n{}\n", printed.lines().next().unwrap());
            let (before, table) = page.split_once(&begin).expect("the title of the table");
            let (_, after) = table.split_once(&end).expect("its quantities");
            page = format!("{before}```text\n{printed}{end}{after}");
        } else {
            shows("docs/results.md", &page, printed);
        }
    }
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, page).unwrap();
    }
}

/// The curve of a lost run ends where the rotor is lost, in the color of its estimator, with a mark.
#[test]
fn a_lost_run_is_cut_where_it_is_lost() {
    let plots = plots::all(&of(grid(), &["DirectEmf", "VoltageModel"], &["reversal"]));
    let [Plot { figure, .. }] = &plots[..] else { panic!("{plots:?}") };
    for panel in &figure.panels {
        let [lost, held] = &panel.curves[..] else { panic!("{panel:?}") };
        assert_eq!((lost.ink, held.ink), (ink::of(Kind::DirectEmf), ink::of(Kind::VoltageModel)));
        assert!(lost.lost && !held.lost && held.y.len() == held.x.len());
        // The reference passes zero at 0.95 s.
        let end = lost.x[lost.y.len() - 1];
        assert!((0.9..1.1).contains(&end) && lost.y.iter().all(|y| y.abs() <= 90.0), "{end} s");
    }
    let svg = svg::draw(figure).unwrap();
    assert!(svg.contains("DirectEmf ✕ lost") && svg.matches("l10 10m0-10l-10 10").count() == 2, "{svg}");
}

#[test]
fn what_is_outside_is_marked() {
    let mut cells: Vec<Run> = grid().iter().filter(|c| c.entry.name == "DirectEmf").cloned().collect();
    let cell = cells.iter_mut().find(|c| c.scenario.id == "load-0.5").unwrap();
    let compare::Outcome::Measured(measures, _) = &mut cell.outcome else { panic!() };
    measures.iter_mut().find(|m| m.name == "dip").unwrap().value = 0.2;
    assert!(!cell.holds());
    let text = table::text(&cells);
    assert!(text.contains("0.200✗"), "{text}");
    assert!(text.contains("OUTSIDE: DirectEmf, load-0.5, dip: 0.200 pu, expected 0.093"), "{text}");
    assert!(table::markdown(&cells).contains("| DirectEmf"));
    let html = html::page(&cells, &[]).unwrap();
    assert!(html.contains(" out\" title=\"expected 0.093") && html.contains(">0.200 ✗</td>"), "{html}");
}

/// Rasmussen's row is for another machine, and every table states this.
#[test]
fn another_machine_is_told_in_its_row() {
    let cells = of(grid(), &["Rasmussen", "ExtendedEmf"], &["generating-0.1"]);
    let row = "Rasmussen (reference motor, 2 N.m)";
    for text in [table::text(&cells), table::markdown(&cells), html::page(&cells, &[]).unwrap()] {
        assert!(text.contains(row) && !text.contains("ExtendedEmf ("), "{text}");
    }
    let csv = table::csv(&cells);
    assert!(csv.lines().all(|line| line.starts_with("ExtendedEmf") == line.contains("2.2 kW")), "{csv}");
    assert!(csv.contains(",\"reference motor, 2 N.m\""), "{csv}");
}

fn fmu(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fmu")).args(arguments).output().unwrap()
}

#[test]
fn the_command_writes_table_plots_and_page() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a/b");
    let scenarios = "load-0.5,bandwidth,signal-trace";
    let of = ["compare", "--only", "extendedemf,RotatingInjection", "--scenario", scenarios, "--out"];
    let output = fmu(&[&of[..], &[out.to_str().unwrap()]].concat());
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(output.status.code(), Some(0), "{text}");
    assert!(output.stderr.is_empty() && text.contains("figures are inside their tolerance"), "{text}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    for svg in ["load-0.5.svg", "signal-RotatingInjection-current.svg", "signal-RotatingInjection-angle.svg"] {
        assert!(read(svg).contains("<svg"), "{svg}");
    }
    let html = read("compare.html");
    let (swatch, curve) = (
        "background:#0593e6\"></span>Extended<wbr>Emf</th>",
        "\"ink\":\"#0593e6\",\"lost\":false,\"name\":\"ExtendedEmf\"",
    );
    for part in
        ["Fig. 8 of the review", "<small>pu</small></th>", "class=\"number in\" title=\"expected", swatch, curve]
    {
        assert!(html.contains(part), "{part}");
    }
    // A wide table shades the edges with hidden content, and takes the keyboard focus for scrolling.
    let boxes = html.matches("<div class=\"scroll\"").count();
    assert!(boxes > 0 && html.contains(" local, linear-gradient("), "{html}");
    assert_eq!(html.matches("<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"").count(), boxes);
    common::pages::stands_alone(&html, |file| out.join(file).exists());
    let csv = read("compare.csv");
    assert!(
        csv.contains("ExtendedEmf,load-0.5,dip,pu,0.09") && csv.contains("not applicable: injects nothing"),
        "{csv}"
    );
    assert!(read("compare.md").contains("## Bandwidth of the speed loop"));
}

#[test]
fn a_wrong_name_is_told_with_the_right_ones() {
    for (arguments, known) in
        [(["compare", "--only", "Luenberger"], "ExtendedEmf"), (["compare", "--scenario", "x"], "ramp")]
    {
        let output = fmu(&arguments);
        let error = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{error}");
        assert!(error.contains(arguments[2]) && error.contains(known) && error.lines().count() == 1, "{error}");
    }
    let list = String::from_utf8(fmu(&["compare", "--list"]).stdout).unwrap();
    assert!(Entry::all().iter().all(|e| list.contains(e.name)) && list.contains("wrong-l-q"), "{list}");
}
