//! Frequency responses: the implementation behind `fmurun.frequency_response` in `fmurun/_frequency.py`.

use crate::error::gate;
use crate::plan::{GoOn, Plan, attended};
use fmu_sweep::frequency::{self, Complex64, Excitation, FrequencyOutcome, ResponsePoint};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The response of an output at all frequencies: frequencies (Hz), values, amplitudes, the checks (amplitude, settling, step),
/// the doubts or the error per frequency, and the first warning of the FMUs.
#[pyfunction]
#[expect(clippy::type_complexity, clippy::too_many_arguments, reason = "Python's arguments and result")]
pub(crate) fn frequency_response<'py>(
    py: Python<'py>,
    plan: &Plan,
    input: String,
    output: String,
    over: Option<String>,
    frequencies: Vec<f64>,
    amplitude: Option<f64>,
    settle: Option<f64>,
    threads: usize,
) -> PyResult<(
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<Complex64>>,
    Bound<'py, PyArray1<f64>>,
    [Bound<'py, PyArray1<f64>>; 3],
    Vec<String>,
    Option<String>,
)> {
    gate(|| {
        let excitation =
            Excitation { input, outputs: vec![output], over, watch: Vec::new(), frequencies, amplitude, settle };
        let threads = if threads == 0 { fmu_sweep::threads_here() } else { threads };
        let run = |go_on: &GoOn<'_>| plan.plan().frequency_response(&excitation, threads, go_on);
        let outcomes: Vec<FrequencyOutcome> = py.detach(|| attended(run, None))?;
        let of = |value: fn(&frequency::FrequencyPoint) -> f64| {
            let one = |(_, outcome): &FrequencyOutcome| outcome.as_ref().map_or(f64::NAN, value);
            outcomes.iter().map(one).collect::<Vec<f64>>().into_pyarray(py)
        };
        let none = Complex64::new(f64::NAN, f64::NAN);
        let value = |(_, outcome): &FrequencyOutcome| outcome.as_ref().map_or(none, |point| point.values[0]);
        let doubt = |(_, outcome): &FrequencyOutcome| match outcome {
            Ok(point) => point.doubts().join("; "),
            Err(error) => error.clone(),
        };
        let warning = outcomes.iter().find_map(|(_, outcome)| outcome.as_ref().ok()?.warning.clone());
        Ok((
            outcomes.iter().map(|(f, _)| *f).collect::<Vec<f64>>().into_pyarray(py),
            outcomes.iter().map(value).collect::<Vec<Complex64>>().into_pyarray(py),
            of(|point| point.amplitude),
            [of(|point| point.nonlinear), of(|point| point.unsettled), of(|point| point.stepped.unwrap_or(f64::NAN))],
            outcomes.iter().map(doubt).collect(),
            warning,
        ))
    })
}

/// Properties of a closed loop (`open` false) or the margins of an open one.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn loop_properties<'py>(
    py: Python<'py>,
    frequencies: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray1<'py, Complex64>,
    open: bool,
) -> PyResult<Bound<'py, PyDict>> {
    gate(|| {
        let points: Vec<ResponsePoint> = points(&frequencies, &values).filter(|(_, x)| x.is_finite()).collect();
        let dict = PyDict::new(py);
        if open {
            let found = frequency::margins(&points);
            dict.set_item("crossover", found.crossover)?;
            dict.set_item("phase_margin", found.phase)?;
            dict.set_item("delay_margin", found.delay)?;
            dict.set_item("phase_crossover", found.phase_crossover)?;
            dict.set_item("gain_margin", found.gain)?;
            dict.set_item("sensitivity", found.sensitivity)?;
            dict.set_item("sensitivity_at", found.sensitivity_at)?;
        } else {
            let found = frequency::band(&points);
            dict.set_item("bandwidth", found.bandwidth)?;
            dict.set_item("peak", found.peak)?;
            dict.set_item("peak_at", found.peak_at)?;
        }
        Ok(dict)
    })
}

/// Phases in degrees without jumps.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn phases<'py>(
    py: Python<'py>,
    frequencies: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray1<'py, Complex64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    gate(|| Ok(frequency::phases(&points(&frequencies, &values).collect::<Vec<_>>()).into_pyarray(py)))
}

fn points(
    frequencies: &PyReadonlyArray1<'_, f64>,
    values: &PyReadonlyArray1<'_, Complex64>,
) -> impl Iterator<Item = ResponsePoint> {
    let values: Vec<Complex64> = values.as_array().iter().copied().collect();
    let frequencies: Vec<f64> = frequencies.as_array().iter().copied().collect();
    frequencies.into_iter().zip(values)
}
