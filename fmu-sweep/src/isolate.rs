//! Rows in separate processes: an FMU that crashes ends one process and one row.
//!
//! The parent sends the sweep, then ranges of rows, on standard input. The worker answers on standard output, where an FMU may
//! print as well: each answer begins a new line with a mark, and other lines are skipped.

use crate::sweep::Writer;
use crate::{Definition, Error, RunResult, Sweep};
use fmu_import::guard;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, Write};
use std::ops::Range;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};

const MARK: &str = "@fmu-sweep ";

/// A command whose process calls [`serve`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Isolation {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
}

#[derive(Deserialize, Serialize)]
struct Job {
    definition: Definition,
    folder: PathBuf,
    reuse: bool,
    traces: Option<PathBuf>,
}

/// A worker process, started when it is needed and again after it has died.
pub(crate) struct Process<'a> {
    sweep: &'a Sweep,
    command: &'a Isolation,
    job: String,
    running: Option<Running>,
}

struct Running {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

/// The end of a process that did not answer.
struct Died(String);

impl<'a> Process<'a> {
    pub(crate) fn new(
        sweep: &'a Sweep,
        command: &'a Isolation,
        reuse: bool,
        traces: Option<PathBuf>,
    ) -> Result<Self, Error> {
        let (definition, folder) = (sweep.definition().clone(), sweep.folder().to_owned());
        let job = serde_json::to_string(&Job { definition, folder, reuse, traces });
        Ok(Self { sweep, command, job: job.map_err(|e| Error::Invalid(e.to_string()))?, running: None })
    }

    /// [`Sweep::probe`] in the process; `None` if it dies.
    pub(crate) fn probe(&mut self) -> Result<Option<(f64, bool)>, Error> {
        let answered = self.started()?.ask("probe").and_then(Running::answer);
        if let Ok(answer) = answered {
            return Ok(serde_json::from_str(&answer).ok());
        }
        self.running = None;
        Ok(None)
    }

    /// The lines of rows, and the rows in which the FMUs warned.
    pub(crate) fn run(
        &mut self,
        mut rows: Range<u64>,
        lines: &mut String,
        warnings: &mut Vec<(u64, String)>,
    ) -> Result<(), Error> {
        let mut idle = 0;
        while !rows.is_empty() {
            // Only the row that it has announced can have caused the crash.
            let mut announced = None;
            let died = match self.started()?.ask(&format!("{} {}", rows.start, rows.end)) {
                Ok(running) => loop {
                    match running.answer() {
                        Err(died) => break Some(died),
                        Ok(answer) => match answer.split_once(' ') {
                            Some(("row", row)) => announced = row.parse::<u64>().ok(),
                            Some(("warning", text)) => warnings.push((rows.start, text.into())),
                            Some(("line", line)) => {
                                lines.push_str(line);
                                lines.push('\n');
                                rows.start += 1;
                                announced = None;
                            }
                            Some(("error", cause)) => return Err(Error::Invalid(cause.into())),
                            _ => break None,
                        },
                    }
                },
                Err(died) => Some(died),
            };
            let Some(Died(how)) = died else { continue };
            self.running = None;
            if announced == Some(rows.start) {
                let (mut values, outcome) = (Vec::new(), RunResult { result: Err(how), end: f64::NAN });
                self.sweep.rows().row(rows.start, &mut values);
                lines.push_str(&self.sweep.line(rows.start, &values, &outcome));
                rows.start += 1;
                idle = 0;
            } else {
                idle += 1;
                if idle > 3 {
                    return Err(Error::Invalid(format!(
                        "the worker process was {how} before row {} started",
                        rows.start
                    )));
                }
            }
        }
        Ok(())
    }

