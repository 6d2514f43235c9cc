//! Runs the probes: each check of the binary in a separate process, with a time limit, on all cores.
//!
//! The parent starts the same program with the hidden command `probe`. The child appends its findings to a file, line by line,
//! and writes the call that it is about to make to another file. When the child dies, the parent knows what was found and which
//! call ended it. A probe with several cases is restarted after the case that ended it.

use crate::check::{Check, Conclusion, Options, Run, Verdict};
use crate::checks::GROUPS;
use crate::evidence::{calls, is_of_second, conclude, panic, read, side_effects};
use crate::fmu_file::FmuFile;
use crate::session::Line;
use crate::watch::{Pace, Watch};
use fmu_import::guard::{self, Allowance, End, Guarded};
use fmu_import::{limits, threads};
use model_description::Interface;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Default time limit of a probe.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Checks that run even if a minimal run fails, because they show why.
const WITHOUT_MINIMAL_RUN: [&str; 4] = ["B00", "L00", "E00", "X02b"];
/// Checks with `Run::Probe` that make no instance, so that they apply to every interface.
const WITHOUT_INSTANCE: [&str; 3] = ["B00", "X02b", "L08n"];
/// The check that processes which outlive a probe count for.
const LEFT_BEHIND: &str = "B08p";
const OUT_OF_TIME: &str = "the run reached its time limit (see --timeout)";
/// After this time a clock that counts seconds shows another one.
const ANOTHER_SECOND: Duration = Duration::from_millis(1050);
/// Maximum number of restarts of a probe whose cases crash it.
const MAX_RESTARTS: usize = 12;

/// The verdicts of checks, in their order.
pub(super) fn run_all(fmu: &Arc<FmuFile>, checks: &[&Check], options: &Options) -> Vec<Conclusion> {
    let verdicts: Vec<Mutex<Option<Conclusion>>> = checks.iter().map(|_| Mutex::new(None)).collect();
    let mut queue = VecDeque::new();
    let mut of_file = Vec::new();
    for (check, verdict) in checks.iter().zip(&verdicts) {
        match check.run {
            Run::File(check_file) => of_file.push((check_file, verdict)),
            _ => queue.push_back((*check, verdict)),
        }
    }
    let runner = Runner::new(fmu, options);
    check_file(fmu, &of_file, options.deadline());
    let by_exchange = |check: &Check| match (check.run, &runner) {
        (Run::Any(_) | Run::Silent(_), Ok(runner)) => runner.simulation.is_none(),
        _ => is_exchange(check),
    };
    let [simulates, exchanges] = [false, true].map(|exchange| {
        let mut checks = queue.iter().filter(|(check, _)| exchange == by_exchange(check));
        checks.next().and_then(|_| why_no_run_succeeds(&runner, if exchange { "E00" } else { "L00" }))
    });
    let queue = Mutex::new(queue);
    let work = || {
        while let Some((check, verdict)) = take(&queue) {
            let why = match check.run {
                Run::Scheduled(_) => &None,
                _ if by_exchange(check) => &exchanges,
                _ => &simulates,
            };
            let found = match (&runner, why) {
                (Err(cause), _) => Verdict::NotDetermined(cause.clone()).into(),
                (Ok(_), Some(cause)) if !WITHOUT_MINIMAL_RUN.contains(&check.id) => cause.clone().into(),
                (Ok(runner), _) if matches!(check.run, Run::Twice(_)) => {
                    let Some(found) = runner.once_more(check) else {
                        put_back(&queue, (check, verdict));
                        continue;
                    };
                    found
                }
                (Ok(runner), _) => runner.run(check),
            };
            store(verdict, found);
        }
    };
    // The second process of a comparison begins when the clock shows another second: the other probes run meanwhile.
    if let Ok(mut queue) = queue.lock() {
        queue.make_contiguous().sort_by_key(|(check, _)| !matches!(check.run, Run::Twice(_)));
    }
    threads::share(threads::available(), |_| work());
    let lost = || Verdict::NotDetermined("the probe did not report a result".into()).into();
    let mut found: Vec<_> = verdicts.into_iter().map(|v| v.into_inner().ok().flatten().unwrap_or_else(lost)).collect();
    if let Ok(runner) = &runner {
        checks.iter().zip(&mut found).for_each(|(check, found)| runner.charge(check, found));
    }
    found
}

