//! The paper's start-up, speed steps and load steps: runs the packed FMUs, then measures, checks and plots the results.

pub mod figures;
pub mod packed;
pub mod plots;
mod report;
pub mod scenario;

use anyhow::{Context, Result};
use packed::Packed;
use report::Table;
use scenario::{ALL, ClosedLoop, Trace};
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
    let all = |standard: &str| -> Result<Vec<Trace>> {
        let pair = Packed::open(&folder.join(standard))?;
        let run = |s: &scenario::Scenario| pair.run(s, STEP).with_context(|| format!("{standard}, {}", s.title));
        ALL.iter().map(run).collect()
    };
    // One thread per standard: the two runs are independent.
    let (fmi2, fmi3) = std::thread::scope(|scope| {
        let other = scope.spawn(|| all("fmi2"));
        let fmi3 = all("fmi3");
        (other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), fmi3)
    });
    let (fmi2, fmi3) = (fmi2?, fmi3?);

    let measure = |traces: &[Trace]| ALL.iter().zip(traces).map(|(s, trace)| figures::of(s.id, trace)).collect();
    let table = Table { fmi2: measure(&fmi2), fmi3: measure(&fmi3) };
    let identical = fmi2 == fmi3;

    std::fs::create_dir_all(out).with_context(|| format!("creating {}", out.display()))?;
    let write = |name: &str, text: &str| {
        std::fs::write(out.join(name), text).with_context(|| format!("writing {}", out.join(name).display()))
    };
    for (scenario, trace) in ALL.iter().zip(&fmi3) {
        write(&format!("{}.csv", scenario.id), &report::csv(trace))?;
    }
    let [start, step_20, step_500, step_1000, step_1500, load_0, load_1000] = &fmi3[..] else {
        unreachable!("as many traces as experiments")
    };
    let plots = [
        ("figure-4.svg", plots::figure_4(start, [step_20, step_500, step_1000, step_1500])),
        ("second-start.svg", plots::second_start(start)),
        ("figure-5.svg", plots::figure_5(load_0, load_1000)),
    ];
    for (name, figure) in &plots {
        write(name, &fmu_plot::svg::draw(figure)?)?;
    }
    write("report.html", &report::html(&table, identical, &plots, &ALL)?)?;
    write("table.md", &table.text())?;
    let verdict = report::verdict(table.holds(), identical);
    Ok((format!("{}\n{verdict}", table.text()), table.holds() && identical))
}
