//! Copies of the FMU below the working directory of a probe, which is temporary.

use crate::session::{NotDetermined, Session};
use fmu_import::limits;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Files below a folder that the checker still looks at.
pub(crate) const MANY: usize = 10_000;

/// Files with size and time of their last change.
pub(crate) type Files = Vec<(PathBuf, u64, Option<SystemTime>)>;

/// The files below a folder; `None` if they are more, or larger, than the checker looks at.
pub(crate) fn list(folder: &Path) -> Option<Files> {
    let (mut found, mut folders) = (Files::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let Ok(meta) = entry.metadata() else { continue };
            if meta.is_dir() {
                folders.push(entry.path());
            } else {
                found.push((entry.path(), meta.len(), meta.modified().ok()));
            }
            if found.len() + folders.len() > MANY || meta.len() >= limits::PROBE_FILE {
                return None;
            }
        }
    }
    found.sort();
    Some(found)
}

pub(crate) fn failed(e: &std::io::Error) -> NotDetermined {
    NotDetermined(e.to_string())
}

/// Copies a folder with its contents, but not what has these names in it.
pub(crate) fn copy(from: &Path, to: &Path, but: &[&str]) -> std::io::Result<()> {
    if list(from).is_none() {
        return Err(std::io::Error::other("not tried: the folder has too many files, or too large ones, for a copy"));
    }
    copy_all(from, to, but)
}

fn copy_all(from: &Path, to: &Path, but: &[&str]) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        if but.iter().any(|b| entry.file_name() == *b) {
            continue;
        }
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_all(&from, &to, &[])?;
        } else {
            fs::copy(from, to)?;
        }
    }
    Ok(())
}

/// A copy of the binary below the working directory, which is temporary; under the new path it is loaded again.
pub(crate) fn second_binary(session: &Session, folder: &str) -> Result<PathBuf, NotDetermined> {
    let folder_of_run = session.home.join(folder);
    copy(session.binary.parent().unwrap_or(&folder_of_run), &folder_of_run, &[]).map_err(|e| failed(&e))?;
    Ok(folder_of_run.join(session.binary.file_name().unwrap_or_default()))
}
