//! The process of the FMUs that `fmu simulate` starts, watches and interrupts.

use super::{Simulate, simulate};
use crate::Failed;
use anyhow::{Context, Result, anyhow, bail};
use fmu_import::guard::{self, Allowance, End, Guarded};
use fmu_import::journal;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Number of times the user has pressed Ctrl-C: the first ends the run at the next communication point, the second the process.
static INTERRUPTS: AtomicU32 = AtomicU32::new(0);

/// File for the status and the error of the worker, below its folder for temporary files.
const RESULT: &str = "result";

/// File there for the standard output of the command. It is created after the run, so output that an FMU writes to descriptors
/// of the process cannot get into it.
const OUTPUT: &str = "output";

/// Time between two checks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(100);

/// File there whose existence ends the run of the worker.
const INTERRUPT: &str = "interrupt";

/// Runs the same command as a worker.
pub(super) fn guarded(args: &Simulate) -> Result<()> {
    let timeout = Duration::try_from_secs_f64(args.timeout).map_err(|e| anyhow!("--timeout {}: {e}", args.timeout))?;
    let allowance = Allowance { memory: args.memory << 30, sandbox: args.sandbox, ..Allowance::default() };
    let mut command = guard::command(&std::env::current_exe()?, allowance);
    // Output of the FMUs goes to standard error.
    command.args(["simulate", "--worker"]).args(std::env::args_os().skip(2)).stdout(io::stderr());
    let mut worker = Guarded::start(command)?;
    let folder = worker.folder().to_owned();
    let (mut since, mut progress) = (Instant::now(), None);
    let report = worker.wait(|_| {
        match INTERRUPTS.load(Ordering::Relaxed) {
            0 => {}
            1 => drop(std::fs::write(folder.join(INTERRUPT), "")),
            _ => return true,
        }
        let last = journal::read(&folder);
        let now = last.as_ref().map(|last| last.progress);
        if now != progress || last.is_some_and(|last| last.call == journal::Call::Write) {
            (since, progress) = (Instant::now(), now);
        }
        !timeout.is_zero() && since.elapsed() > timeout
    })?;
    if !report.left.is_empty() {
        crate::message::warning(&format!(
            "the FMUs left processes behind, which are ended now: {}",
            report.left.join(", ")
        ));
    }
    let result = std::fs::read_to_string(folder.join(RESULT)).ok();
    let result = result.as_deref().and_then(|text| text.split_once(' '));
    match (&report.end, result) {
        (End::Ended(status), Some((code, cause))) if status.code().is_some_and(|c| c.to_string() == code) => {
            if let Ok(mut printed) = File::open(folder.join(OUTPUT)) {
                match io::copy(&mut printed, &mut io::stdout()) {
                    // A reader such as `head` closes the pipe early.
                    Err(e) if e.kind() == io::ErrorKind::BrokenPipe => {}
                    other => drop(other.context("standard output")?),
                }
            }
            match code {
                "0" => Ok(()),
                "1" => Err(Failed(cause.into()).into()),
                _ => Err(anyhow!("{cause}")),
            }
        }
        (end, _) => {
            let last = journal::read(&folder).map_or_else(|| "the process of the FMUs".into(), |last| last.describe());
            match end {
                End::Refused(_) => bail!("the process of the FMUs {}", end.describe()),
                End::Stopped if INTERRUPTS.load(Ordering::Relaxed) > 1 => {
                    Err(Failed("interrupted twice: no file is written".into()).into())
                }
                End::Stopped => bail!("{last} did not return within {} s; --timeout changes the limit", args.timeout),
                _ => bail!("{last} {}", end.describe()),
            }
        }
    }
}

/// Counts Ctrl-C instead of ending.
///
/// # Errors
/// The system refuses.
pub(super) fn catch_interrupts() -> Result<()> {
    ctrlc::set_handler(|| {
        INTERRUPTS.fetch_add(1, Ordering::Relaxed);
    })?;
    Ok(())
}

/// Whether the run must end. Called at every communication point; cheap, because the file is checked only ten times a second.
pub(super) fn look(args: &Simulate) -> impl FnMut() -> bool + use<> {
    let (mut looked, worker, interrupt) = (Instant::now(), args.worker, std::env::temp_dir().join(INTERRUPT));
    move || {
        if looked.elapsed() <= LOOK {
            return false;
        }
        looked = Instant::now();
        INTERRUPTS.load(Ordering::Relaxed) > 0 || (worker && interrupt.exists())
    }
}

/// A file that is created when the first byte is written to it.
struct Later {
    path: PathBuf,
    file: Option<File>,
}

impl io::Write for Later {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let file = match self.file.take() {
            Some(file) => file,
            None => File::create_new(&self.path)?,
        };
        self.file.insert(file).write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.as_mut().map_or(Ok(()), File::flush)
    }
}

/// The worker. It writes its status and its error to a file, because an FMU may have closed the standard streams.
pub(super) fn work(args: &Simulate) -> Result<()> {
    guard::end_with_parent();
    let folder = std::env::temp_dir();
    journal::open(&folder)?;
    let outcome = simulate(args, Later { path: folder.join(OUTPUT), file: None });
    let (status, text) = match &outcome {
        Ok(()) => (0, String::new()),
        Err(error) => (crate::exit_status(error), format!("{error:#}")),
    };
    std::fs::write(folder.join(RESULT), format!("{status} {text}"))?;
    outcome
}
