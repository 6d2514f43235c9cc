//! The result of an FMU's default experiment: reference files in its archive, named as in the layered standard FMI-LS-REF
//! 1.0.0-beta.1 (<https://github.com/modelica/fmi-ls-ref>). The experiment has the format of its release 1.0.0-alpha.1, which
//! <https://github.com/modelica/ma-hs-experiments> continues.
//!
//! The CSV files follow the rules for the examples that the FMI tools page lists: names in quotes, time first, at most ten
//! variables (<https://github.com/modelica/fmi-standard.org>, CONTRIBUTING, "Compatibility information").

use crate::archive::PackedFile;
use crate::error::{Context, Error, Result};
use fmu_core::{Description, Experiment};
use fmu_import::{Fmu, csv, journal};
use fmu_system::cosimulation::{CommunicationPoint, Recording, Schedule, Sequence, Settings, System};
use model_description::{BaseType, Causality};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::ControlFlow;
use std::path::Path;

/// Folder of the layered standard in an archive.
pub const FOLDER: &str = "extra/org.fmi-standard.fmi-ls-ref/";

/// File of a package with the inputs of its FMU: CSV with time first and a column per input; real numbers are interpolated
/// linearly, other values are held.
pub const STIMULI: &str = "stimuli.csv";

/// Maximum number of variables, and of intervals.
const VARIABLES: usize = 10;
const INTERVALS: f64 = 200.0;

/// Maximum number of communication steps, so that a build takes seconds.
const MOST_STEPS: f64 = 1e6;

/// Why there is no reference result for a model: it cannot run alone, or its default experiment takes too long.
pub fn impossible(description: &Description) -> Option<String> {
    let Experiment { start, stop, step, .. } = description.experiment;
    if description.model_exchange.as_ref().is_some_and(|exchange| exchange.only) {
        return Some("it has no Co-Simulation".into());
    }
    ((stop - start) / step > MOST_STEPS).then(|| format!("its default experiment has more than {MOST_STEPS:e} steps"))
}

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
) -> Result<BTreeMap<String, PackedFile>> {
    let (name, experiment) = (description.model_name(), &description.experiment);
    let known = |name: &str| description.variable(name).is_some();
    let fed = if stimuli.is_file() { Sequence::read_csv(stimuli, known).map_err(Error::Invalid)? } else { Vec::new() };
    let system = system(archive, &fed).with_context(|| stimuli.display().to_string())?;
    let inputs: Vec<Feed> = fed.iter().map(|(input, texts)| Feed::of(&system, input, texts)).collect::<Result<_>>()?;
    let inputs = held(&inputs, experiment);
    let result = thinned(&simulate(system, experiment)?, every(experiment));
    let mut texts = vec![(format!("{name}_ref.csv"), result)];
    let step = experiment.step;
    let of = format!("Result of the default experiment in communication steps of {step} s");
    let mut related = vec![(format!("{name}_ref.csv"), "text/csv", "result", of)];
    let mut stimulus = String::new();
    if stimuli.is_file() {
        let file = format!("{name}_in.csv");
        stimulus = format!("    <Stimuli source=\"{file}\"/>\n");
        texts.push((file, header(fed.iter().map(|(input, _)| input.as_str())) + &inputs));
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
        format!(
            "The default experiment with its inputs, constant over communication steps of {step} s, and its result"
        ),
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
        (format!("{FOLDER}{file}"), PackedFile { bytes: text.into_bytes(), executable: false })
    };
    Ok(texts.into_iter().map(entry).collect())
}

const XML: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
const ROOT: &str = "<fmiReferences xmlns:fmi-ls=\"http://fmi-standard.org/fmi-ls-manifest\" \
     fmi-ls:fmi-ls-name=\"org.fmi-standard.fmi-ls-ref\" fmi-ls:fmi-ls-version=\"1.0.0-beta.1\" \
     fmi-ls:fmi-ls-description=\"Layered Standard providing information on related files included in an FMU.\">\n";

/// The experiment in Co-Simulation, every communication point recorded: the first outputs, those that are real numbers before others.
///
/// # Errors
/// Those of the FMU.
pub fn run(archive: &Path, experiment: &Experiment, fed: &[(String, Sequence)]) -> Result<Recording> {
    simulate(system(archive, fed)?, experiment)
}

/// The FMU with its inputs and the recorded outputs.
fn system(archive: &Path, fed: &[(String, Sequence)]) -> Result<System> {
    let fmu = Fmu::open(archive)?;
    let mut system = System::default();
    system.add("fmu", &fmu, false)?;
    let outputs = fmu.description().variables.iter().filter(|v| v.causality == Causality::Output);
    let (reals, others): (Vec<_>, Vec<_>) =
        outputs.filter(|v| v.base != BaseType::Clock).partition(|v| v.base.is_float() && !v.is_array());
    for output in reals.into_iter().chain(others).take(VARIABLES) {
        let port = format!("fmu.{}", output.name);
        if system.is_text(&port)? {
            system.record_text_as(&port, &output.name)?;
        } else {
            system.record_as(&port, &output.name)?;
        }
    }
    for (input, texts) in fed {
        system.sequence(&format!("fmu.{input}"), texts)?;
    }
    Ok(system)
}

