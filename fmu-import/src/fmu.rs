//! An FMU: its archive, its description and its loaded binary.

use crate::abi::Functions;
use crate::abi::journal::{self, Call};
use crate::abi::log::{Log, Logging};
use crate::archive::{self, Archive, Extracted};
use crate::error::Error;
use crate::folder::Folder;
use crate::instance::Instance;
use crate::standard::{Kind, explain};
use crate::text::file_uri;
use model_description::{FmiVersion, Interface, ModelDescription, TerminalsAndIcons};
use std::collections::BTreeMap;
use std::ffi::CString;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The description of an `.fmu` file, and all its files.
///
/// # Errors
/// The file is missing, is not an archive, or has no readable description.
pub fn contents(path: &Path) -> Result<(ModelDescription, BTreeMap<String, Vec<u8>>), Error> {
    let mut archive = Archive::open(path)?;
    let files = archive.files()?;
    Ok((Arc::unwrap_or_clone(archive.description), files))
}

/// Summary of an `.fmu` file, from a small part of its bytes.
#[non_exhaustive]
pub struct Outline {
    /// Its description.
    pub description: ModelDescription,
    /// Terminals and icons, if they exist and can be read.
    pub terminals: Option<TerminalsAndIcons>,
    /// The names of its files, and the heads of those below `binaries/`.
    pub files: BTreeMap<String, Vec<u8>>,
}

/// Reads an `.fmu` file as far as needed to describe it: its memory does not grow with the unpacked size of the archive.
///
/// # Errors
/// The file is missing, is not an archive, or has no readable description.
pub fn outline(path: &Path) -> Result<Outline, Error> {
    let mut archive = Archive::open(path)?;
    let (files, terminals) = (archive.outline()?, archive.terminals().ok().flatten());
    Ok(Outline { description: Arc::unwrap_or_clone(archive.description), terminals, files })
}

/// An archive unpacked to its folder, for [`describe`](crate::describe).
pub struct Unpacked {
    folder: Folder,
    /// The library for this platform.
    pub library: PathBuf,
}

impl Unpacked {
    /// Unpacks the library for this platform and the resources.
    ///
    /// # Errors
    /// The file is missing, is not an archive, or lacks a readable description or a binary for this platform.
    pub fn new(path: &Path) -> Result<Self, Error> {
        let Extracted { folder, co_simulation, model_exchange, .. } = Archive::open(path)?.extract()?;
        let library = co_simulation.map(Ok).or(model_exchange).transpose()?;
        let library = library.ok_or_else(|| Error::file(path, "has no binary"))?;
        Ok(Self { folder, library })
    }

    /// The folder of its resources.
    pub fn resources(&self) -> PathBuf {
        self.folder.path().join("resources")
    }
}

/// An FMU with its description and its loaded binary. Every opening loads a separate copy of the binary; clones share it.
#[derive(Clone)]
pub struct Fmu {
    path: PathBuf,
    description: Arc<ModelDescription>,
    terminals: Arc<Result<Option<TerminalsAndIcons>, Error>>,
    /// Each interface of the description with its binary. If there is Co-Simulation, a binary for Model Exchange only may fail
    /// to load.
    co_simulation: Option<Functions>,
    model_exchange: Option<Result<Functions, Error>>,
    archive: Arc<Mutex<Archive>>,
    /// Path of the unpacked folder `resources`, which exists only if the archive has one.
    resources: PathBuf,
}

