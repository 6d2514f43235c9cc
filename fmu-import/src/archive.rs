//! Opens the archive of an FMU: reads its description and extracts the files needed to run it.

use crate::error::{EntryError, Error};
use crate::folder::Folder;
use crate::limits::{self, UNPACKED, XML};
use crate::machine;
use crate::platform::Platform;
use model_description::{FmiVersion, Interface, ModelDescription, TerminalsAndIcons};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zip::ZipArchive;
use zip::result::ZipError;

/// Source of an archive: a file, or memory.
trait Source: Read + Seek + Send {}
impl<T: Read + Seek + Send> Source for T {}
type Zip = ZipArchive<Box<dyn Source>>;

/// An FMU's archive, checked, with its description read.
pub(super) struct Archive {
    /// Path of the `.fmu` file.
    pub(super) path: PathBuf,
    zip: Zip,
    names: Vec<String>,
    /// Its modelDescription.xml.
    pub(super) description: Arc<ModelDescription>,
}

/// Files extracted from an archive.
pub(super) struct Extracted {
    pub(super) folder: Folder,
    /// Path of the binary for Co-Simulation, if the FMU has that interface.
    pub(super) co_simulation: Option<PathBuf>,
    /// Path of the binary for Model Exchange, if the FMU has that interface.
    pub(super) model_exchange: Option<Result<PathBuf, Error>>,
    /// Number of files.
    pub(super) files: usize,
}

/// The names of an FMU's interfaces.
pub(super) fn interfaces(description: &ModelDescription) -> String {
    let ModelDescription { co_simulation: cs, model_exchange: me, scheduled_execution: se, version, .. } = description;
    let standard = if *version == FmiVersion::V2 { "FMI 2.0" } else { "FMI 3.0" };
    let event_mode = if cs.as_ref().is_some_and(Interface::has_event_mode) { " with event mode" } else { "" };
    let names = [
        cs.as_ref().map(|_| format!("Co-Simulation{event_mode}")),
        me.as_ref().map(|_| "Model Exchange".to_owned()),
        se.as_ref().map(|_| "Scheduled Execution".to_owned()),
    ];
    let names: Vec<String> = names.into_iter().flatten().collect();
    if names.is_empty() { "no interface".into() } else { format!("{} ({standard})", names.join(" and ")) }
}

