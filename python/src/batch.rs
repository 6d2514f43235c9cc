//! Many instances of one FMU that step in one call: `fmurun.Batch` is its subclass in `fmurun/_batch.py`.

use crate::cache::{self, Opened};
use crate::error::{gate, raise, usage};
use crate::lane::{Common, Lane, Ports, renew};
use fmu_import::threads;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::{PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

struct Lanes {
    opened: Arc<Opened>,
    common: Common,
    all: Vec<Lane>,
    threads: usize,
    /// Start values by variable, one for all lanes or one per lane.
    ports: Ports,
    values: Vec<Vec<f64>>,
    /// A warning has been reported to Python since the last initialization.
    reported: bool,
}

/// Start values from Python: names, and for each one value or one for each lane.
type Start = Vec<(String, Vec<f64>)>;

impl Lanes {
    /// Does `work` on every lane with its rows, in slices on several threads.
    fn each(&mut self, actions: &[f64], out: &mut [f64], work: impl Fn(&Common, &mut Lane, &[f64], &mut [f64]) + Sync) {
        let (a, o) = (self.common.actions.all.len(), self.common.observations.all.len());
        let common = &self.common;
        let one = |lanes: &mut [Lane], actions: &[f64], out: &mut [f64]| {
            for (k, (lane, out)) in lanes.iter_mut().zip(out.chunks_exact_mut(o)).enumerate() {
                let actions = actions.get(k * a..(k + 1) * a).unwrap_or_default();
                work(common, lane, actions, out);
            }
        };
        if self.threads == 1 || self.all.len() == 1 {
            return one(&mut self.all, actions, out);
        }
        let size = self.all.len().div_ceil(self.threads);
        let slices = Mutex::new(self.all.chunks_mut(size).zip(out.chunks_mut(size * o)).enumerate());
        let work = || loop {
            let next = slices.lock().unwrap_or_else(PoisonError::into_inner).next();
            let Some((k, (lanes, out))) = next else { return };
            one(lanes, actions.get(k * size * a..).unwrap_or_default(), out);
        };
        threads::share(self.threads, |_| work());
    }

    fn observe(&mut self) -> Vec<f64> {
        let mut out = vec![0.0; self.all.len() * self.common.observations.all.len()];
        self.each(&[], &mut out, |common, lane, _, out| lane.observe(common, out));
        out
    }

    /// Resets the lanes of the mask; with start values they are initialized again.
    fn reset(&mut self, mask: Option<&[bool]>, start: Option<Start>) -> Result<Vec<f64>, fmu_import::Error> {
        let anew = start.is_some();
        if let Some(start) = start {
            let (names, values): (Vec<_>, Vec<_>) = start.into_iter().unzip();
            self.ports = Ports::find(&self.opened.fmu, &names)?;
            self.values = values;
            self.reported = false;
        }
        let all = renew(&mut self.opened, &mut self.all)?;
        let Self { all: lanes, common, opened, ports, values, .. } = self;
        for (k, lane) in lanes.iter_mut().enumerate() {
            if !all && mask.is_some_and(|mask| !mask[k]) || !anew && !all && lane.rewind()? {
                continue;
            }
            let row: Vec<f64> = values.iter().map(|x| if x.len() == 1 { x[0] } else { x[k] }).collect();
            lane.initialize(common, opened, ports, &row)?;
        }
        Ok(self.observe())
    }

    /// The first warning, once after each initialization.
    fn news(&mut self) -> Option<String> {
        if self.reported || !self.common.news.swap(false, Ordering::Relaxed) {
            return None;
        }
        let mut warnings = self.all.iter().filter_map(|lane| lane.warning.as_ref());
        let first = warnings.next()?;
        let text = match warnings.count() {
            0 => first.clone(),
            more => format!("{first}; and {more} of the other instances: `warned` has their warnings"),
        };
        self.reported = true;
        Some(text)
    }
}

/// Instances of one FMU that step in one call.
#[pyclass(frozen, subclass, module = "fmurun._core")]
pub(crate) struct Batch {
    n: usize,
    actions: usize,
    observations: usize,
    lanes: Mutex<Lanes>,
}

#[pymethods]
impl Batch {
    #[new]
    #[expect(
        clippy::too_many_arguments,
        clippy::needless_pass_by_value,
        reason = "Python's keywords; PyO3 extracts values"
    )]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        n: usize,
        actions: Vec<String>,
        observations: Vec<String>,
        step_size: f64,
        start_values: Start,
        threads: usize,
    ) -> PyResult<Self> {
        gate(|| {
            if n == 0 || threads == 0 || observations.is_empty() {
                return Err(PyValueError::new_err("n, threads and the number of observations must be at least 1"));
            }
            if !(step_size > 0.0 && step_size.is_finite()) {
                return Err(PyValueError::new_err(format!("step_size must be positive and finite, not {step_size}")));
            }
            let make = || {
                let opened = cache::read(&path)?;
                let description = opened.fmu.description();
                let common = Common {
                    actions: Ports::find(&opened.fmu, &actions)?,
                    observations: Ports::find(&opened.fmu, &observations)?,
                    step: step_size,
                    states: description
                        .co_simulation
                        .as_ref()
                        .is_some_and(model_description::CoSimulation::can_get_and_set_state),
                    news: AtomicBool::new(false),
                };
                let name = |k| {
                    if n == 1 { description.model_name.clone() } else { format!("{}[{k}]", description.model_name) }
                };
                let lanes = (0..n).map(|k| Lane::new(name(k), k % 16 == 0)).collect();
                let ports = Ports::find(&opened.fmu, &[])?;
                let values = Vec::new();
                let mut lanes = Lanes { opened, common, all: lanes, threads, ports, values, reported: false };
                lanes.reset(None, Some(start_values))?;
                Ok(lanes)
            };
            let lanes = Mutex::new(py.detach(make).map_err(raise)?);
            Ok(Self { n, actions: actions.len(), observations: observations.len(), lanes })
        })
    }

    /// Number of instances.
    #[getter]
    fn n(&self) -> usize {
        self.n
    }

    #[pyo3(name = "_reset", signature = (mask, start_values))]
    fn reset<'py>(
        &self,
        py: Python<'py>,
        mask: Option<PyReadonlyArray1<'py, bool>>,
        start_values: Option<Start>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        gate(|| {
            let mask = mask.map(|mask| mask.as_array().to_vec());
            if mask.as_ref().is_some_and(|mask| mask.len() != self.n) {
                return Err(PyValueError::new_err(format!("the mask must have {} elements", self.n)));
            }
            let observed = py.detach(|| self.lanes().reset(mask.as_deref(), start_values)).map_err(raise)?;
            self.report(py, 2)?;
            self.shaped(py, observed)
        })
    }

    /// Write the actions, take `repeat` steps, read the observations.
    ///
    /// `actions` has the shape (n, number of actions), or (number of actions,) for n = 1; `out` receives the observations (n,
    /// number of observations) instead of a new array. A failed instance returns NaN, with its error in `failed`, until it is
    /// reset; FmuError when no instance is left.
    #[pyo3(signature = (actions, repeat = 1, out = None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: &Bound<'py, PyAny>,
        repeat: u32,
        out: Option<Bound<'py, PyArray2<f64>>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        gate(|| {
            let actions = self.actions(py, actions)?;
            if let Some(out) = &out
                && out.shape() != [self.n, self.observations]
            {
                let cause = format!("out has the shape {:?}, not ({}, {})", out.shape(), self.n, self.observations);
                return Err(PyValueError::new_err(cause));
            }
            let (observed, error) = py.detach(|| {
                let (mut lanes, mut observed) = (self.lanes(), vec![0.0; self.n * self.observations]);
                lanes.each(&actions, &mut observed, |common, lane, a, o| lane.advance(common, a, repeat, o));
                let none_left = lanes.all.iter().all(|l| l.error.is_some());
                (observed, lanes.all[0].error.clone().filter(|_| none_left))
            });
            if let Some(error) = error {
                return Err(raise(error));
            }
            self.report(py, 1)?;
            let Some(out) = out else { return self.shaped(py, observed) };
            let mut target = out.try_readwrite().map_err(|e| PyValueError::new_err(format!("out: {e}")))?;
            target.as_array_mut().iter_mut().zip(observed).for_each(|(x, y)| *x = y);
            Ok(out)
        })
    }

    /// Read the observations without a step.
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        gate(|| {
            let observed = py.detach(|| self.lanes().observe());
            self.shaped(py, observed)
        })
    }

    /// The first warning of each instance that warned since its last initialization, by its number. Every 16th instance is checked
    /// in all steps, the others only in the first step after an initialization, because the checks take time.
    #[getter]
    fn warned(&self) -> BTreeMap<usize, String> {
        self.lanes().all.iter().enumerate().filter_map(|(k, lane)| Some((k, lane.warning.clone()?))).collect()
    }

    /// The errors of the instances that failed, by their number.
    #[getter]
    fn failed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        // The lanes must not be locked here: creating an exception runs Python, which may switch to another thread.
        let errors: Vec<_> = self.lanes().all.iter().map(|lane| lane.error.clone()).collect();
        let dict = PyDict::new(py);
        for (k, error) in errors.into_iter().enumerate().filter_map(|(k, e)| Some((k, e?))) {
            dict.set_item(k, raise(error).into_value(py))?;
        }
        Ok(dict)
    }

    /// Save instance `k`: its number of steps and its state as bytes.
    fn save<'py>(&self, py: Python<'py>, k: usize) -> PyResult<(u32, Bound<'py, PyBytes>)> {
        gate(|| {
            let (steps, bytes) = self.lane(k, py, Lane::save)?;
            Ok((steps, PyBytes::new(py, &bytes)))
        })
    }

    /// Let instance `k` continue from a state that `save` gave, of this or another instance of the FMU.
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn restore(&self, py: Python<'_>, k: usize, state: (u32, Vec<u8>)) -> PyResult<()> {
        gate(|| self.lane(k, py, |lane| lane.restore(state.0, &state.1)))
    }
}

