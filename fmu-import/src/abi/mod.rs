//! The C interface of both standards, from the importer's side: the only module with `unsafe` code.

pub(crate) mod fmi2;
pub(crate) mod fmi3;
pub mod journal;
pub(crate) mod library;
pub(crate) mod log;
pub mod raw;
#[cfg(unix)]
pub(crate) mod sandbox;
pub(crate) mod shared;
mod signatures;

use crate::Error;
use crate::folder::Folder;
use crate::instance::Stepped;
use crate::standard::{Kind, Outcome, Refusal, Standard};
use log::Log;
use model_description::FmiVersion;
use shared::SharedFunctions;
use std::ffi::CString;
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::sync::Arc;

/// The functions of a library, the library, and the folder that contains it, if it is kept; dropped in this order.
pub(crate) struct Loaded<F> {
    api: F,
    shared: Arc<SharedFunctions>,
    library: libloading::Library,
    _folder: Option<Arc<Folder>>,
}

/// The functions of either standard.
#[derive(Clone)]
pub(crate) enum Functions {
    V2(Arc<Loaded<fmi2::Functions>>),
    V3(Arc<Loaded<fmi3::Functions>>),
}

impl Functions {
    /// Loads the binary that a description with the interface of this kind promises, and keeps the folder as long as the
    /// library is loaded.
    pub(crate) fn load(
        binary: &Path,
        version: FmiVersion,
        kind: Kind,
        folder: Option<Arc<Folder>>,
    ) -> Result<Self, Error> {
        let library = library::load(binary)?;
        // First: a library that is not an FMU lacks the one that instantiates.
        promised(&library, version, kind).map_err(|cause| Error::file(binary, cause))?;
        let load = move || {
            // SAFETY: an FMU's functions have the types of the standard that its description names; the struct that they go
            // to keeps the library.
            let shared = || unsafe { SharedFunctions::load(&library, version) }.map(Arc::new);
            Ok(match version {
                FmiVersion::V2 => {
                    // SAFETY: as above.
                    let (api, shared) = (unsafe { fmi2::Functions::load(&library) }?, shared()?);
                    Self::V2(Arc::new(Loaded { api, shared, library, _folder: folder }))
                }
                FmiVersion::V3 => {
                    // SAFETY: as above.
                    let (api, shared) = (unsafe { fmi3::Functions::load(&library) }?, shared()?);
                    Self::V3(Arc::new(Loaded { api, shared, library, _folder: folder }))
                }
            })
        };
        load().map_err(|cause: String| Error::file(binary, cause))
    }

    /// An instance; `resources` is a URI in FMI 2.0 and a path in FMI 3.0.
    pub(crate) fn instantiate(
        &self,
        name: &CString,
        token: &CString,
        resources: &CString,
        log: &Arc<Log>,
        logging: bool,
        kind: Kind,
    ) -> Outcome<AnyInstance> {
        let (library, version) = match self {
            Self::V2(functions) => (&functions.library, FmiVersion::V2),
            Self::V3(functions) => (&functions.library, FmiVersion::V3),
        };
        promised(library, version, kind).map_err(Refusal::Impossible)?;
        match self {
            Self::V2(functions) => {
                fmi2::Instance::new(functions.clone(), name, token, resources, log, logging, kind).map(AnyInstance::V2)
            }
            Self::V3(functions) => {
                fmi3::Instance::new(functions.clone(), name, token, resources, log, logging, kind).map(AnyInstance::V3)
            }
        }
    }
}

/// An instance of either standard. What a simulation calls at every communication point is known here; all else goes
/// through [`Standard`].
pub(crate) enum AnyInstance {
    V2(fmi2::Instance),
    V3(fmi3::Instance),
}

impl AnyInstance {
    #[inline]
    pub(crate) fn get_reals(&mut self, references: &[u32], values: &mut [f64]) -> Outcome {
        match self {
            Self::V2(instance) => instance.get_reals(references, values),
            Self::V3(instance) => instance.get_reals(references, values),
        }
    }

    #[inline]
    pub(crate) fn set_reals(&mut self, references: &[u32], values: &[f64]) -> Outcome {
        match self {
            Self::V2(instance) => instance.set_reals(references, values),
            Self::V3(instance) => instance.set_reals(references, values),
        }
    }

    #[inline]
    pub(crate) fn do_step(&mut self, t: f64, h: f64) -> Outcome<Stepped> {
        match self {
            Self::V2(instance) => instance.do_step(t, h),
            Self::V3(instance) => instance.do_step(t, h),
        }
    }
}

impl Deref for AnyInstance {
    type Target = dyn Standard + Send;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::V2(instance) => instance,
            Self::V3(instance) => instance,
        }
    }
}

impl DerefMut for AnyInstance {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::V2(instance) => instance,
            Self::V3(instance) => instance,
        }
    }
}

/// Names the first function that is missing of those that an instance of this kind needs.
fn promised(library: &libloading::Library, version: FmiVersion, kind: Kind) -> Result<(), String> {
    let (names, more): (&[&str], &[&str]) = match (version, kind) {
        (FmiVersion::V2, Kind::CoSimulation { .. }) => (fmi2::CO_SIMULATION, &[]),
        (FmiVersion::V2, Kind::ModelExchange) => (fmi2::MODEL_EXCHANGE, &[]),
        (FmiVersion::V3, Kind::CoSimulation { event_mode: false, .. }) => (fmi3::CO_SIMULATION, &[]),
        (FmiVersion::V3, Kind::CoSimulation { event_mode: true, .. }) => (fmi3::CO_SIMULATION, fmi3::EVENT_MODE),
        (FmiVersion::V3, Kind::ModelExchange) => (fmi3::MODEL_EXCHANGE, &[]),
    };
    // SAFETY: only whether there is such a symbol is asked; nothing is called under this type.
    let lacks = |name: &&&str| unsafe { library.get::<signatures::OfInstance>(**name) }.is_err();
    match names.iter().chain(more).find(lacks) {
        Some(name) => Err(format!("the function {name} is missing")),
        None => Ok(()),
    }
}