impl Archive {
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        let wrong = |cause: &dyn std::fmt::Display| Error::file(path, cause);
        if path.is_dir() {
            return Err(wrong(&"is a directory, expected an .fmu file"));
        }
        let file = File::open(path).map_err(|e| Error::file_from(path, "", e))?;
        let size = file.metadata().map_err(|e| Error::file_from(path, "", e))?.len();
        limits::ARCHIVE.check(size).map_err(|cause| wrong(&cause))?;
        Self::read(path, Box::new(file))
    }

    /// An archive in memory; errors name it `path`.
    pub(super) fn from_bytes(path: &Path, bytes: Arc<[u8]>) -> Result<Self, Error> {
        Self::read(path, Box::new(io::Cursor::new(bytes)))
    }

    fn read(path: &Path, source: Box<dyn Source>) -> Result<Self, Error> {
        let wrong = |cause: &dyn std::fmt::Display| Error::file(path, cause);
        let mut zip = ZipArchive::new(source).map_err(|e| match e {
            ZipError::Io(e) if e.raw_os_error().is_some() => Error::file_from(path, "", e),
            e => Error::file_from(path, "not a ZIP archive, or cut short: ", e),
        })?;
        let names = check_entries(&mut zip).map_err(|e| e.of(path))?;
        let xml = document(&mut zip, "modelDescription.xml").map_err(|e| e.of(path))?;
        let xml = xml.ok_or_else(|| wrong(&no_description(&names)))?;
        let description =
            model_description::read(&xml).map_err(|e| Error::file_from(path, "modelDescription.xml: ", e))?;
        Ok(Self { path: path.into(), zip, names, description: Arc::new(description) })
    }

    /// Terminals and icons, if there are any.
    pub(super) fn terminals(&mut self) -> Result<Option<TerminalsAndIcons>, Error> {
        const NAME: &str = "terminalsAndIcons/terminalsAndIcons.xml";
        let xml = document(&mut self.zip, NAME).map_err(|e| e.of(&self.path))?;
        let of = format!("{NAME}: ");
        let read = |xml| model_description::read_terminals(xml).map_err(|e| Error::file_from(&self.path, &of, e));
        xml.map(read).transpose()
    }

    /// Extracts the binaries for this platform and the resources.
    pub(super) fn extract(&mut self) -> Result<Extracted, Error> {
        let description = self.description.clone();
        let mut binary = |interface: &Option<Interface>| interface.as_ref().map(|i| self.binary(&i.model_identifier));
        let co_simulation = binary(&description.co_simulation).transpose()?;
        let model_exchange = binary(&description.model_exchange);
        let wrong = |e: &dyn std::fmt::Display| Error::file(&self.path, e);
        if co_simulation.is_none() && model_exchange.is_none() {
            let has = interfaces(&description);
            return Err(wrong(&format!("has neither Co-Simulation nor Model Exchange; it has {has}")));
        }
        let folder = Folder::new().map_err(|e| self.not_unpacked(e))?;
        // The FMU is given the path of the resources folder, so it is created even if the archive has none.
        fs::create_dir(folder.path().join("resources")).map_err(|e| self.not_unpacked(e))?;
        let found = co_simulation.iter().chain(model_exchange.iter().flatten());
        let mut prefixes: Vec<String> = found.map(|(folder, _)| format!("binaries/{folder}/")).collect();
        prefixes.push("resources/".into());
        let files = self.extract_into(folder.path(), &prefixes)?;
        let place = |(of, name): (&str, String)| folder.path().join("binaries").join(of).join(name);
        Ok(Extracted {
            co_simulation: co_simulation.map(place),
            model_exchange: model_exchange.map(|found| found.map(place)),
            files,
            folder,
        })
    }

    /// Folder and file name of the binary with this model identifier for this platform.
    fn binary(&mut self, model_identifier: &str) -> Result<(&'static str, String), Error> {
        let host = Platform::host();
        let folders = host.folders(self.description.version);
        let name = format!("{model_identifier}.{}", host.extension());
        let mut others = None;
        for &folder in &folders {
            let entry = format!("binaries/{folder}/{name}");
            let Some(index) = self.names.iter().position(|n| *n == entry) else { continue };
            let wrong = |e: &dyn std::fmt::Display| Error::file(&self.path, format!("{entry}: {e}"));
            let mut head = Vec::new();
            let file = self.zip.by_index(index).map_err(|e| wrong(&e))?;
            let unread = |e| Error::file_from(&self.path, &format!("{entry}: "), e);
            file.take(machine::HEAD).read_to_end(&mut head).map_err(unread)?;
            let platforms = machine::platforms(&head);
            // The loader reports the fault of a file that is not a library.
            if platforms.is_empty() || platforms.contains(&host) {
                return Ok((folder, name));
            }
            let platforms: Vec<&str> = platforms.into_iter().map(Platform::tuple).collect();
            let is_for = format!("{entry} is for {}, not for this platform ({host})", platforms.join(" and "));
            others.get_or_insert(is_for);
        }
        Err(Error::file(&self.path, others.unwrap_or_else(|| self.missing_binary(folders[0], &name))))
    }

    /// The names of its files, and the head of each library below `binaries/`, which states its platform.
    pub(super) fn outline(&mut self) -> Result<BTreeMap<String, Vec<u8>>, Error> {
        let mut files = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate().filter(|(_, name)| !name.ends_with('/')) {
            let mut head = Vec::new();
            if name.starts_with("binaries/") {
                let entry = self.zip.by_index(index).map_err(|e| unreadable(&self.path, name, e))?;
                entry.take(machine::HEAD).read_to_end(&mut head).map_err(|e| unreadable(&self.path, name, e))?;
            }
            files.insert(name.clone(), head);
        }
        Ok(files)
    }

    /// Every file, with its name.
    pub(super) fn files(&mut self) -> Result<BTreeMap<String, Vec<u8>>, Error> {
        let mut files = BTreeMap::new();
        for (index, name) in self.names.iter().enumerate() {
            let entry = self.zip.by_index(index).map_err(|e| unreadable(&self.path, name, e))?;
            if entry.is_dir() {
                continue;
            }
            let (mut entry, mut bytes) = (entry, Vec::new());
            // Reading stops if it contains more than its headers claim, which is within the limits.
            entry.read_to_end(&mut bytes).map_err(|e| unreadable(&self.path, name, e))?;
            if files.insert(name.clone(), bytes).is_some() {
                return Err(Error::file(&self.path, format!("{name}: occurs twice in the archive")));
            }
        }
        Ok(files)
    }

    /// Extracts the entries that begin with one of the prefixes; returns the number of files.
    fn extract_into(&mut self, dir: &Path, prefixes: &[String]) -> Result<usize, Error> {
        let mut files = 0;
        let mut buffer = vec![0; 1 << 16];
        for (index, name) in self.names.iter().enumerate() {
            if !prefixes.iter().any(|p| name.starts_with(p.as_str())) {
                continue;
            }
            let full = |e| not_unpacked(&self.path, e);
            let mut entry = self.zip.by_index(index).map_err(|e| unreadable(&self.path, name, e))?;
            let target = dir.join(name);
            if entry.is_dir() {
                fs::create_dir_all(&target).map_err(full)?;
                continue;
            }
            if let Some(parent) = target.parent() {
                fs::create_dir_all(parent).map_err(full)?;
            }
            let mut out = File::create(&target).map_err(full)?;
            // Reading stops if it contains more than its headers claim, which is within the limits.
            loop {
                match entry.read(&mut buffer) {
                    Ok(0) => break,
                    Ok(len) => out.write_all(&buffer[..len]).map_err(full)?,
                    Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                    Err(e) => return Err(unreadable(&self.path, name, e)),
                }
            }
            files += 1;
        }
        Ok(files)
    }

    fn not_unpacked(&self, cause: io::Error) -> Error {
        not_unpacked(&self.path, cause)
    }

    fn missing_binary<'a>(&'a self, folder: &str, name: &str) -> String {
        let folder_of = |name: &'a String| Some(name.strip_prefix("binaries/")?.split_once('/')?.0);
        let mut there: Vec<&str> = self.names.iter().filter_map(folder_of).collect();
        there.sort_unstable();
        there.dedup();
        let there = if there.is_empty() { "no binaries".into() } else { format!("binaries for {}", there.join(", ")) };
        let standard = if self.description.version == FmiVersion::V2 { "FMI 2.0" } else { "FMI 3.0" };
        format!("has no binaries/{folder}/{name} for this platform ({standard}); it has {there}")
    }
}

