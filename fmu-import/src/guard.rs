//! Guards the process that runs FMUs of unknown origin, so that they cannot affect the calling process.
//!
//! The caller starts a guard, which is the same program again ([`command`], [`serve`]), and the guard starts the process that
//! loads the FMUs. On Unix the guard leads a new session and its child a new process group, so a signal that an FMU sends to
//! its group ends no other process. On Linux the guard adopts processes that the child leaves behind, counts them, and ends
//! them. Guard and caller share a socket: when the caller ends for any reason, the guard ends all processes and removes the
//! folder for temporary files. Other systems end the child only.

use crate::folder::Folder;
use crate::limits;
use std::ffi::OsString;
use std::io;
use std::path::Path;
use std::process::{Child, Command, ExitCode, ExitStatus};
use std::time::{Duration, Instant};

/// First argument of a guard.
const GUARD: &str = "@guard";
/// Interval at which a caller checks the time.
const LOOK: Duration = Duration::from_millis(5);
/// Time to wait until a busy system can start another process or thread.
const PRESSURE: Duration = Duration::from_secs(10);
/// Time for a guard to end its child.
#[cfg(unix)]
const GRACE: Duration = Duration::from_secs(5);

/// Limits of a guarded process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Allowance {
    /// Address space in bytes; 0 for no limit on it and on open files. Unix only.
    pub memory: u64,
    /// Largest file in bytes that it may write; 0 for no limit. Unix only.
    pub file: u64,
    /// Without network: on Linux, if the kernel allows this user a namespace.
    pub sandbox: bool,
}

impl Default for Allowance {
    fn default() -> Self {
        Self { memory: limits::PROCESS_MEMORY, file: 0, sandbox: false }
    }
}

/// A process with its guard.
pub struct Guarded {
    child: Child,
    #[cfg(unix)]
    channel: std::os::unix::net::UnixStream,
    folder: Folder,
}

/// The end of a guarded process.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum End {
    /// Normally, or by a signal.
    Ended(ExitStatus),
    /// Its time was up.
    Stopped,
    /// Code in its child ended the guard itself.
    Lost,
    /// The guard could not start it, for this reason.
    Refused(String),
}

/// Findings of the guard.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Report {
    /// The end of the process.
    pub end: End,
    /// Processes that it left behind, with number and name; the guard has ended them.
    pub left: Vec<String>,
}

/// A command that runs `program` under a guard. `program` calls [`serve`] first of all.
pub fn command(program: &Path, allowance: Allowance) -> Command {
    let mut command = Command::new(program);
    if cfg!(unix) {
        let Allowance { memory, file, sandbox } = allowance;
        command.args([GUARD, &memory.to_string(), &file.to_string(), if sandbox { "sandbox" } else { "open" }]);
    }
    command
}

impl Guarded {
    /// Starts a command from [`command`]. Standard input is the guard's; temporary files go to a folder that is removed at the
    /// end.
    ///
    /// # Errors
    /// The process cannot be started.
    pub fn start(mut command: Command) -> io::Result<Self> {
        let folder = Folder::new()?;
        for name in ["TMPDIR", "TMP", "TEMP"] {
            command.env(name, folder.path());
        }
        #[cfg(unix)]
        {
            let (channel, other) = std::os::unix::net::UnixStream::pair()?;
            command.stdin(std::process::Stdio::from(std::os::fd::OwnedFd::from(other)));
            Ok(Self { child: patiently(|| command.spawn())?, channel, folder })
        }
        #[cfg(not(unix))]
        {
            command.stdin(std::process::Stdio::null());
            Ok(Self { child: patiently(|| command.spawn())?, folder })
        }
    }

