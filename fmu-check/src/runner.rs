//! Runs the probes: each check of the binary in a separate process, with a time limit, on all cores.
//!
//! The parent starts the same program with the hidden command `probe`. The child appends its findings to a file, line by line,
//! and writes the call that it is about to make to another file. If the child dies, the parent has its findings and the call that
//! ended it. A probe with several cases is restarted after the case that ended it.

use crate::check::{Check, Conclusion, Options, Run, Verdict};
use crate::checks::GROUPS;
use crate::evidence::{calls, conclude, is_after_free, is_of_second, panic, printed, read, script, side_effects};
use crate::fmu_file::FmuFile;
use crate::lines::Line;
use crate::probe::NOT_WRITTEN;
use crate::watch::{Pace, Watch};
use fmu_import::Folder;
use fmu_import::guard::{self, Allowance, End, Guarded, kernel_size};
use fmu_import::limits;
use model_description::Interface;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Default time limit of a probe.
const TIMEOUT: Duration = Duration::from_secs(10);
/// The check that compares two plain runs.
pub(super) const PLAIN_RUNS: &str = "T10";
/// Checks with `Run::Probe` that create no instance, so they apply to every interface.
const WITHOUT_INSTANCE: [&str; 3] = ["B00", "X02b", "L08n"];
/// Checks that only create an instance: also for Scheduled Execution alone.
const INSTANCE_ALONE: [&str; 5] = ["X04", "L01a", "G-L2a", "G-L2b", "G-L3c"];
/// The check that processes which outlive a probe count for.
const LEFT_BEHIND: &str = "B08p";
pub(super) const OUT_OF_TIME: &str = "the run reached its time limit (see --timeout)";
pub(super) const OUT_OF_MEMORY: &str = "the run reached its limit of resident memory";
/// File with the description for the probes.
const DESCRIPTION: &str = "description";
/// After this time, a clock that counts seconds shows a different value.
const ANOTHER_SECOND: Duration = Duration::from_millis(1050);
/// Maximum number of restarts of a probe whose cases crash it.
const MAX_RESTARTS: usize = 12;

/// Settings that all probes of a file share, and the processes they left behind.
pub(super) struct Runner {
    program: PathBuf,
    dir: PathBuf,
    /// The description as this process has read it, for the probes.
    description: Folder,
    /// Findings come with all their calls.
    scripts: bool,
    /// The attribute generationTool.
    pub(super) tool: Option<String>,
    /// The binaries for co-simulation, Model Exchange and Scheduled Execution; usually the same.
    pub(super) simulation: Option<PathBuf>,
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
    /// Names of the variables in which the two runs of T10 differ.
    pub(super) varying: OnceLock<Vec<String>>,
    /// For a check that compares two processes: the findings of the first one, and when it began.
    first: Mutex<Option<(Instant, Vec<String>)>>,
    /// End of the whole run.
    deadline: Option<Instant>,
}

/// Whether a check creates instances only for Model Exchange.
pub(super) fn is_exchange(check: &Check) -> bool {
    matches!(check.run, Run::Exchange(_))
}

/// Checks whose calls have extreme arguments: they have a shorter time limit.
const WILD: [&str; 4] = ["T02b", "G07a", "E09", "F04c"];
/// Checks whose subject is a second instance; in all others, a second instance that hangs is not a finding.
const SEVERAL: [&str; 8] = ["L04a", "L04b", "L04c", "B05d", "G07a", "F03a", "F04a", "E14"];

/// The check that makes instances after others were freed; in all others, a crash of an instantiation then is not a finding.
const REMADE: &str = "B07a";

/// The folder of a probe, and its resource limits.
#[derive(Clone)]
pub(super) struct Conditions {
    /// Folder that the FMU was unpacked to.
    pub(super) dir: PathBuf,
    pub(super) binary: PathBuf,
    pub(super) allowance: Allowance,
    /// The resident memory in bytes at which the checker ends the process: without a limit on address space, an FMU could take
    /// the memory of the whole computer. Linux only.
    pub(super) resident: Option<u64>,
}

