//! The session of a probe: one FMU, loaded into its own process, and the findings about it.
//!
//! Every finding is written at once and every call is written before it is made, so that nothing is lost if the FMU crashes the
//! process. `Err(NotDetermined)` ends a probe that cannot decide.

use crate::confidence::Confidence;
use crate::level::Level;
use crate::lines::{Line, ProbeArguments};
use crate::settable::aliases;
use fmu_import::platform::Platform;
use fmu_import::raw::{Arguments, Interface, Raw};
use fmu_import::{file_uri, machine, printable_lines};
use model_description::{BaseType, FmiVersion, ModelDescription};
use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::ffi::CString;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Why a probe cannot decide.
#[derive(Debug)]
pub(super) struct NotDetermined(pub(super) String);

/// Why a probe has no session.
pub(super) enum NotOpened {
    /// Something failed on this computer; the FMU is not at fault.
    Here(String),
    /// The binary does not load.
    Load(String),
}

/// A probe's FMU.
pub(super) struct Session {
    pub(super) raw: Raw,
    pub(super) description: ModelDescription,
    /// Which variables are further names of a value.
    pub(super) aliases: Vec<bool>,
    /// Some variable is a clock.
    clocks: bool,
    /// Path of the binary.
    pub(super) binary: PathBuf,
    /// Folder that the FMU was unpacked to.
    pub(super) dir: PathBuf,
    lines: RefCell<File>,
    journal: RefCell<File>,
    preparing: Cell<bool>,
    /// The level of a crash, if lower than the check's.
    lower: Cell<Option<Level>>,
    pub(super) silent: Cell<bool>,
    /// A finding could not be written.
    pub(super) lost: Cell<bool>,
    /// A getter has returned OK without writing a value.
    pub(super) unwritten: Cell<bool>,
    /// The step of the integrator in s, if not the default.
    pub(super) integrator: Cell<Option<f64>>,
    /// Names of the variables in which two plain runs differ.
    pub(super) varying: HashSet<String>,
    log: RefCell<File>,
    /// Lines of the log that are not written yet: the results of the last call.
    results: RefCell<String>,
    trace: bool,
    /// Number of lines left: every call is recorded up to the first finding or a maximum number of lines.
    full: Cell<Option<usize>>,
    from: usize,
    one: bool,
    next: Cell<usize>,
    violations: Cell<usize>,
    instances_made: Cell<usize>,
    /// Instances of this case.
    of_case: Cell<usize>,
    began: Instant,
    /// When `show_progress` last wrote.
    shown: Cell<Instant>,
    timeout: Duration,
    /// The working directory at the start: temporary, and the FMU may leave it.
    pub(super) home: PathBuf,
    /// The file of `journal`.
    calls: PathBuf,
}

/// Below the environments of the instances.
const ENVIRONMENT: usize = 0x5000;
/// Marks the start of a process in the log of calls.
pub(super) const BEGUN: &str = "# begun";
/// Marks a finding in the log of calls.
pub(super) const FOUND: &str = "# found";
/// Start of the reason if the FMU ended the simulation, as it may at any time.
pub(super) const ENDED: &str = "the FMU ended the simulation";
/// Lines of calls in a script.
const FULL: usize = 6000;
/// Maximum number of violations that one probe reports.
const MAX_VIOLATIONS: usize = 25;

/// A library for another processor or system than this one: the dynamic linker reports a missing file.
fn of_other(binary: &Path) -> Option<String> {
    let mut head = Vec::new();
    File::open(binary).ok()?.take(machine::HEAD).read_to_end(&mut head).ok()?;
    let (platforms, host) = (machine::platforms(&head), Platform::host());
    let first = platforms.first().filter(|_| !platforms.contains(&host))?;
    Some(format!("it is for {}, and this computer is {}", first.tuple(), host.tuple()))
}

/// The description: a hundred probes of a large FMU spend most of their time on its XML.
fn description(args: &ProbeArguments) -> Result<ModelDescription, String> {
    let read = |path: &Path| std::fs::read(path).map_err(|e| e.to_string());
    match &args.description {
        Some(file) => postcard::from_bytes(&read(file)?).map_err(|e| e.to_string()),
        None => model_description::read(read(&args.dir.join("modelDescription.xml"))?).map_err(|e| e.to_string()),
    }
}

