//! Probes: each check of the binary in a process of its own, all cores at work, with a time-out.
//!
//! The parent starts the same program with the hidden command `probe`. The child writes what it finds to a file line by line,
//! and the call that it is about to make to another; so when it dies, the parent knows what was found, and what killed it.
//! A probe of many cases is started again behind the one that killed it.

use super::bench::{Bench, Blocked, Line};
use super::{Check, GROUPS, Options, Run, Subject, Verdict};
use clap::Args;
use std::collections::VecDeque;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time that a probe may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// Checks for which it is a violation that the probe cannot even begin. All others then are not determined.
const OUTRIGHT: [&str; 2] = ["B00", "L00"];
/// Checks that say what is wrong when not even a plain life goes through.
const FIRST: [&str; 3] = ["B00", "L00", "X02b"];
/// Most restarts of a probe whose cases kill it.
const RESTARTS: usize = 12;

/// Runs one probe. Only the checker calls it.
#[derive(Debug, Args)]
pub struct Probe {
    /// Id of the check.
    #[arg(long)]
    pub id: String,
    /// Folder that the FMU was unpacked to.
    #[arg(long)]
    pub dir: PathBuf,
    /// The binary.
    #[arg(long)]
    pub binary: PathBuf,
    /// File that the findings go to.
    #[arg(long)]
    pub out: PathBuf,
    /// Number of the first case.
    #[arg(long, default_value_t = 0)]
    pub from: usize,
    /// Time that it may take, in seconds.
    #[arg(long, default_value_t = 10.0)]
    pub seconds: f64,
}

/// Runs one probe, in this process.
///
/// # Errors
/// There is no such check, or the folder is not readable.
pub fn run(args: &Probe) -> anyhow::Result<()> {
    let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == args.id);
    let Some(Run::Probe(probe) | Run::Silent(probe) | Run::Twice(probe)) = check.map(|c| c.run) else {
        anyhow::bail!("there is no probe {}", args.id);
    };
    match Bench::open(args) {
        Ok(bench) => {
            if let Err(Blocked(why)) = probe(&bench) {
                bench.write(&if OUTRIGHT.contains(&check.map_or("", |c| c.id)) {
                    Line::Violated(why)
                } else {
                    Line::Blocked(why)
                });
            }
            bench.write(&Line::Done);
            // The parent judges by what was written; the end of the process is a check of its own.
            bench.calling("(the process ends)");
            std::mem::forget(bench);
        }
        Err(Blocked(why)) => {
            let tool = needs_tool(&args.dir);
            let line = if args.id == "B00" && !tool { Line::Violated(why) } else { Line::Blocked(why) };
            let text = [line, Line::Done].iter().map(serde_json::to_string).collect::<Result<Vec<_>, _>>()?;
            fs::write(&args.out, text.join("\n"))?;
        }
    }
    Ok(())
}

/// Whether the FMU needs a tool that may not be here.
fn needs_tool(dir: &Path) -> bool {
    let xml = fs::read(dir.join("modelDescription.xml")).unwrap_or_default();
    let interface = model_description::read(&xml).ok().and_then(|d| d.co_simulation);
    interface.is_some_and(|i| i.needs_execution_tool())
}

/// The verdicts of checks, in their order.
pub(super) fn run_all(subject: &Subject, checks: &[&Check], options: &Options) -> Vec<Verdict> {
    let verdicts: Vec<Mutex<Option<Verdict>>> = checks.iter().map(|_| Mutex::new(None)).collect();
    let mut queue = VecDeque::new();
    for (check, verdict) in checks.iter().zip(&verdicts) {
        match check.run {
            Run::File(look) => store(verdict, look(subject)),
            Run::Probe(_) | Run::Silent(_) | Run::Twice(_) => queue.push_back((*check, verdict)),
        }
    }
    let runner = Runner::new(subject, options);
    let gate = if queue.is_empty() { None } else { gate(&runner) };
    let queue = Mutex::new(queue);
    let workers = std::thread::available_parallelism().map_or(2, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                while let Some((check, verdict)) = take(&queue) {
                    let found = match (&runner, &gate) {
                        (Err(cause), _) => Verdict::NotDetermined(cause.clone()),
                        (Ok(_), Some(cause)) if !FIRST.contains(&check.id) => Verdict::NotDetermined(cause.clone()),
                        (Ok(runner), _) => runner.run(check),
                    };
                    store(verdict, found);
                }
            });
        }
    });
    let lost = || Verdict::NotDetermined("the probe was lost".into());
    verdicts.into_iter().map(|v| v.into_inner().ok().flatten().unwrap_or_else(lost)).collect()
}

