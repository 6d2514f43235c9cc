//! Runs the probes: each check of the binary in a process of its own, with a time limit, on all cores.
//!
//! The parent starts the same program with the hidden command `probe`. The child appends its findings to a file, line by line,
//! and writes the call that it is about to make to another file. When the child dies, the parent knows what was found and which
//! call ended it. A probe with several cases is restarted after the case that ended it.

use crate::check::{Check, Options, Run, Verdict};
use crate::checks::GROUPS;
use crate::fmu_file::FmuFile;
use crate::session::Line;
use fmu_import::guard::{self, Allowance, End, Guarded};
use model_description::{Interface, limits};
use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Default time limit of a probe.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Checks that run even if a minimal run fails, because they show why.
const WITHOUT_MINIMAL_RUN: [&str; 4] = ["B00", "L00", "E00", "X02b"];
/// Checks with `Run::Probe` that make no instance, so that they apply to every interface.
const WITHOUT_INSTANCE: [&str; 3] = ["B00", "X02b", "L08n"];
/// The check that processes which outlive a probe count for.
const LEFT_BEHIND: &str = "B08p";
/// Maximum number of restarts of a probe whose cases crash it.
const MAX_RESTARTS: usize = 12;

/// The verdicts of checks, in their order.
pub(super) fn run_all(fmu: &Arc<FmuFile>, checks: &[&Check], options: &Options) -> Vec<Verdict> {
    let verdicts: Vec<Mutex<Option<Verdict>>> = checks.iter().map(|_| Mutex::new(None)).collect();
    let mut queue = VecDeque::new();
    let mut of_file = Vec::new();
    for (check, verdict) in checks.iter().zip(&verdicts) {
        match check.run {
            Run::File(check_file) => of_file.push((check_file, verdict)),
            _ => queue.push_back((*check, verdict)),
        }
    }
    check_file(fmu, &of_file);
    let runner = Runner::new(fmu, options);
    let [simulates, exchanges] = [false, true].map(|exchange| {
        let mut checks = queue.iter().filter(|(check, _)| exchange == is_exchange(check));
        checks.next().and_then(|_| why_no_run_succeeds(&runner, if exchange { "E00" } else { "L00" }))
    });
    let queue = Mutex::new(queue);
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((check, verdict)) = take(&queue) {
                    let why = if is_exchange(check) { &exchanges } else { &simulates };
                    let found = match (&runner, why) {
                        (Err(cause), _) => Verdict::NotDetermined(cause.clone()),
                        (Ok(_), Some(cause)) if !WITHOUT_MINIMAL_RUN.contains(&check.id) => cause.clone(),
                        (Ok(runner), _) => runner.run(check),
                    };
                    store(verdict, found);
                }
            });
        }
    });
    let lost = || Verdict::NotDetermined("the probe did not report a result".into());
    let mut verdicts: Vec<_> =
        verdicts.into_iter().map(|v| v.into_inner().ok().flatten().unwrap_or_else(lost)).collect();
    let left = runner.map(|r| r.left.into_inner().unwrap_or_else(PoisonError::into_inner)).unwrap_or_default();
    for (check, verdict) in checks.iter().zip(&mut verdicts).filter(|(check, _)| check.id == LEFT_BEHIND) {
        charge(check, verdict, &left);
    }
    verdicts
}

/// Adds what outlived the probes, whichever it was, to the check that is about it.
fn charge(check: &Check, verdict: &mut Verdict, left: &[String]) {
    match verdict {
        _ if left.is_empty() => {}
        Verdict::Violated(found) => found.extend(left.iter().filter(|l| l.contains(check.id)).cloned()),
        _ => *verdict = Verdict::Violated(left.to_vec()),
    }
}

/// A check of the file, and the place for its verdict.
type OfFile<'a> = (fn(&FmuFile) -> Verdict, &'a Mutex<Option<Verdict>>);