impl Session {
    /// Loads the FMU.
    pub(super) fn open(args: &ProbeArguments) -> Result<Self, NotOpened> {
        let lost = |e: &dyn std::fmt::Display| NotOpened::Here(e.to_string());
        let home = std::env::current_dir().map_err(|e| lost(&e))?;
        let description = description(args).map_err(|e| lost(&e))?;
        let create = |path: &Path| File::options().create(true).append(true).open(path).map_err(|e| lost(&e));
        let lines = create(&args.out)?;
        let calls = args.out.with_extension("call");
        let mut journal = File::create(&calls).map_err(|e| lost(&e))?;
        let log = create(&args.out.with_extension("log"))?;
        let _ = journal.write_all(b"P loading the binary");
        let _ = (&log).write_all(format!("{BEGUN}\n").as_bytes());
        let raw = Raw::open(&args.binary, description.version).map_err(|e| {
            NotOpened::Load(format!("the binary does not load: {}", of_other(&args.binary).unwrap_or(e)))
        })?;
        let paths = [args.binary.clone(), args.dir.clone(), home, calls];
        let timeout = Duration::from_secs_f64(args.seconds);
        let session = Self::new(raw, description, paths, [lines, journal, log], timeout);
        let integrator = Cell::new(args.integrator);
        let names = args.varying.as_deref().map(std::fs::read).transpose().map_err(|e| lost(&e))?;
        let varying = names.map(|json| serde_json::from_slice(&json)).transpose().map_err(|e| lost(&e))?;
        let varying = varying.unwrap_or_default();
        let full = Cell::new(args.full.then_some(FULL));
        Ok(Self { integrator, varying, full, trace: args.trace, from: args.from, one: args.one, ..session })
    }

    /// A session at its start that runs every case and prints nothing; the paths are, in this order, the binary, the unpacked
    /// folder, the working directory and the journal; the files are the findings, the journal and the log.
    fn new(
        raw: Raw,
        description: ModelDescription,
        [binary, dir, home, calls]: [PathBuf; 4],
        [lines, journal, log]: [File; 3],
        timeout: Duration,
    ) -> Self {
        Self {
            raw,
            aliases: aliases(&description),
            clocks: description.variables.iter().any(|v| v.base == BaseType::Clock),
            description,
            binary,
            dir,
            lines: RefCell::new(lines),
            journal: RefCell::new(journal),
            preparing: Cell::new(false),
            lower: Cell::new(None),
            silent: Cell::new(false),
            lost: Cell::new(false),
            unwritten: Cell::new(false),
            integrator: Cell::new(None),
            varying: HashSet::new(),
            log: RefCell::new(log),
            results: RefCell::default(),
            trace: false,
            full: Cell::new(None),
            from: 0,
            one: false,
            next: Cell::new(0),
            violations: Cell::new(0),
            instances_made: Cell::new(0),
            of_case: Cell::new(0),
            began: Instant::now(),
            shown: Cell::new(Instant::now()),
            timeout,
            home,
            calls,
        }
    }

    /// Loads the FMU once more, from this copy of its binary: for another thread, or under another path.
    pub(super) fn duplicate(&self, binary: &Path, number: usize) -> Result<Self, NotDetermined> {
        let raw = Raw::open(binary, self.description.version).map_err(NotDetermined)?;
        self.duplicate_with(raw, number)
    }

    /// A session with another loaded binary of the FMU; its findings and calls are discarded.
    pub(super) fn duplicate_with(&self, raw: Raw, number: usize) -> Result<Self, NotDetermined> {
        self.duplicate_at(&self.dir, raw, number)
    }

    /// A session with another loaded binary and another unpacked folder; its findings and calls are discarded.
    pub(super) fn duplicate_at(&self, dir: &Path, raw: Raw, number: usize) -> Result<Self, NotDetermined> {
        let lost = |e: std::io::Error| NotDetermined(e.to_string());
        // It writes only progress there.
        let journal = File::options().append(true).open(&self.calls).map_err(lost)?;
        let paths = [self.binary.clone(), dir.into(), self.home.clone(), self.calls.clone()];
        let discarded = || tempfile::tempfile().map_err(lost);
        let files = [discarded()?, journal, discarded()?];
        let session = Self::new(raw, self.description.clone(), paths, files, self.timeout);
        let instances_made = Cell::new(1000 * (number + 1));
        let (silent, integrator, varying) = (Cell::new(true), self.integrator.clone(), self.varying.clone());
        Ok(Self { silent, integrator, varying, instances_made, began: self.began, ..session })
    }

    /// Where the FMU's resources are, if it has any.
    pub(super) fn resources(&self) -> PathBuf {
        self.dir.join("resources")
    }

    /// Writes a line.
    pub(super) fn write(&self, line: &Line) {
        if let Ok(text) = serde_json::to_string(line) {
            let written = writeln!(self.lines.borrow_mut(), "{text}");
            // Except if the FMU has closed the file, which is the FMU's fault.
            let full = |e: std::io::Error| matches!(e.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded);
            self.lost.set(self.lost.get() || written.is_err_and(full));
        }
    }

