//! A sweep into its folder: missing parts on threads, or in processes.

use crate::isolate::{Isolation, Process};
use crate::output::{Cut, Failures, Output, restart};
use crate::pool::{self, BLOCK};
use crate::sweep::Writer;
use crate::warned::Warned;
use crate::{Error, Sweep, files};
use fmu_import::threads;
use std::collections::HashMap;
use std::fs::{self, File};
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime};

/// How to run.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Threads or processes; by default the number that the machine can run in parallel.
    pub jobs: Option<usize>,
    /// Only the parts k with k = I mod N.
    pub part: Option<(u64, u64)>,
    /// Stop after this many rows, rounded up to whole parts.
    pub limit: Option<u64>,
    /// Remove earlier results first.
    pub restart: bool,
    /// Run rows in separate processes.
    pub isolate: Option<Isolation>,
}

/// Receives progress of a run, on any thread.
pub trait Progress: Sync {
    /// A note of one line.
    fn note(&self, text: &str);
    /// The numbers of rows done, to run, and failed.
    fn progress(&self, done: u64, failed: u64, all: u64);
}

/// The work of one call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Rows that this call has run.
    pub rows: u64,
    /// Missing parts of the sweep.
    pub missing: u64,
    /// All results, once no part is missing.
    pub results: Option<PathBuf>,
    /// Number of failed rows: among all results, or, while parts are missing, in this call.
    pub failures: Failures,
    /// Rows of this call in which FMUs warned.
    pub warned: Warned,
}

/// Runs the missing parts of the folder.
///
/// # Errors
/// The folder belongs to another sweep, a file cannot be written, or an FMU cannot be instantiated. Complete parts remain.
pub fn run(sweep: &Sweep, folder: &Path, options: &Options, watch: &dyn Progress) -> Result<Report, Error> {
    // An FMU may change the working directory.
    let folder = &std::path::absolute(folder).map_err(|e| Error::file(folder, e))?;
    if options.restart {
        restart(folder)?;
    }
    fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
    let _marker = Marker::new(folder, watch)?;
    let traces = sweep.definition().trace.as_ref().map(|_| folder.join("traces"));
    let isolate = options.isolate.as_ref();
    let fixed = sweep.definition().design.as_ref().and_then(|design| design.part);
    let output = Output::open(sweep, folder, || match isolate {
        None => sweep.probe().map(|(seconds, reuse)| Cut::new(fixed, seconds, reuse)),
        Some(command) => {
            // If the probed row killed the process, the duration of a row is unknown: small parts.
            let probed = Process::new(sweep, command, true, None)?.probe()?;
            let (seconds, reuse) = probed.unwrap_or((0.05, sweep.definition().reuse.unwrap_or(true)));
            Ok(Cut::new(fixed, seconds, reuse))
        }
    })?;
    let reuse = output.cut().reuse;
    if !reuse && sweep.definition().reuse.is_none() {
        watch.note("a run after a reset differs from a run of a new instance: every run gets new instances");
    }
    if let Some(traces) = &traces {
        fs::create_dir_all(traces).map_err(|e| Error::file(traces, e))?;
    }
    let missing = output.missing();
    let there = output.parts() - len(&missing);
    if there > 0 {
        watch.note(&format!("{there} of {} parts already exist", output.parts()));
    }
    let mut jobs = Vec::new();
    let (mut rows, mut blocks) = (0, 0);
    for part in missing {
        let mine = options.part.is_none_or(|(i, n)| part % n == i % n);
        if mine && options.limit.is_none_or(|limit| rows < limit) {
            let range = output.rows_of(part);
            let first_block = blocks;
            rows += range.end - range.start;
            blocks += (range.end - range.start).div_ceil(BLOCK);
            jobs.push(Job { part, rows: range, first_block });
        }
    }
    let threads = if isolate.is_none() && sweep.plan().only_one_instance().is_some() {
        1
    } else {
        options.jobs.unwrap_or_else(threads::available).max(1)
    };
    let log = Log::new(folder)?;
    log.write(&format!("{rows} rows in {} parts on {threads} jobs", jobs.len()))?;
    let state = Mutex::new(Tally::default());
    let work = Work { sweep, output: &output, jobs: &jobs, state: &state, watch, log: &log, rows };
    pool::run(
        blocks,
        threads,
        |_| {
            Ok(match isolate {
                None => Executor::Here(Box::new(sweep.writer(reuse, traces.clone())?)),
                Some(command) => Executor::Process(Process::new(sweep, command, reuse, traces.clone())?),
            })
        },
        |executor, block| work.block(executor, block),
    )?;
    let Tally { mut failures, warned, .. } = state.into_inner().unwrap_or_else(PoisonError::into_inner);
    let missing = len(&output.missing());
    let mut results = None;
    if missing == 0 {
        failures = output.join(sweep)?;
        files::clean_up(folder);
        results = Some(folder.join("results.csv"));
    }
    log.write(&format!("{rows} rows done, {} failed, {missing} parts missing", failures.count))?;
    Ok(Report { rows, missing, results, failures, warned })
}

/// Numbers of the missing parts and of all parts, and rows of a part; without a run and without output.
///
/// # Errors
/// The folder belongs to another sweep.
pub fn missing(sweep: &Sweep, folder: &Path) -> Result<Option<(Vec<u64>, u64, u64)>, Error> {
    if !folder.join("sweep.json").exists() {
        return Ok(None);
    }
    let output = Output::open(sweep, folder, || Err(Error::Interrupted))?;
    Ok(Some((output.missing(), output.parts(), output.cut().rows_per_part)))
}

