//! Values for a machine: `fmurun.drives.tune`.

use crate::error::{gate, plain};
use pyo3::prelude::*;
use std::path::PathBuf;

/// The values of a machine's file as JSON.
#[pyfunction]
#[pyo3(signature = (path, estimator = None))]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn tune(py: Python<'_>, path: PathBuf, estimator: Option<String>) -> PyResult<String> {
    let values = || drive_tools::tune::values(&path, estimator.as_deref());
    gate(|| py.detach(values).map(|values| values.to_string()).map_err(|e| plain(&format!("{e:#}"))))
}
