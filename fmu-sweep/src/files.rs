//! Files that exist completely or not at all, even if the process or the machine stops.

use crate::Error;
use std::ffi::OsString;
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process;

/// Writes a file under a temporary name, syncs it to disk, and then renames it.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_with(path, |file| file.write_all(bytes))
}

/// Writes a file whose contents a function produces.
pub(crate) fn write_with(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), Error> {
    let partial = partial(path);
    let whole = || {
        let mut file = File::create(&partial)?;
        content(&mut file)?;
        file.sync_all()?;
        match fs::rename(&partial, path) {
            // Another process has written the same file, and cleaned up.
            Err(e) if e.kind() == io::ErrorKind::NotFound && path.exists() => Ok(()),
            renamed => renamed.and_then(|()| sync_folder(path)),
        }
    };
    whole().map_err(|e| {
        let _ = fs::remove_file(&partial);
        Error::file(path, e)
    })
}

/// Writes a file unless it exists; returns whether it was written.
pub(crate) fn create(path: &Path, bytes: &[u8]) -> Result<bool, Error> {
    let partial = partial(path);
    let whole = || {
        let mut file = File::create(&partial)?;
        file.write_all(bytes)?;
        file.sync_all()?;
        // A link fails where a rename would replace the file.
        let linked = fs::hard_link(&partial, path);
        fs::remove_file(&partial)?;
        match linked {
            Ok(()) => sync_folder(path).map(|()| true),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            // A file system without links: two processes at the same moment are then not safe.
            Err(_) if path.exists() => Ok(false),
            Err(_) => {
                let mut file = File::create_new(path)?;
                file.write_all(bytes)?;
                file.sync_all().map(|()| true)
            }
        }
    };
    whole().map_err(|e| {
        let _ = fs::remove_file(&partial);
        Error::file(path, e)
    })
}

/// `.NAME-PID-RANDOM` beside the file.
fn partial(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!("-{}", own()));
    path.with_file_name(name)
}

/// `PID-RANDOM`: in containers that share a folder, processes have the same numbers.
pub(crate) fn own() -> String {
    format!("{}-{:016x}", process::id(), RandomState::new().hash_one(0))
}

/// Removes temporary files of killed processes whose files have been completed since.
pub(crate) fn clean_up(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if [".part-", ".results.csv-", ".sweep.json-"].iter().any(|start| name.starts_with(start)) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Syncs a new name to disk, where a folder can be opened.
fn sync_folder(path: &Path) -> io::Result<()> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if cfg!(unix) { File::open(parent)?.sync_all() } else { Ok(()) }
}