/// Why all other probes are in vain: not even a plain life goes through.
fn gate(runner: &Result<Runner, String>) -> Option<String> {
    let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == "L00")?;
    match runner.as_ref().ok()?.run(check) {
        Verdict::Violated(found) => {
            Some(format!("a plain life does not go through (L00): {}", found.first().map_or("", String::as_str)))
        }
        Verdict::NotDetermined(why) => Some(why),
        _ => None,
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

/// What is the same for all probes of a subject.
struct Runner {
    program: PathBuf,
    dir: PathBuf,
    binary: PathBuf,
    patience: Duration,
}

/// How a child ended.
enum End {
    Exit(ExitStatus),
    Hang,
}

impl Runner {
    fn new(subject: &Subject, options: &Options) -> Result<Self, String> {
        let binary = subject.host_binary()?;
        let program = options.program.clone().map_or_else(std::env::current_exe, Ok).map_err(|e| e.to_string())?;
        Ok(Self {
            program,
            dir: subject.dir().to_owned(),
            binary: subject.dir().join(&binary.name),
            patience: options.patience.unwrap_or(PATIENCE),
        })
    }

    fn run(&self, check: &Check) -> Verdict {
        let run = || {
            self.attempt(check).unwrap_or_else(|e| Verdict::NotDetermined(format!("the probe could not be run: {e}")))
        };
        let verdict = run();
        if !matches!((check.run, &verdict), (Run::Twice(_), Verdict::Pass(_))) {
            return verdict;
        }
        match (verdict, run()) {
            (Verdict::Pass(first), Verdict::Pass(second)) if first != second => Verdict::Violated(vec![
                format!("one process: {}", first.join(", ")),
                format!("another: {}", second.join(", ")),
            ]),
            (_, second) => second,
        }
    }

    fn attempt(&self, check: &Check) -> std::io::Result<Verdict> {
        let room = tempfile::Builder::new().prefix("fmu-probe-").tempdir()?;
        let (out, home) = (room.path().join("out"), room.path().join("home"));
        fs::create_dir(&home)?;
        let mut deaths = Vec::new();
        let mut from = 0;
        let began = Instant::now();
        loop {
            let end = self.child(check, room.path(), from)?;
            let lines = read(&out);
            if lines.iter().any(|l| matches!(l, Line::Done)) {
                break;
            }
            let journal = fs::read_to_string(out.with_extension("call")).unwrap_or_default();
            deaths.push((end.told(self.patience), journal.trim().to_owned()));
            let last = lines.iter().rev().find_map(|l| if let Line::Case(n) = l { Some(*n) } else { None });
            match last {
                // Not twice at the same place, not for ever.
                Some(n) if deaths.len() <= RESTARTS && began.elapsed() < 2 * self.patience => from = n + 1,
                _ => break,
            }
        }
        let mut verdict = judge(check.id, read(&out), deaths);
        if matches!(check.run, Run::Silent(_)) && matches!(verdict, Verdict::Pass(_)) {
            let noise = noise(room.path(), &home);
            if !noise.is_empty() {
                verdict = Verdict::Violated(noise);
            }
        }
        Ok(verdict)
    }

    fn child(&self, check: &Check, room: &Path, from: usize) -> std::io::Result<End> {
        let console = File::options().create(true).append(true).open(room.join("console"))?;
        let mut child = Command::new(&self.program)
            .args(["probe", "--id", check.id, "--from", &from.to_string()])
            .args(["--seconds", &self.patience.as_secs_f64().to_string()])
            .arg("--dir")
            .arg(&self.dir)
            .arg("--binary")
            .arg(&self.binary)
            .arg("--out")
            .arg(room.join("out"))
            .current_dir(room.join("home"))
            .stdin(Stdio::null())
            .stdout(console.try_clone()?)
            .stderr(console)
            .spawn()?;
        let began = Instant::now();
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(End::Exit(status));
            }
            if began.elapsed() > self.patience {
                child.kill()?;
                child.wait()?;
                return Ok(End::Hang);
            }
            let pause = if began.elapsed() < Duration::from_millis(50) { 1 } else { 5 };
            std::thread::sleep(Duration::from_millis(pause));
        }
    }
}

impl End {
    fn told(&self, patience: Duration) -> String {
        match self {
            Self::Hang => format!("did not return within {} s", patience.as_secs_f64()),
            Self::Exit(status) => {
                #[cfg(unix)]
                if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(status) {
                    let name = match signal {
                        4 => " (illegal instruction)",
                        6 => " (abort)",
                        7 | 11 => " (bad memory access)",
                        8 => " (arithmetic exception)",
                        _ => "",
                    };
                    return format!("ended the process with signal {signal}{name}");
                }
                format!("ended the process ({status})")
            }
        }
    }
}

fn read(out: &Path) -> Vec<Line> {
    let text = fs::read_to_string(out).unwrap_or_default();
    text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()
}

/// What the process said or left, although nobody asked it to.
fn noise(room: &Path, home: &Path) -> Vec<String> {
    let console = fs::read(room.join("console")).unwrap_or_default();
    let console = String::from_utf8_lossy(&console);
    let mut findings: Vec<_> = console.lines().take(5).map(|l| format!("wrote to the console: {l}")).collect();
    let files = fs::read_dir(home).into_iter().flatten().flatten().take(5);
    findings
        .extend(files.map(|f| format!("made a file in the working directory: {}", f.file_name().to_string_lossy())));
    findings
}

/// A verdict of what was written and of how often the process died.
fn judge(id: &str, lines: Vec<Line>, deaths: Vec<(String, String)>) -> Verdict {
    let (mut violated, mut notes, mut blocked, mut away) = (Vec::new(), Vec::new(), None, None);
    for line in lines {
        match line {
            Line::Violated(text) => violated.push(text),
            Line::Note(text) => notes.push(text),
            Line::Blocked(why) => blocked = blocked.or(Some(why)),
            Line::NotApplicable(why) => away = away.or(Some(why)),
            Line::Case(_) | Line::Done => {}
        }
    }
    for (how, call) in deaths {
        if let Some(call) = call.strip_prefix("C ") {
            violated.push(format!("{call} {how}"));
            continue;
        }
        // Before the probe proper: another check tells of it.
        let call = call.strip_prefix("P ").unwrap_or("the start");
        if id == "B00" || (id == "L00" && !call.starts_with("loading")) {
            violated.push(format!("{call} {how}"));
        } else {
            blocked = blocked.or(Some(format!("{call} {how}, before the probe began")));
        }
    }
    match (violated.is_empty(), blocked, away) {
        (false, ..) => Verdict::Violated(violated),
        (_, Some(why), _) => Verdict::NotDetermined(why),
        (_, _, Some(why)) => Verdict::NotApplicable(why),
        _ => Verdict::Pass(notes),
    }
}
