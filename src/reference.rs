//! The result of an FMU's default experiment: reference files in its archive, as the layered standard FMI-LS-REF
//! 1.0.0-beta.1 names them (<https://github.com/modelica/fmi-ls-ref>). The experiment has the format of its release 1.0.0-alpha.1,
//! which <https://github.com/modelica/ma-hs-experiments> continues.
//!
//! The CSV files follow the rules for the examples that the FMI tools page lists: names in quotes, time first, at most ten
//! variables (<https://github.com/modelica/fmi-standard.org>, CONTRIBUTING, "Compatibility information").

use crate::pack::Entry;
use anyhow::{Context, Result, bail};
use fmu_core::{Description, Experiment};
use fmu_import::Fmu;
use fmu_import::cosimulation::{Recording, Schedule, Settings, System};
use model_description::Causality;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Folder of the layered standard in an archive.
pub const FOLDER: &str = "extra/org.fmi-standard.fmi-ls-ref/";

/// File of a package that feeds its FMU: CSV with time first and a column per input; lines join the points.
pub const STIMULI: &str = "stimuli.csv";

/// Greatest number of variables, and of intervals.
const VARIABLES: usize = 10;
const INTERVALS: f64 = 200.0;

/// Greatest number of communication steps, so that a build takes seconds.
const MOST_STEPS: f64 = 1e6;

/// Runs a packed FMU through its default experiment, fed with the file `stimuli` if there is one; returns the files for its
/// archive. `parameters` is a set of values, its name and the text of its SSV file.
///
/// # Errors
/// The FMU fails, or `stimuli` does not fit it.
pub fn files(
    archive: &Path,
    description: &Description,
    stimuli: &Path,
    parameters: Option<(&str, &str)>,
) -> Result<BTreeMap<String, Entry>> {
    let (name, experiment) = (description.model_name(), &description.experiment);
    let fed = if stimuli.is_file() { Schedule::read_csv(stimuli).map_err(anyhow::Error::msg)? } else { Vec::new() };
    let inputs = held(&fed, experiment);
    let result = thinned(&run(archive, experiment, fed)?, every(experiment));
    let mut texts = vec![(format!("{name}_ref.csv"), result)];
    let step = experiment.step;
    let of = format!("Result of the default experiment in communication steps of {step} s");
    let mut related = vec![(format!("{name}_ref.csv"), "text/csv", "result", of)];
    let mut stimulus = String::new();
    if stimuli.is_file() {
        let file = format!("{name}_in.csv");
        stimulus = format!("    <Stimuli source=\"{file}\"/>\n");
        let text = fs::read_to_string(stimuli)?;
        texts.push((file, format!("{}\n{inputs}", text.lines().next().unwrap_or_default())));
    }
    let Experiment { start, stop, .. } = experiment;
    let experiments = format!(
        "{XML}<Experiments name=\"Smoke test\" description=\"One run in Co-Simulation\">\n  <Experiment name=\"Default\" \
         startTime=\"{start}\" stopTime=\"{stop}\" stepSize=\"{step}\">\n{stimulus}    <References source=\"{name}_ref.csv\"/>\n  \
         </Experiment>\n</Experiments>\n"
    );
    texts.push(("smoke-test.exp".into(), experiments));
    related.push((
        "smoke-test.exp".into(),
        "application/x-ma-hs-experiments",
        "experiment/smoke-test",
        format!("The default experiment with its inputs, held over communication steps of {step} s, and its result"),
    ));
    if let Some((set, text)) = parameters {
        texts.push((format!("{set}.ssv"), text.into()));
        related.push((
            format!("{set}.ssv"),
            "application/x-ssp-parameter-set",
            "parameter",
            format!("Values for {set}"),
        ));
    }
    let mut manifest = format!("{XML}{ROOT}");
    for (source, kind, role, description) in related {
        // Writing to a String does not fail.
        let _ = writeln!(
            manifest,
            "  <Related type=\"{kind}\" source=\"{source}\" role=\"{role}\" description=\"{description}\"/>"
        );
    }
    texts.push(("fmi-ls-manifest.xml".into(), manifest + "</fmiReferences>\n"));
    let entry = |(file, text): (String, String)| {
        (format!("{FOLDER}{file}"), Entry { bytes: text.into_bytes(), executable: false })
    };
    Ok(texts.into_iter().map(entry).collect())
}

const XML: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
const ROOT: &str = "<fmiReferences xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
     fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-ref\" fmi-ls:fmi-ls-version=\"1.0.0-beta.1\" \
     fmi-ls:fmi-ls-description=\"Layered Standard providing information on related files included in an FMU.\">\n";

