//! Many runs of one system: the implementation behind `fmurun.Plan` in `fmurun/_plan.py`.

use crate::error::{gate, plain, raise};
use fmu_import::Number;
use fmu_import::guard::patiently;
use fmu_sweep::{Definition, MeasureDefinition, RunResults, RunVariable, Sweep};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

/// Time between two checks of Python's signals during runs.
const SIGNALS: Duration = Duration::from_millis(100);

fn failed(error: fmu_sweep::Error) -> PyErr {
    match error {
        fmu_sweep::Error::Fmu(error) => raise(error),
        other => plain(&other.to_string()),
    }
}

fn parsed(definition: &str) -> PyResult<Definition> {
    serde_json::from_str(definition).map_err(|error| {
        // The position is one in a text that the user does not see.
        let said =
            |error: serde_json::Error| error.to_string().split(" at line ").next().unwrap_or_default().to_owned();
        let whole: serde_json::Value = serde_json::from_str(definition).unwrap_or_default();
        let wrong = whole["measure"].as_object().into_iter().flatten().find_map(|(name, measure)| {
            let found = serde_json::from_value::<MeasureDefinition>(measure.clone());
            found.err().map(|error| format!("measure {name}: {}", said(error)))
        });
        PyValueError::new_err(wrong.unwrap_or_else(|| said(error)))
    })
}

/// The definition of a TOML file, as JSON.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn read_definition(path: PathBuf) -> PyResult<String> {
    gate(|| {
        let definition = Definition::read(&path).map_err(failed)?;
        serde_json::to_string(&definition).map_err(|e| plain(&e.to_string()))
    })
}

/// Paths of the files of a definition, as written there: first the FMUs, then the design.
#[pyfunction]
pub(crate) fn paths(definition: &str) -> PyResult<Vec<String>> {
    gate(|| {
        let definition = parsed(definition)?;
        let path = |text: &String| Ok(fmu_system::ssp::load::name_and_path(text)?.1.to_string_lossy().into_owned());
        let fmus: Result<Vec<String>, fmu_sweep::Error> = definition.fmus.iter().map(path).collect();
        let mut all = fmus.map_err(failed)?;
        all.extend(definition.design.and_then(|design| design.file));
        Ok(all)
    })
}

/// A system with its measures, and its design, if any.
#[pyclass(frozen, module = "fmurun._core")]
pub(crate) struct Plan {
    plan: fmu_sweep::Plan,
    sweep: Option<Sweep>,
}

#[pymethods]
impl Plan {
    #[new]
    fn new(py: Python<'_>, definition: &str, folder: PathBuf) -> PyResult<Self> {
        gate(|| {
            let definition = parsed(definition)?;
            py.detach(|| open(definition, folder)).map_err(failed)
        })
    }

    /// Notes from opening and connecting the files.
    fn notes(&self) -> Vec<String> {
        self.plan.notes().to_vec()
    }

    /// Run once: time, (name, values, unit) of each recorded variable, and the warnings of the FMUs.
    #[expect(clippy::type_complexity, clippy::needless_pass_by_value, reason = "Python's; PyO3 extracts values")]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        names: Vec<String>,
        values: Vec<String>,
        outputs: Option<Vec<String>>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<(String, Bound<'py, PyAny>, (String, f64, f64))>, Vec<String>)> {
        gate(|| {
            let run = || {
                let set = self.plan.bind(names.iter().map(String::as_str))?;
                let number = |(v, text): (RunVariable, &String)| Ok((v.clone(), self.plan.number(&v, text)?));
                let set: Vec<_> = set.into_iter().zip(&values).map(number).collect::<Result<_, fmu_sweep::Error>>()?;
                self.plan.simulate(&set, outputs.as_deref())
            };
            let (recording, warnings) = py.detach(run).map_err(failed)?;
            let columns = recording.columns.into_iter().map(|c| {
                let values = if c.exact.is_empty() { array(py, &c.values) } else { integers(py, &c.exact) };
                let shown = match &c.display {
                    Some(display) => (c.shown_unit().to_owned(), display.factor, display.offset),
                    None => (c.unit, 1.0, 0.0),
                };
                Ok((c.name, values?, shown))
            });
            let columns = columns.collect::<PyResult<_>>()?;
            Ok((recording.time.into_pyarray(py), columns, warnings))
        })
    }