/// Runs the checks of the file for [`limits::STATIC_SECONDS`] at most, whatever an author of hostile files has thought of.
fn check_file(fmu: &Arc<FmuFile>, checks: &[OfFile<'_>]) {
    let (send, receive) = mpsc::channel();
    let functions: Vec<_> = checks.iter().map(|(function, _)| *function).collect();
    let fmu = fmu.clone();
    // A thread cannot be ended from outside: one that takes too long ends with the process.
    let thread = std::thread::spawn(move || functions.into_iter().try_for_each(|function| send.send(function(&fmu))));
    let end = Instant::now() + Duration::from_secs(limits::STATIC_SECONDS);
    let mut in_time = true;
    for (_, place) in checks {
        let verdict = receive.recv_timeout(end.saturating_duration_since(Instant::now()));
        let why = |e| match e {
            RecvTimeoutError::Timeout => format!("the checks of the file take more than {} s", limits::STATIC_SECONDS),
            RecvTimeoutError::Disconnected => "the checker failed in this check or one before it".into(),
        };
        in_time &= verdict.is_ok();
        store(place, verdict.unwrap_or_else(|e| Verdict::NotDetermined(why(e))));
    }
    if in_time {
        // Its hold on the file ends before the caller's: the last one removes the unpacked archive.
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
    match runner.as_ref().ok()?.run(check) {
        Verdict::Violated(found) => Some(Verdict::NotDetermined(format!(
            "a minimal run fails ({id}): {}",
            found.first().map_or("", String::as_str)
        ))),
        verdict @ (Verdict::NotDetermined(_) | Verdict::NotApplicable(_)) => Some(verdict),
        Verdict::Pass(_) => None,
    }
}

fn take<T>(queue: &Mutex<VecDeque<T>>) -> Option<T> {
    queue.lock().ok()?.pop_front()
}

fn store(place: &Mutex<Option<Verdict>>, verdict: Verdict) {
    if let Ok(mut place) = place.lock() {
        *place = Some(verdict);
    }
}

/// Settings that all probes of a file share, and what they left behind.
struct Runner {
    program: PathBuf,
    dir: PathBuf,
    /// The binaries for co-simulation and for Model Exchange; mostly the same one.
    simulation: Option<PathBuf>,
    exchange: Option<PathBuf>,
    timeout: Duration,
    allowance: Allowance,
    /// Processes that outlived a probe.
    left: Mutex<Vec<String>>,
}

impl Runner {
    fn new(fmu: &FmuFile, options: &Options) -> Result<Self, String> {
        let description = fmu.description.as_ref().map_err(|_| "the description cannot be read")?;
        let binary = |interface: &Option<Interface>| {
            interface.as_ref().map(|i| Ok::<_, String>(fmu.dir().join(&fmu.host_binary(i)?.name))).transpose()
        };
        let (simulation, exchange) = (binary(&description.co_simulation)?, binary(&description.model_exchange)?);
        if simulation.is_none() && exchange.is_none() {
            return Err("the description has no interface for co-simulation or Model Exchange".into());
        }
        let program = options.program.clone().map_or_else(std::env::current_exe, Ok).map_err(|e| e.to_string())?;
        Ok(Self {
            program,
            dir: fmu.dir().to_owned(),
            simulation,
            exchange,
            timeout: options.timeout.unwrap_or(TIMEOUT),
            allowance: Allowance { file: limits::PROBE_FILE, ..options.allowance },
            left: Mutex::default(),
        })
    }

    fn run(&self, check: &Check) -> Verdict {
        let binary = match (is_exchange(check), &self.simulation, &self.exchange) {
            (true, _, None) => return Verdict::NotApplicable("the FMU has no interface for Model Exchange".into()),
            (true, _, Some(binary)) | (false, Some(binary), _) => binary,
            (false, None, Some(binary)) if WITHOUT_INSTANCE.contains(&check.id) => binary,
            (false, None, _) => return Verdict::NotApplicable("the FMU has no interface for co-simulation".into()),
        };
        let run = || {
            self.attempt(check, binary)
                .unwrap_or_else(|e| Verdict::NotDetermined(format!("the probe could not be started: {e}")))
        };
        let verdict = run();
        if !matches!((check.run, &verdict), (Run::Twice(_), Verdict::Pass(_))) {
            return verdict;
        }
        match (verdict, run()) {
            (Verdict::Pass(first), Verdict::Pass(second)) if first != second => Verdict::Violated(vec![
                format!("first process: {}", first.join(", ")),
                format!("second process: {}", second.join(", ")),
            ]),
            (_, second) => second,
        }
    }

    fn attempt(&self, check: &Check, binary: &Path) -> std::io::Result<Verdict> {
        let folder = tempfile::Builder::new().prefix("fmu-probe-").tempdir()?;
        let (out, working_directory) = (folder.path().join("out"), folder.path().join("home"));
        fs::create_dir(&working_directory)?;
        let mut crashes = Vec::new();
        let mut from = 0;
        let began = Instant::now();
        loop {
            let end = self.child(check, binary, folder.path(), from)?;
            let lines = read(&out);
            if lines.iter().any(|l| matches!(l, Line::Done)) {
                break;
            }
            let last_call = fs::read_to_string(out.with_extension("call")).unwrap_or_default();
            crashes.push((self.describe(&end), last_call.trim().to_owned()));
            let last = lines.iter().rev().find_map(|l| if let Line::Case(n) = l { Some(*n) } else { None });
            match last {
                // Continue with the next case, within a limit of restarts and time.
                Some(n) if crashes.len() <= MAX_RESTARTS && began.elapsed() < 2 * self.timeout => from = n + 1,
                _ => break,
            }
        }
        let mut verdict = verdict_of(check.id, read(&out), crashes);
        if matches!(check.run, Run::Silent(_)) && matches!(verdict, Verdict::Pass(_)) {
            let side_effects = side_effects(folder.path(), &working_directory);
            if !side_effects.is_empty() {
                verdict = Verdict::Violated(side_effects);
            }
        }
        Ok(verdict)
    }

    fn child(&self, check: &Check, binary: &Path, folder: &Path, from: usize) -> std::io::Result<End> {
        let console = File::options().create(true).append(true).open(folder.join("console"))?;
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
            .current_dir(folder.join("home"))
            .stdout(console.try_clone()?)
            .stderr(console);
        let began = Instant::now();
        let report = Guarded::start(command)?.wait(|| began.elapsed() > self.timeout)?;
        match report.end {
            End::Refused(why) => return Err(std::io::Error::other(why)),
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
        Ok(report.end)
    }

    fn describe(&self, end: &End) -> String {
        match end {
            End::Stopped => format!("did not return within {} s", self.timeout.as_secs_f64()),
            end => end.describe(),
        }
    }
}

fn read(out: &Path) -> Vec<Line> {
    let text = fs::read_to_string(out).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// Unwanted console output and files of the process.
fn side_effects(folder: &Path, working_directory: &Path) -> Vec<String> {
    let mut console = Vec::new();
    if let Ok(file) = File::open(folder.join("console")) {
        let _ = file.take(64 << 10).read_to_end(&mut console);
    }
    let console = String::from_utf8_lossy(&console);
    let mut findings: Vec<_> = console.lines().take(5).map(|l| format!("wrote to the console: {l}")).collect();
    let files = fs::read_dir(working_directory).into_iter().flatten().flatten().take(5);
    findings
        .extend(files.map(|f| format!("created a file in the working directory: {}", f.file_name().to_string_lossy())));
    findings
}

/// The verdict from the lines of the probe and from its crashes (how, and in which call).
fn verdict_of(id: &str, lines: Vec<Line>, crashes: Vec<(String, String)>) -> Verdict {
    let (mut violated, mut notes, mut not_determined, mut not_applicable) = (Vec::new(), Vec::new(), None, None);
    for line in lines {
        match line {
            Line::Violated(text) => violated.push(text),
            Line::Note(text) => notes.push(text),
            Line::NotDetermined(why) => not_determined = not_determined.or(Some(why)),
            Line::NotApplicable(why) => not_applicable = not_applicable.or(Some(why)),
            Line::Case(_) | Line::Done => {}
        }
    }
    for (how, call) in crashes {
        if let Some(call) = call.strip_prefix("C ") {
            violated.push(format!("{call} {how}"));
            continue;
        }
        // Preparing the probe failed: another check reports that.
        let call = call.strip_prefix("P ").unwrap_or("the start");
        if id == "B00" || (["L00", "E00"].contains(&id) && !call.starts_with("loading")) {
            violated.push(format!("{call} {how}"));
        } else {
            not_determined = not_determined.or(Some(format!("{call} {how}, before the probe began")));
        }
    }
    match (violated.is_empty(), not_determined, not_applicable) {
        (false, ..) => Verdict::Violated(violated),
        (_, Some(why), _) => Verdict::NotDetermined(why),
        (_, _, Some(why)) => Verdict::NotApplicable(why),
        _ => Verdict::Pass(notes),
    }
}
