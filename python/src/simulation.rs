//! The loop of FMPy's `simulate_fmu` for co-simulation, with its communication points: `start + (n + 1) interval`, steps that
//! are differences of two points, and steps that end at events of the input.

use crate::error::gate;
use crate::input::{Group, Input, is_close};
use crate::instance::Instance;
use crate::record::{self, Record};
use fmu_import::Error;
use model_description::BaseType;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Steps between two checks of the clock and of Python's signals.
const CHUNK: u32 = 1024;

struct Run {
    start: f64,
    stop: f64,
    interval: f64,
    /// Steps may have any size: they end at input events and at the stop time.
    variable_step: bool,
    fmi2: bool,
    input: Input,
    record: Record,
    time: f64,
    /// Regular points reached so far.
    reached: u32,
    ended: bool,
}

impl Run {
    /// One step with its sample; false at the end.
    fn step(&mut self, instance: &mut fmu_import::Instance) -> Result<bool, Error> {
        let time = self.time;
        if self.ended || time > self.stop || is_close(time, self.stop) {
            return Ok(false);
        }
        let regular = self.start + f64::from(self.reached + 1) * self.interval;
        let mut next = regular;
        if self.variable_step {
            let event = self.input.next_event(time);
            if next > event && !is_close(next, event) {
                next = event;
            }
        }
        if next > self.stop && !is_close(next, self.stop) {
            if !self.variable_step {
                return Ok(false);
            }
            next = self.stop;
        }
        self.input.apply(instance, time, true)?;
        self.ended = instance.do_step(time, next - time)?.is_break();
        self.time = if self.ended && self.fmi2 { instance.last_successful_time()? } else { next };
        self.record.sample(instance, self.time)?;
        if is_close(self.time, regular) {
            self.reached += 1;
        }
        Ok(!self.ended)
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
/// Type, whether continuous, value references, one row of samples for each.
type Samples<'py> = (String, bool, Vec<u32>, PyReadonlyArray2<'py, f64>);

fn base(name: &str) -> PyResult<BaseType> {
    BaseType::from_word(name).ok_or_else(|| PyValueError::new_err(format!("{name} is not a type of FMI 3.0")))
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (instance, times, variable_step, columns, samples = None))]
    fn new(
        instance: Bound<'_, Instance>,
        times: (f64, f64, f64),
        variable_step: bool,
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
            let record = Record::new(groups, fmi2);
            let run = Run {
                start,
                stop,
                interval,
                variable_step,
                fmi2,
                input,
                record,
                time: start,
                reached: 0,
                ended: false,
            };
            Ok(Self { instance: instance.unbind(), run: Mutex::new(run) })
        })
    }

    /// Set the inputs at the start.
    fn apply(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |run, i| run.input.apply(i, run.time, false))
    }

    /// Read the variables and append a row.
    fn sample(&self, py: Python<'_>, time: f64) -> PyResult<()> {
        self.with(py, |run, i| run.record.sample(i, time))
    }

    /// Take one step; false when there was none, or when it was the last because the FMU asked to end.
    fn step(&self, py: Python<'_>) -> PyResult<bool> {
        self.with(py, Run::step)
    }

    /// Run to the end, or until the timeout (s) is over.
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
        self.run().time
    }

    /// Number of rows.
    #[getter]
    fn rows(&self) -> usize {
        self.run().record.rows
    }

    /// The rows as bytes; those of the simulation are then empty with `take`.
    fn bytes<'py>(&self, py: Python<'py>, take: bool) -> Bound<'py, PyArray1<u8>> {
        let bytes = &mut self.run().record.bytes;
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
