//! The tables of `docs/methods.md` are what `fmu compare MOTOR.toml` measures.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive_study::compare::measure::Effort;
use drive_study::compare::scenario::Scenario;
use drive_study::compare::trials::TRIALS;
use drive_study::compare::{OnMachine, Outcome, on_machine, write_machine};
use drive_tools::tune::motor::MotorFile;
use std::path::{Path, PathBuf};

/// The machines of the page.
const MACHINES: [&str; 3] = ["reference", "ipmsm-2.2kw", "traction-100kw"];

/// The columns: scenarios, of which the worst counts, and the measure.
const COLUMNS: [(&[&str], &str); 8] = [
    (&["start"], "failed starts"),
    (&["load"], "dip"),
    (&["top"], "speed"),
    (&["lowest"], "held down to"),
    (&["r-high", "r-low"], "held down to"),
    (&["dead-time"], "held down to"),
    (&["noise"], "held down to"),
    (&["offset"], "held down to"),
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The part of the page on a machine.
fn section(machine: &str) -> String {
    let page = std::fs::read_to_string(root().join("docs/methods.md")).unwrap();
    let (_, after) = page.split_once(&format!("### `{machine}`\n")).unwrap_or_else(|| panic!("no {machine}"));
    after.split("\n##").next().unwrap().to_owned()
}

/// The cells of a method in the table of a machine.
fn row(machine: &str, kind: Kind) -> Option<Vec<String>> {
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let rows = section(machine).lines().filter(|line| line.starts_with('|')).map(cells).collect::<Vec<_>>();
    rows.into_iter().find(|cells| cells[0] == kind.name()).map(|cells| cells[1..].to_vec())
}

fn ran(machine: &str, kinds: &[Kind], columns: &[usize]) -> OnMachine {
    let motor = MotorFile::read(&root().join(format!("motors/{machine}.toml"))).unwrap();
    let wanted: Vec<&str> = columns.iter().flat_map(|&k| COLUMNS[k].0.iter().copied()).collect();
    let scenarios: Vec<&Scenario> = TRIALS.iter().filter(|s| wanted.contains(&s.id)).collect();
    on_machine(&motor, kinds, &scenarios, Effort::Full, || ()).unwrap()
}

/// A column of a method as the page writes it.
fn cell(compared: &OnMachine, kind: Kind, column: usize) -> String {
    let (scenarios, name) = COLUMNS[column];
    let worst = scenarios.iter().map(|id| {
        let run = compared.runs.iter().find(|run| run.entry.name == kind.name() && run.scenario.id == *id).unwrap();
        match &run.outcome {
            Outcome::Measured(measures, _) => measures.iter().find(|measure| measure.name == name).unwrap().value,
            _ => f64::NAN,
        }
    });
    match worst.reduce(f64::max).unwrap() {
        x if x.is_nan() => "–".into(),
        x if x.is_infinite() => "lost".into(),
        x => ((100.0 * x).round() / 100.0).to_string(),
    }
}

/// The columns of the page that differ from a run.
fn differences(machine: &str, kinds: &[Kind], columns: &[usize]) -> Vec<String> {
    let compared = ran(machine, kinds, columns);
    let refused: Vec<&str> = compared.refused.iter().map(|unsuited| unsuited.estimator.name()).collect();
    let mut all = Vec::new();
    for &kind in kinds {
        let row = row(machine, kind);
        if row.is_some() == refused.contains(&kind.name()) {
            all.push(format!("{machine}, {}: refused by {refused:?}, row {row:?}", kind.name()));
        }
        for (row, &column) in row.iter().flat_map(|row| columns.iter().map(move |column| (row, column))) {
            let found = cell(&compared, kind, column);
            if row[column] != found {
                let title = COLUMNS[column].0.join(", ");
                all.push(format!("{machine}, {}, {title}: {}, measured {found}", kind.name(), row[column]));
            }
        }
    }
    all
}

/// A machine without `s_2` starts by I-f. The current of that start is not counted as the carrier's, and a comparison in which every
/// drive is lost is written, too.
#[test]
fn an_i_f_start_is_named_and_left_out_of_the_cost() {
    let motor = MotorFile::read(&root().join("motors/traction-100kw.toml")).unwrap();
    let scenarios: Vec<&Scenario> = TRIALS.iter().filter(|s| ["load", "signal"].contains(&s.id)).collect();
    let kinds = [Kind::VoltageFeedback, Kind::PulsatingInjection];
    let compared = on_machine(&motor, &kinds, &scenarios, Effort::Reduced, || ()).unwrap();
    assert_eq!(compared.starts, "How they start: VoltageFeedback, PulsatingInjection: I-f start.");
    let cost = compared.runs.iter().find(|run| run.entry.kind == kinds[1] && run.scenario.id == "signal").unwrap();
    // 3.261 V at 6283 rad/s through 0.2 to 0.22 mH: an amplitude of 2.4 to 2.6 A. The I-f start has 99 A.
    let carrier = cost.measures().iter().find(|measure| measure.name == "carrier current (rms)").unwrap().value;
    assert!(carrier > 1.5 && carrier < 2.0, "{carrier} A");
    let lost = on_machine(&motor, &[Kind::RotatingInjection], &scenarios, Effort::Reduced, || ()).unwrap();
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join("lost");
    write_machine(&lost, &dir).unwrap();
    let text = std::fs::read_to_string(dir.join("compare.txt")).unwrap();
    assert!(text.contains("lost"), "{text}");
}

/// The line of the refused methods is what the rules refuse; it takes no run.
#[test]
fn refused_methods_are_those_of_the_rules() {
    for machine in MACHINES {
        let kinds: Vec<Kind> = Kind::ALL.iter().copied().filter(|&kind| row(machine, kind).is_none()).collect();
        let compared = ran(machine, &kinds, &[]);
        assert!(compared.runs.is_empty() && compared.refused.len() == kinds.len(), "{machine}: {:?}", compared.refused);
        let names = kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(", ");
        assert!(section(machine).contains(&format!("Refused: {names}.")), "{machine}: {names}");
    }
}

/// A change of the rules of `fmu tune` moves cells: look at each of them.
#[test]
fn every_cell_of_the_page_is_measured() {
    let columns: Vec<usize> = (0..COLUMNS.len()).collect();
    let all: Vec<String> = MACHINES.iter().flat_map(|machine| differences(machine, Kind::ALL, &columns)).collect();
    assert!(all.is_empty(), "{}", all.join("\n"));
}
