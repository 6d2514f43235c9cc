//! One instance, called from Python: the base of `FMU2Slave` and `FMU3Slave` in `fmurun/fmpy.py`.

use crate::cache::{self, Opened};
use crate::error::{gate, raise, usage};
use fmu_import::trace::traced;
use fmu_import::{Error, Kind, Logging, Values};
use model_description::BaseType;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList, PyTuple};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// An instance. Calls from several threads wait for each other.
#[pyclass(frozen, subclass, module = "fmurun._core")]
pub(crate) struct Instance {
    opened: Arc<Opened>,
    name: String,
    id: u64,
    fmi2: bool,
    /// `None` after it was freed.
    inner: Mutex<Option<fmu_import::Instance>>,
    /// A line for each call to the FMU, if requested.
    calls: Option<Mutex<Vec<String>>>,
}

/// A saved state of one instance.
#[pyclass(frozen, name = "FmuState", module = "fmurun._core")]
pub(crate) struct FmuState {
    state: fmu_import::FmuState,
    owner: u64,
}

impl Instance {
    fn new(
        py: Python<'_>,
        opened: &Arc<Opened>,
        name: &str,
        kind: Kind,
        logging: Logging,
        [visible, traces]: [bool; 2],
    ) -> PyResult<Self> {
        static IDS: AtomicU64 = AtomicU64::new(0);
        let make = || opened.fmu.instantiate_with(kind, name, logging, visible);
        let (inner, lines) = py.detach(|| if traces { traced(make) } else { (make(), Vec::new()) });
        let (inner, id, fmi2) = (inner.map_err(raise)?, IDS.fetch_add(1, Ordering::Relaxed), opened.is_fmi2());
        let calls = traces.then(|| Mutex::new(lines));
        Ok(Self { opened: opened.clone(), name: name.into(), id, fmi2, inner: Mutex::new(Some(inner)), calls })
    }

    /// One call on the instance that keeps Python's lock: for calls of less than a microsecond.
    #[inline]
    fn call<T>(
        &self,
        py: Python<'_>,
        call: impl FnOnce(&mut fmu_import::Instance) -> Result<T, Error> + Send,
    ) -> PyResult<T>
    where
        T: Send,
    {
        gate(|| match self.inner.try_lock() {
            Ok(mut inner) => self.on(inner.as_mut(), call),
            // Another thread is calling, and may need Python's lock before it finishes.
            Err(_) => py.detach(|| self.with(call)),
        })
    }

    /// One call on the instance, without Python's lock.
    pub(crate) fn with<T>(&self, call: impl FnOnce(&mut fmu_import::Instance) -> Result<T, Error>) -> PyResult<T> {
        self.on(self.inner.lock().unwrap_or_else(PoisonError::into_inner).as_mut(), call)
    }

    #[inline]
    fn on<T>(
        &self,
        instance: Option<&mut fmu_import::Instance>,
        call: impl FnOnce(&mut fmu_import::Instance) -> Result<T, Error>,
    ) -> PyResult<T> {
        let instance = instance.ok_or_else(|| usage(&self.name, "was freed"))?;
        let result = match &self.calls {
            None => call(instance),
            Some(calls) => {
                let (result, lines) = traced(|| call(instance));
                calls.lock().unwrap_or_else(PoisonError::into_inner).extend(lines);
                result
            }
        };
        result.map_err(|error| {
            if matches!(&error, Error::Call { status, .. } if status == "Fatal") {
                cache::forget(&self.opened);
            }
            raise(error)
        })
    }

    /// Number of elements of the variable with a value reference.
    fn elements(&self, reference: u32) -> usize {
        if self.opened.arrays.is_empty() { 1 } else { self.opened.arrays.get(&reference).copied().unwrap_or(1) }
    }