    /// Run rows, known by the numbers `runs`: columns of the measures, times reached, errors, a sentence about warnings of the FMUs. 0
    /// threads means all cores.
    #[expect(clippy::type_complexity, clippy::needless_pass_by_value, reason = "Python's; PyO3 extracts values")]
    fn run_many<'py>(
        &self,
        py: Python<'py>,
        names: Vec<String>,
        columns: Vec<Given<'py>>,
        runs: PyReadonlyArray1<'py, i64>,
        threads: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Vec<Bound<'py, PyAny>>, Bound<'py, PyArray1<f64>>, Vec<String>, Option<String>)> {
        gate(|| {
            let runs = runs.as_array().to_vec();
            // Copies: another thread may write the arrays once Python's lock is released.
            let columns: Vec<Vec<Number>> = columns.iter().map(Given::numbers).collect();
            let variables = self.plan.bind(names.iter().map(String::as_str)).map_err(failed)?;
            let threads = if threads == 0 { fmu_sweep::threads_here() } else { threads };
            let columns: Vec<&[Number]> = columns.iter().map(Vec::as_slice).collect();
            let run = |go_on: &GoOn<'_>| self.plan.run_many(&variables, &columns, threads, go_on);
            let RunResults { measures, end, errors, warned } = py.detach(|| attended(run, progress.as_ref()))?;
            let measures = measures.iter().map(|x| integers(py, x)).collect::<PyResult<_>>()?;
            let errors = errors.into_iter().map(Option::unwrap_or_default).collect();
            let number = |row| usize::try_from(row).ok().and_then(|row| runs.get(row)).copied().unwrap_or_default();
            Ok((measures, end.into_pyarray(py), errors, warned.sentence(runs.len() as u64, number)))
        })
    }

    /// Runs at a point, then with each variable increased by its step, then decreased: columns of the measures, errors, and a warning.
    #[expect(clippy::type_complexity, clippy::needless_pass_by_value, reason = "Python's; PyO3 extracts values")]
    fn run_around<'py>(
        &self,
        py: Python<'py>,
        names: Vec<String>,
        point: Vec<f64>,
        steps: Vec<f64>,
        threads: usize,
    ) -> PyResult<(Vec<Bound<'py, PyArray1<f64>>>, Vec<String>, Option<String>)> {
        gate(|| {
            let variables = self.plan.bind(names.iter().map(String::as_str)).map_err(failed)?;
            let threads = if threads == 0 { fmu_sweep::threads_here() } else { threads };
            let run = |go_on: &GoOn<'_>| self.plan.run_around(&variables, &point, &steps, threads, go_on);
            let RunResults { measures, errors, warned, .. } = py.detach(|| attended(run, None))?;
            let reals = |x: Vec<Number>| x.into_iter().map(Number::real).collect::<Vec<f64>>().into_pyarray(py);
            let measures = measures.into_iter().map(reals).collect();
            let errors = errors.into_iter().map(Option::unwrap_or_default).collect();
            Ok((measures, errors, warned.first.map(|(_, text)| text)))
        })
    }

    /// Rows of the design from number `first` on: `first`, and a column for each varied variable.
    fn rows<'py>(&self, py: Python<'py>, first: u64, count: u64) -> PyResult<(u64, Bound<'py, PyDict>)> {
        gate(|| {
            let rows = self.sweep()?.rows();
            let (first, mut row) = (first.min(rows.count()), Vec::new());
            let end = first.saturating_add(count).min(rows.count());
            let mut columns = vec![Vec::new(); rows.names().count()];
            for index in first..end {
                rows.row(index, &mut row);
                columns.iter_mut().zip(&row).for_each(|(column, x)| column.push(*x));
            }
            let dict = PyDict::new(py);
            for (name, column) in rows.names().zip(columns) {
                dict.set_item(name, integers(py, &column)?)?;
            }
            Ok((first, dict))
        })
    }

    /// Number of rows of the design.
    #[getter]
    fn count(&self) -> PyResult<u64> {
        gate(|| Ok(self.sweep()?.rows().count()))
    }

    /// Names of the variables that the design varies.
    #[getter]
    fn varied(&self) -> PyResult<Vec<String>> {
        gate(|| Ok(self.sweep()?.rows().names().map(str::to_owned).collect()))
    }

    /// Names of all outputs.
    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.plan.outputs().to_vec()
    }

    /// Numbers and names of an enumeration's values, for a variable set in runs; empty for other types.
    fn items(&self, name: &str) -> PyResult<Vec<(i64, String)>> {
        gate(|| Ok(self.plan.bind([name]).map_err(failed)?.swap_remove(0).column.items))
    }

    /// Numbers and names of the values of each measure; empty unless it is a value of an enumeration.
    #[getter]
    fn measure_items(&self) -> Vec<Vec<(i64, String)>> {
        self.plan.measures().iter().map(|column| column.items.clone()).collect()
    }

    /// Names of the last two columns of results that also have these columns.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn last_columns(columns: Vec<String>) -> [String; 2] {
        fmu_sweep::last_columns(|name| columns.iter().any(|column| column == name))
    }

    /// The number of a text as the value of a variable; an integer keeps its digits.
    fn number<'py>(&self, py: Python<'py>, name: &str, text: &str) -> PyResult<Bound<'py, PyAny>> {
        gate(|| {
            let variable = self.plan.bind([name]).map_err(failed)?;
            Ok(match self.plan.number(&variable[0], text).map_err(failed)? {
                Number::Integer(i) => i.into_pyobject(py)?.into_any(),
                other => other.real().into_pyobject(py)?.into_any(),
            })
        })
    }
}

impl Plan {
    /// The system with its measures.
    pub(crate) fn plan(&self) -> &fmu_sweep::Plan {
        &self.plan
    }

