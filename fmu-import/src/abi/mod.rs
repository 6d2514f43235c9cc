//! The C interface of both standards as an importer calls it: the only module with `unsafe` code.

pub(crate) mod arguments;
mod binary;
pub(crate) mod calls;
mod format;
pub(crate) mod functions;
pub mod journal;
pub(crate) mod library;
pub(crate) mod live;
pub(crate) mod log;
mod logger;
pub mod raw;
pub mod replay;
#[cfg(unix)]
pub(crate) mod sandbox;
mod signatures;

use crate::Error;
use crate::folder::Folder;
use crate::standard::{Kind, Outcome, Refusal};
use functions::Calls;
use live::Live;
use log::Log;
use model_description::FmiVersion;
use std::ffi::CStr;
use std::path::Path;
use std::sync::Arc;

/// The functions of a library, for the instances of the facade.
#[derive(Clone)]
pub(crate) struct Functions(Arc<Calls>);

impl Functions {
    /// Loads the binary of the description for this interface, and keeps the folder as long as the library is loaded.
    pub(crate) fn load(
        binary: &Path,
        version: FmiVersion,
        kind: Kind,
        folder: Option<Arc<Folder>>,
    ) -> Result<Self, Error> {
        let library = library::load(binary)?;
        // SAFETY: an FMU's functions have the types of the standard that its description names.
        let calls = unsafe { Calls::new(library, version, folder) };
        // Those that instantiate come first: a library that is not an FMU lacks them.
        let required = if version == FmiVersion::V2 { REQUIRED_2 } else { REQUIRED_3 };
        let found = promised(&calls, kind).and_then(|()| present(&calls, required));
        found.map_err(|cause| Error::file(binary, cause))?;
        Ok(Self(Arc::new(calls)))
    }

    /// An instance; `resources` is a URI in FMI 2.0 and a path in FMI 3.0.
    pub(crate) fn instantiate(&self, texts: [&CStr; 3], log: &Arc<Log>, shows: [bool; 2], kind: Kind) -> Outcome<Live> {
        promised(&self.0, kind).map_err(Refusal::Impossible)?;
        Live::new(&self.0, texts, log, shows, kind)
    }
}

/// Names the first missing function that an instance of this kind needs.
fn promised(calls: &Calls, kind: Kind) -> Result<(), String> {
    match (calls.version, kind) {
        (FmiVersion::V2, Kind::CoSimulation { .. }) => present(calls, &["fmi2Instantiate", "fmi2DoStep"]),
        (FmiVersion::V2, Kind::ModelExchange) => present(calls, MODEL_EXCHANGE_2),
        (FmiVersion::V3, Kind::CoSimulation { event_mode, .. }) => {
            present(calls, &["fmi3InstantiateCoSimulation", "fmi3DoStep"])?;
            present(calls, if event_mode { EVENT_MODE } else { &[] })
        }
        (FmiVersion::V3, Kind::ModelExchange) => present(calls, MODEL_EXCHANGE_3),
    }
}

fn present(calls: &Calls, names: &[&str]) -> Result<(), String> {
    match names.iter().find(|name| !calls.has(name)) {
        Some(name) => Err(format!("the function {name} is missing")),
        None => Ok(()),
    }
}

/// Functions that no FMU of FMI 2.0 may omit. Some exporters omit others; a call reports them.
const REQUIRED_2: &[&str] = &[
    "fmi2SetupExperiment",
    "fmi2EnterInitializationMode",
    "fmi2GetReal",
    "fmi2SetReal",
    "fmi2GetInteger",
    "fmi2SetInteger",
    "fmi2GetBoolean",
    "fmi2SetBoolean",
    "fmi2GetString",
    "fmi2SetString",
    "fmi2FreeInstance",
    "fmi2ExitInitializationMode",
    "fmi2Terminate",
    "fmi2Reset",
];

/// Functions that no FMU of FMI 3.0 may omit. Some exporters omit others; a call reports them.
const REQUIRED_3: &[&str] = &[
    "fmi3EnterInitializationMode",
    "fmi3GetFloat64",
    "fmi3SetFloat64",
    "fmi3FreeInstance",
    "fmi3ExitInitializationMode",
    "fmi3Terminate",
    "fmi3Reset",
];

/// Functions that `hasEventMode` promises.
const EVENT_MODE: &[&str] = &["fmi3EnterEventMode", "fmi3UpdateDiscreteStates", "fmi3EnterStepMode"];

/// Functions that Model Exchange promises in FMI 2.0.
const MODEL_EXCHANGE_2: &[&str] = &[
    "fmi2Instantiate",
    "fmi2EnterEventMode",
    "fmi2NewDiscreteStates",
    "fmi2EnterContinuousTimeMode",
    "fmi2CompletedIntegratorStep",
    "fmi2SetTime",
    "fmi2SetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetContinuousStates",
    "fmi2GetNominalsOfContinuousStates",
];

/// Functions that Model Exchange promises in FMI 3.0.
const MODEL_EXCHANGE_3: &[&str] = &[
    "fmi3InstantiateModelExchange",
    "fmi3EnterEventMode",
    "fmi3UpdateDiscreteStates",
    "fmi3EnterContinuousTimeMode",
    "fmi3CompletedIntegratorStep",
    "fmi3SetTime",
    "fmi3SetContinuousStates",
    "fmi3GetContinuousStateDerivatives",
    "fmi3GetEventIndicators",
    "fmi3GetContinuousStates",
    "fmi3GetNominalsOfContinuousStates",
    "fmi3GetNumberOfContinuousStates",
    "fmi3GetNumberOfEventIndicators",
];
