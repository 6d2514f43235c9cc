//! The file under check: archive, description as XML tree and as parsed, and the unpacked folders.

use crate::zip_headers::{Archive, contents, copy, is_inside};
use fmu_import::platform::Platform;
use fmu_import::{Folder, limits, machine};
use model_description::{Element, Error, FmiVersion, Interface, ModelDescription, ModelVariable};
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

const DESCRIPTION: &str = "modelDescription.xml";

/// A file that cannot be checked at all: exit status 2.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub struct Unusable {
    path: PathBuf,
    cause: String,
}

/// A binary in the archive.
pub(super) struct Binary {
    /// Name in the archive.
    pub(super) name: String,
    /// Folder below `binaries/`.
    pub(super) folder: String,
    /// The folder with the unpacked files.
    path: PathBuf,
}

impl Binary {
    /// Its contents.
    pub(super) fn bytes(&self) -> Result<Vec<u8>, String> {
        let read = || {
            limits::LIBRARY.check(fs::metadata(&self.path).map_err(|e| e.to_string())?.len())?;
            fs::read(&self.path).map_err(|e| e.to_string())
        };
        read().map_err(|cause| format!("{}: {cause}", self.name))
    }

    /// The platforms that it is for, from its headers.
    fn platforms(&self) -> io::Result<Vec<Platform>> {
        let mut head = Vec::new();
        File::open(&self.path)?.take(machine::HEAD).read_to_end(&mut head)?;
        Ok(machine::platforms(&head))
    }
}

/// An FMU to be checked.
pub struct FmuFile {
    /// Path of the `.fmu` file.
    pub path: PathBuf,
    pub(super) source: File,
    pub(super) zip: Archive,
    pub(super) xml: Vec<u8>,
    /// The standard that it claims to follow.
    pub version: FmiVersion,
    /// The description as elements, or why it is not XML.
    pub(super) tree: Result<Element, String>,
    /// The description as an importer reads it, or why it cannot.
    pub(super) description: Result<ModelDescription, String>,
    pub(super) binaries: Vec<Binary>,
    /// Location of the element of a variable, by its line and name.
    places: OnceLock<HashMap<(usize, String), usize>>,
    /// Entries that could not be unpacked.
    pub(super) unpack_errors: Vec<String>,
    /// Entries that this computer could not store, for example because of their long names.
    pub(super) own_errors: Vec<String>,
    dir: Folder,
}

impl FmuFile {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, is not a ZIP archive, or has no description of FMI 2.0 or 3.0.
    pub fn open(path: &Path) -> Result<Self, Unusable> {
        let unusable = |cause: String| Unusable { path: path.into(), cause };
        let size = fs::metadata(path).map_err(|e| unusable(e.to_string()))?;
        if !size.is_file() {
            return Err(unusable("is not a file".into()));
        }
        limits::ARCHIVE.check(size.len()).map_err(&unusable)?;
        let source = File::open(path).map_err(|e| unusable(e.to_string()))?;
        let zip = Archive::read(&source, size.len()).map_err(&unusable)?;
        let entry = zip.find(DESCRIPTION).ok_or_else(|| unusable(format!("has no {DESCRIPTION}")))?;
        let in_description = |cause: String| unusable(format!("{DESCRIPTION}: {cause}"));
        limits::XML.check(entry.central.size.into()).map_err(in_description)?;
        let xml = contents(&source, entry, limits::XML.most).map_err(&unusable)?;
        let version = version(&xml).map_err(&unusable)?;
        let tree = model_description::decode(&xml).and_then(Element::parse);
        let description = tree.as_ref().map_err(Clone::clone).and_then(model_description::read_element);
        if let Err(Error::Limit(cause)) = &description {
            return Err(in_description(cause.clone()));
        }
        let (tree, description) = (tree.map_err(|e| e.to_string()), description.map_err(|e| e.to_string()));
        let folder = std::env::temp_dir();
        let full = |e: io::Error| {
            unusable(format!("cannot be unpacked to the temporary folder {}: {e}; set TMPDIR", folder.display()))
        };
        let dir = Folder::new().map_err(full)?;
        let mut fmu = Self {
            path: path.into(),
            source,
            zip,
            xml,
            version,
            tree,
            description,
            binaries: Vec::new(),
            places: OnceLock::new(),
            unpack_errors: Vec::new(),
            own_errors: Vec::new(),
            dir,
        };
        fmu.unpack().map_err(full)?;
        Ok(fmu)
    }

    /// Where it was unpacked: `modelDescription.xml`, `binaries/` of every platform, `resources/`, and the folders
    /// that the probe of I02 removes.
    pub(super) fn dir(&self) -> &Path {
        self.dir.path()
    }

    /// Removes the unpacked files, even if a check that exceeds its time limit still uses them.
    pub(super) fn discard(&self) {
        let _ = fs::remove_dir_all(self.dir());
    }