    /// Checks that the variables have this many elements.
    fn count(&self, references: &[u32], given: usize) -> PyResult<()> {
        let expected: usize = references.iter().map(|&r| self.elements(r)).sum();
        let cause = || format!("{given} values for {expected} elements of {} variables", references.len());
        if expected == given { Ok(()) } else { Err(PyValueError::new_err(cause())) }
    }

    /// The description of the FMU.
    pub(crate) fn opened(&self) -> &Arc<Opened> {
        &self.opened
    }

    fn state<'a>(&self, state: &'a FmuState) -> PyResult<&'a fmu_import::FmuState> {
        let own = state.owner == self.id;
        own.then_some(&state.state).ok_or_else(|| usage(&self.name, "the state belongs to another instance"))
    }
}

/// Value references from a list, which is fast, or from any iterable.
fn references(vr: &Bound<'_, PyAny>) -> PyResult<Vec<u32>> {
    if let Ok(list) = vr.cast::<PyList>() {
        list.iter().map(|x| x.extract()).collect()
    } else {
        vr.try_iter()?.map(|x| x?.extract()).collect()
    }
}

fn base(name: &str) -> PyResult<BaseType> {
    let name = match name {
        "Real" => "Float64",
        "Integer" => "Int32",
        other => other,
    };
    BaseType::from_word(name).ok_or_else(|| PyValueError::new_err(format!("{name} is not a type of FMI")))
}

/// Values from Python, for a variable of this type.
fn values(base: BaseType, items: &Bound<'_, PyAny>) -> PyResult<Values> {
    Ok(match base {
        BaseType::Float32 | BaseType::Float64 => Values::Reals(items.extract()?),
        BaseType::Boolean | BaseType::Clock => {
            Values::Booleans(items.try_iter()?.map(|x| x?.is_truthy()).collect::<PyResult<_>>()?)
        }
        BaseType::String => Values::Strings(items.extract()?),
        BaseType::Binary => {
            let bytes = |x: PyResult<Bound<'_, PyAny>>| x?.extract::<Vec<u8>>();
            Values::Binaries(items.try_iter()?.map(bytes).collect::<PyResult<_>>()?)
        }
        _ => Values::Integers(items.extract()?),
    })
}

#[pymethods]
impl Instance {
    #[new]
    #[pyo3(signature = (fmu, name, kind, logging = Some(false), visible = false, traces = false))]
    fn create(
        py: Python<'_>,
        fmu: &Bound<'_, crate::cache::Fmu>,
        name: &str,
        kind: (bool, bool, bool),
        logging: Option<bool>,
        visible: bool,
        traces: bool,
    ) -> PyResult<Self> {
        let (exchange, event_mode, early_return) = kind;
        let kind = if exchange { Kind::ModelExchange } else { Kind::CoSimulation { event_mode, early_return } };
        let logging = logging.map_or(Logging::Warnings, Logging::from);
        gate(|| Self::new(py, &fmu.get().0, name, kind, logging, [visible, traces]))
    }

    /// Name in errors and messages.
    #[getter]
    #[pyo3(name = "instanceName")]
    fn name(&self) -> &str {
        &self.name
    }

    /// Read double-precision numbers by their value references: all elements of arrays, regardless of `nValues`.
    #[pyo3(name = "_get_reals", signature = (vr, nValues = None))]
    #[allow(non_snake_case, unused_variables, reason = "FMPy's name")]
    fn get_reals(&self, py: Python<'_>, vr: &Bound<'_, PyAny>, nValues: Option<usize>) -> PyResult<Vec<f64>> {
        let references = references(vr)?;
        if self.opened.arrays.is_empty() {
            let mut values = vec![0.0; references.len()];
            return self.call(py, |i| i.get_reals(&references, &mut values).map(|()| values));
        }
        let mut all = Vec::new();
        for reference in references {
            let count = self.elements(reference);
            if let Values::Reals(x) = self.call(py, |i| i.get_at(BaseType::Float64, reference, count))? {
                all.extend(x);
            }
        }
        Ok(all)
    }

