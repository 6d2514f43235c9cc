//! The C interface of both standards, from the importer's side: the only module with `unsafe` code.

pub(crate) mod fmi2;
pub(crate) mod fmi3;
pub(crate) mod library;
pub(crate) mod log;
pub mod raw;
pub(crate) mod shared;
mod signatures;

use crate::Error;
use crate::folder::Folder;
use crate::standard::{Outcome, Standard};
use log::Log;
use model_description::FmiVersion;
use shared::SharedFunctions;
use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;

/// The functions of a library, the library, and the folder that contains it, if it is kept; dropped in this order.
pub(crate) struct Loaded<F> {
    api: F,
    shared: Arc<SharedFunctions>,
    _library: libloading::Library,
    _folder: Option<Arc<Folder>>,
}

/// The functions of either standard.
#[derive(Clone)]
pub(crate) enum Functions {
    V2(Arc<Loaded<fmi2::Functions>>),
    V3(Arc<Loaded<fmi3::Functions>>),
}

impl Functions {
    /// Loads the binary, and keeps the folder as long as the library is loaded.
    pub(crate) fn load(binary: &Path, version: FmiVersion, folder: Option<Arc<Folder>>) -> Result<Self, Error> {
        let library = library::load(binary)?;
        let load = move || {
            // SAFETY: an FMU's functions have the types of the standard that its description names; the struct that they go
            // to keeps the library.
            let shared = || unsafe { SharedFunctions::load(&library, version) }.map(Arc::new);
            // The functions of each standard first: a library that is not an FMU lacks the one that instantiates.
            Ok(match version {
                FmiVersion::V2 => {
                    // SAFETY: as above.
                    let (api, shared) = (unsafe { fmi2::Functions::load(&library) }?, shared()?);
                    Self::V2(Arc::new(Loaded { api, shared, _library: library, _folder: folder }))
                }
                FmiVersion::V3 => {
                    // SAFETY: as above.
                    let (api, shared) = (unsafe { fmi3::Functions::load(&library) }?, shared()?);
                    Self::V3(Arc::new(Loaded { api, shared, _library: library, _folder: folder }))
                }
            })
        };
        load().map_err(|cause: String| Error::file(binary, cause))
    }

    /// An instance for co-simulation; `resources` is a URI in FMI 2.0 and a path in FMI 3.0.
    pub(crate) fn instantiate(
        &self,
        name: &CString,
        token: &CString,
        resources: &CString,
        log: &Arc<Log>,
        logging: bool,
    ) -> Outcome<Box<dyn Standard + Send>> {
        match self {
            Self::V2(functions) => {
                fmi2::Instance::new(functions.clone(), name, token, resources, log, logging).map(|i| Box::new(i) as _)
            }
            Self::V3(functions) => {
                fmi3::Instance::new(functions.clone(), name, token, resources, log, logging).map(|i| Box::new(i) as _)
            }
        }
    }
}
