//! Files that are written whole or not at all, even if the disk is full or the process is killed.

use crate::Error;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A name that is not finished: this, and `RANDOM` letters and digits.
const PREFIX: &str = ".fmu-part-";
const RANDOM: usize = 12;

/// Writes a file under a temporary name beside it, syncs it to the disk, and then renames it. Missing folders are created. A process that
/// is killed leaves the temporary file; the next one that writes into the folder removes it. A file that exists keeps its permissions, a
/// link stays and leads to the new file, and a device or a pipe is written directly; `/dev/stdout` is refused.
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
    let whole = || {
        if is_open_file(path) {
            // In the process that runs the FMUs, /dev/stdout is another stream than the user's.
            let why = "the name of an open file; write - for the standard output where a command takes it";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, why));
        }
        if is_stream(path) {
            let mut stream = File::options().write(true).open(path)?;
            return content(&mut stream).and_then(|()| stream.flush());
        }
        let path = &if path.is_symlink() { behind(path)? } else { path.to_owned() };
        let folder = folder(path);
        fs::create_dir_all(folder)?;
        remove_abandoned(folder);
        let mut file = begun(folder)?;
        content(file.as_file_mut())?;
        if let Ok(old) = fs::metadata(path) {
            file.as_file().set_permissions(old.permissions())?;
        }
        // Some file systems find out here that the disk is full.
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error).map(drop)
    };
    whole().map_err(|e: io::Error| Error::file_from(path, "", e))
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether the path is a device, a pipe or a socket, which a renamed file would replace.
fn is_stream(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

/// Whether the path is a link of the system to a file that the process has open: `/dev/stdout`.
fn is_open_file(path: &Path) -> bool {
    path.starts_with("/dev") && path.is_symlink()
}

/// The file that a link leads to, which need not exist.
fn behind(link: &Path) -> io::Result<PathBuf> {
    fs::canonicalize(link).or_else(|_| Ok(folder(link).join(fs::read_link(link)?)))
}

/// A temporary file, locked as long as this process writes it.
fn begun(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    loop {
        let mut name = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Temporary files are private, but these are readable by whom the umask of the process lets.
            name.permissions(fs::Permissions::from_mode(0o666));
        }
        let file = name.prefix(PREFIX).rand_bytes(RANDOM).tempfile_in(folder)?;
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

    #[cfg(unix)]
    #[test]
    fn a_pipe_and_a_link_stay_what_they_are() {
        use std::io::Read;
        use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        // Only looked at: nothing here may alter /dev.
        assert!(!is_open_file(Path::new("/dev/null")) && !is_open_file(&at("pipe")));
        assert!(cfg!(not(target_os = "linux")) || is_open_file(Path::new("/dev/stdout")));
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = at("pipe");
            move || File::open(pipe).and_then(|mut pipe| pipe.read_to_end(&mut Vec::new()))
        });
        write(&at("pipe"), b"three").unwrap();
        assert!(fs::metadata(at("pipe")).unwrap().file_type().is_fifo());
        assert_eq!(reader.join().unwrap().unwrap(), 5);

        fs::create_dir(at("data")).unwrap();
        symlink("data/run.csv", at("run.csv")).unwrap();
        for text in ["new", "again"] {
            write(&at("run.csv"), text.as_bytes()).unwrap();
            assert!(at("run.csv").is_symlink(), "{text}");
            assert_eq!(fs::read_to_string(at("data/run.csv")).unwrap(), text);
        }
        symlink("run.csv", at("second.csv")).unwrap();
        write(&at("second.csv"), b"by two links").unwrap();
        assert!(at("run.csv").is_symlink() && at("second.csv").is_symlink());
        // A private file stays private.
        fs::set_permissions(at("data/run.csv"), fs::Permissions::from_mode(0o600)).unwrap();
        write(&at("run.csv"), b"private").unwrap();
        assert_eq!(fs::metadata(at("data/run.csv")).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(names(&at("data")), ["run.csv"]);
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
