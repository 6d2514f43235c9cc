//! The checker against faults: each makes exactly the right check fail, and its twin without the fault makes none.
#![allow(missing_docs, unreachable_pub, clippy::missing_panics_doc)]

mod alarms;
mod archive;
mod binary;
mod ci;
mod description;
mod exchange;
mod findings;
mod fmus;
mod machine;
mod population;
mod sizes;
mod starts;
mod ticks;
mod varying;
mod zip;

use findings::{check, listed, violated};
use fmu_check::{Verdict, report::Report};
use fmus::{compile, each, library, pack, pack_with};

/// What runs the probes.
const PROGRAM: &str = env!("CARGO_BIN_EXE_fmu-check");

/// The verdict of a check that ran.
pub fn verdict(report: &Report, id: &str) -> Verdict {
    report.finding(id).map_or_else(|| panic!("{id} did not run"), |f| f.verdict.clone())
}