    /// The folder for temporary files.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Waits until the process has ended, or `over` reports that its time is up. `over` gets the number of the process as soon
    /// as the guard has started it.
    ///
    /// # Errors
    /// The system does not report the end of the process.
    #[cfg(unix)]
    pub fn wait(&mut self, mut over: impl FnMut(Option<u32>) -> bool) -> io::Result<Report> {
        use std::io::Read;
        let mut stopped = None;
        let mut received = Vec::new();
        self.channel.set_read_timeout(Some(LOOK))?;
        let mut bytes = [0; 4096];
        loop {
            match self.channel.read(&mut bytes) {
                Ok(0) => break,
                Ok(n) => received.extend_from_slice(&bytes[..n]),
                Err(e) if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => match stopped {
                    None if over(unix::read_id(&received)) => {
                        stopped = Some(Instant::now());
                        self.channel.shutdown(std::net::Shutdown::Write)?;
                    }
                    // The FMU has stopped the guard.
                    Some(since) if Instant::elapsed(&since) > GRACE => break,
                    _ => {}
                },
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(_) => break,
            }
        }
        let id = self.child.id();
        let report = unix::read_report(&String::from_utf8_lossy(&received));
        if report.is_none() {
            unix::end_session(id);
            let _ = self.child.kill();
        }
        self.child.wait()?;
        let Report { end, left } = report.unwrap_or(Report { end: End::Lost, left: Vec::new() });
        Ok(Report { end: if stopped.is_some() { End::Stopped } else { end }, left })
    }

    /// Waits until the process has ended, or `over` reports that its time is up. `over` gets the number of the process.
    ///
    /// # Errors
    /// The system does not report the end of the process.
    #[cfg(not(unix))]
    pub fn wait(&mut self, mut over: impl FnMut(Option<u32>) -> bool) -> io::Result<Report> {
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(Report { end: End::Ended(status), left: Vec::new() });
            }
            if over(Some(self.child.id())) {
                self.child.kill()?;
                self.child.wait()?;
                return Ok(Report { end: End::Stopped, left: Vec::new() });
            }
            std::thread::sleep(LOOK);
        }
    }
}

impl End {
    /// Description of the end, to follow the name of a call: `ended the process by SIGSEGV (invalid memory access)`.
    pub fn describe(&self) -> String {
        match self {
            Self::Ended(status) => how(*status),
            Self::Stopped => "did not return in time".into(),
            Self::Lost => "ended the process that guards it".into(),
            Self::Refused(why) => format!("cannot be started: {why}"),
        }
    }
}

/// `ended the process by SIGSEGV (invalid memory access)`, or `ended the process with exit status 3`.
pub fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let (name, meaning) = signal_name(signal);
        return format!("ended the process by {name}{meaning}");
    }
    status
        .code()
        .map_or_else(|| "ended the process".into(), |code| format!("ended the process with exit status {code}"))
}

/// Name of a signal, and its usual meaning: `SIGSEGV` and ` (invalid memory access)`.
pub fn signal_name(signal: i32) -> (String, &'static str) {
    // The only number of these that differs between systems.
    let bus = if cfg!(target_os = "macos") { 10 } else { 7 };
    let (name, meaning) = match signal {
        4 => ("SIGILL", " (illegal instruction)"),
        5 => ("SIGTRAP", " (trap)"),
        6 => ("SIGABRT", " (abort)"),
        8 => ("SIGFPE", " (arithmetic exception)"),
        9 => ("SIGKILL", ""),
        11 => ("SIGSEGV", " (invalid memory access)"),
        13 => ("SIGPIPE", ""),
        15 => ("SIGTERM", ""),
        24 => ("SIGXCPU", " (processor time)"),
        25 => ("SIGXFSZ", " (size of a file)"),
        _ if signal == bus => ("SIGBUS", " (a file that is cut short, or invalid memory access)"),
        _ => return (format!("signal {signal}"), ""),
    };
    (name.into(), meaning)
}

/// Starts a process or a thread. A busy system may be unable to start one at first, and able a moment later.
///
/// # Errors
/// It cannot be started within ten seconds.
pub fn patiently<T>(mut start: impl FnMut() -> io::Result<T>) -> io::Result<T> {
    let begun = Instant::now();
    loop {
        match start() {
            // EAGAIN.
            Err(e) if e.kind() == io::ErrorKind::WouldBlock && begun.elapsed() < PRESSURE => std::thread::sleep(LOOK),
            done => return done,
        }
    }
}

