//! The definition of a sweep: the contents of its TOML file.

use crate::Error;
use crate::ordered::Ordered;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// A sweep: the system, its runs, varied variables and measures. A program can set the fields that a file would give.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Definition {
    /// FMUs written `FILE` or `NAME=FILE`, or one SSP file; paths from the folder of the definition.
    pub fmus: Vec<String>,
    /// Connect every unconnected input to the output of the same name of another FMU.
    pub auto_connect: bool,
    /// Pairs of an output and an input.
    pub connect: Vec<[String; 2]>,
    /// Pairs of terminals.
    pub terminal: Vec<[String; 2]>,
    /// Pass numbers between different units unchanged; otherwise they are converted by the BaseUnits of both FMUs.
    pub no_unit_conversion: bool,
    /// Step the FMUs one after another; each receives the new outputs of those before it.
    pub sequential: bool,
    /// The method for all FMUs; by default, each FMU with Co-Simulation steps itself.
    pub interface: Option<Interface>,
    /// Names of FMUs that still step themselves in a system for Model Exchange.
    pub stepping: Vec<String>,
    /// Integration method (Model Exchange); by default the adaptive solver.
    pub solver: Option<SolverName>,
    /// Relative tolerance of the adaptive solver; by default 1e-6. If no FMU is integrated, as `tolerance`.
    pub rtol: Option<f64>,
    /// Relative tolerance of the solvers inside FMUs for Co-Simulation; default: the tolerance of each default experiment.
    pub tolerance: Option<f64>,
    /// Start time in s; by default from the FMUs.
    pub start: Option<f64>,
    /// Stop time in s; by default from the FMUs.
    pub stop: Option<f64>,
    /// Communication step in s; by default from the FMUs.
    pub step: Option<f64>,
    /// Reuse instances from run to run by resetting them; by default determined by comparing two rows.
    pub reuse: Option<bool>,
    /// Parameters and unconnected inputs, the same in all runs.
    pub set: Ordered<SetValue>,
    /// Inputs over time, written as for `fmu simulate --input`.
    pub input: Ordered<String>,
    /// How to generate rows.
    pub design: Option<Design>,
    /// The varied variables; in the order of the columns.
    pub vary: Ordered<Vary>,
    /// The measures of each run.
    pub measure: Ordered<MeasureDefinition>,
    /// The runs to record.
    pub trace: Option<Traces>,
}

/// The integrator of an FMU's states.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub enum Interface {
    /// The FMU itself.
    CoSimulation,
    /// The importer.
    ModelExchange,
}

/// An integrator of Model Exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
pub enum SolverName {
    /// Dormand and Prince, of order 5, with adaptive steps.
    Dopri,
    /// Runge-Kutta of order 4, with the communication step as its step.
    #[serde(rename = "RK4")]
    Rk4,
}

/// How to generate rows.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The kind of design.
    pub kind: Kind,
    /// Number of rows of a random, LHS or Sobol design.
    pub runs: Option<u64>,
    /// Seed of a random, LHS or Sobol design; a different seed gives different rows.
    pub seed: Option<u64>,
    /// CSV file of a list; its header names the variables.
    pub file: Option<String>,
    /// Rows of a part; by default about 5 s of work.
    pub part: Option<u64>,
}

/// Kinds of designs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Every combination; the last variable changes from row to row.
    Grid,
    /// Independent random numbers.
    Random,
    /// Latin hypercube sampling: with n rows, each variable has one value in each of n strata.
    Lhs,
    /// Sobol's sequence, shifted by the seed.
    Sobol,
    /// The rows of a file.
    List,
}

/// The variation of a variable: one of `uniform`, `log`, `normal`, `values`, `from` with `to` and `count`, `same`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Vary {
    /// Uniform between two numbers.
    pub uniform: Option<[f64; 2]>,
    /// Uniform in the logarithm, between two positive numbers.
    pub log: Option<[f64; 2]>,
    /// Normal, with mean and standard deviation.
    pub normal: Option<[f64; 2]>,
    /// Truncates the normal distribution.
    pub within: Option<[f64; 2]>,
    /// One of these.
    pub values: Option<Vec<SetValue>>,
    /// One of `count` evenly spaced numbers: the first.
    pub from: Option<f64>,
    /// The last of them.
    pub to: Option<f64>,
    /// Their number.
    pub count: Option<u32>,
    /// Equal to another column ...
    pub same: Option<String>,
    /// ... times this; by default 1.
    pub times: Option<f64>,
}

/// A number for each run.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct MeasureDefinition {
    /// A sum of variables, each optionally after a number and `*`.
    pub of: String,
    /// The function to compute from it.
    pub is: MeasureFunction,
    /// Period to which the sum is wrapped (±period/2): a number or a multiple of pi such as `2pi`.
    pub wrap: Option<SetValue>,
    /// Time in s from which values count; by default the start.
    pub after: Option<f64>,
    /// Time in s, of `at`.
    pub time: Option<f64>,
    /// Level at which a rise begins.
    pub from: Option<f64>,
    /// Level at which a rise ends.
    pub to: Option<f64>,
    /// The value at which it settles.
    pub target: Option<f64>,
    /// Maximum distance from the target of a settled value.
    pub band: Option<f64>,
}

