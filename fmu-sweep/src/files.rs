//! Files that are there whole or not at all, whenever the process or the machine stops.

use crate::Error;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process;

/// Writes a file under another name, on the disk, and then gives it its own.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_with(path, |file| file.write_all(bytes))
}

/// The same, with contents that a function writes.
pub(crate) fn write_with(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), Error> {
    let partial = partial(path);
    let whole = || {
        let mut file = File::create(&partial)?;
        content(&mut file)?;
        file.sync_all()?;
        fs::rename(&partial, path)?;
        sync_folder(path)
    };
    whole().map_err(|e| {
        let _ = fs::remove_file(&partial);
        Error::file(path, e)
    })
}

/// The same, unless the file exists; says whether it was written.
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

/// `.NAME-PID` beside the file.
fn partial(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!("-{}", process::id()));
    path.with_file_name(name)
}

/// Makes a new name last, where a folder can be opened.
fn sync_folder(path: &Path) -> io::Result<()> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if cfg!(unix) { File::open(parent)?.sync_all() } else { Ok(()) }
}
