//! A sweep from its file: its rows and their results, as lines of CSV.

use crate::definition::{Runs, Traces, Which};
use crate::error::invalid;
use crate::plan::{RUN, last_columns};
use crate::warned::Warned;
use crate::{Definition, DesignRows, Error, Plan, ResultColumn, RunResult, RunResults, RunVariable, Runner};
use fmu_import::{Number, csv};
use fmu_system::cosimulation::item;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs::File;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A sweep, ready to run: its file is read, its FMUs are open, its names are resolved.
#[derive(Clone)]
pub struct Sweep {
    definition: Definition,
    folder: PathBuf,
    plan: Plan,
    rows: DesignRows,
    variables: Vec<RunVariable>,
}

impl Sweep {
    /// Opens a sweep from its TOML file.
    ///
    /// # Errors
    /// The file, its content, or a file that it names is invalid; nothing has run.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let definition = Definition::read(path)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Self::new(definition, folder).map_err(|error| match error {
            Error::Invalid(cause) => Error::file(path, cause),
            other => other,
        })
    }

    /// Opens a sweep; its relative paths begin in `folder`.
    ///
    /// # Errors
    /// As for [`open`](Self::open).
    pub fn new(definition: Definition, folder: PathBuf) -> Result<Self, Error> {
        // An FMU may change the working directory.
        let folder = if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder };
        let folder = std::path::absolute(&folder).map_err(|e| Error::file(&folder, e))?;
        let plan = Plan::new(&definition, &folder)?;
        let Some(design) = &definition.design else {
            return invalid("expected a table [design] with kind = grid, random, lhs, sobol or list");
        };
        let number = |name: &str, text: &str| {
            let variable = plan.bind([name]).map_err(|e| e.to_string())?;
            plan.number(&variable[0], text).map_err(|e| e.to_string())
        };
        let rows = DesignRows::new(design, &definition.vary, &folder, &|name| plan.bind([name]).is_ok(), &number)?;
        if rows.names().any(|name| name == RUN) {
            return invalid(format!("vary: {RUN} is the column with the number of each run: write INSTANCE.{RUN}"));
        }
        let variables = plan.bind(rows.names())?;
        if definition.measure.is_empty() && definition.trace.is_none() {
            return invalid("expected a table [measure]: nothing is measured");
        }
        for (name, _) in &definition.measure {
            if rows.names().any(|other| other == name) {
                return invalid(format!("measure: {name} is the name of a varied variable: rename it"));
            }
            if name.contains(['\n', '\r']) {
                return invalid(format!("measure: {name:?} has a line break: rename it"));
            }
        }
        if let Some(Traces { every: Some(0), .. }) = definition.trace {
            return invalid("trace: every = 0, expected at least 1");
        }
        if design.part == Some(0) {
            return invalid("design: part = 0, expected at least 1");
        }
        Ok(Self { definition, folder, plan, rows, variables })
    }

    /// The folder to which relative paths refer.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The contents of the file.
    pub fn definition(&self) -> &Definition {
        &self.definition
    }

    /// The system and its measures.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The rows of the design.
    pub fn rows(&self) -> &DesignRows {
        &self.rows
    }

    /// The varied variables, in the order of the columns of a row.
    pub fn variables(&self) -> &[RunVariable] {
        &self.variables
    }

    /// Runs rows `first..first + count`, which must be rows of the design.
    ///
    /// # Errors
    /// There are fewer rows, an FMU refuses an instance, or `progress` stops it. An error of a run is in its row.
    pub fn run(
        &self,
        first: u64,
        count: u64,
        threads: usize,
        progress: &(dyn Fn(u64) -> ControlFlow<()> + Sync),
    ) -> Result<RunResults, Error> {
        if first.checked_add(count).is_none_or(|end| end > self.rows.count()) {
            let all = self.rows.count();
            return invalid(format!("rows from {first}, {count} of them, of a design with {all} rows"));
        }
        let row = |k: u64, values: &mut Vec<Number>| self.rows.row(first + k, values);
        self.plan.run_rows(&self.variables, count, &row, threads, progress)
    }

    /// All columns of the results: `run`, the varied variables, the measures, `end`, `error` (or [`last_columns`]).
    pub fn columns(&self) -> Vec<ResultColumn> {
        let plain =
            |name: &str, unit: &str| ResultColumn { name: name.into(), unit: unit.into(), ..ResultColumn::default() };
        let varied = self.variables.iter().map(|variable| &variable.column);
        let mut all = vec![plain(RUN, "")];
        all.extend(varied.chain(self.plan.measures()).cloned());
        let [end, error] = last_columns(|name| all.iter().any(|column| column.name == name));
        all.extend([plain(&end, "s"), plain(&error, "")]);
        all
    }

    /// Whether the FMUs are [asked](Warned::asks) for warnings in this row.
    pub(crate) fn hears(&self, row: u64) -> bool {
        Warned::asks(row, self.rows.count())
    }

    /// The header of the results, with its line break.
    pub(crate) fn header(&self) -> String {
        csv::line(self.columns().iter().map(|column| &column.name))
    }

    /// All files of the sweep, FMUs included, with the SHA-256 of their bytes.
    pub(crate) fn files(&self) -> Result<Vec<(String, String)>, Error> {
        let list = self.definition.design.iter().filter_map(|design| design.file.as_deref());
        let fmus = self.definition.fmus.iter().map(|text| fmu_system::ssp::load::name_and_path(text));
        let fmus: Vec<_> = fmus.map(|found| Ok(found?.1)).collect::<Result<_, Error>>()?;
        fmus.into_iter()
            .chain(list.map(Path::new))
            .map(|path| {
                let full = self.folder.join(path);
                let read = || {
                    let mut hash = Sha256::new();
                    io::copy(&mut File::open(&full)?, &mut HashWriter(&mut hash))?;
                    Ok(hex(&hash.finalize()))
                };
                let hash = read().map_err(|e: io::Error| Error::file(&full, e))?;
                Ok((path.to_string_lossy().into_owned(), hash))
            })
            .collect()
    }

    /// Runs rows and writes their lines.
    pub(crate) fn writer(&self, reuse: bool, traces: Option<PathBuf>) -> Result<Writer<'_>, Error> {
        let mut runner = self.plan.runner(&self.variables)?;
        runner.reuse(reuse);
        Ok(Writer { sweep: self, runner, values: Vec::new(), traces, trace: String::new() })
    }

    /// The line of a row, with its line break.
    pub(crate) fn line(&self, row: u64, values: &[Number], outcome: &RunResult) -> String {
        let mut cells = vec![row.to_string()];
        let mut put = |(column, x): (&ResultColumn, &Number)| cells.push(value(&column.items, *x));
        self.variables.iter().map(|variable| &variable.column).zip(values).for_each(&mut put);
        match &outcome.result {
            Ok(measures) => self.plan.measures().iter().zip(measures).for_each(put),
            Err(_) => cells.extend(std::iter::repeat_n(String::new(), self.plan.measures().len())),
        }
        cells.push(if outcome.end.is_nan() { String::new() } else { number(Number::Real(outcome.end)) });
        let error = outcome.result.as_ref().err();
        cells.push(error.map(|e| e.split_whitespace().collect::<Vec<_>>().join(" ")).unwrap_or_default());
        csv::line(cells)
    }

    /// The error of a line, if any.
    pub(crate) fn error_of(line: &str) -> Option<String> {
        // Most rows end with the comma before an empty error.
        if line.trim_end().ends_with(',') { None } else { csv::cells(line).pop() }
    }

    /// Duration of a run in s, and whether instances can be reused, that is, whether the last row gives the same line after a
    /// reset as with new instances.
    pub(crate) fn probe(&self) -> Result<(f64, bool), Error> {
        let (first, last) = (0, self.rows.count() - 1);
        let mut writer = self.writer(true, None)?;
        let mut longest = 0.0_f64;
        let mut line = |writer: &mut Writer<'_>, row| {
            let begun = Instant::now();
            let line = writer.run(row);
            longest = longest.max(begun.elapsed().as_secs_f64());
            line
        };
        line(&mut writer, first)?;
        let after_reset = line(&mut writer, last)?;
        writer.runner.reuse(false);
        let of_new = line(&mut writer, last)?;
        Ok((longest, self.definition.reuse.unwrap_or(after_reset == of_new)))
    }
}