    fn sweep(&self) -> PyResult<&Sweep> {
        let none =
            || plain("the plan has no design: Plan.from_toml reads a file that has one; or give rows as a table");
        self.sweep.as_ref().ok_or_else(none)
    }
}

/// A column of numbers from Python.
#[derive(FromPyObject)]
enum Given<'py> {
    Signed(PyReadonlyArray1<'py, i64>),
    Unsigned(PyReadonlyArray1<'py, u64>),
    Real(PyReadonlyArray1<'py, f64>),
}

impl Given<'_> {
    fn numbers(&self) -> Vec<Number> {
        match self {
            Self::Signed(column) => column.as_array().iter().map(|&i| Number::Integer(i.into())).collect(),
            Self::Unsigned(column) => column.as_array().iter().map(|&i| Number::Integer(i.into())).collect(),
            Self::Real(column) => column.as_array().iter().map(|&x| Number::Real(x)).collect(),
        }
    }
}

#[expect(clippy::unnecessary_wraps, reason = "as `integers`")]
fn array<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
    Ok(values.to_vec().into_pyarray(py).into_any())
}

/// An array of these numbers: of 64-bit integers if all are integers and doubles would lose digits, else of doubles; where a
/// number is missing among integers that doubles would round, of Python's numbers.
fn integers<'py>(py: Python<'py>, numbers: &[Number]) -> PyResult<Bound<'py, PyAny>> {
    let rounded = |x: &Number| matches!(x, Number::Integer(i) if i.unsigned_abs() > 1 << 53);
    if !numbers.iter().any(rounded) {
        return array(py, &numbers.iter().map(|x| x.real()).collect::<Vec<f64>>());
    }
    let whole = |x: &Number| if let Number::Integer(i) = x { Some(*i) } else { None };
    let whole: Option<Vec<i128>> = numbers.iter().map(whole).collect();
    let fit = |x: &Vec<i128>| x.iter().map(|&i| i64::try_from(i).ok()).collect::<Option<Vec<i64>>>();
    let fit_unsigned = |x: &Vec<i128>| x.iter().map(|&i| u64::try_from(i).ok()).collect::<Option<Vec<u64>>>();
    if let Some(signed) = whole.as_ref().and_then(fit) {
        return Ok(signed.into_pyarray(py).into_any());
    }
    if let Some(unsigned) = whole.as_ref().and_then(fit_unsigned) {
        return Ok(unsigned.into_pyarray(py).into_any());
    }
    let any = |x: &Number| match x {
        Number::Integer(i) => Ok(i.into_pyobject(py)?.into_any().unbind()),
        other => Ok(other.real().into_pyobject(py)?.into_any().unbind()),
    };
    let all: Vec<Py<PyAny>> = numbers.iter().map(any).collect::<PyResult<_>>()?;
    Ok(all.into_pyarray(py).into_any())
}

/// Called with the number of rows done; returns whether to continue.
pub(crate) type GoOn<'a> = dyn Fn(u64) -> ControlFlow<()> + Sync + 'a;

/// Runs on other threads, while this one checks Python's signals: Ctrl-C ends the run.
pub(crate) fn attended<T: Send>(
    run: impl Fn(&GoOn<'_>) -> Result<T, fmu_sweep::Error> + Sync,
    progress: Option<&Py<PyAny>>,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    let done_rows = AtomicU64::new(0);
    let tell = |py: Python<'_>| match progress {
        Some(progress) => progress.call1(py, (done_rows.load(Ordering::Relaxed),)).map(drop),
        None => Ok(()),
    };
    let go_on = |done| {
        done_rows.fetch_max(done, Ordering::Relaxed);
        if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (done, result) = channel();
    std::thread::scope(|scope| {
        let (run, go_on) = (&run, &go_on);
        let start = || {
            let done = done.clone();
            // The receiver exists as long as this thread.
            let work = move || drop(done.send(run(go_on)));
            std::thread::Builder::new().spawn_scoped(scope, work)
        };
        let work = patiently(start).map_err(|e| plain(&format!("no thread for the runs: {e}")))?;
        drop(done);
        let mut signal = Ok(());
        loop {
            match result.recv_timeout(SIGNALS) {
                Ok(outcomes) => {
                    let outcomes = signal.and(outcomes.map_err(failed))?;
                    Python::attach(tell)?;
                    return Ok(outcomes);
                }
                Err(RecvTimeoutError::Timeout) if signal.is_ok() => {
                    let heard = Python::attach(|py| py.check_signals().and_then(|()| tell(py)));
                    signal = heard;
                    stop.store(signal.is_err(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    let panic = work.join().err().unwrap_or_else(|| Box::new("no result"));
                    std::panic::resume_unwind(panic)
                }
            }
        }
    })
}

fn open(definition: Definition, folder: PathBuf) -> Result<Plan, fmu_sweep::Error> {
    if definition.design.is_some() {
        let sweep = Sweep::new(definition, folder)?;
        return Ok(Plan { plan: sweep.plan().clone(), sweep: Some(sweep) });
    }
    Ok(Plan { plan: fmu_sweep::Plan::new(&definition, Path::new(&folder))?, sweep: None })
}