impl MeasureDefinition {
    /// A function of a variable from the start on: `MeasureDefinition { after: Some(0.3), ..MeasureDefinition::new("speed", is) }`.
    pub fn new(of: impl Into<String>, is: MeasureFunction) -> Self {
        let (of, none) = (of.into(), None);
        Self { of, is, wrap: None, after: none, time: none, from: none, to: none, target: none, band: none }
    }
}

impl From<f64> for SetValue {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<i64> for SetValue {
    fn from(x: i64) -> Self {
        Self::Integer(x)
    }
}

impl From<bool> for SetValue {
    fn from(x: bool) -> Self {
        Self::Boolean(x)
    }
}

impl From<&str> for SetValue {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

/// The function that a measure computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MeasureFunction {
    /// The last value.
    Final,
    /// The least value.
    Min,
    /// The greatest value.
    Max,
    /// The greatest magnitude.
    MaxAbs,
    /// The mean of the communication points.
    Mean,
    /// The root of the mean square of the communication points.
    Rms,
    /// The integral over time, by trapezoids.
    Integral,
    /// The value at the first communication point at or after a time.
    At,
    /// Time in s from the first crossing of `from` to the next crossing of `to`, interpolated; infinite if there are none.
    Rise,
    /// Time in s until it stays within `band` of `target`; infinite if it never does.
    Settling,
}

/// Recordings of runs, as files in the folder `traces`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Traces {
    /// Variables to record.
    pub of: Vec<String>,
    /// Record every n-th communication point; by default every point.
    pub every: Option<u32>,
    /// Which runs.
    pub runs: Runs,
}

/// The runs to record.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum Runs {
    /// `"failed"` or `"all"`.
    Word(Which),
    /// These rows.
    Rows(Vec<u64>),
}

/// Words for runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Which {
    /// Those that end with an error.
    Failed,
    /// All of them.
    All,
}

/// A number, a Boolean or a text.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(untagged, expecting = "expected a number, true, false or a text; put a name with dots in quotes")]
pub enum SetValue {
    /// `true` or `false`.
    Boolean(bool),
    /// An integer.
    Integer(i64),
    /// An integer beyond those, which a program gives: TOML has none.
    Unsigned(u64),
    /// A number.
    Number(f64),
    /// A text, such as a name of an enumeration.
    Text(String),
}

impl fmt::Display for SetValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Boolean(x) => x.fmt(f),
            Self::Integer(x) => x.fmt(f),
            Self::Unsigned(x) => x.fmt(f),
            Self::Number(x) => x.fmt(f),
            Self::Text(x) => x.fmt(f),
        }
    }
}

impl Definition {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, or is not a definition of a sweep: names the line and the fault.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
        Self::parse(&text).map_err(|cause| Error::file(path, cause))
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// The line and the fault.
    pub fn parse(text: &str) -> Result<Self, String> {
        toml::from_str(text).map_err(|error| {
            let line = error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            let place = line.map(|line| format!("line {line}: ")).unwrap_or_default();
            format!("{place}{}", error.message().split_whitespace().collect::<Vec<_>>().join(" "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_the_file_is_kept() {
        let d = Definition::parse(
            "fmus = ['z=a.fmu']\n[vary]\n'z.b' = { uniform = [0, 1] }\n'z.a' = { values = [1, 2.5, true, 'Off'] }\n\
             [measure]\nend = { of = 'z.x', is = 'max_abs', after = 1 }",
        )
        .unwrap();
        assert_eq!(d.vary.keys().collect::<Vec<_>>(), ["z.b", "z.a"]);
        let values: Vec<_> = d.vary["z.a"].values.as_ref().unwrap().iter().map(ToString::to_string).collect();
        assert_eq!(values, ["1", "2.5", "true", "Off"]);
        assert_eq!((d.measure["end"].is, d.measure["end"].after), (MeasureFunction::MaxAbs, Some(1.0)));
    }

    #[test]
    fn what_is_no_definition_is_told_with_its_line() {
        for (text, part) in [
            ("fmus = 3", "line 1"),
            ("fmus = []\nfmu = 1", "line 2: unknown field `fmu`"),
            ("[set]\np.R = 2", "line 2: expected a number, true, false or a text; put a name with dots in quotes"),
            ("[vary]\n'a' = { unifrom = [0, 1] }", "line 2: unknown field `unifrom`, expected one of `uniform`"),
            ("[design]\nkind = 'gird'", "line 2: unknown variant `gird`, expected one of `grid`"),
            ("[measure]\nm = { of = 'x', is = 'maximum' }", "line 2: unknown variant `maximum`"),
            ("a = ", "line 1"),
        ] {
            let error = Definition::parse(text).unwrap_err();
            assert!(error.contains(part) && error.lines().count() == 1, "{text}: {error}");
        }
    }
}