/// A size in bytes from a file in /proc with lines such as `VmRSS:  1234 kB`; `None` on systems without it.
pub fn kernel_size(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(Path::new("/proc").join(file)).ok()?;
    let size = text.lines().find_map(|line| line.strip_prefix(name))?;
    size.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Signals that the process of this command sends to its process group reach no other process; it calls [`end_with_parent`]
/// itself. Linux only.
pub fn own_group(command: &mut Command) {
    #[cfg(target_os = "linux")]
    std::os::unix::process::CommandExt::process_group(command, 0);
    #[cfg(not(target_os = "linux"))]
    let _ = command;
}

/// This process ends when the thread that started it ends: on Linux.
pub fn end_with_parent() {
    #[cfg(target_os = "linux")]
    let _ = rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::KILL));
}

/// The child processes that this process has not reaped, with number and name; empty except on Linux.
pub fn children() -> Vec<String> {
    #[cfg(unix)]
    return unix::children();
    #[cfg(not(unix))]
    return Vec::new();
}

/// Targets of the three standard streams of this process: device and number of the file; empty on systems without this
/// information.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Streams([Option<(u64, u64)>; 3]);

impl Streams {
    /// Their targets now.
    pub fn now() -> Self {
        #[cfg(unix)]
        {
            use std::os::fd::{AsFd, BorrowedFd};
            let of = |stream: BorrowedFd<'_>| rustix::fs::fstat(stream).ok().map(|file| (file.st_dev, file.st_ino));
            Self([of(io::stdin().as_fd()), of(io::stdout().as_fd()), of(io::stderr().as_fd())])
        }
        #[cfg(not(unix))]
        Self([None; 3])
    }

    /// The streams whose targets have changed or are closed.
    pub fn lost(&self) -> Vec<&'static str> {
        let names = ["standard input", "standard output", "standard error"];
        let pairs = self.0.iter().zip(Self::now().0);
        names.into_iter().zip(pairs).filter(|(_, (before, now))| *before != now).map(|(name, _)| name).collect()
    }
}

/// Plays the guard if this process was started as one: call it before anything else in `main`.
pub fn serve() -> Option<ExitCode> {
    let arguments: Vec<OsString> = std::env::args_os().collect();
    if arguments.get(1).is_none_or(|first| first != GUARD) {
        return None;
    }
    #[cfg(unix)]
    return Some(unix::serve(&arguments[2..]));
    #[cfg(not(unix))]
    return None;
}

#[cfg(unix)]
mod unix {
    use super::{Allowance, End, ExitCode, GRACE, GUARD, OsString, Report, io, patiently};
    use crate::limits;
    use crate::text::printable;
    use rustix::io::Errno;
    use rustix::process::{Pid, Resource, Rlimit, Signal, WaitId, WaitIdOptions, WaitOptions};
    use rustix::process::{getppid, getrlimit, kill_process, kill_process_group, setrlimit, setsid, wait, waitid};
    use std::fs;
    use std::io::{Read, Write};
    use std::os::fd::AsFd;
    use std::os::unix::net::UnixStream;
    use std::os::unix::process::{CommandExt, ExitStatusExt};
    use std::process::{Command, ExitStatus, Stdio};
    use std::sync::{Mutex, PoisonError};
    use std::time::{Duration, Instant};

    /// Prefix of the line with the number of the child, which the guard writes first, before its report.
    const STARTED: &str = "started ";
    /// Grace period for the helpers of a process after its end.
    const FAREWELL: Duration = Duration::from_millis(100);

    /// Arguments: memory, file, sandbox or open, then the child's arguments, which runs the same program.
    pub(super) fn serve(arguments: &[OsString]) -> ExitCode {
        // This process communicates only over the caller's socket.
        let Ok(channel) = io::stdin().as_fd().try_clone_to_owned().map(UnixStream::from) else {
            return ExitCode::from(2);
        };
        let caller = getppid();
        let report =
            guard(arguments, &channel).unwrap_or_else(|why| Report { end: End::Refused(why), left: Vec::new() });
        let _ = (&channel).write_all(write_report(&report).as_bytes());
        if getppid() != caller
            && let Some(folder) = std::env::var_os("TMPDIR")
        {
            // No other process will remove it.
            let _ = fs::remove_dir_all(folder);
        }
        ExitCode::SUCCESS
    }