/// The checks on which others depend: a failure that is due to this computer or to a limit is not a finding.
const FIRST: [&str; 3] = ["B00", "L00", "E00"];

/// End of the process of a probe.
enum Outcome {
    /// By itself.
    End(End),
    /// In a call that hangs, for this reason.
    Hang(&'static str),
    /// Too slow, although no call hangs.
    Slow,
    /// The time limit of the whole run was reached.
    OutOfTime,
    /// [`Conditions::resident`] was reached.
    OutOfMemory,
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
        let kept = Folder::of_probe().map_err(|e| e.to_string())?;
        let bytes = postcard::to_stdvec(description).map_err(|e| e.to_string())?;
        fs::write(kept.path().join(DESCRIPTION), bytes).map_err(|e| e.to_string())?;
        let program = options.program.clone().map_or_else(std::env::current_exe, Ok).map_err(|e| e.to_string())?;
        Ok(Self {
            program,
            dir: fmu.dir().to_owned(),
            description: kept,
            scripts: options.scripts,
            tool: description.generation_tool.clone(),
            simulation,
            exchange,
            scheduled,
            timeout: options.patience.unwrap_or(TIMEOUT),
            allowance: Allowance { file: limits::PROBE_FILE, ..options.allowance },
            left: Mutex::default(),
            wild: OnceLock::new(),
            integrator: OnceLock::new(),
            varying: OnceLock::new(),
            first: Mutex::default(),
            deadline: options.deadline(),
        })
    }

    /// Sets the time limit of calls with extreme arguments, from the time of a minimal run.
    pub(super) fn measured(&self, run: Duration) {
        let minimum = Duration::from_secs(1).min(self.timeout);
        let _ = self.wild.set((20 * run).clamp(minimum, self.timeout));
    }

    /// Whether a check runs with instances for Scheduled Execution, which has no minimal run.
    pub(super) fn is_scheduled(&self, check: &Check) -> bool {
        let alone = self.simulation.is_none() && self.exchange.is_none();
        matches!(check.run, Run::Scheduled(_))
            || (alone && INSTANCE_ALONE.iter().chain(&WITHOUT_INSTANCE).any(|id| *id == check.id))
    }

    /// The time limit of a call of a check.
    fn limit(&self, id: &str) -> Duration {
        let wild = self.wild.get().filter(|_| WILD.contains(&id));
        wild.copied().unwrap_or(self.timeout)
    }