/// A check of the file, and the slot for its verdict.
type OfFile<'a> = (fn(&FmuFile) -> Verdict, &'a Mutex<Option<Conclusion>>);

/// Runs the checks of the file until the deadline, and for at most [`limits::STATIC_SECONDS`], even on hostile files.
fn check_file(fmu: &Arc<FmuFile>, checks: &[OfFile<'_>], deadline: Option<Instant>) {
    if checks.is_empty() {
        return;
    }
    let (send, receive) = mpsc::channel();
    let functions: Vec<_> = checks.iter().map(|(function, _)| *function).collect();
    // A thread cannot be ended from outside: one that takes too long ends with the process.
    let start = || {
        let (fmu, functions, send) = (fmu.clone(), functions.clone(), send.clone());
        let work = move || functions.into_iter().try_for_each(|function| send.send(function(&fmu)));
        std::thread::Builder::new().spawn(work)
    };
    let thread = match guard::patiently(start) {
        Ok(thread) => thread,
        Err(e) => {
            let why = format!("no thread can be started: {e}");
            return checks.iter().for_each(|(_, slot)| store(slot, Verdict::NotDetermined(why.clone()).into()));
        }
    };
    drop(send);
    let end = Instant::now() + Duration::from_secs(limits::STATIC_SECONDS);
    let (end, over) = match deadline {
        Some(deadline) if deadline < end => (deadline, OUT_OF_TIME.to_owned()),
        _ => (end, format!("the checks of the file take more than {} s", limits::STATIC_SECONDS)),
    };
    let mut in_time = true;
    for (_, slot) in checks {
        let verdict = receive.recv_timeout(end.saturating_duration_since(Instant::now()));
        let why = |e| match e {
            RecvTimeoutError::Timeout => over.clone(),
            RecvTimeoutError::Disconnected => "the checker failed in this check or one before it".into(),
        };
        in_time &= verdict.is_ok();
        store(slot, verdict.unwrap_or_else(|e| Verdict::NotDetermined(why(e))).into());
    }
    if in_time {
        // It releases the file before the caller does: the last owner removes the unpacked archive.
        let _ = thread.join();
    }
}

fn is_exchange(check: &Check) -> bool {
    matches!(check.run, Run::Exchange(_))
}

/// The verdict of all other probes of an interface if its minimal run does not succeed: L00 of co-simulation, E00 of Model
/// Exchange.
fn why_no_run_succeeds(runner: &Result<Runner, String>, id: &str) -> Option<Verdict> {
    let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == id)?;
    let runner = runner.as_ref().ok()?;
    let began = Instant::now();
    let verdict = runner.run(check).verdict;
    let minimum = Duration::from_secs(1).min(runner.timeout);
    let _ = runner.wild.set((20 * began.elapsed()).clamp(minimum, runner.timeout));
    match verdict {
        Verdict::Violated(found) => Some(Verdict::NotDetermined(format!(
            "a minimal run fails ({id}): {}",
            found.first().map_or("", String::as_str)
        ))),
        verdict @ (Verdict::NotDetermined(_) | Verdict::NotApplicable(_)) => Some(verdict),
        Verdict::Pass(_) => None,
    }
}

fn put_back<T>(queue: &Mutex<VecDeque<T>>, item: T) {
    queue.lock().unwrap_or_else(PoisonError::into_inner).push_back(item);
}

fn take<T>(queue: &Mutex<VecDeque<T>>) -> Option<T> {
    queue.lock().ok()?.pop_front()
}

fn store(slot: &Mutex<Option<Conclusion>>, verdict: Conclusion) {
    if let Ok(mut slot) = slot.lock() {
        *slot = Some(verdict);
    }
}