fn len(parts: &[u64]) -> u64 {
    u64::try_from(parts.len()).unwrap_or(u64::MAX)
}

/// A part to run.
struct Job {
    part: u64,
    rows: Range<u64>,
    /// Number of its first block among all blocks.
    first_block: u64,
}

enum Executor<'a> {
    Here(Box<Writer<'a>>),
    Process(Process<'a>),
}

#[derive(Default)]
struct Tally {
    /// The completed lines of unfinished parts, by part number.
    parts: HashMap<u64, HashMap<u64, String>>,
    begun: HashMap<u64, Instant>,
    done: u64,
    failures: Failures,
    warned: Warned,
}

struct Work<'a> {
    sweep: &'a Sweep,
    output: &'a Output,
    jobs: &'a [Job],
    state: &'a Mutex<Tally>,
    watch: &'a dyn Progress,
    log: &'a Log,
    /// Rows of all jobs.
    rows: u64,
}

impl Work<'_> {
    /// Runs a block; the thread that completes a part writes it.
    fn block(&self, executor: &mut Executor<'_>, block: u64) -> Result<(), Error> {
        let index = self.jobs.partition_point(|job| job.first_block <= block) - 1;
        let Job { part, rows, first_block } = &self.jobs[index];
        let (of_part, length) = (block - first_block, rows.end - rows.start);
        let range = pool::rows_of(of_part, length);
        let range = rows.start + range.start..rows.start + range.end;
        self.state().begun.entry(*part).or_insert_with(Instant::now);
        let (mut lines, mut warnings) = (String::new(), Vec::new());
        match executor {
            Executor::Here(writer) => {
                for row in range.clone() {
                    lines.push_str(&writer.run(row)?);
                    warnings.extend(writer.warning().map(|warning| (row, warning)));
                }
            }
            Executor::Process(process) => process.run(range.clone(), &mut lines, &mut warnings)?,
        }
        let mut state = self.state();
        state.warned.asked += range.clone().map(|row| u64::from(self.sweep.hears(row))).sum::<u64>();
        for (row, warning) in warnings {
            state.warned.add(row, warning);
        }
        lines.lines().for_each(|line| state.failures.add(line));
        state.done += range.end - range.start;
        let (done, failed) = (state.done, state.failures.count);
        let blocks = state.parts.entry(*part).or_default();
        blocks.insert(of_part, lines);
        let complete = blocks.len() as u64 == length.div_ceil(BLOCK);
        let whole = if complete { state.parts.remove(part) } else { None };
        let seconds = state.begun.get(part).map_or(0.0, |begun| begun.elapsed().as_secs_f64());
        drop(state);
        if let Some(blocks) = whole {
            let mut text = self.sweep.header();
            (0..length.div_ceil(BLOCK)).filter_map(|block| blocks.get(&block)).for_each(|lines| text.push_str(lines));
            files::write(&self.output.part(*part), text.as_bytes())?;
            self.log.write(&format!("part {part}: {length} rows in {seconds:.2} s"))?;
        }
        self.watch.progress(done, failed, self.rows);
        Ok(())
    }

    fn state(&self) -> std::sync::MutexGuard<'_, Tally> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// `log.txt`: data that may differ between two sweeps with the same results.
struct Log(Mutex<File>, PathBuf);

impl Log {
    fn new(folder: &Path) -> Result<Self, Error> {
        let path = folder.join("log.txt");
        let file = File::options().create(true).append(true).open(&path).map_err(|e| Error::file(&path, e))?;
        Ok(Self(Mutex::new(file), path))
    }

    fn write(&self, text: &str) -> Result<(), Error> {
        let now = SystemTime::now()
            .duration_since(SystemTime::UNIX_EPOCH)
            .map_or(0, |since| i64::try_from(since.as_secs()).unwrap_or(0));
        let host = fs::read_to_string("/proc/sys/kernel/hostname").or_else(|_| std::env::var("COMPUTERNAME"));
        let host = host.unwrap_or_else(|_| "host".into());
        let line = format!("{} {} {}: {text}\n", model_description::date_from_epoch(now), host.trim(), process::id());
        let mut file = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(line.as_bytes()).map_err(|e| Error::file(&self.1, e))
    }
}

/// A file that a process locks while it works in the folder. An unlocked file belongs to a process that was killed.
struct Marker {
    path: PathBuf,
    _lock: File,
}

impl Marker {
    fn new(folder: &Path, watch: &dyn Progress) -> Result<Self, Error> {
        let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, e))?;
        let names = entries.flatten().filter(|e| e.file_name().to_string_lossy().starts_with(".running-"));
        let mut killed = false;
        for path in names.map(|e| e.path()) {
            if File::open(&path).is_ok_and(|lock| lock.try_lock().is_ok()) {
                killed = true;
                let _ = fs::remove_file(path);
            }
        }
        if killed {
            watch.note("an earlier process was interrupted; if an FMU crashes, --isolate makes its row an error");
        }
        let path = folder.join(format!(".running-{}", files::own()));
        let lock = File::create(&path).map_err(|e| Error::file(&path, e))?;
        // Without locks in this file system only the note is missing.
        let _ = lock.try_lock();
        Ok(Self { path, _lock: lock })
    }
}

impl Drop for Marker {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}
