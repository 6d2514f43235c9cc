//! Lines that the parent passes to a probe, and lines that the probe writes for the parent.

use crate::confidence::Confidence;
use crate::level::Level;
use clap::Args;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// One line of a probe's output.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Line {
    /// A case begins, by number.
    Case(usize),
    /// A violation; of this level, if that is lower than the level of the check.
    Violated(Option<Level>, Confidence, String),
    /// Evidence for a pass.
    Note(String),
    /// The requirement does not apply to this FMU.
    NotApplicable(String),
    /// The check could not decide.
    NotDetermined(String),
    /// Euler's method needs steps of this size, in s.
    Integrator(f64),
    /// Two plain runs differ in the variable of this name.
    Varies(String),
    /// The probe is complete.
    Done,
}

/// Comes before the last message of an FMU that does not run.
pub(super) const SAID: &str = "; its last message: ";

/// Runs one probe. Only the checker calls it.
#[derive(Debug, Args)]
pub struct ProbeArguments {
    /// Id of the check.
    #[arg(long)]
    pub id: String,
    /// Folder that the FMU was unpacked to.
    #[arg(long)]
    pub dir: PathBuf,
    /// The binary.
    #[arg(long)]
    pub binary: PathBuf,
    /// File with the description as the checker has read it; without it, the probe reads the one in the folder.
    #[arg(long)]
    pub description: Option<PathBuf>,
    /// File that the findings go to.
    #[arg(long)]
    pub out: PathBuf,
    /// Number of the first case.
    #[arg(long, default_value_t = 0)]
    pub from: usize,
    /// Only this case.
    #[arg(long)]
    pub one: bool,
    /// Print every call with what it returned.
    #[arg(long)]
    pub trace: bool,
    /// Record every call one by one, up to the first finding.
    #[arg(long)]
    pub full: bool,
    /// Step of the integrator in s, if a twentieth of the communication step is too long.
    #[arg(long)]
    pub integrator: Option<f64>,
    /// File with the names of the variables that are not compared, as a list in JSON.
    #[arg(long)]
    pub varying: Option<PathBuf>,
    /// Time that it may take, in seconds.
    #[arg(long, default_value_t = 10.0)]
    pub seconds: f64,
}
