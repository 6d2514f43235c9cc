//! Files that exist completely or not at all, even if the process or the machine stops.

use crate::Error;
use std::ffi::OsString;
use std::fs::{self, File};
use std::hash::{BuildHasher, RandomState};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process;

/// Writes a file under another name, on the disk, and then gives it its own.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_with(path, |file| file.write_all(bytes))
}

/// Writes a file with contents that a function writes.
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
        // A link fails where a rename would replace.
        let linked = fs::hard_link(&partial, path);
        fs::remove_file(&partial)?;
        match linked {
            Ok(()) => sync_folder(path).map(|()| true),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            // A file system without links: then two processes at the same moment are one too many.
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

/// Removes what killed processes have left of files that are complete by now.
pub(crate) fn clean_up(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if [".part-", ".results.csv-", ".sweep.json-"].iter().any(|start| name.starts_with(start)) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Makes a new name last, where a folder can be opened.
fn sync_folder(path: &Path) -> io::Result<()> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if cfg!(unix) { File::open(parent)?.sync_all() } else { Ok(()) }
}