    pub(super) fn run(&self, check: &Check) -> Conclusion {
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
            Run::Any(_) if INSTANCE_ALONE.contains(&check.id) => any(),
            Run::Any(_) | Run::Silent(_) => self.exchange.as_ref(),
            _ => any().filter(|_| WITHOUT_INSTANCE.contains(&check.id)),
        };
        let Some(binary) = binary.as_ref().or_else(other) else {
            return Verdict::NotApplicable(format!("the FMU has no interface for {interface}")).into();
        };
        let conditions = self.conditions(binary);
        let mut found = self.attempt(check, &conditions);
        if FIRST.contains(&check.id) {
            found = self.excused(check, &conditions, found);
        }
        if self.scripts && matches!(found.verdict, Verdict::Violated(_)) {
            // The first run shows where a second one would end or hang.
            let full = if found.fatal { None } else { self.full(check, &conditions).ok() };
            found.script = full.unwrap_or_else(|| found.calls.clone());
        }
        found
    }

    fn conditions(&self, binary: &Path) -> Conditions {
        Conditions { dir: self.dir.clone(), binary: binary.into(), allowance: self.allowance, resident: None }
    }

    /// The first of two processes that a check compares: no result yet if it passes. The second process, one second of the clock
    /// later: the verdict.
    pub(super) fn once_more(&self, check: &Check) -> Option<Conclusion> {
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

    /// Runs a probe under these conditions.
    pub(super) fn attempt(&self, check: &Check, conditions: &Conditions) -> Conclusion {
        self.try_attempt(check, conditions)
            .unwrap_or_else(|e| Verdict::NotDetermined(format!("the probe could not be started: {e}")).into())
    }

    fn try_attempt(&self, check: &Check, conditions: &Conditions) -> io::Result<Conclusion> {
        let folder = Folder::of_probe()?;
        let (out, working_directory) = (folder.path().join("out"), folder.path().join("home"));
        fs::create_dir(&working_directory)?;
        let (mut crashes, mut slow) = (Vec::new(), None);
        let mut from = 0;
        let began = Instant::now();
        loop {
            let end = self.child(check, conditions, folder.path(), from)?;
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
                // One hang is enough; each further case would cost the same time.
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
        let varies = |l: &Line| if let Line::Varies(name) = l { Some(name.clone()) } else { None };
        let varying: Vec<_> = lines.iter().filter_map(varies).collect();
        if !varying.is_empty() {
            let _ = self.varying.set(varying);
        }
        let mut found = conclude(check.id, lines, crashes, slow);
        if let Verdict::Violated(evidence) = &mut found.verdict {
            found.calls = calls(&fs::read_to_string(out.with_extension("log")).unwrap_or_default());
            if FIRST.contains(&check.id) {
                evidence.extend(printed(folder.path()));
            }
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
    fn command(&self, check: &Check, conditions: &Conditions, folder: &Path, from: usize) -> io::Result<Command> {
        let mut command = guard::command(&self.program, conditions.allowance);
        command
            .args(["probe", "--id", check.id, "--from", &from.to_string()])
            .args(["--seconds", &self.timeout.as_secs_f64().to_string()])
            .arg("--dir")
            .arg(&conditions.dir)
            .arg("--binary")
            .arg(&conditions.binary)
            .arg("--description")
            .arg(self.description.path().join(DESCRIPTION))
            .arg("--out")
            .arg(folder.join("out"))
            .current_dir(folder.join("home"));
        if let Some(step) = self.integrator.get() {
            command.args(["--integrator", &step.to_string()]);
        }
        if let Some(names) = self.varying.get() {
            let file = folder.join("varying");
            fs::write(&file, serde_json::to_vec(names)?)?;
            command.arg("--varying").arg(file);
        }
        Ok(command)
    }

    /// Runs a probe, or one case of it, in a process that prints its calls; returns the findings.
    pub(super) fn replay(&self, check: &Check, case: Option<usize>) -> io::Result<Conclusion> {
        let (exchange, simulation) = (self.exchange.as_deref(), self.simulation.as_deref());
        let Some(binary) = (if is_exchange(check) { exchange } else { simulation.or(exchange) }) else {
            return Ok(Verdict::NotApplicable("the FMU has no such interface".into()).into());
        };
        // They find the step of the integrator, and what cannot be compared.
        for first in [Some("E00").filter(|_| is_exchange(check)), Some(PLAIN_RUNS)].into_iter().flatten() {
            let first = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == first && c.id != check.id);
            let _ = first.map(|first| self.run(first));
        }
        let folder = Folder::of_probe()?;
        fs::create_dir(folder.path().join("home"))?;
        let out = folder.path().join("out");
        let conditions = self.conditions(binary);
        let mut command = self.command(check, &conditions, folder.path(), case.unwrap_or(0))?;
        command.arg("--trace");
        if case.is_some() {
            command.arg("--one");
        }
        let end = self.guarded(check, command, &conditions, &out)?;
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

    fn child(&self, check: &Check, conditions: &Conditions, folder: &Path, from: usize) -> io::Result<Outcome> {
        let console = File::options().create(true).append(true).open(folder.join("console"))?;
        let mut command = self.command(check, conditions, folder, from)?;
        command.stdout(console.try_clone()?).stderr(console);
        self.guarded(check, command, conditions, &folder.join("out"))
    }

    /// Runs a command of [`Self::command`] to its end.
    fn guarded(&self, check: &Check, command: Command, conditions: &Conditions, out: &Path) -> io::Result<Outcome> {
        let (mut watch, mut state, mut late, mut large) = (None, Pace::Runs, false, false);
        let new = |id| Watch::new(id, out.with_extension("call"), self.limit(check.id));
        let report = Guarded::start(command)?.wait(|id| {
            late = self.deadline.is_some_and(|end| Instant::now() > end);
            if let Some(id) = id {
                state = watch.get_or_insert_with(|| new(id)).look();
                let memory = || kernel_size(&format!("{id}/status"), "VmRSS:");
                large = conditions.resident.is_some_and(|most| memory().is_some_and(|bytes| bytes > most));
            }
            late || large || state != Pace::Runs
        })?;
        match report.end {
            End::Refused(why) => return Err(io::Error::other(why)),
            End::Stopped if late => return Ok(Outcome::OutOfTime),
            End::Stopped if large => return Ok(Outcome::OutOfMemory),
            End::Stopped if state == Pace::Slow => return Ok(Outcome::Slow),
            End::Stopped if state == Pace::Stopped => {
                return Ok(Outcome::Hang("stopped the process (as by SIGSTOP), which was not continued"));
            }
            End::Stopped => return Ok(Outcome::Hang("did not return")),
            // A process ended by the checker could not clean up.
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
            Outcome::OutOfMemory => Err(OUT_OF_MEMORY.into()),
            Outcome::Slow => Err(format!(
                "the probe is too slow on this machine for a limit of {limit} s per call; it was in {} (see --patience)",
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::Hang(how) if !SEVERAL.contains(&check.id) && is_of_second(call, out) => Err(format!(
                "{} {how} within {limit} s, unlike in the first instance: see L04a",
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::Hang(how) => Ok((format!("{how} within {limit} s"), call.into())),
            // A full disk is not a fault of the FMU, and neither is a probe that could not begin.
            Outcome::End(End::Ended(status))
                if status.code() == Some(NOT_WRITTEN) || (call.is_empty() && status.code() == Some(2)) =>
            {
                let folder = std::env::temp_dir();
                Err(format!(
                    "the probe could not write to the temporary folder {}: the disk may be full (see TMPDIR)",
                    folder.display()
                ))
            }
            // The limit is the checker's own.
            Outcome::End(end) if end.describe().contains("SIGXFSZ") => Err(format!(
                "incomplete: a file of the probe reached the limit of {} bytes, in {}",
                limits::PROBE_FILE,
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim()
            )),
            Outcome::End(end) if check.id != REMADE && is_after_free(call, out) => Err(format!(
                "{} {}, after another instance was freed: see {REMADE}",
                call.trim_start_matches(['C', 'P', 'S', 'H']).trim(),
                end.describe()
            )),
            Outcome::End(end) => match panic(end, out) {
                Some(why) => Err(format!("the checker failed: {why}")),
                None => Ok((end.describe(), call.into())),
            },
        }
    }

    /// All calls of a check up to its first finding, one by one, from one more run of it.
    fn full(&self, check: &Check, conditions: &Conditions) -> io::Result<Vec<String>> {
        let folder = Folder::of_probe()?;
        fs::create_dir(folder.path().join("home"))?;
        let console = File::create(folder.path().join("console"))?;
        let mut command = self.command(check, conditions, folder.path(), 0)?;
        command.arg("--full").stdout(console.try_clone()?).stderr(console);
        let out = folder.path().join("out");
        self.guarded(check, command, conditions, &out)?;
        Ok(script(&fs::read_to_string(out.with_extension("log"))?))
    }

    /// Adds the processes that outlived any probe to the check that reports them.
    pub(super) fn charge(&self, check: &Check, found: &mut Conclusion) {
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
