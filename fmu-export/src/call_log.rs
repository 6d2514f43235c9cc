//! The call log: with `FMU_CALL_LOG=FOLDER` in the environment of the importer, an instance records its calls in a file of that
//! folder, in the format of [`fmu_core::call_log`].
//!
//! The environment is read once per instance, at its instantiation. Only this file reads it, and only this file writes files.

use fmu_core::call_log::{CallEnd, LogHead, LogValue, NamedValue, begun};
use std::env;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The environment variable with the folder.
const VARIABLE: &str = "FMU_CALL_LOG";

/// Whether calls can be logged: a page in a browser has no files.
pub(crate) const IS_POSSIBLE: bool = !cfg!(target_family = "wasm");

/// The file of an instance.
pub(crate) struct CallLog {
    /// `None` after a failure.
    file: Option<File>,
    path: PathBuf,
    /// Number of calls that have begun and not ended, the last of them in a line without its end.
    depth: usize,
    unfinished: bool,
    /// Time of the last call in s.
    time: Option<f64>,
    /// Handles of saved states, in the order of their appearance.
    states: Vec<usize>,
    /// A failure that was not yet reported.
    failure: Option<String>,
}

impl CallLog {
    /// Creates the file, if the environment names a folder.
    ///
    /// # Errors
    /// The message for the importer if the file cannot be created.
    pub(crate) fn asked(head: impl FnOnce() -> LogHead) -> Option<Result<Self, String>> {
        if !IS_POSSIBLE {
            return None;
        }
        let folder = env::var_os(VARIABLE).filter(|folder| !folder.is_empty())?;
        Some(Self::create(Path::new(&folder), &head()))
    }

    fn create(folder: &Path, head: &LogHead) -> Result<Self, String> {
        /// Instances of this process.
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        loop {
            let number = COUNT.fetch_add(1, Ordering::Relaxed) + 1;
            let path = folder.join(format!("{}-{}-{number}.calls", head.model, std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    let (depth, time, states, failure) = (0, None, Vec::new(), None);
                    let mut log = Self { file: Some(file), path, depth, unfinished: false, time, states, failure };
                    log.write(&head.to_string());
                    return log.failure.take().map_or(Ok(log), Err);
                }
                // Of another binary of this model in this process, or of an earlier process.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(unwritable(&path, &error, "no call is logged")),
            }
        }
    }

    /// Writes the beginning of a call; without a time, that of the call before.
    pub(crate) fn begin(&mut self, time: Option<f64>, name: &str, arguments: &[NamedValue]) {
        self.time = time.or(self.time);
        let opening = if self.unfinished { " {\n" } else { "" };
        let line = format!("{opening}{:1$}{2}", "", 2 * self.depth, begun(self.time, name, arguments));
        self.write(&line);
        self.depth += 1;
        self.unfinished = true;
    }

    /// Writes the end of the call that began last.
    pub(crate) fn end(&mut self, end: &CallEnd) {
        self.depth = self.depth.saturating_sub(1);
        let line =
            if self.unfinished { format!(" -> {end}\n") } else { format!("{:1$}}} -> {end}\n", "", 2 * self.depth) };
        self.write(&line);
        self.unfinished = false;
    }

    /// A saved state, by its number in this file.
    pub(crate) fn state(&mut self, handle: usize) -> LogValue {
        if handle == 0 {
            return LogValue::State(0);
        }
        let known = self.states.iter().position(|state| *state == handle);
        LogValue::State(
            1 + known.unwrap_or_else(|| {
                self.states.push(handle);
                self.states.len() - 1
            }),
        )
    }

    /// The message of a failure, once.
    pub(crate) fn take_failure(&mut self) -> Option<String> {
        self.failure.take()
    }

    /// Without a buffer: the text is in the file when the next line of the model runs.
    fn write(&mut self, text: &str) {
        if let Some(Err(error)) = self.file.as_mut().map(|file| file.write_all(text.as_bytes())) {
            self.failure = Some(unwritable(&self.path, &error, "the log ends here"));
            self.file = None;
        }
    }
}

fn unwritable(path: &Path, error: &std::io::Error, effect: &str) -> String {
    format!("{VARIABLE}: {} cannot be written: {error}; {effect}", path.display())
}
