//! The process of the FMUs that `fmu simulate` and `fmu bode` start, watch and interrupt.

use crate::Failed;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use fmu_import::guard::{self, Allowance, End, Guarded};
use fmu_import::journal::{self, Call, Last};
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::OnceLock;
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

/// Shortest time limit: the process is looked at in parts of it.
const SHORTEST: Duration = Duration::from_millis(10);

/// File there whose existence ends the run of the worker.
const INTERRUPT: &str = "interrupt";

/// The process of the FMUs.
#[derive(Debug, Default, Args)]
pub struct ProcessOptions {
    /// Maximum time in s for loading, for initialization, and between two communication points, at least 0.01; 0 for no limit
    #[arg(long, value_name = "S", default_value_t = 300.0)]
    pub timeout: f64,
    /// Address space of the process of the FMUs, in GiB; 0 for no limit
    #[arg(long, value_name = "GIB", default_value_t = Allowance::default().memory >> 30, value_parser = clap::value_parser!(u64).range(..=1 << 20))]
    pub memory: u64,
    /// Run the FMUs without network (Linux with user namespaces; refused elsewhere)
    #[arg(long)]
    pub sandbox: bool,
    /// Run the FMUs in this process, without limits: for FMUs that you trust
    #[arg(long, conflicts_with_all = ["sandbox", "timeout", "memory"])]
    pub in_process: bool,
    /// Run as the process of the FMUs
    #[arg(long, hide = true)]
    pub worker: bool,
}

/// Runs a command in a process that it guards. `work` writes standard output, which it drops before the FMUs are freed. With `threads`,
/// several runs share the process, and the call that ends it is unknown: the command runs again with `--jobs 1`, which names it.
///
/// # Errors
/// Those of `work`, or the process ended, and how.
pub fn run(
    name: &str,
    options: &ProcessOptions,
    threads: bool,
    work: impl FnOnce(Box<dyn io::Write>) -> Result<()>,
) -> Result<()> {
    if options.worker {
        return serve(work);
    }
    catch_interrupts()?;
    if options.in_process {
        return work(Box::new(io::stdout()));
    }
    guarded(name, crate::arguments().skip(2), options, threads)
}

/// Whether this program starts workers: it is a command that serves them.
static SERVES: OnceLock<()> = OnceLock::new();

/// Makes [`guards`] true: this program runs the commands that workers are started with.
pub fn serves() {
    let _ = SERVES.set(());
}

/// Whether these options ask for a separate process, and this program can start one.
pub fn guards(options: &ProcessOptions) -> bool {
    SERVES.get().is_some() && !options.in_process
}

/// Runs the command `name` of this program with these arguments as a worker, and once more on one thread if a call of unknown name ended
/// it.
///
/// # Errors
/// Those of the worker, or how it ended.
pub fn guarded(
    name: &str,
    arguments: impl IntoIterator<Item = OsString>,
    args: &ProcessOptions,
    threads: bool,
) -> Result<()> {
    let arguments: Vec<_> = arguments.into_iter().collect();
    let ended = match once(name, &arguments, args)? {
        Worker::Done(outcome) => return outcome,
        Worker::Died(death) => death,
    };
    let repeated = |last: &Last| threads && !matches!(last.call, Call::Load | Call::Write) && !interrupted_twice();
    let death = match ended {
        Death { last: Some(last), .. } if repeated(&last) => {
            crate::message::note(
                "the FMU has ended its process in one of several runs at once; the same on one thread, for the call",
            );
            let alone: Vec<_> = arguments.into_iter().chain(["--jobs", "1"].map(OsString::from)).collect();
            match once(name, &alone, args)? {
                Worker::Died(death) => death,
                Worker::Done(Err(error)) => return Err(error),
                Worker::Done(Ok(())) => {
                    bail!(
                        "{}: several runs at once {}; one after the other (--jobs 1), none did",
                        last.name,
                        ended.end.describe()
                    )
                }
            }
        }
        ended => ended,
    };
    let limit = death.limit(args);
    let Death { end, last, .. } = death;
    let last = last.map_or_else(|| "the process of the FMUs".into(), |last| last.describe());
    match end {
        End::Refused(_) => bail!("the process of the FMUs {}{limit}", end.describe()),
        End::Stopped if interrupted_twice() => Err(Failed("interrupted twice: no file is written".into()).into()),
        End::Stopped => bail!("{last} did not return within {} s; --timeout changes the limit", args.timeout),
        _ => bail!("{last} {}{limit}", end.describe()),
    }
}

