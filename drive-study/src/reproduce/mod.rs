//! The paper's start-up, speed steps and load steps: runs the packed FMUs, then measures, checks and plots the results.

pub mod experiment;
pub mod figures;
pub mod packed;
pub mod plots;
mod report;

use crate::output::Folder;
use drive_tools::error::{Result, WithContext};
use drive_tools::queue;
use experiment::{ALL, ClosedLoop, Record};
use packed::Packed;
use report::Table;
use std::path::Path;

/// Communication step of the experiments in s: the controller's sample period.
const STEP: f64 = 1e-4;

/// Runs every experiment with the archives of `folder/fmi2` and `folder/fmi3`, writes everything to `out` and returns the
/// table as text with the verdict.
///
/// # Errors
/// An archive cannot run, a step is refused, or a file cannot be written. A figure outside its tolerance is not an
/// error.
pub fn run(folder: &Path, out: &Path) -> Result<(String, bool)> {
    let all = |standard: &str| -> Result<Vec<Record>> {
        let pair = Packed::open(&folder.join(standard))?;
        let run = |s: &experiment::Experiment| pair.run(s, STEP).with_context(|| format!("{standard}, {}", s.title));
        ALL.iter().map(run).collect()
    };
    let both: Vec<_> = queue::map(&["fmi2", "fmi3"], |standard| all(standard)).into_iter().collect::<Result<_>>()?;
    let [fmi2, fmi3] = &both[..] else { unreachable!("two standards") };

    let measure = |records: &[Record]| ALL.iter().zip(records).map(|(s, record)| figures::of(s.id, record)).collect();
    let table = Table { fmi2: measure(fmi2), fmi3: measure(fmi3) };
    let identical = fmi2 == fmi3;

    let out = Folder::create(out)?;
    for (experiment, record) in ALL.iter().zip(fmi3) {
        out.write(&format!("{}.csv", experiment.id), &report::csv(record))?;
    }
    let [start, step_20, step_500, step_1000, step_1500, load_0, load_1000] = &fmi3[..] else {
        unreachable!("one record per experiment")
    };
    let plots = [
        ("figure-4.svg", plots::figure_4(start, [step_20, step_500, step_1000, step_1500])),
        ("second-start.svg", plots::second_start(start)),
        ("figure-5.svg", plots::figure_5(load_0, load_1000)),
    ];
    for (name, figure) in &plots {
        out.write(name, &fmu_plot::svg::draw(figure)?)?;
    }
    out.write("report.html", &report::html(&table, identical, &plots, &ALL)?)?;
    out.write("table.md", &table.text())?;
    let verdict = report::verdict(table.holds(), identical);
    Ok((format!("{}\n{verdict}", table.text()), table.holds() && identical))
}