impl Fmu {
    /// Opens an `.fmu` file of FMI 2.0 or FMI 3.0.
    ///
    /// # Errors
    /// The file is missing or is not an archive; it lacks a readable description, an interface (Co-Simulation or Model
    /// Exchange), or a binary for this platform; or the binary lacks a function.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::load(&Arc::new(Mutex::new(Archive::open(path.as_ref())?)))
    }

    /// Opens the bytes of an `.fmu` file; errors name it `path`.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn from_bytes(path: impl AsRef<Path>, bytes: Arc<[u8]>) -> Result<Self, Error> {
        Self::load(&Arc::new(Mutex::new(Archive::from_bytes(path.as_ref(), bytes)?)))
    }

    /// Opens the FMU again with another copy of its binary, from the same archive, even if its path now refers to another file.
    /// After the status Fatal no instance of a binary can be used (FMI 2.0.5, 2.1.3; FMI 3.0.2, 2.2.4).
    ///
    /// # Errors
    /// The archive cannot be read or unpacked.
    pub fn open_again(&self) -> Result<Self, Error> {
        Self::load(&self.archive)
    }

    fn load(shared: &Arc<Mutex<Archive>>) -> Result<Self, Error> {
        let mut archive = shared.lock().unwrap_or_else(PoisonError::into_inner);
        let Extracted { folder, co_simulation, model_exchange, files } = archive.extract()?;
        let folder = Arc::new(folder);
        let (terminals, description) = (Arc::new(archive.terminals()), archive.description.clone());
        let (path, resources) = (archive.path.clone(), folder.path().join("resources"));
        journal::note(journal::name(&path.to_string_lossy()), Call::Load);
        // A loaded binary no longer needs its file, except on Windows, so a kill leaves nothing behind.
        let kept = (cfg!(windows) || files > 1).then(|| folder.clone());
        let load = |binary: &Path, kind| {
            Functions::load(binary, description.version, kind, kept.clone()).map_err(|e| Error::file(&path, e.cause()))
        };
        let stepping = co_simulation.as_ref().map(|binary| load(binary, Kind::default())).transpose()?;
        let exchanging = model_exchange.map(|binary| match &stepping {
            Some(functions) if binary.as_ref().ok() == co_simulation.as_ref() => Ok(functions.clone()),
            _ => load(&binary?, Kind::ModelExchange),
        });
        let exchanging = match exchanging {
            Some(Err(error)) if stepping.is_none() => return Err(error),
            other => other,
        };
        let archive = shared.clone();
        Ok(Self {
            description,
            terminals,
            co_simulation: stepping,
            model_exchange: exchanging,
            archive,
            resources,
            path,
        })
    }

    /// The contents of modelDescription.xml.
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// The contents of terminalsAndIcons.xml, if present.
    ///
    /// # Errors
    /// The file cannot be read; the FMU still runs.
    pub fn terminals(&self) -> Result<Option<&TerminalsAndIcons>, Error> {
        (*self.terminals).as_ref().map(Option::as_ref).map_err(Clone::clone)
    }

    /// Path of the `.fmu` file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Creates an instance for co-simulation; with `true`, the FMU logs everything, with `false` only errors.
    ///
    /// # Errors
    /// The FMU refuses or has no Co-Simulation, or a name has a null byte.
    pub fn instantiate(&self, name: &str, logging: impl Into<Logging>) -> Result<Instance, Error> {
        self.instantiate_as(Kind::default(), name, logging)
    }

    /// Creates an instance of this kind.
    ///
    /// # Errors
    /// The FMU refuses or has no such interface, or a name has a null byte.
    pub fn instantiate_as(&self, kind: Kind, name: &str, logging: impl Into<Logging>) -> Result<Instance, Error> {
        self.instantiate_with(kind, name, logging, false)
    }

    /// Creates an instance of this kind; `visible` lets an FMU that has a window show it.
    ///
    /// # Errors
    /// As [`instantiate_as`](Self::instantiate_as).
    pub fn instantiate_with(
        &self,
        kind: Kind,
        name: &str,
        logging: impl Into<Logging>,
        visible: bool,
    ) -> Result<Instance, Error> {
        let logging = logging.into();
        let mut instance = self.made(kind, name, logging == Logging::All, visible)?;
        if logging == Logging::Warnings && instance.log_warnings(true).is_err() {
            // After an error, an instance can only be freed; one without warnings is better than none.
            drop(instance);
            return self.made(kind, name, false, visible);
        }
        Ok(instance)
    }

    fn made(&self, kind: Kind, name: &str, logging: bool, visible: bool) -> Result<Instance, Error> {
        let functions = self.functions(kind, name)?;
        let c_name = text(name, name)?;
        let token = text(name, &self.description.token)?;
        let log = Log::new();
        let resources = match self.description.version {
            FmiVersion::V2 => file_uri(&self.resources),
            // FMI 3.0 requires a native path with a separator at its end (FMI 3.0.2, 2.3.1).
            FmiVersion::V3 => format!("{}{}", self.resources.display(), std::path::MAIN_SEPARATOR),
        };
        let resources = text(name, &resources)?;
        let id = journal::name(name);
        journal::note(id, Call::Instantiate);
        match functions.instantiate([&c_name, &token, &resources], &log, [logging, visible], kind) {
            Ok(live) => Ok(Instance::new(name, id, self.description.clone(), live, kind, log)),
            Err(refusal) => Err(explain(name, refusal, log.reason())),
        }
    }

    /// The functions of the interface that a kind of instance needs.
    fn functions(&self, kind: Kind, instance: &str) -> Result<&Functions, Error> {
        let has = archive::interfaces(&self.description);
        let none = |what: &str| Error::usage(instance, format!("has no {what}; it has {has}"));
        match kind {
            Kind::ModelExchange => match &self.model_exchange {
                Some(functions) => functions.as_ref().map_err(Clone::clone),
                None => Err(none("Model Exchange")),
            },
            Kind::CoSimulation { event_mode, early_return } => {
                let functions = self.co_simulation.as_ref().ok_or_else(|| none("Co-Simulation"))?;
                if event_mode && !self.description.co_simulation.as_ref().is_some_and(Interface::has_event_mode) {
                    return Err(none("event mode"));
                }
                if early_return && self.description.version == FmiVersion::V2 {
                    return Err(none("early return"));
                }
                Ok(functions)
            }
        }
    }
}

fn text(instance: &str, text: &str) -> Result<CString, Error> {
    CString::new(text).map_err(|_| Error::usage(instance, format!("{text:?} has a null byte")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_share_fmus_and_pass_instances_on() {
        fn shared<T: Clone + Send + Sync>() {}
        fn passed_on<T: Send>() {}
        shared::<Fmu>();
        passed_on::<Instance>();
    }
}
