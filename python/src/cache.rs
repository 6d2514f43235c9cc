//! FMUs that this process has opened; an archive with equal bytes is opened once.

use crate::describe;
use crate::error::{gate, plain, raise};
use fmu_import::Error;
use model_description::{FmiVersion, ModelDescription};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Maximum number of unused FMUs that stay open.
const KEPT: usize = 16;

static OPENED: Mutex<VecDeque<Arc<Opened>>> = Mutex::new(VecDeque::new());

/// An open FMU with the bytes of its archive.
pub(crate) struct Opened {
    pub(crate) fmu: fmu_import::Fmu,
    bytes: Arc<[u8]>,
    /// Number of elements of each array, by value reference.
    pub(crate) arrays: HashMap<u32, usize>,
}

impl Opened {
    pub(crate) fn is_fmi2(&self) -> bool {
        self.fmu.description().version == FmiVersion::V2
    }
}

/// The open FMU with these bytes, opened under the lock so that two threads open it only once.
pub(crate) fn opened(path: &Path, bytes: Vec<u8>) -> Result<Arc<Opened>, Error> {
    let mut all = OPENED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(index) = all.iter().position(|o| *o.bytes == *bytes) {
        let found = all.remove(index).unwrap_or_else(|| unreachable!("position is below the length"));
        all.push_back(found.clone());
        return Ok(found);
    }
    let bytes: Arc<[u8]> = bytes.into();
    let fmu = fmu_import::Fmu::from_bytes(path, bytes.clone())?;
    let arrays = array_sizes(fmu.description());
    let opened = Arc::new(Opened { fmu, bytes, arrays });
    all.push_back(opened.clone());
    if all.len() > KEPT {
        all.pop_front();
    }
    Ok(opened)
}

/// After a fatal error no instance of the library can be used (FMI 3.0.2, 2.2.4): the next one gets a separate library.
pub(crate) fn forget(opened: &Arc<Opened>) {
    OPENED.lock().unwrap_or_else(PoisonError::into_inner).retain(|o| !Arc::ptr_eq(o, opened));
}

/// Opens the FMU again, with a library that has had no fatal error.
pub(crate) fn renewed(opened: &Arc<Opened>) -> Result<Arc<Opened>, Error> {
    forget(opened);
    self::opened(opened.fmu.path(), opened.bytes.to_vec())
}

/// Reads a file and opens it.
pub(crate) fn read(path: &Path) -> Result<Arc<Opened>, Error> {
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    opened(path, bytes)
}

fn array_sizes(description: &ModelDescription) -> HashMap<u32, usize> {
    let arrays = description.variables.iter().filter(|v| v.is_array());
    arrays.map(|v| (v.value_reference, describe::shape(description, v).iter().product())).collect()
}

/// An open FMU.
#[pyclass(frozen, module = "fmurun._core")]
pub(crate) struct Fmu(pub(crate) Arc<Opened>);

#[pymethods]
impl Fmu {
    /// Whether both are the same open library.
    fn __eq__(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    fn __hash__(&self) -> u64 {
        // The address, like Python's hash of an object; it is valid as long as the FMU is open.
        Arc::as_ptr(&self.0) as u64 >> 4
    }

    /// The model description as plain values; see `describe` in Rust.
    fn describe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        gate(|| describe::dictionary(py, self.0.fmu.description()))
    }
}

/// Opens an FMU from its file, or from bytes; errors name it `path`.
#[pyfunction]
#[pyo3(signature = (path, bytes = None))]
#[expect(clippy::needless_pass_by_value, reason = "PyO3 extracts values")]
pub(crate) fn open(py: Python<'_>, path: PathBuf, bytes: Option<Vec<u8>>) -> PyResult<Fmu> {
    gate(|| {
        if bytes.is_none() && path.as_os_str().is_empty() {
            return Err(plain("the name of the FMU is empty"));
        }
        py.detach(|| bytes.map_or_else(|| read(&path), |bytes| opened(&path, bytes))).map(Fmu).map_err(raise)
    })
}