    /// Write double-precision numbers by their value references.
    #[pyo3(name = "_set_reals")]
    fn set_reals(&self, py: Python<'_>, vr: &Bound<'_, PyAny>, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let (references, values): (_, Vec<f64>) = (references(vr)?, values.extract()?);
        self.count(&references, values.len())?;
        if self.opened.arrays.is_empty() {
            return self.call(py, |i| i.set_reals(&references, &values));
        }
        let mut rest = values.as_slice();
        for reference in references {
            let (one, more) = rest.split_at(self.elements(reference));
            rest = more;
            self.call(py, |i| i.set_at(BaseType::Float64, reference, &Values::Reals(one.to_vec())))?;
        }
        Ok(())
    }

    /// Read variables of any type by their value references.
    #[pyo3(name = "_get")]
    fn get<'py>(&self, py: Python<'py>, kind: &str, vr: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyList>> {
        let (base, all) = (base(kind)?, PyList::empty(py));
        for reference in references(vr)? {
            let count = self.elements(reference);
            match self.call(py, |i| i.get_at(base, reference, count))? {
                Values::Reals(x) => x.into_iter().try_for_each(|x| all.append(x))?,
                Values::Integers(x) => x.into_iter().try_for_each(|x| all.append(x))?,
                Values::Booleans(x) => x.into_iter().try_for_each(|x| all.append(x))?,
                Values::Strings(x) => x.into_iter().try_for_each(|x| all.append(x))?,
                Values::Binaries(x) => x.into_iter().try_for_each(|x| all.append(PyBytes::new(py, &x)))?,
            }
        }
        Ok(all)
    }

    /// Write variables of any type by their value references.
    #[pyo3(name = "_set")]
    fn set(&self, py: Python<'_>, kind: &str, vr: &Bound<'_, PyAny>, items: &Bound<'_, PyAny>) -> PyResult<()> {
        let (base, references) = (base(kind)?, references(vr)?);
        let items: Vec<Bound<'_, PyAny>> = items.try_iter()?.collect::<PyResult<_>>()?;
        self.count(&references, items.len())?;
        let mut rest = items.as_slice();
        for reference in references {
            let (one, more) = rest.split_at(self.elements(reference));
            rest = more;
            let one = values(base, PyList::new(py, one)?.as_any())?;
            self.call(py, |i| i.set_at(base, reference, &one))?;
        }
        Ok(())
    }

    /// Times of the experiment (s).
    #[pyo3(name = "_setup", signature = (tolerance, start, stop))]
    fn setup(&self, py: Python<'_>, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> PyResult<()> {
        self.call(py, |i| i.setup_with(start, stop, tolerance))
    }