fn simulate(mut system: System, experiment: &Experiment) -> Result<Recording> {
    let Experiment { start, stop, step, .. } = *experiment;
    let settings = Settings { start, stop, step, sequential: false };
    let go_on = |point: &mut CommunicationPoint<'_>| {
        journal::reached(point.time);
        Ok(ControlFlow::Continue(()))
    };
    Ok(system.run(&settings, go_on)?)
}

/// An input over time, in the units of its variable: a CSV file of the archive has no units, because other importers read none.
enum Feed {
    /// A real number.
    Lines(Schedule),
    /// Any other value: an integer, a text, bytes, a whole array.
    Held(Sequence),
}

impl Feed {
    fn of(system: &System, input: &str, texts: &Sequence) -> Result<Self> {
        let port = format!("fmu.{input}");
        Ok(match system.lines(&port, texts)? {
            Some(schedule) => Self::Lines(schedule),
            None => Self::Held(texts.clone()),
        })
    }

    /// The cell at time `t` (s).
    fn at(&self, t: f64) -> String {
        match self {
            Self::Lines(schedule) => schedule.at(t).to_string(),
            Self::Held(texts) => texts.at(t).to_owned(),
        }
    }
}

/// Duration of a change of the inputs, as a share of the step; the change ends one such duration before the communication
/// point.
const EDGE: f64 = 1e-3;

/// Rows of the inputs as in the run: constant over its communication steps. A change ends just before its communication point, so
/// an importer with shorter steps feeds the same values; straight lines connect the rows.
fn held(fed: &[Feed], experiment: &Experiment) -> String {
    let Experiment { start, stop, step, .. } = *experiment;
    let at = |t: f64| fed.iter().map(|feed| feed.at(t)).collect::<Vec<String>>();
    let digits = (4.0 - step.log10()).ceil().clamp(0.0, 17.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 17")]
    let digits = digits as usize;
    let mut csv = String::new();
    let mut row = |t: f64, values: &[String]| {
        let time = format!("{t:.digits$}");
        let time = if digits > 0 { time.trim_end_matches('0').trim_end_matches('.') } else { &time };
        csv.push_str(&csv::line([time].into_iter().chain(values.iter().map(String::as_str))));
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

/// The first line of a CSV file: time and these names, all in quotation marks.
fn header<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names = std::iter::once("time").chain(names).map(|name| format!("\"{}\"", name.replace('"', "\"\"")));
    names.collect::<Vec<_>>().join(",") + "\n"
}

/// CSV with every `every`-th row, and the last one. A row is a line, so a text of several lines is left out.
fn thinned(recording: &Recording, every: usize) -> String {
    let texts: Vec<_> = recording.texts.iter().filter(|c| !c.values.iter().any(|x| x.contains(['\n', '\r']))).collect();
    let numbers = recording.columns.iter().map(|c| c.name.as_str());
    let mut csv = header(numbers.chain(texts.iter().map(|c| c.name.as_str())));
    let last = recording.time.len().saturating_sub(1);
    for (k, t) in recording.time.iter().enumerate().filter(|(k, _)| k % every == 0 || *k == last) {
        let numbers = recording.columns.iter().map(|c| c.at(k).to_string());
        csv.push_str(&csv::line(
            [t.to_string()].into_iter().chain(numbers).chain(texts.iter().map(|c| c.values[k].clone())),
        ));
    }
    csv
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp over two steps and a jump: at every communication point of the reference and between them, lines through the rows
    /// give the values of the run.
    #[test]
    fn the_inputs_say_the_steps_of_their_reference() {
        let experiment = Experiment { stop: 1.0, step: 0.25, ..Experiment::DEFAULT };
        let lines = |points: &[(f64, f64)]| Schedule::lines(points.to_vec()).unwrap();
        let fed = [
            lines(&[(0.0, 0.0), (0.25, 0.0), (0.75, 10.0), (1.0, 10.0)]),
            lines(&[(0.0, 1.0), (0.5, 1.0), (0.5001, 2.0)]),
        ];
        let texts = Sequence::parse("0:1 2,0.6:a, b").unwrap();
        let with_texts = [Feed::Lines(fed[0].clone()), Feed::Held(texts)];
        let rows = "0,0,1 2\n0.4995,0,1 2\n0.49975,5,1 2\n0.7495,5,1 2\n0.74975,10,\"a, b\"\n1,10,\"a, b\"\n";
        assert_eq!(held(&with_texts, &experiment), rows);
        let csv = held(&fed.clone().map(Feed::Lines), &experiment);
        assert_eq!(csv, "0,0,1\n0.4995,0,1\n0.49975,5,1\n0.7495,5,1\n0.74975,10,2\n1,10,2\n");
        let rows: Vec<Vec<f64>> =
            csv.lines().map(|line| line.split(',').map(|x| x.parse().unwrap()).collect()).collect();
        for (column, schedule) in fed.iter().enumerate() {
            let read = lines(&rows.iter().map(|row| (row[0], row[column + 1])).collect::<Vec<_>>());
            for n in 0..160 {
                let t = f64::from(n) / 160.0;
                let point = 0.25 * f64::from(n / 40);
                assert!((read.at(t) - schedule.at(point)).abs() < 1e-12, "{t} s: {}", read.at(t));
            }
        }
    }
}