    /// Reports a violation.
    pub(super) fn violated(&self, text: impl Into<String>) {
        self.report(None, Confidence::Certain, text);
    }

    /// Reports a violation at this level, or at the check's own level.
    pub(super) fn report(&self, lower: Option<Level>, confidence: Confidence, text: impl Into<String>) {
        if lower.is_none() {
            self.violations.set(self.violations.get() + 1);
        }
        if lower.is_some() || self.violations.get() <= MAX_VIOLATIONS {
            self.write(&Line::Violated(lower, confidence, text.into()));
        }
        self.note_call(&format!("\n{FOUND}\n"));
    }

    /// Reports a violation at a lower level than the check's.
    pub(super) fn lesser(&self, level: Level, text: impl Into<String>) {
        self.report(Some(level), Confidence::Certain, text);
    }

    /// Reports a call that should have succeeded, as a violation; an end requested by the FMU is not a violation.
    pub(super) fn failed(&self, what: &str, NotDetermined(why): NotDetermined) {
        if why.starts_with(ENDED) {
            self.write(&Line::NotDetermined(why));
        } else {
            self.violated(format!("{what}: {why}"));
        }
    }

    /// Reports a violation unless `holds`.
    pub(super) fn require(&self, holds: bool, text: impl FnOnce() -> String) {
        if !holds {
            self.violated(text());
        }
    }

    /// Reports evidence.
    pub(super) fn note(&self, text: impl Into<String>) {
        self.write(&Line::Note(text.into()));
    }

    /// Reports that the requirement does not apply to this FMU, as the result of the probe.
    #[expect(clippy::unnecessary_wraps, reason = "probes return it")]
    pub(super) fn not_applicable(&self, reason: impl Into<String>) -> Result<(), NotDetermined> {
        self.write(&Line::NotApplicable(reason.into()));
        Ok(())
    }

    /// Runs an independent case of a probe: after a crash the probe continues with the next case.
    pub(super) fn case(&self, case: impl FnOnce() -> Result<(), NotDetermined>) {
        let number = self.next.get();
        self.next.set(number + 1);
        if number < self.from || (self.one && number > self.from) {
            return;
        }
        self.of_case.set(0);
        self.write(&Line::Case(number));
        self.note_call(&format!("\n# case {number}\n"));
        if let Err(NotDetermined(why)) = case() {
            self.write(&Line::NotDetermined(why));
        }
    }

    /// Runs a case of a probe with each of these values.
    #[expect(clippy::unnecessary_wraps, reason = "probes return it")]
    pub(super) fn cases<T>(
        &self,
        values: impl IntoIterator<Item = T>,
        case: impl Fn(T) -> Result<(), NotDetermined>,
    ) -> Result<(), NotDetermined> {
        values.into_iter().for_each(|value| self.case(|| case(value)));
        Ok(())
    }

    /// Whether half of the time is used up; loops end then.
    pub(super) fn half_time_used(&self) -> bool {
        self.began.elapsed() > self.timeout / 2
    }

    /// Writes the next call to the journal.
    pub(super) fn record_call(&self, call: &str) {
        if self.silent.get() {
            return self.show_progress();
        }
        if !call.starts_with('(') {
            self.note_call(&format!("\n{call}"));
        }
        // One write per call: with the results of the last one, before this one is made.
        let mut results = self.results.borrow_mut();
        let _ = self.log.borrow_mut().write_all(results.as_bytes());
        results.clear();
        let mut journal = self.journal.borrow_mut();
        let mark = match (self.preparing.get(), self.lower.get()) {
            (true, _) => "P",
            (_, Some(Level::Should)) => "S",
            (_, Some(Level::Hard)) => "H",
            _ => "C",
        };
        // The call is the first line; what follows it is left from other calls.
        let _ = journal.seek(SeekFrom::Start(0));
        let _ = journal.write_all(format!("{mark} {call}\n").as_bytes());
    }

    /// Adds to the log of calls.
    fn note_call(&self, text: &str) {
        match self.full.get() {
            _ if self.silent.get() => return,
            Some(0) => return,
            Some(left) => self.full.set(Some(if text.contains(FOUND) {
                0
            } else {
                left - text.matches('\n').count().min(left - 1)
            })),
            None => {}
        }
        self.results.borrow_mut().push_str(text);
        if self.trace {
            print!("{}", printable_lines(text));
            let _ = std::io::stdout().flush();
        }
    }

    /// Adds the result of the last call.
    pub(super) fn record_result(&self, result: &dyn std::fmt::Display) {
        if self.silent.get() {
            return;
        }
        self.note_call(&format!(" -> {result}"));
    }

    /// Adds a value that the last call returned.
    pub(super) fn record_value(&self, value: &str) {
        self.note_call(&format!(", {value}"));
    }

