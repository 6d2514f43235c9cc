//! Values for a machine and for a data sheet: `fmurun.drives.tune` and `from_datasheet`.

use crate::error::{gate, plain};
use drive_tools::tune::application::Application;
use pyo3::prelude::*;
use std::path::PathBuf;

/// The values of a machine's file in an application as JSON.
#[pyfunction]
#[pyo3(signature = (path, estimator = None, control = None, shaft = None))]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn tune(
    py: Python<'_>,
    path: PathBuf,
    estimator: Option<String>,
    control: Option<String>,
    shaft: Option<String>,
) -> PyResult<String> {
    let values = || {
        let application = Application::named(control.as_deref(), shaft.as_deref())?;
        drive_tools::tune::values(&path, estimator.as_deref(), application)
    };
    gate(|| py.detach(values).map(|values| values.to_string()).map_err(|e| plain(&format!("{e:#}"))))
}

/// The values of `MappedDrive` for a data sheet as JSON, and its doubts.
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn datasheet(py: Python<'_>, path: PathBuf) -> PyResult<(String, Vec<String>)> {
    let values = || drive_tools::datasheet::values(&path);
    gate(|| {
        py.detach(values).map(|(values, doubts)| (values.to_string(), doubts)).map_err(|e| plain(&format!("{e:#}")))
    })
}