/// Settings that all probes of a file share, and the processes they left behind.
pub(super) struct Runner {
    program: PathBuf,
    dir: PathBuf,
    /// The binaries for co-simulation, Model Exchange and Scheduled Execution; mostly the same one.
    simulation: Option<PathBuf>,
    exchange: Option<PathBuf>,
    scheduled: Option<PathBuf>,
    /// Time limit of one call.
    timeout: Duration,
    allowance: Allowance,
    /// Processes that outlived a probe.
    left: Mutex<Vec<String>>,
    /// Time limit of a call with arguments that a real importer never passes; a minimal run measures it.
    wild: OnceLock<Duration>,
    /// The step of the integrator that E00 needs, in s.
    integrator: OnceLock<f64>,
    /// What the first process of a check found that compares two, and when it began.
    first: Mutex<Option<(Instant, Vec<String>)>>,
    /// End of the whole run.
    deadline: Option<Instant>,
}

/// Checks whose calls have extreme arguments: they have a shorter time limit.
const WILD: [&str; 4] = ["T02b", "G07a", "E09", "F04c"];
/// Checks whose subject is a second instance; in all others, a second instance that hangs is no finding.
const SEVERAL: [&str; 8] = ["L04a", "L04b", "L04c", "B05d", "G07a", "F03a", "F04a", "E14"];

/// How the process of a probe ended.
enum Outcome {
    /// By itself.
    End(End),
    /// In a call that hangs, in this way.
    Hang(&'static str),
    /// Too slow, although no call hangs.
    Slow,
    /// The time limit of the whole run was reached.
    OutOfTime,
}

impl Runner {
    pub(super) fn new(fmu: &FmuFile, options: &Options) -> Result<Self, String> {
        let description = fmu.description.as_ref().map_err(|_| "the description cannot be read")?;
        let binary = |interface: &Option<Interface>| {
            interface.as_ref().map(|i| Ok::<_, String>(fmu.dir().join(&fmu.host_binary(i)?.name))).transpose()
        };
        let (simulation, exchange) = (binary(&description.co_simulation)?, binary(&description.model_exchange)?);
        let scheduled = binary(&description.scheduled_execution)?;
        if simulation.is_none() && exchange.is_none() && scheduled.is_none() {
            return Err("the description has no interface".into());
        }
        let program = options.program.clone().map_or_else(std::env::current_exe, Ok).map_err(|e| e.to_string())?;
        Ok(Self {
            program,
            dir: fmu.dir().to_owned(),
            simulation,
            exchange,
            scheduled,
            timeout: options.patience.unwrap_or(TIMEOUT),
            allowance: Allowance { file: limits::PROBE_FILE, ..options.allowance },
            left: Mutex::default(),
            wild: OnceLock::new(),
            integrator: OnceLock::new(),
            first: Mutex::default(),
            deadline: options.deadline(),
        })
    }

    /// The time limit of a call of a check.
    fn limit(&self, id: &str) -> Duration {
        let wild = self.wild.get().filter(|_| WILD.contains(&id));
        wild.copied().unwrap_or(self.timeout)
    }

    fn run(&self, check: &Check) -> Conclusion {
        if self.deadline.is_some_and(|end| Instant::now() > end) {
            return Verdict::NotDetermined(OUT_OF_TIME.into()).into();
        }
        let (binary, interface) = match check.run {
            Run::Exchange(_) => (&self.exchange, "Model Exchange"),
            Run::Scheduled(_) => (&self.scheduled, "Scheduled Execution"),
            _ => (&self.simulation, "co-simulation"),
        };
        let any = || self.exchange.as_ref().or(self.scheduled.as_ref());
        let other = || match check.run {
            Run::Any(_) | Run::Silent(_) => self.exchange.as_ref(),
            _ => any().filter(|_| WITHOUT_INSTANCE.contains(&check.id)),
        };
        let Some(binary) = binary.as_ref().or_else(other) else {
            return Verdict::NotApplicable(format!("the FMU has no interface for {interface}")).into();
        };
        self.attempt(check, binary)
            .unwrap_or_else(|e| Verdict::NotDetermined(format!("the probe could not be started: {e}")).into())
    }

