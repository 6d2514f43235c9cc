//! `fmu simulate --replay`: repeats the calls that an FMU recorded in another importer.

use crate::{Failed, message};
use anyhow::{Context, Result, anyhow, bail};
use fmu_import::replay::{Difference, ReplayError, replay};
use fmu_import::{journal, printable};
use std::io::Write;
use std::path::Path;

/// Longest part of a call in a message, in characters.
const LONGEST: usize = 300;

/// Repeats the log of one FMU.
pub(super) fn run(fmus: &[String], log: &Path, mut out: Box<dyn Write>) -> Result<()> {
    let [fmu] = fmus else {
        bail!("--replay {}: a log is of one FMU, and {} are given", log.display(), fmus.len());
    };
    let place = log.display();
    let text = std::fs::read_to_string(log).with_context(|| format!("--replay {place}"))?;
    let note = |text: &str| message::note(&printable(&shortened(text)));
    let replayed = replay(Path::new(fmu), &text, &note).map_err(|error| match error {
        ReplayError::Log(why) | ReplayError::Other(why) => anyhow!("{place}: {}", printable(&shortened(&why))),
        ReplayError::Fmu(error) => error.into(),
    })?;
    journal::writes();
    if let Some(Difference { line, call, logged, now, message }) = replayed.difference {
        let said = message.map(|text| format!("; the FMU says: {text}")).unwrap_or_default();
        let call = shortened(&call);
        let text = format!("{place}: line {line}: {call}: the log has {logged}, now {now}{said}");
        return Err(Failed(printable(&text).into_owned()).into());
    }
    if let Some(last) = replayed.last {
        writeln!(out, "the log ends in the middle, and this call now returns: {}", printable(&shortened(&last)))?;
    }
    writeln!(out, "{} calls replayed, all as in the log", replayed.calls).context("standard output")
}

/// A text without the middle of long arrays.
fn shortened(text: &str) -> String {
    let n = text.chars().count();
    if n <= LONGEST {
        return text.to_owned();
    }
    let start: String = text.chars().take(LONGEST / 2).collect();
    let end: String = text.chars().skip(n - LONGEST / 2).collect();
    format!("{start} ... {end}")
}
