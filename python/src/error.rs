//! Errors and panics as `FmuError`, a class of `fmurun/_error.py`, so that pickle finds it by name.

use fmu_import::Error;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use std::panic::{AssertUnwindSafe, catch_unwind};

static CLASS: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

fn make(fields: (Option<&str>, Option<&str>, Option<&str>, &str)) -> PyErr {
    Python::attach(|py| {
        let class = CLASS.get_or_try_init(py, || Ok(py.import("fmurun._error")?.getattr("FmuError")?.unbind()));
        match class.and_then(|class| class.bind(py).call1(fields)) {
            Ok(error) => PyErr::from_value(error),
            Err(other) => other,
        }
    })
}

/// The `FmuError` of an importer's error.
pub(crate) fn raise(error: Error) -> PyErr {
    match error {
        Error::Variable { ref instance, .. } => make((None, None, Some(instance), &error.cause())),
        Error::Usage { instance, cause } => make((None, None, Some(&instance), &cause)),
        Error::Call { instance, function, status, message } => {
            make((Some(function), Some(&status), Some(&instance), message.as_deref().unwrap_or_default()))
        }
        other => make((None, None, None, &other.to_string())),
    }
}

/// An `FmuError` about one instance.
pub(crate) fn usage(instance: &str, cause: &str) -> PyErr {
    make((None, None, Some(instance), cause))
}

/// An `FmuError` with a message only.
pub(crate) fn plain(message: &str) -> PyErr {
    make((None, None, None, message))
}

/// The entry of every call from Python: a panic becomes an `FmuError`, which `except Exception` catches, instead of PyO3's
/// `PanicException`, which it does not.
#[inline]
pub(crate) fn gate<T>(call: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|panic| {
        let said = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
        Err(plain(&format!("a fault of fmurun: {}", said.unwrap_or("panic"))))
    })
}

/// Panics behind the gate; for the gate's test.
#[pyfunction]
#[pyo3(name = "_panic")]
pub(crate) fn panic() -> PyResult<()> {
    gate(|| panic!("asked for"))
}