    fn guard(arguments: &[OsString], channel: &UnixStream) -> Result<Report, String> {
        let text = |index: usize| arguments.get(index).and_then(|a| a.to_str()).unwrap_or_default();
        let number =
            |index: usize| text(index).parse().map_err(|_| format!("argument {index} of {GUARD} is not a number"));
        let allowance = Allowance { memory: number(0)?, file: number(1)?, sandbox: text(2) == "sandbox" };
        // Fails only for a process that already leads its group.
        let _ = setsid();
        limit(allowance);
        if allowance.sandbox {
            crate::abi::sandbox::enter().map_err(|why| format!("--sandbox is not available here: {why}"))?;
        }
        #[cfg(target_os = "linux")]
        let _ = rustix::process::set_child_subreaper(Some(rustix::process::getpid()));
        let mut command = Command::new(std::env::current_exe().map_err(|e| e.to_string())?);
        command.args(&arguments[3..]).stdin(Stdio::null()).process_group(0);
        let mut child = patiently(|| command.spawn()).map_err(|e| e.to_string())?;
        let id = Pid::from_child(&child);
        let _ = (&*channel).write_all(format!("{STARTED}{}\n", child.id()).as_bytes());
        // Until the child is reaped, its number is its own.
        let running = Mutex::new(true);
        let is_running = || running.lock().unwrap_or_else(PoisonError::into_inner);
        let end = || {
            if *is_running() {
                let _ = kill_process_group(id, Signal::KILL);
                let _ = kill_process(id, Signal::KILL);
            }
        };
        let watch = || {
            // The caller sends no data: its end closes when it exits or no longer needs the result.
            let _ = (&*channel).read(&mut [0]);
            end();
        };
        std::thread::scope(|scope| {
            let started = patiently(|| std::thread::Builder::new().spawn_scoped(scope, watch).map(|_| ()));
            if let Err(e) = started {
                end();
                let _ = child.wait();
                return Err(e.to_string());
            }
            while let Err(Errno::INTR) = waitid(WaitId::Pid(id), WaitIdOptions::EXITED | WaitIdOptions::NOWAIT) {}
            let mut running = is_running();
            if !cfg!(target_os = "linux") {
                let _ = kill_process_group(id, Signal::KILL);
            }
            *running = false;
            let status = child.wait().map_err(|e| e.to_string());
            drop(running);
            let _ = channel.shutdown(std::net::Shutdown::Read);
            let status = status?;
            let farewell = if status.success() { FAREWELL } else { Duration::ZERO };
            Ok(Report { end: End::Ended(status), left: end_children(farewell) })
        })
    }

    fn limit(allowance: Allowance) {
        let at_most = |resource, most: u64| {
            let hard = getrlimit(resource).maximum;
            let most = Some(hard.map_or(most, |hard| hard.min(most)));
            let _ = setrlimit(resource, Rlimit { current: most, maximum: most });
        };
        at_most(Resource::Core, 0);
        if allowance.memory > 0 {
            at_most(Resource::Nofile, limits::PROCESS_FILES);
        }
        // The system counts all threads of this user, and none of root's.
        if let Some(threads) = threads() {
            at_most(Resource::Nproc, limits::PROCESS_THREADS + threads);
        }
        for (resource, most) in [(Resource::As, allowance.memory), (Resource::Fsize, allowance.file)] {
            if most > 0 {
                at_most(resource, most);
            }
        }
    }

    /// Number of threads on this system: `0.20 0.18 0.12 1/80 11206`.
    fn threads() -> Option<u64> {
        let text = fs::read_to_string("/proc/loadavg").ok()?;
        text.split_whitespace().nth(3)?.split_once('/')?.1.parse().ok()
    }