fn interrupted_twice() -> bool {
    INTERRUPTS.load(Ordering::Relaxed) > 1
}

/// How a worker ended.
enum Worker {
    /// With the outcome of the command.
    Done(Result<()>),
    /// Without one, in its last call.
    Died(Death),
}

/// The end of a worker without an outcome.
struct Death {
    end: End,
    last: Option<Last>,
    /// Largest address space seen, in bytes; 0 where the system does not tell it.
    peak: u64,
}

impl Death {
    /// The limit on address space as the end of a message, if it may be the cause; otherwise nothing.
    fn limit(&self, args: &ProcessOptions) -> String {
        let limit = args.memory << 30;
        let suspected = match &self.end {
            // ENOMEM.
            End::Refused(why) => why.contains("(os error 12)"),
            End::Ended(status) => self.peak > limit / 2 || guard::how(*status).contains("SIGABRT"),
            _ => false,
        };
        if limit == 0 || !suspected {
            return String::new();
        }
        format!("; its address space is limited to {} GiB: --memory changes the limit", args.memory)
    }
}

/// Runs the command as a worker.
fn once(name: &str, arguments: &[OsString], args: &ProcessOptions) -> Result<Worker> {
    let timeout = Duration::try_from_secs_f64(args.timeout).map_err(|e| anyhow!("--timeout {}: {e}", args.timeout))?;
    if !timeout.is_zero() && timeout < SHORTEST {
        bail!("--timeout {}: at least {} s, or 0 for no limit", args.timeout, SHORTEST.as_secs_f64());
    }
    let allowance = Allowance { memory: args.memory << 30, sandbox: args.sandbox, ..Allowance::default() };
    let program = std::env::current_exe().context("the path of this program")?;
    let mut command = guard::command(&program, allowance);
    // Output of the FMUs goes to standard error.
    command.args([name, "--worker"]).args(arguments).stdout(io::stderr());
    let mut worker = Guarded::start(command).with_context(|| format!("cannot start {}", program.display()))?;
    let folder = worker.folder().to_owned();
    let (mut since, mut progress, mut peak) = (Instant::now(), None, 0);
    let report = worker.wait(|id| {
        peak = id.and_then(|id| guard::kernel_size(&format!("{id}/status"), "VmPeak:")).unwrap_or(peak);
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
            Ok(Worker::Done(match code {
                "0" => Ok(()),
                "1" => Err(Failed(cause.into()).into()),
                _ => Err(anyhow!("{cause}")),
            }))
        }
        _ => Ok(Worker::Died(Death { end: report.end, last: journal::read(&folder), peak })),
    }
}

/// Counts Ctrl-C instead of ending.
///
/// # Errors
/// The system refuses.
fn catch_interrupts() -> Result<()> {
    ctrlc::set_handler(|| {
        INTERRUPTS.fetch_add(1, Ordering::Relaxed);
    })?;
    Ok(())
}

/// Whether the run must end. Called at every communication point; cheap, because the file is checked only ten times a second.
pub fn look(args: &ProcessOptions) -> impl FnMut() -> bool + use<> {
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
fn serve(work: impl FnOnce(Box<dyn io::Write>) -> Result<()>) -> Result<()> {
    guard::end_with_parent();
    let folder = std::env::temp_dir();
    journal::open(&folder)?;
    let outcome = work(Box::new(Later { path: folder.join(OUTPUT), file: None }));
    let (status, text) = match &outcome {
        Ok(()) => (0, String::new()),
        Err(error) => (crate::exit_status(error), format!("{error:#}")),
    };
    std::fs::write(folder.join(RESULT), format!("{status} {text}"))?;
    outcome
}
