//! A machine from a record: `fmurun.identify`.

use crate::error::{gate, plain};
use drive_tools::csv::Columns;
use drive_tools::identify::columns::Signals;
use drive_tools::identify::{Options, identify as of};
use pyo3::prelude::*;

/// The result of `fmu identify --json` for columns in memory; `options` is the JSON of [`Options`].
#[pyfunction]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn identify(py: Python<'_>, columns: Vec<(String, Vec<f64>)>, options: String) -> PyResult<String> {
    let found = || {
        let options: Options = serde_json::from_str(&options)?;
        let table = Columns::of("record", &columns)?;
        of(&Signals::of(&table, &options.naming)?, &options).map(|found| found.json().to_string())
    };
    gate(|| py.detach(found).map_err(|e| plain(&format!("{e:#}"))))
}