    fn unpack(&mut self) -> io::Result<()> {
        fs::create_dir(self.dir().join("resources"))?;
        fs::write(self.dir().join(DESCRIPTION), &self.xml)?;
        let mut left = limits::UNPACKED.most;
        // If a file and a folder share a name, an importer needs the folder.
        let folders = self.zip.files_and_folders();
        for entry in &self.zip.entries {
            let name = entry.name();
            if name.ends_with('/') || entry.is_link() || !is_inside(&name) || (name == DESCRIPTION) {
                continue;
            }
            let folder = name.split('/').next().unwrap_or_default();
            let wanted = ["binaries", "resources", "terminalsAndIcons", "extra"].contains(&folder)
                && folders.binary_search(&name).is_err();
            let path = self.dir.path().join(&name);
            let made = || path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| File::create(&path));
            let mut target = Target(wanted.then(made));
            let copied = copy(&self.source, entry, left, &mut target);
            if let Some(Err(e)) = &target.0 {
                self.own_errors.push(format!("{name}: {e}"));
            }
            match copied {
                Err(cause) => {
                    self.unpack_errors.push(cause);
                    if wanted {
                        let _ = fs::remove_file(&path);
                    }
                }
                Ok(bytes) => {
                    left -= bytes;
                    if let Some((folder, file)) = name.strip_prefix("binaries/").and_then(|n| n.split_once('/')) {
                        let library = [".so", ".dll", ".dylib"].iter().any(|extension| file.ends_with(extension));
                        if library && !file.contains('/') && matches!(target.0, Some(Ok(_))) {
                            self.binaries.push(Binary { folder: folder.into(), name: name.clone(), path });
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// The root element.
    pub(super) fn root(&self) -> Option<&Element> {
        self.tree.as_ref().ok()
    }

    /// The element of a variable.
    pub(super) fn element_of(&self, v: &ModelVariable) -> Option<&Element> {
        let list = &self.root()?.child("ModelVariables")?.children;
        let places = self.places.get_or_init(|| {
            let key = |e: &Element| (e.line, e.get("name").unwrap_or_default().to_owned());
            list.iter().enumerate().rev().map(|(index, e)| (key(e), index)).collect()
        });
        list.get(*places.get(&(v.line, v.name.clone()))?)
    }

    /// The interface for co-simulation if available, otherwise another one.
    pub(super) fn interface(&self) -> Option<&Interface> {
        let description = self.description.as_ref().ok()?;
        let interface = description.co_simulation.as_ref().or(description.model_exchange.as_ref());
        interface.or(description.scheduled_execution.as_ref())
    }

    /// The binary of an interface for this machine, by its name in the archive: from the first folder with a library for this
    /// processor, or else from the first folder.
    pub(super) fn host_binary(&self, interface: &Interface) -> Result<&Binary, String> {
        let host = Platform::host();
        let file = format!("{}.{}", interface.model_identifier, host.extension());
        let folders = host.folders(self.version);
        let named = |folder: &&str| self.binaries.iter().find(|b| b.name == format!("binaries/{folder}/{file}"));
        let there: Vec<&Binary> = folders.iter().filter_map(named).collect();
        let fits = |b: &&&Binary| b.platforms().is_ok_and(|platforms| platforms.contains(&host));
        let found = there.iter().find(fits).or(there.first()).copied();
        found.ok_or_else(|| format!("the archive has no binary for this platform: binaries/{}/{file}", folders[0]))
    }
}

/// Target of an entry: a file, or none if it is not needed or this computer cannot store it.
struct Target(Option<io::Result<File>>);

impl io::Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(Ok(file)) = &mut self.0
            && let Err(e) = file.write_all(bytes)
        {
            self.0 = Some(Err(e));
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The standard, from the text: the XML may be broken.
fn version(xml: &[u8]) -> Result<FmiVersion, String> {
    // Null bytes indicate UTF-16 or UTF-32, which X01a reports.
    let head: Vec<u8> = xml.iter().copied().filter(|b| *b != 0).take(1 << 16).collect();
    let text = String::from_utf8_lossy(&head);
    let value = text.split_once("fmiVersion").map(|(_, rest)| rest.trim_start_matches([' ', '=', '"', '\'', '\n']));
    let value = value.map(|v| v.split(['"', '\'']).next().unwrap_or_default());
    match value {
        Some(v) if v.starts_with("2.") => Ok(FmiVersion::V2),
        Some(v) if v.starts_with("3.") => Ok(FmiVersion::V3),
        Some(v) => Err(format!("fmiVersion=\"{v}\" is neither FMI 2.0 nor FMI 3.0")),
        None => Err("modelDescription.xml has no attribute fmiVersion".into()),
    }
}