/// Why the description is missing: it may be in a folder that was packed as a whole.
fn no_description(names: &[String]) -> String {
    let folders = names.iter().filter_map(|name| name.strip_suffix("/modelDescription.xml"));
    match folders.min_by_key(|folder| folder.len()) {
        Some(folder) => format!(
            "has no modelDescription.xml at its top but one in the folder {folder}: pack the contents of the folder, not the folder"
        ),
        None => "has no modelDescription.xml".into(),
    }
}

/// The contents of an entry with an XML document; `None` if no entry has this name.
///
/// # Errors
/// The entry cannot be read, or is larger than [`limits::XML`].
pub fn document<R: Read + Seek>(zip: &mut ZipArchive<R>, name: &str) -> Result<Option<Vec<u8>>, EntryError> {
    let mut bytes = Vec::new();
    // Some tools write ./ before each name.
    let written = format!("./{name}");
    let name = if zip.index_for_name(name).is_none() && zip.index_for_name(&written).is_some() {
        written.as_str()
    } else {
        name
    };
    match zip.by_name(name) {
        Ok(entry) => entry.take(XML.most + 1).read_to_end(&mut bytes).map_err(|e| EntryError::from_source(name, e))?,
        Err(zip::result::ZipError::FileNotFound) => return Ok(None),
        Err(e) => return Err(EntryError::from_source(name, e)),
    };
    if bytes.len() as u64 > XML.most {
        return Err(format!("{name}: {}", XML.exceeded(format!("more than {}", XML.most))).into());
    }
    Ok(Some(bytes))
}