    /// The first process of a check that compares two: nothing yet, if it passes. The second, after another second of the clock:
    /// the verdict.
    fn once_more(&self, check: &Check) -> Option<Conclusion> {
        let first = self.first.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some((began, first)) = first else {
            let (began, found) = (Instant::now(), self.run(check));
            let Verdict::Pass(evidence) = found.verdict else { return Some(found) };
            *self.first.lock().unwrap_or_else(PoisonError::into_inner) = Some((began, evidence));
            return None;
        };
        std::thread::sleep(ANOTHER_SECOND.saturating_sub(began.elapsed()));
        let second = self.run(check);
        Some(match second.verdict {
            Verdict::Pass(second) if first != second => Verdict::Violated(vec![
                format!("first process: {}", first.join(", ")),
                format!("second process: {}", second.join(", ")),
            ])
            .into(),
            _ => second,
        })
    }

    fn attempt(&self, check: &Check, binary: &Path) -> io::Result<Conclusion> {
        let folder = tempfile::Builder::new().prefix("fmu-probe-").tempdir()?;
        let (out, working_directory) = (folder.path().join("out"), folder.path().join("home"));
        fs::create_dir(&working_directory)?;
        let (mut crashes, mut slow) = (Vec::new(), None);
        let mut from = 0;
        let began = Instant::now();
        loop {
            let end = self.child(check, binary, folder.path(), from)?;
            let lines = read(&out);
            if lines.iter().any(|l| matches!(l, Line::Done)) {
                break;
            }
            match self.crash(check, &end, &out) {
                Ok(crash) => crashes.push(crash),
                Err(why) => {
                    slow = Some(why);
                    break;
                }
            }
            if matches!(end, Outcome::Hang(_)) {
                // One hang is enough to know; the other cases would cost as much time again.
                break;
            }
            let last = lines.iter().rev().find_map(|l| if let Line::Case(n) = l { Some(*n) } else { None });
            match last {
                // Continue with the next case, within a limit of restarts and time.
                Some(n) if crashes.len() <= MAX_RESTARTS && began.elapsed() < 2 * self.timeout => from = n + 1,
                _ => break,
            }
        }
        let lines = read(&out);
        if let Some(step) = lines.iter().find_map(|l| if let Line::Integrator(step) = l { Some(*step) } else { None }) {
            let _ = self.integrator.set(step);
        }
        let mut found = conclude(check.id, lines, crashes, slow);
        if matches!(found.verdict, Verdict::Violated(_)) {
            found.calls = calls(&fs::read_to_string(out.with_extension("log")).unwrap_or_default());
        }
        if matches!(check.run, Run::Silent(_)) && matches!(found.verdict, Verdict::Pass(_)) {
            let side_effects = side_effects(folder.path(), &working_directory);
            if !side_effects.is_empty() {
                found = Verdict::Violated(side_effects).into();
            }
        }
        Ok(found)
    }

    /// The probe's process.
    fn command(&self, check: &Check, binary: &Path, folder: &Path, from: usize) -> Command {
        let mut command = guard::command(&self.program, self.allowance);
        command
            .args(["probe", "--id", check.id, "--from", &from.to_string()])
            .args(["--seconds", &self.timeout.as_secs_f64().to_string()])
            .arg("--dir")
            .arg(&self.dir)
            .arg("--binary")
            .arg(binary)
            .arg("--out")
            .arg(folder.join("out"))
            .current_dir(folder.join("home"));
        if let Some(step) = self.integrator.get() {
            command.args(["--integrator", &step.to_string()]);
        }
        command
    }

    /// Runs a probe, or one case of it, in a process that prints its calls; returns what was found.
    pub(super) fn replay(&self, check: &Check, case: Option<usize>) -> io::Result<Conclusion> {
        let (exchange, simulation) = (self.exchange.as_deref(), self.simulation.as_deref());
        let Some(binary) = (if is_exchange(check) { exchange } else { simulation.or(exchange) }) else {
            return Ok(Verdict::NotApplicable("the FMU has no such interface".into()).into());
        };
        // It finds the step of the integrator.
        let first =
            GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == "E00" && is_exchange(check) && c.id != check.id);
        let _ = first.map(|first| self.run(first));
        let folder = tempfile::Builder::new().prefix("fmu-probe-").tempdir()?;
        fs::create_dir(folder.path().join("home"))?;
        let out = folder.path().join("out");
        let mut command = self.command(check, binary, folder.path(), case.unwrap_or(0));
        command.arg("--trace");
        if case.is_some() {
            command.arg("--one");
        }
        let end = self.guarded(check, command, &out)?;
        let lines = read(&out);
        let (mut crashes, mut slow) = (Vec::new(), None);
        if !lines.iter().any(|l| matches!(l, Line::Done)) {
            match self.crash(check, &end, &out) {
                Ok(crash) => crashes.push(crash),
                Err(why) => slow = Some(why),
            }
        }
        let mut found = conclude(check.id, lines, crashes, slow);
        self.charge(check, &mut found);
        Ok(found)
    }

