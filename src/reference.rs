//! What an FMU gives when it is run as it recommends: reference files in its archive, as the layered standard FMI-LS-REF
//! 1.0.0-beta.1 names them (<https://github.com/modelica/fmi-ls-ref>). The experiment has the format of its release 1.0.0-alpha.1,
//! which <https://github.com/modelica/ma-hs-experiments> continues.
//!
//! The files of CSV keep to the rules for the examples that the FMI tools page lists: names in quotes, time first, at most ten
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

/// File of a package with what its FMU is fed with: CSV with time first and a column per input, joined by lines.
pub const STIMULI: &str = "stimuli.csv";

/// Variables and intervals at most.
const VARIABLES: usize = 10;
const INTERVALS: f64 = 200.0;

/// Communication steps at most: a build takes seconds.
const MOST_STEPS: f64 = 1e6;

/// Runs a packed FMU through its default experiment, fed with the file `stimuli` if there is one; returns the files for its
/// archive. `parameters` is a set of values, its name and the text of its SSV file.
///
/// # Errors
/// The FMU fails, or what feeds it does not fit.
pub fn files(
    archive: &Path,
    description: &Description,
    stimuli: &Path,
    parameters: Option<(&str, &str)>,
) -> Result<BTreeMap<String, Entry>> {
    let (name, experiment) = (description.model_name(), &description.experiment);
    let fed = if stimuli.is_file() { Schedule::read_csv(stimuli).map_err(anyhow::Error::msg)? } else { Vec::new() };
    let result = thinned(&run(archive, experiment, fed)?, every(experiment));
    let mut texts = vec![(format!("{name}_ref.csv"), result)];
    let mut related =
        vec![(format!("{name}_ref.csv"), "text/csv", "result", "Result of the default experiment".to_owned())];
    let mut stimulus = String::new();
    if stimuli.is_file() {
        let file = format!("{name}_in.csv");
        stimulus = format!("    <Stimuli source=\"{file}\"/>\n");
        texts.push((file, fs::read_to_string(stimuli)?));
    }
    let Experiment { start, stop, step } = experiment;
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
        "The default experiment with its inputs and its result".into(),
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
/// As those of the FMU.
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
    let Experiment { start, stop, step } = *experiment;
    if (stop - start) / step > MOST_STEPS {
        bail!("the default experiment has more than {MOST_STEPS:e} steps");
    }
    let settings = Settings { start, stop, step, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).context("the default experiment")
}

/// Communication steps from one row of the result to the next.
pub fn every(experiment: &Experiment) -> usize {
    let steps = ((experiment.stop - experiment.start) / experiment.step).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a ratio of a few millions at most")]
    let every = (steps / INTERVALS).ceil().max(1.0) as usize;
    every
}

/// Every so many rows as CSV, and the last one.
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