/// Runs rows of a sweep, and writes each as a line.
pub(crate) struct Writer<'a> {
    sweep: &'a Sweep,
    runner: Runner,
    values: Vec<Number>,
    /// Folder for traces.
    traces: Option<PathBuf>,
    trace: String,
}

impl Writer<'_> {
    /// The first warning of the FMUs in the last row, if the row [is heard](Sweep::hears).
    pub(crate) fn warning(&self) -> Option<String> {
        self.runner.warning()
    }

    /// Runs a row; returns its line.
    pub(crate) fn run(&mut self, row: u64) -> Result<String, Error> {
        let Self { sweep, runner, values, traces, trace } = self;
        sweep.rows.row(row, values);
        runner.hear(sweep.hears(row));
        let wanted = sweep.definition.trace.as_ref().filter(|wanted| match &wanted.runs {
            Runs::Rows(rows) => rows.contains(&row),
            Runs::Word(_) => true,
        });
        let every = wanted.and_then(|wanted| wanted.every).unwrap_or(1);
        let mut point = 0;
        trace.clear();
        let outcome = runner.run(values, &mut |t, traced| {
            if wanted.is_some() && point % every == 0 {
                let values = sweep.plan.traced().zip(traced).map(|(column, x)| value(&column.items, x));
                trace.push_str(&csv::line([number(Number::Real(t))].into_iter().chain(values)));
            }
            point += 1;
        });
        if let (Some(wanted), Some(folder)) = (wanted, traces)
            && (wanted.runs != Runs::Word(Which::Failed) || outcome.result.is_err())
        {
            let names = csv::line(std::iter::once("time").chain(wanted.of.iter().map(String::as_str)));
            let text = format!("{names}{trace}");
            crate::files::write(&folder.join(format!("run-{row:08}.csv")), text.as_bytes())?;
        }
        Ok(sweep.line(row, values, &outcome))
    }
}

/// The name of an enumeration's value, or a number.
fn value(items: &[(i64, String)], x: Number) -> String {
    item(items, x.real()).map_or_else(|| number(x), str::to_owned)
}

/// The shortest text that reads back as the same number; empty for a missing number.
fn number(number: Number) -> String {
    match number {
        Number::Real(x) if x != 0.0 && x.is_finite() && !(1e-5..1e16).contains(&x.abs()) => format!("{x:e}"),
        number => number.to_string(),
    }
}

struct HashWriter<'a>(&'a mut Sha256);

impl io::Write for HashWriter<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// SHA-256 of a text.
pub(crate) fn hash(text: &str) -> String {
    hex(&Sha256::digest(text.as_bytes()))
}