    /// Begin the initialization.
    #[pyo3(name = "_enter")]
    fn enter(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::enter_initialization)
    }

    /// End the initialization.
    #[pyo3(name = "exitInitializationMode")]
    fn exit(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::exit_initialization)
    }

    /// Step from a time by a step size (s). FMI 3.0 returns (event encountered, end requested, early return, time reached).
    #[pyo3(name = "doStep", signature = (currentCommunicationPoint, communicationStepSize, noSetFMUStatePriorToCurrentPoint = true))]
    #[allow(non_snake_case, unused_variables, reason = "FMPy's names; a state may be set at any time, promised or not")]
    fn do_step<'py>(
        &self,
        py: Python<'py>,
        currentCommunicationPoint: f64,
        communicationStepSize: f64,
        noSetFMUStatePriorToCurrentPoint: bool,
    ) -> PyResult<Option<Bound<'py, PyTuple>>> {
        let (t, h) = (currentCommunicationPoint, communicationStepSize);
        // A step may take long: other threads run meanwhile.
        let stepped = gate(|| py.detach(|| self.with(|i| i.advance(t, h))))?;
        if self.fmi2 {
            return if stepped.terminate {
                Err(raise(Error::Call {
                    instance: self.name.clone(),
                    function: "fmi2DoStep",
                    status: "Discard".into(),
                    message: Some("the FMU asks to end the simulation".into()),
                }))
            } else {
                Ok(None)
            };
        }
        (stepped.event, stepped.terminate, stepped.early, stepped.last).into_pyobject(py).map(Some)
    }

    /// End the simulation; variables can still be read.
    fn terminate(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::terminate)
    }

    /// Return to the state after instantiation.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::reset)
    }

    /// Free the instance; it takes no more calls.
    #[pyo3(name = "freeInstance")]
    fn free(&self, py: Python<'_>) -> PyResult<()> {
        gate(|| {
            let free = || drop(self.inner.lock().unwrap_or_else(PoisonError::into_inner).take());
            let ((), lines) = py.detach(|| traced(free));
            if let Some(calls) = &self.calls {
                calls.lock().unwrap_or_else(PoisonError::into_inner).extend(lines);
            }
            Ok(())
        })
    }

    /// Switch logging on or off.
    #[pyo3(name = "_set_debug_logging")]
    fn set_debug_logging(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        self.call(py, |i| i.set_debug_logging(on))
    }

    /// Take the messages since the last call: (status, category, text).
    #[pyo3(name = "_take_messages")]
    fn take_messages(&self, py: Python<'_>) -> PyResult<Vec<(String, String, String)>> {
        let all = self.call(py, |i| Ok(i.take_messages()))?;
        Ok(all.into_iter().map(|m| (m.status.to_string(), m.category, m.text)).collect())
    }

    /// Take the lines of the calls since the last call.
    #[pyo3(name = "_take_calls")]
    fn take_calls(&self) -> Vec<String> {
        self.calls
            .as_ref()
            .map(|calls| std::mem::take(&mut *calls.lock().unwrap_or_else(PoisonError::into_inner)))
            .unwrap_or_default()
    }

    /// Enter event mode.
    #[pyo3(name = "enterEventMode")]
    fn enter_event_mode(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::enter_event_mode)
    }

    /// Update the discrete states once: (needs another, terminates, nominals changed, states changed, next is defined, next time).
    #[pyo3(name = "_update")]
    fn update(&self, py: Python<'_>) -> PyResult<(bool, bool, bool, bool, bool, f64)> {
        let u = self.call(py, fmu_import::Instance::update_discrete_states)?;
        let next = u.next_event_time;
        Ok((u.again, u.terminate, u.nominals_changed, u.states_changed, next.is_some(), next.unwrap_or(0.0)))
    }

    /// Leave event mode for continuous-time mode.
    #[pyo3(name = "_enter_continuous")]
    fn enter_continuous(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::enter_continuous_time_mode)
    }

    /// Leave event mode for step mode.
    #[pyo3(name = "_enter_steps")]
    fn enter_steps(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, fmu_import::Instance::enter_step_mode)
    }

    /// Numbers of continuous states and of event indicators.
    #[pyo3(name = "_counts")]
    fn counts(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        self.call(py, fmu_import::Instance::state_and_indicator_counts)
    }

    /// Set the time in continuous-time mode.
    #[pyo3(name = "_set_time")]
    fn set_time(&self, py: Python<'_>, time: f64) -> PyResult<()> {
        self.call(py, |i| i.set_time(time))
    }

    /// Set all continuous states.
    #[pyo3(name = "_set_states")]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn set_states(&self, py: Python<'_>, x: Vec<f64>) -> PyResult<()> {
        self.call(py, |i| i.set_continuous_states(&x))
    }

    /// Read `n` states, derivatives, indicators or nominals.
    #[pyo3(name = "_vector")]
    fn vector(&self, py: Python<'_>, which: &str, n: usize) -> PyResult<Vec<f64>> {
        let mut values = vec![0.0; n];
        self.call(py, |i| match which {
            "states" => i.get_continuous_states(&mut values),
            "derivatives" => i.get_derivatives(&mut values),
            "indicators" => i.get_event_indicators(&mut values),
            _ => i.get_nominals(&mut values),
        })?;
        Ok(values)
    }

    /// Report a completed integrator step: (enters event mode, terminates).
    #[pyo3(name = "_completed")]
    fn completed(&self, py: Python<'_>) -> PyResult<(bool, bool)> {
        let completed = self.call(py, fmu_import::Instance::completed_integrator_step)?;
        Ok((completed.enter_event_mode, completed.terminate))
    }

    /// Partial derivatives in the direction of a seed, or with `adjoint` the seed of the unknowns times them.
    #[pyo3(name = "_sensitivity")]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn sensitivity(
        &self,
        py: Python<'_>,
        unknowns: Vec<u32>,
        knowns: Vec<u32>,
        seed: Vec<f64>,
        results: usize,
        adjoint: bool,
    ) -> PyResult<Vec<f64>> {
        let mut values = vec![0.0; results];
        self.call(py, |i| {
            if adjoint {
                i.adjoint_derivative(&unknowns, &knowns, &seed, &mut values)
            } else {
                i.directional_derivative(&unknowns, &knowns, &seed, &mut values)
            }
        })?;
        Ok(values)
    }

    /// Derivatives of outputs with respect to time.
    #[pyo3(name = "_output_derivatives")]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn output_derivatives(&self, py: Python<'_>, vr: Vec<u32>, order: Vec<i32>) -> PyResult<Vec<f64>> {
        let mut values = vec![0.0; vr.len()];
        self.call(py, |i| i.output_derivatives(&vr, &order, &mut values)).map(|()| values)
    }

    /// Derivatives of inputs with respect to time (FMI 2.0).
    #[pyo3(name = "setRealInputDerivatives")]
    #[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
    fn set_input_derivatives(&self, py: Python<'_>, vr: Vec<u32>, order: Vec<i32>, value: Vec<f64>) -> PyResult<()> {
        self.call(py, |i| i.set_input_derivatives(&vr, &order, &value))
    }

    /// Save the state.
    #[pyo3(name = "getFMUState")]
    fn get_state(&self, py: Python<'_>) -> PyResult<FmuState> {
        let state = self.call(py, fmu_import::Instance::get_state)?;
        Ok(FmuState { state, owner: self.id })
    }

    /// Go back to a saved state of this instance.
    #[pyo3(name = "setFMUState")]
    fn set_state(&self, py: Python<'_>, state: &FmuState) -> PyResult<()> {
        let state = *self.state(state)?;
        self.call(py, |i| i.set_state(state))
    }

    /// Free a saved state; those that remain are freed with the instance.
    #[pyo3(name = "freeFMUState")]
    fn free_state(&self, py: Python<'_>, state: &FmuState) -> PyResult<()> {
        let state = *self.state(state)?;
        self.call(py, |i| i.free_state(state))
    }

    /// A saved state as bytes, for any instance of the same FMU.
    #[pyo3(name = "serializeFMUState")]
    fn serialize<'py>(&self, py: Python<'py>, state: &FmuState) -> PyResult<Bound<'py, PyBytes>> {
        let state = *self.state(state)?;
        Ok(PyBytes::new(py, &self.call(py, |i| i.serialize_state(state))?))
    }

    /// A state of this instance from bytes; it is not yet set.
    #[pyo3(name = "deserializeFMUState", signature = (serializedState, state = None))]
    #[allow(non_snake_case, unused_variables, reason = "FMPy's names; a state is never used again")]
    fn deserialize(&self, py: Python<'_>, serializedState: &[u8], state: Option<&FmuState>) -> PyResult<FmuState> {
        let state = self.call(py, |i| i.deserialize_state(serializedState))?;
        Ok(FmuState { state, owner: self.id })
    }
}