impl Batch {
    fn lanes(&self) -> MutexGuard<'_, Lanes> {
        self.lanes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Reports the first warning to Python, at the caller this many frames above.
    fn report(&self, py: Python<'_>, frames: i32) -> PyResult<()> {
        let Some(text) = self.lanes().news() else { return Ok(()) };
        let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, frames)
    }

    fn lane<T: Send>(
        &self,
        k: usize,
        py: Python<'_>,
        work: impl FnOnce(&mut Lane) -> Result<T, fmu_import::Error> + Send,
    ) -> PyResult<T> {
        if k >= self.n {
            return Err(usage(&k.to_string(), &format!("is not an instance; there are {}", self.n)));
        }
        py.detach(|| work(&mut self.lanes().all[k])).map_err(raise)
    }

    /// A copy of the actions: another thread may write the array once Python's lock is released.
    fn actions(&self, py: Python<'_>, actions: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
        let wrong = |shape: &[usize]| {
            PyValueError::new_err(format!("actions have the shape {shape:?}, expected [{}, {}]", self.n, self.actions))
        };
        if let Ok(array) = actions.cast::<PyArray1<f64>>() {
            let right = self.n == 1 && array.len() == self.actions;
            return if right { Ok(array.readonly().as_array().to_vec()) } else { Err(wrong(array.shape())) };
        }
        if let Ok(array) = actions.cast::<PyArray2<f64>>() {
            let right = array.shape() == [self.n, self.actions];
            return if right {
                Ok(array.readonly().as_array().iter().copied().collect())
            } else {
                Err(wrong(array.shape()))
            };
        }
        let array = py.import("numpy")?.call_method1("asarray", (actions, "float64"))?;
        let flat: Bound<'_, PyArray1<f64>> = array.call_method1("reshape", (-1,))?.cast_into()?;
        if array.getattr("ndim")?.extract::<usize>()? > 2 || flat.len() != self.n * self.actions {
            return Err(wrong(&array.getattr("shape")?.extract::<Vec<usize>>()?));
        }
        Ok(flat.readonly().as_array().to_vec())
    }

    fn shaped<'py>(&self, py: Python<'py>, values: Vec<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shaped = Array2::from_shape_vec((self.n, self.observations), values);
        Ok(shaped.map_err(|e| PyValueError::new_err(e.to_string()))?.into_pyarray(py))
    }
}