    /// Ends the children of this process, which are those that it has adopted; returns those that were alive.
    fn end_children(farewell: Duration) -> Vec<String> {
        let begun = Instant::now();
        let mut left: Vec<(Pid, String)> = Vec::new();
        while begun.elapsed() < GRACE {
            match wait(WaitOptions::NOHANG) {
                Err(Errno::INTR) | Ok(Some(_)) => continue,
                Err(_) => break,
                Ok(None) if begun.elapsed() >= farewell => {
                    let me = rustix::process::getpid();
                    for process in processes().filter(|p| p.parent == me.as_raw_pid() && p.alive) {
                        let _ = kill_process_group(process.group, Signal::KILL);
                        let _ = kill_process(process.id, Signal::KILL);
                        if left.iter().all(|(id, _)| *id != process.id) {
                            left.push((process.id, process.name));
                        }
                    }
                }
                Ok(None) => {}
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        left.into_iter().map(|(id, name)| format!("{} ({name})", id.as_raw_pid())).collect()
    }

    pub(super) fn children() -> Vec<String> {
        let me = rustix::process::getpid().as_raw_pid();
        let named = |p: Process| {
            let state = if p.alive { "" } else { ", which has ended and was not reaped" };
            format!("{} ({}){state}", p.id.as_raw_pid(), p.name)
        };
        processes().filter(|p| p.parent == me).map(named).collect()
    }

    /// Ends all processes of a session.
    pub(super) fn end_session(id: u32) {
        for process in processes().filter(|p| u32::try_from(p.session) == Ok(id)) {
            let _ = kill_process(process.id, Signal::KILL);
        }
    }

    struct Process {
        id: Pid,
        name: String,
        alive: bool,
        parent: i32,
        group: Pid,
        session: i32,
    }

    /// All visible processes; empty except on Linux.
    fn processes() -> impl Iterator<Item = Process> {
        fs::read_dir("/proc").into_iter().flatten().flatten().filter_map(|entry| {
            let id = entry.file_name().to_str()?.parse().ok().and_then(Pid::from_raw)?;
            // `11206 (a name) S 11205 11206 11206 ...`, where the name may contain any characters.
            let bytes = fs::read(entry.path().join("stat")).ok()?;
            let stat = String::from_utf8_lossy(&bytes);
            let (name, rest) = (stat.find('(')?, stat.rfind(')')?);
            let fields: Vec<&str> = stat[rest + 1..].split_whitespace().collect();
            let number = |index: usize| fields.get(index)?.parse::<i32>().ok();
            Some(Process {
                id,
                name: printable(stat.get(name + 1..rest)?).into_owned(),
                alive: !matches!(*fields.first()?, "Z" | "X"),
                parent: number(1)?,
                // -1 for a process that is being removed.
                group: number(2).filter(|group| *group > 0).and_then(Pid::from_raw)?,
                session: number(3)?,
            })
        })
    }

    pub(super) fn read_id(received: &[u8]) -> Option<u32> {
        let line = std::str::from_utf8(received).ok()?.strip_prefix(STARTED)?.split_once('\n')?.0;
        line.parse().ok()
    }

    /// A line for the end, and one for each process that was left.
    fn write_report(report: &Report) -> String {
        let end = match &report.end {
            End::Ended(status) => format!("ended {}", status.into_raw()),
            End::Refused(why) => format!("refused {}", printable(why)),
            End::Stopped | End::Lost => "lost".into(),
        };
        let lines: Vec<&str> = std::iter::once(end.as_str()).chain(report.left.iter().map(String::as_str)).collect();
        lines.join("\n") + "\n"
    }

    pub(super) fn read_report(text: &str) -> Option<Report> {
        let mut lines = text.strip_suffix('\n')?.lines().skip_while(|line| line.starts_with(STARTED));
        let (word, rest) = lines.next()?.split_once(' ')?;
        let end = match word {
            "ended" => End::Ended(ExitStatus::from_raw(rest.parse().ok()?)),
            "refused" => End::Refused(rest.into()),
            _ => return None,
        };
        Some(Report { end, left: lines.map(str::to_owned).collect() })
    }
}
