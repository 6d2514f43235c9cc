//! The file under check: archive, description as XML tree and as parsed, and the unpacked folders.

use crate::zip_headers::{Archive, contents, is_inside};
use fmu_import::platform::Platform;
use model_description::{Element, FmiVersion, Interface, ModelDescription};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Maximum size in bytes of a description, and of everything that is unpacked.
const MAX_XML_BYTES: u64 = 256 << 20;
const MAX_BYTES: u64 = 2 << 30;

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
    /// Contents.
    pub(super) bytes: Vec<u8>,
}

/// An FMU to be checked.
pub struct FmuFile {
    /// Path of the `.fmu` file.
    pub path: PathBuf,
    pub(super) bytes: Vec<u8>,
    pub(super) zip: Archive,
    pub(super) xml: Vec<u8>,
    /// The standard that it claims to follow.
    pub version: FmiVersion,
    /// The description as elements, or why it is not XML.
    pub(super) tree: Result<Element, String>,
    /// The description as an importer reads it, or why it cannot.
    pub(super) description: Result<ModelDescription, String>,
    pub(super) binaries: Vec<Binary>,
    /// Entries that could not be unpacked.
    pub(super) unpack_errors: Vec<String>,
    /// Entries that this computer could not store, for example because of their long names.
    pub(super) own_errors: Vec<String>,
    dir: TempDir,
}

impl FmuFile {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, is no ZIP archive, or has no description of FMI 2.0 or 3.0.
    pub fn open(path: &Path) -> Result<Self, Unusable> {
        let unusable = |cause: String| Unusable { path: path.into(), cause };
        let size = fs::metadata(path).map_err(|e| unusable(e.to_string()))?;
        if !size.is_file() {
            return Err(unusable("is not a file".into()));
        }
        if size.len() > MAX_BYTES {
            return Err(unusable(format!("has {} bytes, more than the limit of {MAX_BYTES}", size.len())));
        }
        let bytes = fs::read(path).map_err(|e| unusable(e.to_string()))?;
        let zip = Archive::read(&bytes).map_err(&unusable)?;
        let entry = zip.find("modelDescription.xml").ok_or_else(|| unusable("has no modelDescription.xml".into()))?;
        let xml = contents(&bytes, entry, MAX_XML_BYTES).map_err(&unusable)?;
        let version = version(&xml).map_err(&unusable)?;
        let text = std::str::from_utf8(&xml).map_err(|_| "modelDescription.xml is not UTF-8".to_owned());
        let tree = text.and_then(|text| Element::parse(text).map_err(|e| e.to_string()));
        let description = model_description::read(&xml).map_err(|e| e.to_string());
        let dir = tempfile::Builder::new().prefix("fmu-check-").tempdir().map_err(|e| unusable(e.to_string()))?;
        let mut fmu = Self {
            path: path.into(),
            bytes,
            zip,
            xml,
            version,
            tree,
            description,
            binaries: Vec::new(),
            unpack_errors: Vec::new(),
            own_errors: Vec::new(),
            dir,
        };
        fmu.unpack().map_err(|e| unusable(e.to_string()))?;
        Ok(fmu)
    }

    /// Where it was unpacked: `modelDescription.xml`, `binaries/` of every platform, `resources/`, and the folders
    /// that the probe of I02 removes.
    pub(super) fn dir(&self) -> &Path {
        self.dir.path()
    }

    fn unpack(&mut self) -> std::io::Result<()> {
        fs::create_dir(self.dir().join("resources"))?;
        fs::write(self.dir().join("modelDescription.xml"), &self.xml)?;
        let mut left = MAX_BYTES;
        for entry in &self.zip.entries {
            let name = entry.name();
            let folder = name.split('/').next().unwrap_or_default();
            let wanted = ["binaries", "resources", "terminalsAndIcons", "extra"].contains(&folder);
            if name.ends_with('/') || entry.is_link() || !is_inside(&name) || (name == "modelDescription.xml") {
                continue;
            }
            match contents(&self.bytes, entry, left) {
                Err(cause) => self.unpack_errors.push(cause),
                Ok(bytes) if wanted => {
                    left = left.saturating_sub(bytes.len() as u64).max(1);
                    let target = self.dir.path().join(&name);
                    let made = target.parent().map_or(Ok(()), fs::create_dir_all);
                    if let Err(e) = made.and_then(|()| fs::write(&target, &bytes)) {
                        self.own_errors.push(format!("{name}: {e}"));
                        continue;
                    }
                    if let Some((folder, file)) = name.strip_prefix("binaries/").and_then(|n| n.split_once('/')) {
                        let library = [".so", ".dll", ".dylib"].iter().any(|extension| file.ends_with(extension));
                        if library && !file.contains('/') {
                            self.binaries.push(Binary { folder: folder.into(), name: name.clone(), bytes });
                        }
                    }
                }
                Ok(_) => {}
            }
        }
        Ok(())
    }

    /// The root element.
    pub(super) fn root(&self) -> Option<&Element> {
        self.tree.as_ref().ok()
    }

    /// The interface for co-simulation, or for Model Exchange where there is no other.
    pub(super) fn interface(&self) -> Option<&Interface> {
        let description = self.description.as_ref().ok()?;
        description.co_simulation.as_ref().or(description.model_exchange.as_ref())
    }

    /// The binary of an interface for this machine, as it is named in the archive.
    pub(super) fn host_binary(&self, interface: &Interface) -> Result<&Binary, String> {
        let host = Platform::host();
        let file = format!("{}.{}", interface.model_identifier, host.extension());
        let folders = host.folders(self.version);
        let fits = |b: &&Binary| folders.iter().any(|folder| b.name == format!("binaries/{folder}/{file}"));
        self.binaries
            .iter()
            .find(fits)
            .ok_or_else(|| format!("the archive has no binary for this platform: binaries/{}/{file}", folders[0]))
    }
}

/// The standard, from the text: the XML may be broken.
fn version(xml: &[u8]) -> Result<FmiVersion, String> {
    let text = String::from_utf8_lossy(xml);
    let value = text.split_once("fmiVersion").map(|(_, rest)| rest.trim_start_matches([' ', '=', '"', '\'', '\n']));
    let value = value.map(|v| v.split(['"', '\'']).next().unwrap_or_default());
    match value {
        Some(v) if v.starts_with("2.") => Ok(FmiVersion::V2),
        Some(v) if v.starts_with("3.") => Ok(FmiVersion::V3),
        Some(v) => Err(format!("fmiVersion=\"{v}\" is neither FMI 2.0 nor FMI 3.0")),
        None => Err("modelDescription.xml has no attribute fmiVersion".into()),
    }
}
