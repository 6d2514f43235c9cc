//! Files that are written whole or not at all, even if the disk is full or the process is killed.

use crate::Error;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::Path;

/// A name that is not finished: this, and `RANDOM` letters and digits.
const PREFIX: &str = ".fmu-part-";
const RANDOM: usize = 12;

/// Writes a file under a temporary name beside it, syncs it to the disk, and then renames it. Missing folders are created. A process that
/// is killed leaves the temporary file; the next one that writes into the folder removes it.
///
/// # Errors
/// Names the file; it is then as before.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    write_with(path, |file| file.write_all(bytes))
}

/// [`write()`] with contents that a function produces.
///
/// # Errors
/// Those of [`write()`] and of the function.
pub fn write_with(path: &Path, content: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), Error> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let whole = || {
        fs::create_dir_all(folder)?;
        remove_abandoned(folder);
        let mut file = begun(folder)?;
        content(file.as_file_mut())?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Temporary files are private, but these must be readable by everyone.
            file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
        }
        // Some file systems find out here that the disk is full.
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error).map(drop)
    };
    whole().map_err(|e: io::Error| Error::file_from(path, "", e))
}

/// A temporary file, locked as long as this process writes it.
fn begun(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    loop {
        let file = tempfile::Builder::new().prefix(PREFIX).rand_bytes(RANDOM).tempfile_in(folder)?;
        match file.as_file().try_lock() {
            // Another process took the new file for an abandoned one: it removes it, or has removed it.
            Err(TryLockError::WouldBlock) => {}
            Ok(()) if !file.path().exists() => {}
            // On a file system without locks, the file stays behind after a kill.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(file),
        }
    }
}

/// Removes the temporary files that no process has locked.
fn remove_abandoned(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_ours(&entry.file_name().to_string_lossy())
            && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn is_ours(name: &str) -> bool {
    let random = name.strip_prefix(PREFIX);
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut all: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        all.sort();
        all
    }

    #[test]
    fn a_file_is_as_before_until_it_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b.csv");
        write(&path, b"one").unwrap();
        let failed = write_with(&path, |file| {
            file.write_all(b"tw")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        let said = failed.unwrap_err().to_string();
        assert!(said.starts_with(&path.display().to_string()) && said.ends_with("no storage space"), "{said}");
        assert_eq!(
            (fs::read(&path).unwrap(), names(&dir.path().join("a"))),
            (b"one".to_vec(), vec!["b.csv".to_owned()])
        );
        write(&path, b"two").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"two");
    }

    #[test]
    fn what_a_killed_process_leaves_is_removed_and_what_another_writes_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let (left, other) = (format!("{PREFIX}0123456789aB"), format!("{PREFIX}notes"));
        for name in [&left, &other] {
            fs::write(dir.path().join(name), "").unwrap();
        }
        let writing = begun(dir.path()).unwrap();
        write(&dir.path().join("x"), b"").unwrap();
        let writes = writing.path().file_name().unwrap().to_string_lossy().into_owned();
        let mut expected = vec![other, writes, "x".to_owned()];
        expected.sort();
        assert_eq!(names(dir.path()), expected);
    }
}