    /// The number of one more instance of this case.
    pub(super) fn another(&self) -> usize {
        self.of_case.set(self.of_case.get() + 1);
        self.of_case.get()
    }

    /// Number of instances that this case has created.
    pub(super) fn made_in_case(&self) -> usize {
        self.of_case.get()
    }

    /// Shows the parent, from time to time, that calls without separate journal entries return.
    pub(super) fn show_progress(&self) {
        if self.shown.get().elapsed() < Duration::from_millis(100) {
            return;
        }
        self.shown.set(Instant::now());
        let mut journal = self.journal.borrow_mut();
        let _ = journal.seek(SeekFrom::End(0)).and_then(|_| writeln!(journal, "and others"));
    }

    /// Makes calls that the standard leaves undefined; a crash in them is reported at this lower level.
    pub(super) fn lenient<T>(&self, level: Level, work: impl FnOnce() -> T) -> T {
        let before = self.lower.replace(Some(level));
        let result = work();
        self.lower.set(before);
        result
    }

    /// Makes many calls with one journal entry.
    pub(super) fn record_calls<T>(&self, what: &str, work: impl FnOnce() -> T) -> T {
        if self.full.get().is_some() {
            self.note_call(&format!("\n# {what}"));
            return work();
        }
        self.record_call(what);
        let before = self.silent.replace(true);
        let result = work();
        self.silent.set(before);
        result
    }

    pub(super) fn prepare<T>(&self, work: impl FnOnce() -> Result<T, NotDetermined>) -> Result<T, NotDetermined> {
        let before = self.preparing.replace(true);
        let result = work();
        self.preparing.set(before);
        self.record_call("(between two calls)");
        result
    }

    /// Valid arguments for an instantiation.
    pub(super) fn arguments(&self, name: &str) -> Arguments {
        let text = |text: &str| CString::new(text).unwrap_or_default();
        let resources = self.resources();
        let resources = match self.description.version {
            FmiVersion::V2 => file_uri(&resources),
            FmiVersion::V3 => format!("{}{}", resources.display(), std::path::MAIN_SEPARATOR),
        };
        self.instances_made.set(self.instances_made.get() + 1);
        Arguments {
            name: Some(text(name)),
            token: Some(text(&self.description.token)),
            resources: Some(text(&resources)),
            interface: match (&self.description.co_simulation, &self.description.model_exchange) {
                (Some(_), _) => Interface::CoSimulation,
                (None, None) => Interface::ScheduledExecution,
                (None, _) => Interface::ModelExchange,
            },
            logger: true,
            callbacks: true,
            memory: true,
            lasting: true,
            logging: false,
            event_mode: self.clocks,
            early_return: false,
            environment: self.environment(),
            intermediate: None,
            locks: false,
        }
    }

    /// The environment of the instance that was made last.
    pub(super) fn environment(&self) -> usize {
        ENVIRONMENT + 0x10 * self.instances_made.get()
    }

    /// The relative deviation up to which two runs count as equal, because the standards nowhere require equal bits: the tolerance of
    /// the default experiment, at least 1e-6.
    pub(super) fn tolerance(&self) -> f64 {
        self.description.default_experiment.tolerance.filter(|t| t.is_finite()).unwrap_or(0.0).max(1e-6)
    }

    /// The FMU is one of FMI 2.0.
    pub(super) fn is_v2(&self) -> bool {
        self.description.version == FmiVersion::V2
    }

    /// Start time of the default experiment.
    pub(super) fn start(&self) -> f64 {
        self.description.default_experiment.start.filter(|t| t.is_finite()).unwrap_or(0.0)
    }

    /// A suitable communication step in s.
    pub(super) fn h(&self) -> f64 {
        let x = self.description.default_experiment;
        let fixed = self
            .description
            .co_simulation
            .as_ref()
            .and_then(|c| c.attribute("fixedInternalStepSize")?.trim().parse().ok());
        let good = |h: &f64| h.is_finite() && *h > 0.0;
        let span = x.stop.map(|stop| (stop - self.start()) / 100.0);
        x.step.filter(good).or(fixed.filter(good)).or(span.filter(good)).unwrap_or(0.01)
    }

    /// Whether the archive has resources.
    pub(super) fn has_resources(&self) -> bool {
        std::fs::read_dir(self.resources()).is_ok_and(|mut files| files.next().is_some())
    }

    /// A capability of co-simulation, or of Model Exchange if there is no co-simulation.
    pub(super) fn flag(&self, name: &str) -> bool {
        let d = &self.description;
        d.co_simulation.as_ref().or(d.model_exchange.as_ref()).is_some_and(|i| i.flag(name))
    }
}
