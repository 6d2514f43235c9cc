//! The order of the checks: checks of the file, a minimal and two plain runs, then all other probes on all cores.

use crate::check::{Check, Conclusion, Options, Run, Verdict};
use crate::checks::GROUPS;
use crate::fmu_file::FmuFile;
use crate::runner::{OUT_OF_TIME, PLAIN_RUNS, Runner, is_exchange};
use fmu_import::{guard, limits, threads};
use std::collections::VecDeque;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Checks that run even if a minimal run fails, because they show why.
const WITHOUT_MINIMAL_RUN: [&str; 4] = ["B00", "L00", "E00", "X02b"];

/// What the checks found.
pub(super) struct Found {
    /// In the order of the checks.
    pub(super) conclusions: Vec<Conclusion>,
    /// The variables that were not compared, because two plain runs differ in them.
    pub(super) varying: Vec<String>,
}

/// Runs checks.
pub(super) fn run_all(fmu: &Arc<FmuFile>, checks: &[&Check], options: &Options) -> Found {
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
    let probes: Vec<_> = queue.iter().map(|(check, _)| *check).collect();
    let first = FirstRuns::new(&runner, &probes);
    // The second process of a comparison begins when the clock shows another second: the other probes run meanwhile.
    queue.make_contiguous().sort_by_key(|(check, _)| !matches!(check.run, Run::Twice(_)));
    let queue = Mutex::new(queue);
    let work = || {
        while let Some((check, verdict)) = take(&queue) {
            let found = match (&runner, first.found(check), first.obstacle(check)) {
                (Err(cause), ..) => Verdict::NotDetermined(cause.clone()).into(),
                (Ok(_), Some(found), _) => found,
                (Ok(_), _, Some(cause)) if !WITHOUT_MINIMAL_RUN.contains(&check.id) => cause.clone().into(),
                (Ok(runner), ..) if matches!(check.run, Run::Twice(_)) => {
                    let Some(found) = runner.once_more(check) else {
                        put_back(&queue, (check, verdict));
                        continue;
                    };
                    found
                }
                (Ok(runner), ..) => runner.run(check),
            };
            store(verdict, found);
        }
    };
    threads::share(threads::available(), |_| work());
    let lost = || Verdict::NotDetermined("the probe did not report a result".into()).into();
    let mut conclusions: Vec<_> =
        verdicts.into_iter().map(|v| v.into_inner().ok().flatten().unwrap_or_else(lost)).collect();
    let mut varying = Vec::new();
    if let Ok(runner) = &runner {
        checks.iter().zip(&mut conclusions).for_each(|(check, found)| runner.charge(check, found));
        varying = runner.varying.get().cloned().unwrap_or_default();
    }
    Found { conclusions, varying }
}

/// The runs before all other probes: a minimal one of each interface, L00 of co-simulation and E00 of Model Exchange, on which
/// the other probes depend, and two plain ones, which reveal the variables that cannot be compared.
struct FirstRuns {
    found: Vec<(&'static str, Conclusion)>,
    /// The FMU has no co-simulation: checks that make no steps are for Model Exchange.
    exchange_alone: bool,
    /// The checks that run with instances for Scheduled Execution.
    scheduled: Vec<&'static str>,
    /// Why no probe of co-simulation and of Model Exchange can run.
    obstacles: [Option<Verdict>; 2],
}

impl FirstRuns {
    fn new(runner: &Result<Runner, String>, probes: &[&Check]) -> Self {
        let mut first =
            Self { found: Vec::new(), exchange_alone: false, scheduled: Vec::new(), obstacles: [None, None] };
        let Ok(runner) = runner else { return first };
        first.scheduled = probes.iter().filter(|check| runner.is_scheduled(check)).map(|check| check.id).collect();
        first.exchange_alone = runner.simulation.is_none();
        let needed = [("L00", false), ("E00", true)];
        let needed = needed.iter().filter(|(_, exchange)| probes.iter().any(|c| first.by_exchange(c) == *exchange));
        let queue: Mutex<VecDeque<_>> = Mutex::new(needed.filter_map(|(id, _)| named(id)).collect());
        let found = Mutex::new(Vec::new());
        threads::share(threads::available(), |_| {
            while let Some(check) = take(&queue) {
                let began = Instant::now();
                let conclusion = runner.run(check);
                runner.measured(began.elapsed());
                found.lock().unwrap_or_else(PoisonError::into_inner).push((check.id, conclusion));
            }
        });
        first.found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
        for (id, conclusion) in &first.found {
            first.obstacles[usize::from(*id == "E00")] = match &conclusion.verdict {
                Verdict::Violated(found) => Some(Verdict::NotDetermined(format!(
                    "a minimal run fails ({id}): {}",
                    found.first().map_or("", String::as_str)
                ))),
                verdict @ (Verdict::NotDetermined(_) | Verdict::NotApplicable(_)) => Some(verdict.clone()),
                Verdict::Pass(_) => None,
            };
        }
        let compares = |check: &&&Check| !WITHOUT_MINIMAL_RUN.contains(&check.id) && first.obstacle(check).is_none();
        if let Some(check) = named(PLAIN_RUNS).filter(|check| first.obstacle(check).is_none())
            && probes.iter().any(|probe| compares(&probe))
        {
            first.found.push((check.id, runner.run(check)));
        }
        first
    }

    /// Whether a check is made with instances for Model Exchange.
    fn by_exchange(&self, check: &Check) -> bool {
        match check.run {
            Run::Any(_) | Run::Silent(_) => self.exchange_alone,
            _ => is_exchange(check),
        }
    }

    /// The result of one of these runs.
    fn found(&self, check: &Check) -> Option<Conclusion> {
        self.found.iter().find(|(id, _)| *id == check.id).map(|(_, found)| found.clone())
    }

    /// Why a check cannot run.
    fn obstacle(&self, check: &Check) -> Option<&Verdict> {
        if self.scheduled.contains(&check.id) {
            return None;
        }
        self.obstacles[usize::from(self.by_exchange(check))].as_ref()
    }
}

fn named(id: &str) -> Option<&'static Check> {
    GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == id)
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