/// The experiment in Co-Simulation, every communication point recorded: the first outputs that are real numbers.
///
/// # Errors
/// Those of the FMU.
pub fn run(archive: &Path, experiment: &Experiment, fed: Vec<(String, Schedule)>) -> Result<Recording> {
    let fmu = Fmu::open(archive)?;
    let mut system = System::default();
    system.add("fmu", &fmu, false)?;
    let outputs = fmu.description().variables.iter().filter(|v| v.causality == Causality::Output);
    for output in outputs.filter(|v| v.base.is_float() && !v.is_array()).take(VARIABLES) {
        system.record_as(&format!("fmu.{}", output.name), &output.name)?;
    }
    for (input, schedule) in fed {
        system.input(&format!("fmu.{input}"), schedule)?;
    }
    let Experiment { start, stop, step, .. } = *experiment;
    if (stop - start) / step > MOST_STEPS {
        bail!("the default experiment has more than {MOST_STEPS:e} steps");
    }
    let settings = Settings { start, stop, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).context("the default experiment")
}

/// Share of a step that a change of the inputs takes, and the time from there to the communication point.
const EDGE: f64 = 1e-3;

/// Rows of the inputs as the run feeds them: held over its communication steps. A change is over just before its communication
/// point, so an importer with shorter steps feeds the same, and straight lines connect the rows.
fn held(fed: &[(String, Schedule)], experiment: &Experiment) -> String {
    let Experiment { start, stop, step, .. } = *experiment;
    let at = |t: f64| fed.iter().map(|(_, schedule)| schedule.at(t)).collect::<Vec<f64>>();
    let digits = (4.0 - step.log10()).ceil().clamp(0.0, 17.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 17")]
    let digits = digits as usize;
    let mut csv = String::new();
    let mut row = |t: f64, values: &[f64]| {
        let time = format!("{t:.digits$}");
        let time = if digits > 0 { time.trim_end_matches('0').trim_end_matches('.') } else { &time };
        csv.push_str(time);
        for x in values {
            // Writing to a String does not fail.
            let _ = write!(csv, ",{x}");
        }
        csv.push('\n');
    };
    let mut last = at(start);
    row(start, &last);
    let mut k = 1.0;
    while start + k * step < stop + EDGE * step {
        let t = start + k * step;
        let now = at(t);
        if now != last {
            row(t - 2.0 * EDGE * step, &last);
            row(t - EDGE * step, &now);
            last = now;
        }
        k += 1.0;
    }
    row(stop, &last);
    csv
}

/// Communication steps from one row of the result to the next.
pub fn every(experiment: &Experiment) -> usize {
    let steps = ((experiment.stop - experiment.start) / experiment.step).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a ratio of a few millions at most")]
    let every = (steps / INTERVALS).ceil().max(1.0) as usize;
    every
}

/// CSV with every `every`-th row, and the last one.
fn thinned(recording: &Recording, every: usize) -> String {
    let names = std::iter::once("time").chain(recording.columns.iter().map(|c| c.name.as_str()));
    let mut csv = names.map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(",") + "\n";
    let last = recording.time.len().saturating_sub(1);
    for (k, t) in recording.time.iter().enumerate().filter(|(k, _)| k % every == 0 || *k == last) {
        // Writing to a String does not fail.
        let _ = write!(csv, "{t}");
        recording.columns.iter().for_each(|c| {
            let _ = write!(csv, ",{}", c.values[k]);
        });
        csv.push('\n');
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp over two steps and a jump: at every communication point of the reference and between them, lines through the rows
    /// give what the run held.
    #[test]
    fn the_inputs_say_the_steps_of_their_reference() {
        let experiment = Experiment { stop: 1.0, step: 0.25, ..Experiment::DEFAULT };
        let lines = |points: &[(f64, f64)]| Schedule::lines(points.to_vec()).unwrap();
        let fed = [
            ("a".to_owned(), lines(&[(0.0, 0.0), (0.25, 0.0), (0.75, 10.0), (1.0, 10.0)])),
            ("b".to_owned(), lines(&[(0.0, 1.0), (0.5, 1.0), (0.5001, 2.0)])),
        ];
        let csv = held(&fed, &experiment);
        assert_eq!(csv, "0,0,1\n0.4995,0,1\n0.49975,5,1\n0.7495,5,1\n0.74975,10,2\n1,10,2\n");
        let rows: Vec<Vec<f64>> =
            csv.lines().map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        for (column, (_, schedule)) in fed.iter().enumerate() {
            let read = lines(&rows.iter().map(|row| (row[0], row[column + 1])).collect::<Vec<_>>());
            for n in 0..160 {
                let t = f64::from(n) / 160.0;
                let point = 0.25 * f64::from(n / 40);
                assert!((read.at(t) - schedule.at(point)).abs() < 1e-12, "{t} s: {}", read.at(t));
            }
        }
    }
}
