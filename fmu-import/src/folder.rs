//! The folder of an unpacked archive: removed by the process that made it or, if that was killed, by a later process.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::process;

const PREFIX: &str = "fmu-";
/// Locked as long as a process uses the folder. The system unlocks it whenever the process ends, so no process has to guess
/// from the number in the name whether its owner is alive, possibly in another container or on another machine.
const LOCK: &str = ".lock";

/// A folder `fmu-PID-XXXXXX` for temporary files. Dropping it removes it.
pub struct Folder {
    path: PathBuf,
    owner: u32,
    lock: Option<File>,
}

impl Folder {
    /// Start of the names of the folders of the checker's probes.
    pub const PROBE: &str = "fmu-probe-";

    /// Creates a folder, and removes those left by killed processes.
    ///
    /// # Errors
    /// The system cannot create it.
    pub fn new() -> io::Result<Self> {
        Self::named(PREFIX)
    }

    /// Creates a folder for a probe of the checker. Its name distinguishes it from files that an FMU writes.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_probe() -> io::Result<Self> {
        Self::named(Self::PROBE)
    }

    fn named(prefix: &str) -> io::Result<Self> {
        remove_abandoned();
        let owner = process::id();
        loop {
            let dir = tempfile::Builder::new().prefix(&format!("{prefix}{owner}-")).tempdir()?;
            let name = dir.path().join(LOCK);
            let lock = match File::create_new(&name) {
                // Another process mistook the empty folder for an abandoned one.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                made => made.map_err(|error| io::Error::new(error.kind(), format!("{}: {error}", name.display())))?,
            };
            match lock.try_lock() {
                // Another thread or process took the new folder for an abandoned one: it removes it, or has removed it.
                Err(TryLockError::WouldBlock) => {}
                Ok(()) if !name.exists() => {}
                // On a file system without locks, the folder works too, but stays behind after a kill.
                Ok(()) | Err(TryLockError::Error(_)) => return Ok(Self { path: dir.keep(), owner, lock: Some(lock) }),
            }
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A forked process has a copy of this but must not remove a folder that its parent still uses.
        if self.owner == process::id() {
            self.lock = None;
            remove(&self.path);
        }
    }
}

/// Removes a folder as far as possible, its lock last: after a kill, it has a lock or is empty.
fn remove(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| entry.file_name() != LOCK) {
        let path = entry.path();
        let _ = if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            fs::remove_dir_all(path)
        } else {
            fs::remove_file(path)
        };
    }
    let _ = fs::remove_dir_all(folder);
}

/// Removes the folders whose lock no process holds, and the empty ones, whose process was killed before creating the lock or
/// after removing it. Skips those that this user cannot read or remove.
fn remove_abandoned() {
    let Ok(entries) = fs::read_dir(std::env::temp_dir()) else { return };
    for entry in entries.flatten().filter(|entry| is_ours(&entry.file_name().to_string_lossy())) {
        if !entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            continue;
        }
        match File::open(entry.path().join(LOCK)) {
            Ok(lock) if lock.try_lock().is_ok() => remove(&entry.path()),
            // Removes an empty folder only.
            Err(error) if error.kind() == io::ErrorKind::NotFound => drop(fs::remove_dir(entry.path())),
            _ => {}
        }
    }
}

/// Whether it is the name of such a folder; other names may begin the same way.
fn is_ours(name: &str) -> bool {
    let rest = name.strip_prefix(Folder::PROBE).or_else(|| name.strip_prefix(PREFIX));
    let owner = rest.and_then(|rest| rest.split_once('-'));
    owner.is_some_and(|(owner, _)| owner.parse::<u32>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    // Another process that opens an FMU in the meantime also removes abandoned folders.
    #[test]
    fn only_unused_folders_are_removed() {
        let used = Folder::new().unwrap();
        let paths = [Folder::new(), Folder::of_probe()].map(|abandoned| {
            let mut abandoned = abandoned.unwrap();
            // The effect of a kill: the lock is gone, the folder remains.
            abandoned.lock = None;
            abandoned.owner = 0;
            abandoned.path().to_owned()
        });
        // A process that is killed before it has created the lock, and unrelated folders.
        let temporary = |prefix| tempfile::Builder::new().prefix(prefix).tempdir().unwrap();
        let (empty, of_probe) = (temporary("fmu-0-"), temporary("fmu-probe-"));
        // Named as an unrelated folder until it is full: another process would remove it.
        let full = temporary("full-");
        fs::write(full.path().join("x"), "").unwrap();
        let named = full.path().with_file_name(format!("fmu-0-{}", process::id()));
        fs::rename(full.keep(), &named).unwrap();
        let later = Folder::new().unwrap();
        assert!(
            paths.iter().all(|path| !path.exists())
                && !empty.path().exists()
                && named.is_dir()
                && of_probe.path().is_dir()
                && used.path().is_dir()
                && later.path().is_dir()
        );
        assert!(used.path().file_name().unwrap().to_string_lossy().starts_with(&format!("fmu-{}-", process::id())));
        fs::remove_dir_all(named).unwrap();
    }

    #[test]
    fn a_forked_process_removes_nothing() {
        let mut folder = Folder::new().unwrap();
        let path = folder.path().to_owned();
        folder.owner = 0;
        let _in_use = folder.lock.take();
        drop(folder);
        assert!(path.is_dir());
        fs::remove_dir_all(path).unwrap();
    }
}
