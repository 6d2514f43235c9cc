//! The loops of FMPy's `simulate_fmu` behind one class.

use crate::course::Course;
use crate::error::gate;
use crate::exchange::{Euler, Integrating};
use crate::input::{Group, Input};
use crate::instance::Instance;
use crate::record::{self, Record};
use crate::stepping::Stepping;
use fmu_import::Error;
use fmu_system::cosimulation::Solver;
use model_description::BaseType;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Steps between two checks of the clock and of Python's signals.
const CHUNK: u32 = 1024;

/// Method from one point to the next.
enum Way {
    Steps(Stepping),
    Euler(Euler),
    Integrates(Box<Integrating>),
}

struct Run {
    course: Course,
    way: Way,
}

impl Run {
    /// One step with its samples; false at the end.
    fn step(&mut self, instance: &mut fmu_import::Instance) -> Result<bool, Error> {
        match &mut self.way {
            Way::Steps(way) => way.step(&mut self.course, instance),
            Way::Euler(way) => way.step(&mut self.course, instance),
            Way::Integrates(way) => way.step(&mut self.course, instance),
        }
    }

    /// Actions after the initialization.
    fn begin(&mut self, instance: &mut fmu_import::Instance) -> Result<(), Error> {
        match &mut self.way {
            Way::Steps(way) => way.begin(&mut self.course, instance),
            Way::Euler(way) => way.begin(instance),
            Way::Integrates(way) => way.begin(&mut self.course, instance),
        }
    }
}

/// A simulation of an instance, step by step or to its end.
#[pyclass(frozen, module = "fmurun._core")]
pub(crate) struct Simulation {
    instance: Py<Instance>,
    run: Mutex<Run>,
}

/// Type, value references and sizes of recorded variables.
type Columns = (String, Vec<u32>, Vec<usize>);
/// Type, whether continuous, value references, one row of samples per reference.
type Samples<'py> = (String, bool, Vec<u32>, PyReadonlyArray2<'py, f64>);

fn base(name: &str) -> PyResult<BaseType> {
    BaseType::from_word(name).ok_or_else(|| PyValueError::new_err(format!("{name} is not a type of FMI 3.0")))
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (instance, times, way, columns, samples = None))]
    fn new(
        instance: Bound<'_, Instance>,
        times: (f64, f64, f64),
        way: &Bound<'_, PyDict>,
        columns: Vec<Columns>,
        samples: Option<(PyReadonlyArray1<'_, f64>, PyReadonlyArray1<'_, f64>, Vec<Samples<'_>>)>,
    ) -> PyResult<Self> {
        gate(|| {
            let (start, stop, interval) = times;
            let steps = (stop - start) / interval;
            if !([start, stop, interval].iter().all(|x| x.is_finite()) && interval > 0.0) {
                let cause = format!(
                    "start_time {start} and stop_time {stop} must be finite, output_interval {interval} positive"
                );
                return Err(PyValueError::new_err(cause));
            }
            if steps >= f64::from(u32::MAX) {
                return Err(PyValueError::new_err(format!(
                    "{steps:e} steps are too many: output_interval is {interval}"
                )));
            }
            let mut input = Input::default();
            if let Some((t, events, groups)) = samples {
                (input.times, input.events) = (t.as_array().to_vec(), events.as_array().to_vec());
                for (kind, continuous, references, table) in groups {
                    let tables = table.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
                    input.groups.push(Group { base: base(&kind)?, continuous, references, tables });
                }
            }
            let group = |(kind, references, sizes): Columns| {
                Ok(record::Group { base: base(&kind)?, variables: references.into_iter().zip(sizes).collect() })
            };
            let groups = columns.into_iter().map(group).collect::<PyResult<_>>()?;
            let fmi2 = instance.get().opened().is_fmi2();
            let is = |name: &str| Ok::<_, PyErr>(way.get_item(name)?.is_some_and(|x| x.is_truthy().unwrap_or(false)));
            let number = |name: &str| way.get_item(name)?.map_or(Ok(f64::NAN), |x| x.extract());
            input.derivatives = is("input_derivatives")?;
            let solver: Option<String> = way.get_item("solver")?.map(|x| x.extract()).transpose()?;
            let record_events = is("record_events")?;
            let integrates = |solver| {
                Ok::<_, PyErr>(Way::Integrates(Box::new(Integrating::new(solver, number("step")?, record_events))))
            };
            let way = match solver.as_deref() {
                None => Way::Steps(Stepping {
                    variable_step: is("variable_step")?,
                    fmi2,
                    event_mode: is("event_mode")?,
                    applied: false,
                }),
                Some("Euler") => Way::Euler(Euler::new(record_events, start)),
                Some("RK4") => integrates(Solver::Rk4)?,
                Some(_) => integrates(Solver::Dopri { rtol: number("rtol")? })?,
            };
            let record = Record::new(groups, fmi2);
            let course = Course { start, stop, interval, input, record, time: start, reached: 0, ended: false };
            Ok(Self { instance: instance.unbind(), run: Mutex::new(Run { course, way }) })
        })
    }

    /// Set the inputs at the start.
    fn apply(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |run, i| run.course.input.apply(i, run.course.time, false))
    }

    /// Begin, when the initialization has ended: the event that follows it, and the first row.
    fn begin(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, Run::begin)
    }

    /// Read the variables and append a row.
    fn sample(&self, py: Python<'_>, time: f64) -> PyResult<()> {
        self.with(py, |run, i| run.course.record.sample(i, time))
    }

    /// Take one step; false if there was none, or if it was the last because the FMU requested the end.
    fn step(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, Run::step)
    }

    /// Run to the end, or until the timeout (s).
    #[pyo3(signature = (timeout = None))]
    fn finish(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<()> {
        let end = timeout.map(|s| (Instant::now(), Duration::from_secs_f64(s.clamp(0.0, 1e9))));
        loop {
            let more = self.with(py, |run, i| {
                for _ in 0..CHUNK {
                    if end.is_some_and(|(begin, limit)| begin.elapsed() > limit) || !run.step(i)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            })?;
            py.check_signals()?;
            if !more {
                return Ok(());
            }
        }
    }

    /// Time (s) reached.
    #[getter]
    fn time(&self) -> f64 {
        self.run().course.time
    }

    /// Number of rows.
    #[getter]
    fn rows(&self) -> usize {
        self.run().course.record.rows
    }

    /// The rows as bytes; `take` empties the simulation's.
    fn bytes<'py>(&self, py: Python<'py>, take: bool) -> Bound<'py, PyArray1<u8>> {
        let bytes = &mut self.run().course.record.bytes;
        if take { std::mem::take(bytes) } else { bytes.clone() }.into_pyarray(py)
    }
}

impl Simulation {
    fn run(&self) -> MutexGuard<'_, Run> {
        self.run.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Works on the run and its instance, with Python's lock released.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Run, &mut fmu_import::Instance) -> Result<T, Error> + Send,
    ) -> PyResult<T> {
        let instance = self.instance.get();
        gate(|| py.detach(|| instance.with(|i| work(&mut self.run(), i))))
    }
}