    fn started(&mut self) -> Result<&mut Running, Error> {
        if self.running.is_none() {
            let Isolation { program, arguments } = self.command;
            let mut command = Command::new(program);
            command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
            guard::own_group(&mut command);
            let mut child = guard::patiently(|| command.spawn()).map_err(|e| Error::file(program, e))?;
            let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
                return Err(Error::file(program, "has no standard input or output"));
            };
            let mut running = Running { child, input, output: BufReader::new(output) };
            match running.ask(&self.job).and_then(Running::answer) {
                Ok(ready) if ready == "ready" => {}
                Ok(cause) => return Err(Error::Invalid(cause.trim_start_matches("error ").into())),
                Err(Died(how)) => {
                    return Err(Error::Invalid(format!("a worker process was {how} while it loaded the FMUs")));
                }
            }
            self.running = Some(running);
        }
        self.running.as_mut().ok_or(Error::Interrupted)
    }
}

impl Running {
    fn ask(&mut self, text: &str) -> Result<&mut Self, Died> {
        match self.input.write_all(format!("{text}\n").as_bytes()) {
            Ok(()) => Ok(self),
            Err(_) => Err(self.died()),
        }
    }

    /// The next marked line, without the mark.
    fn answer(&mut self) -> Result<String, Died> {
        let mut line = Vec::new();
        loop {
            line.clear();
            match self.output.read_until(b'\n', &mut line) {
                Ok(1..) => {}
                Ok(0) | Err(_) => return Err(self.died()),
            }
            if let Some(answer) = line.strip_prefix(MARK.as_bytes()) {
                return Ok(String::from_utf8_lossy(answer).trim_end_matches('\n').to_owned());
            }
        }
    }

    fn died(&mut self) -> Died {
        Died(self.child.wait().map_or_else(|e| e.to_string(), how))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // A worker that waits for rows ends when its input closes; one that still computes a row is no longer needed.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// `killed by SIGSEGV`, or `ended with exit status 3`.
fn how(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        return format!("killed by {}", guard::signal_name(signal).0);
    }
    status.code().map_or_else(|| "ended".into(), |code| format!("ended with exit status {code}"))
}

/// The loop of a worker process, until its standard input ends.
///
/// # Errors
/// The input does not come from a parent, or cannot be read.
pub fn serve() -> Result<(), Error> {
    guard::end_with_parent();
    let wrong = |e: io::Error| Error::Invalid(format!("standard input: {e}"));
    let mut requests = io::stdin().lock().lines();
    let Some(job) = requests.next().transpose().map_err(wrong)? else { return Ok(()) };
    let job: Job = serde_json::from_str(&job).map_err(|e| Error::Invalid(format!("standard input: {e}")))?;
    let sweep = Sweep::new(job.definition, job.folder);
    let mut writer = match sweep.as_ref().map_err(Clone::clone).and_then(|sweep| sweep.writer(job.reuse, job.traces)) {
        Ok(writer) => Some(writer),
        Err(error) => return say(&format!("error {error}")),
    };
    say("ready")?;
    for request in requests {
        let request = request.map_err(wrong)?;
        if request == "probe" {
            // Some FMUs allow only one instance.
            writer = None;
            let probed = sweep.as_ref().map_err(Clone::clone).and_then(Sweep::probe)?;
            say(&serde_json::to_string(&probed).map_err(|e| Error::Invalid(e.to_string()))?)?;
        } else if let (Some(writer), Some((first, end))) = (&mut writer, request.split_once(' '))
            && let (Ok(first), Ok(end)) = (first.parse(), end.parse())
        {
            answer(writer, first..end)?;
        }
    }
    Ok(())
}

fn answer(writer: &mut Writer<'_>, rows: Range<u64>) -> Result<(), Error> {
    for row in rows {
        say(&format!("row {row}"))?;
        match writer.run(row) {
            Ok(line) => {
                if let Some(warning) = writer.warning() {
                    say(&format!("warning {warning}"))?;
                }
                say(&format!("line {}", line.trim_end()))?;
            }
            Err(error) => return say(&format!("error {error}")),
        }
    }
    say("done")
}

/// Written in one piece on its own line, even if the FMU has printed half a line before.
fn say(text: &str) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    let all = out.write_all(format!("\n{MARK}{text}\n").as_bytes()).and_then(|()| out.flush());
    all.map_err(|e| Error::Invalid(format!("standard output: {e}")))
}