/// The names of the entries of an archive.
///
/// # Errors
/// A name leads outside, an entry is a link, or there are more entries or bytes than [`limits`] allow.
pub fn check_entries<R: Read + Seek>(zip: &mut ZipArchive<R>) -> Result<Vec<String>, EntryError> {
    limits::ENTRIES.check(zip.len() as u64)?;
    let (mut names, mut size) = (Vec::new(), 0_u64);
    for index in 0..zip.len() {
        let unreadable = |e| EntryError::from_source(&format!("entry {index}"), e);
        let entry = zip.by_index_raw(index).map_err(unreadable)?;
        let name = entry.name().map_err(unreadable)?.into_owned();
        if leads_outside(&name) {
            return Err(format!("entry {name:?} leads outside of the archive").into());
        }
        if name.contains('\\') {
            let remedy = "a ZIP archive has slashes; pack it with another tool";
            return Err(format!("entry {name:?} has backslashes between its folders: {remedy}").into());
        }
        if cfg!(windows) && name.contains(':') {
            return Err(format!("entry {name:?} has a colon, which no file name of Windows has").into());
        }
        if name.contains('\0') || (cfg!(windows) && entry.enclosed_name().is_none()) {
            return Err(format!("entry {name:?} has no valid name").into());
        }
        if entry.is_symlink() {
            return Err(format!("entry {name:?} is a link").into());
        }
        size = size.saturating_add(entry.size());
        names.push(name.trim_start_matches("./").to_owned());
    }
    UNPACKED.check(size)?;
    Ok(names)
}

/// Whether a name may lead out of the folder to which it is joined, on any system.
fn leads_outside(name: &str) -> bool {
    let mut parts = name.split(['/', '\\']);
    let first = parts.clone().next().unwrap_or_default();
    first.is_empty() || (first.len() == 2 && first.ends_with(':')) || parts.any(|part| part == "..")
}

/// An entry that cannot be read.
fn unreadable(archive: &Path, name: &str, cause: impl std::error::Error + Send + Sync + 'static) -> Error {
    EntryError::from_source(name, cause).of(archive)
}

/// The folder for temporary files is full or cannot be written.
fn not_unpacked(archive: &Path, cause: io::Error) -> Error {
    let what = format!("cannot be unpacked into {}: ", std::env::temp_dir().display());
    Error::file_from(archive, &what, cause)
}

#[cfg(test)]
mod tests {
    use super::*;
    use zip::write::SimpleFileOptions;

    fn refused(names: &[&str]) -> String {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.fmu");
        let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
        for name in names {
            zip.start_file(*name, SimpleFileOptions::default()).unwrap();
            zip.write_all(b"x").unwrap();
        }
        zip.finish().unwrap();
        Archive::open(&path).err().unwrap().to_string()
    }

    #[test]
    fn nothing_is_unpacked_outside() {
        for name in ["../evil", "/etc/evil", "resources/../../evil", "..\\evil", "C:/evil"] {
            let error = refused(&["modelDescription.xml", name]);
            assert!(error.contains("leads outside"), "{name}: {error}");
        }
    }

    #[test]
    fn what_is_wrong_with_an_archive_is_named() {
        let error = refused(&["modelDescription.xml", "binaries\\linux64\\M.so"]);
        assert!(error.contains("has backslashes between its folders"), "{error}");
        let error = refused(&["M/modelDescription.xml", "M/binaries/linux64/M.so"]);
        assert!(error.ends_with("but one in the folder M: pack the contents of the folder, not the folder"), "{error}");
        // The description was found but is not XML.
        for names in [&["./modelDescription.xml"][..], &["modelDescription.xml", "resources/a:b.txt"]] {
            assert!(cfg!(windows) || refused(names).contains("modelDescription.xml: line 1"), "{names:?}");
        }
    }

    #[test]
    fn a_file_without_a_description_is_no_fmu() {
        assert!(refused(&["readme.txt"]).ends_with("has no modelDescription.xml"));
        assert!(refused(&["modelDescription.xml"]).contains("modelDescription.xml: line 1"));
    }
}