    fn child(&self, check: &Check, binary: &Path, folder: &Path, from: usize) -> io::Result<Outcome> {
        let console = File::options().create(true).append(true).open(folder.join("console"))?;
        let mut command = self.command(check, binary, folder, from);
        command.stdout(console.try_clone()?).stderr(console);
        self.guarded(check, command, &folder.join("out"))
    }

    /// Runs a command of [`Self::command`] to its end.
    fn guarded(&self, check: &Check, command: Command, out: &Path) -> io::Result<Outcome> {
        let (mut watch, mut state, mut late) = (None, Pace::Runs, false);
        let new = |id| Watch::new(id, out.with_extension("call"), self.limit(check.id));
        let report = Guarded::start(command)?.wait(|id| {
            late = self.deadline.is_some_and(|end| Instant::now() > end);
            if let Some(id) = id {
                state = watch.get_or_insert_with(|| new(id)).look();
            }
            late || state != Pace::Runs
        })?;
        match report.end {
            End::Refused(why) => return Err(io::Error::other(why)),
            End::Stopped if late => return Ok(Outcome::OutOfTime),
            End::Stopped if state == Pace::Slow => return Ok(Outcome::Slow),
            End::Stopped if state == Pace::Stopped => {
                return Ok(Outcome::Hang("stopped the process (as by SIGSTOP), which was not continued"));
            }
            End::Stopped => return Ok(Outcome::Hang("did not return")),
            // What the checker itself has ended could not clean up.
            End::Ended(status) if status.success() => {
                let left = report
                    .left
                    .iter()
                    .map(|process| format!("after {}, the process {process} was left behind", check.id));
                self.left.lock().unwrap_or_else(PoisonError::into_inner).extend(left);
            }
            _ => {}
        }
        Ok(Outcome::End(report.end))
    }

    /// How, and in which call, a process ended before its probe was complete; or why its end is not a finding.
    fn crash(&self, check: &Check, end: &Outcome, out: &Path) -> Result<(String, String), String> {
        let journal = fs::read_to_string(out.with_extension("call")).unwrap_or_default();
        let call = journal.lines().next().unwrap_or_default().trim();
        let limit = self.limit(check.id).as_secs_f64();
        match end {
            Outcome::OutOfTime => Err(OUT_OF_TIME.into()),
            Outcome::Slow => Err(format!(
                "the probe is too slow on this machine for a limit of {limit} s per call; it was in {} (see --patience)",
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::Hang(how) if !SEVERAL.contains(&check.id) && is_of_second(call, out) => Err(format!(
                "{} {how} within {limit} s, unlike that of the first instance: see L04a",
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::Hang(how) => Ok((format!("{how} within {limit} s"), call.into())),
            // The limit is the checker's own.
            Outcome::End(end) if end.describe().contains("SIGXFSZ") => Err(format!(
                "incomplete: a file of the probe reached the limit of {} bytes, in {}",
                limits::PROBE_FILE,
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::End(end) => match panic(end, out) {
                Some(why) => Err(format!("the checker failed: {why}")),
                None => Ok((end.describe(), call.into())),
            },
        }
    }

    /// Adds the processes that outlived any probe to the check that reports them.
    fn charge(&self, check: &Check, found: &mut Conclusion) {
        let left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        if check.id != LEFT_BEHIND || left.is_empty() {
            return;
        }
        match &mut found.verdict {
            Verdict::Violated(found) => found.extend(left.iter().filter(|l| l.contains(check.id)).cloned()),
            _ => *found = Verdict::Violated(left.clone()).into(),
        }
    }
}
