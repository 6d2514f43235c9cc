//! Several instances, threads, copies, loading and unloading.

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::kept::{set_all, texts};
use crate::checks::process::shared::copies::{failed, second_binary};
use crate::encoding::or_null;
use crate::instance::Instance;
use crate::session::{NotDetermined, Session};
use crate::state::State;
use crate::trajectory::trajectory;
use fmu_import::guard::{kernel_size, patiently};
use fmu_import::raw::{Arguments, Interface, Raw, take_events};
use std::sync::{Mutex, PoisonError};
use std::thread::Builder;
use std::time::{Duration, Instant};

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "L04a", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Probe(interleaved),
        requirement: "Interleaved instances give the same results as each alone.",
        tried: "Runs 8 instances in turns, half of them with other parameters, and compares each with one running alone; frees 6, and reads the others.",
        fix: "Keep all data in the instance; no globals and statics." },
    Check { id: "L04b", clause: "2.0.5, 2.1; 3.0.2, 2.2.1", levels: Levels::SHOULD, run: Run::Probe(threads),
        requirement: "Instances in several threads give the same results as each alone.",
        tried: "Runs 4 instances in 4 threads and compares each with one alone.", fix: "Keep all data in the instance; protect what instances share." },
    Check { id: "L04c", clause: "hardening", levels: Levels::HARD, run: Run::Probe(moving_between_threads),
        requirement: "An instance can be created in one thread, used in another and freed in a third.",
        tried: "Steps in a second thread, frees in a third.", fix: "Use no thread-local data." },
    Check { id: "B05d", clause: "hardening", levels: Levels::HARD, run: Run::Probe(copies),
        requirement: "Two copies of the binary, loaded with their symbols visible to each other, do not interfere.",
        tried: "Loads two copies with their symbols visible to each other and compares.",
        fix: "Hide all symbols except those of the standard, or link with -Bsymbolic." },
    Check { id: "B07a", clause: "hardening", levels: Levels::HARD, run: Run::Any(leaks),
        requirement: "Creating and freeing instances leaks no memory.",
        tried: "Creates, runs, reads and frees some thousand instances and measures memory.",
        fix: "Free in FreeInstance what Instantiate allocated; a sanitizer finds it." },
    Check { id: "B07l", clause: "hardening", levels: Levels::HARD, run: Run::Probe(grows),
        requirement: "The memory of an instance does not grow while it runs.",
        tried: "Makes up to 9000 steps within the default experiment, reads the outputs after each, and measures memory after the first third and \
            at the end.",
        fix: "Free what a step or a getter allocates, and keep no history that grows with time." },
    Check { id: "B07b", clause: "hardening", levels: Levels::HARD, run: Run::Probe(reloads),
        requirement: "The binary can be loaded and unloaded repeatedly and does not stay loaded.",
        tried: "Loads and unloads 20 times.", fix: "End threads and unregister handlers when the library is unloaded." },
];

pub(crate) fn only_once(session: &Session) -> bool {
    session.flag("canBeInstantiatedOnlyOncePerProcess")
}

const ONLY_ONCE: &str = "canBeInstantiatedOnlyOncePerProcess is true";

/// Why a comparison of two instances is inconclusive.
pub(crate) const DISTURBED: &str = "see L04a: a new instance differs from an earlier one, although nothing was changed";

fn interleaved(session: &Session) -> Result<(), NotDetermined> {
    if only_once(session) {
        return session.not_applicable(ONLY_ONCE);
    }
    let alone = session.stepping()?;
    let mut expected = vec![(trajectory(&alone, 20)?, texts(&alone)?)];
    let own: Vec<_> = session.numeric().filter(|v| v.clocks.is_empty()).collect();
    let before = alone.snapshot(&own)?;
    // Every other instance has different parameters, if the FMU accepts these values.
    let trial = session.initializing()?;
    if set_all(&trial, 1.0).is_ok() && trial.exit().is_ok() {
        expected.push((trajectory(&trial, 20)?, texts(&trial)?));
    }
    let kinds = expected.len();
    // Creating the instances is part of the requirement.
    let mut all = Vec::new();
    for k in 0..8 {
        let Some(instance) = session.instantiate(&session.arguments(&format!("probe {k}")))? else {
            session.violated(format!(
                "instance {} could not be created while {} others existed",
                all.len() + 1,
                k + kinds
            ));
            return Ok(());
        };
        instance.enter()?;
        if k % kinds == 1 {
            set_all(&instance, 1.0)?;
        }
        instance.exit()?;
        all.push((instance, Vec::new()));
    }
    for k in 0..20 {
        for (instance, rows) in &mut all {
            instance.change_inputs(k)?;
            instance.steps(1, session.h())?;
            rows.push(instance.snapshot(&session.watched())?);
        }
    }
    for (v, (old, new)) in own.iter().zip(before.into_iter().zip(alone.snapshot(&own)?)) {
        if !old.is_empty() && !new.is_empty() {
            session.compare_variables(&[*v], "an instance that was not called meanwhile", &[vec![old]], &[vec![new]]);
        }
    }
    for (k, (instance, rows)) in all.iter().enumerate() {
        let (alone, words) = &expected[k % kinds];
        session.compare(&format!("instance {k}"), alone, rows);
        for (old, new) in words.iter().zip(&texts(instance)?).filter(|(old, new)| old != new) {
            session.violated(format!(
                "instance {k}: {} is {}; alone it is {}",
                old.0,
                or_null(&new.1),
                or_null(&old.1)
            ));
        }
    }
    free_others(session, all.into_iter().map(|(instance, _)| instance).collect())
}

/// Frees all instances except two, which must keep their values and continue to run.
fn free_others(session: &Session, mut all: Vec<Instance<'_>>) -> Result<(), NotDetermined> {
    let own = session.watched();
    let left = all.split_off(all.len().saturating_sub(2));
    let before = left.iter().map(|instance| instance.snapshot(&own)).collect::<Result<Vec<_>, _>>()?;
    let what = format!("after {} other instances were freed", all.len());
    all.into_iter().try_for_each(Instance::free)?;
    for (instance, old) in left.into_iter().zip(before) {
        for (v, (old, new)) in own.iter().zip(old.into_iter().zip(instance.snapshot(&own)?)) {
            session.compare_variables(&[*v], &what, &[vec![old]], &[vec![new]]);
        }
        if let Err(why) = instance.steps(2, session.h()) {
            session.failed(&what, why);
        }
        instance.free()?;
    }
    Ok(())
}

/// Only one thread may write the files of a session, so each thread gets its own loaded binary and a duplicate without journal.
fn threads(session: &Session) -> Result<(), NotDetermined> {
    if only_once(session) {
        return session.not_applicable(ONLY_ONCE);
    }
    let alone = trajectory(&session.stepping()?, 40)?;
    let duplicates = (0..4).map(|k| session.duplicate(&session.binary, k)).collect::<Result<Vec<_>, _>>()?;
    session.record_call("4 threads, each with an instance, 40 steps");
    let duplicates: Vec<_> = duplicates.into_iter().map(|duplicate| Mutex::new(Some(duplicate))).collect();
    let results: Vec<Result<Vec<Vec<Vec<u64>>>, NotDetermined>> = std::thread::scope(|scope| {
        let run = |duplicate: &Mutex<Option<Session>>| {
            let duplicate = duplicate.lock().unwrap_or_else(PoisonError::into_inner).take();
            let duplicate = duplicate.ok_or_else(|| NotDetermined("the thread has no instance".into()))?;
            trajectory(&duplicate.stepping()?, 40)
        };
        let start = |duplicate| patiently(|| Builder::new().spawn_scoped(scope, move || run(duplicate)));
        let workers = duplicates.iter().map(start).collect::<Result<Vec<_>, _>>().map_err(|e| failed(&e))?;
        let panicked = || Err(NotDetermined("the thread panicked".into()));
        Ok::<_, NotDetermined>(workers.into_iter().map(|w| w.join().unwrap_or_else(|_| panicked())).collect())
    })?;
    for (k, rows) in results.into_iter().enumerate() {
        match rows {
            Err(why) => session.failed(&format!("thread {k}"), why),
            Ok(rows) => session.compare(&format!("thread {k}"), &alone, &rows),
        }
    }
    Ok(())
}

fn moving_between_threads(session: &Session) -> Result<(), NotDetermined> {
    let handle = session.stepping()?.handle;
    let (start, h, raw) = (session.start(), session.h(), &session.raw);
    session.record_call("DoStep in another thread");
    let stepped = std::thread::scope(|scope| {
        let step = move || raw.do_step(handle, start, h, false, [true; 4]).map(|(s, _)| s);
        patiently(|| Builder::new().spawn_scoped(scope, step)).map(std::thread::ScopedJoinHandle::join)
    });
    let status = stepped.map_err(|e| failed(&e))?.ok().flatten();
    session.require(status.is_some_and(fmu_import::Status::is_ok), || {
        format!("DoStep in another thread returned {status:?}")
    });
    session.record_call("FreeInstance in a third thread");
    let freed = std::thread::scope(|scope| {
        patiently(|| Builder::new().spawn_scoped(scope, move || raw.free(handle)))
            .map(std::thread::ScopedJoinHandle::join)
    });
    freed.map(|_| ()).map_err(|e| failed(&e))
}

#[cfg(not(unix))]
fn copies(session: &Session) -> Result<(), NotDetermined> {
    session.not_applicable("libraries do not share symbols on this system")
}

#[cfg(unix)]
fn copies(session: &Session) -> Result<(), NotDetermined> {
    if only_once(session) {
        return session.not_applicable(ONLY_ONCE);
    }
    let alone = trajectory(&session.stepping()?, 20)?;
    let mut duplicates = Vec::new();
    for k in 0..2 {
        let binary = second_binary(session, &format!("copy {k} %23 \u{e4}"))?;
        session.record_call("dlopen(RTLD_NOW | RTLD_GLOBAL)");
        let raw = Raw::open_global(&binary, session.description.version).map_err(NotDetermined)?;
        duplicates.push(session.duplicate_with(raw, 10 + k)?);
    }
    let instances: Vec<Instance<'_>> = duplicates.iter().map(Session::stepping).collect::<Result<_, _>>()?;
    let mut rows = vec![Vec::new(); instances.len()];
    for k in 0..20 {
        for (instance, rows) in instances.iter().zip(&mut rows) {
            instance.change_inputs(k)?;
            instance.steps(1, session.h())?;
            rows.push(instance.snapshot(&session.watched())?);
        }
    }
    for rows in rows {
        session.compare("a copy", &alone, &rows);
    }
    drop(instances);
    // Two copies stay loaded until the process ends.
    duplicates.into_iter().for_each(std::mem::forget);
    Ok(())
}

/// Memory of this process in bytes: what is resident, and what is reserved for data.
fn memory() -> Option<[u64; 2]> {
    let of = |name| kernel_size("self/status", name);
    Some([of("VmRSS:")?, of("VmData:")?])
}

/// Bytes per repetition that are not a leak: the struct of callbacks kept for FMI 2.0, and the checker's tables.
const LEFT: u64 = 300;
/// Growth in bytes per saved state that does not count as a leak; the checker itself stores nothing per state.
pub(crate) const LEFT_BY_STATE: u64 = 50;
/// Number of steps before and during a measurement.
const STEPS: [u32; 2] = [3000, 6000];
/// Growth in bytes per step that does not count as a leak.
const LEFT_BY_STEP: u64 = 20;
/// Total bytes that are not a leak: pages that the allocator keeps.
const MINIMUM: u64 = 300_000;

/// Maximum number of variables that each instance reads: more of them leave time for few instances.
const READ: usize = 1000;

/// Maximum number of variables that the instance of a long run reads after each step.
const READ_BY_STEP: usize = 20;

/// Bytes of memory more than `before`.
fn growth(before: Option<[u64; 2]>) -> u64 {
    let pairs = memory().unwrap_or_default().into_iter().zip(before.unwrap_or_default());
    pairs.map(|(after, before)| after.saturating_sub(before)).max().unwrap_or(0)
}

/// Repeats an action and measures the growth of memory.
pub(crate) fn leak(
    session: &Session,
    (what, left, why): (&str, u64, &str),
    once: &dyn Fn() -> Result<(), NotDetermined>,
) -> Result<(), NotDetermined> {
    if memory().is_none() {
        return Err(NotDetermined("this system does not report the memory of a process".into()));
    }
    let rounds = |most: u64| {
        let began = Instant::now();
        session.record_calls(&format!("up to {most} {what}"), || {
            for k in 0..most {
                once()?;
                // Messages stored here do not count as a leak of the FMU.
                let _ = take_events();
                if session.half_time_used() || (k >= 300 && began.elapsed() > Duration::from_secs(1)) {
                    return Ok(k + 1);
                }
            }
            Ok(most)
        })
    };
    rounds(200)?;
    let before = memory();
    let n = rounds(3000)?;
    let growth = growth(before);
    session.require(growth < (left * n).max(MINIMUM), || format!("{n} {what} leaked {} kB{why}", growth / 1000));
    session.note(format!("{} kB more after {n} {what}", growth / 1000));
    Ok(())
}

fn leaks(session: &Session) -> Result<(), NotDetermined> {
    let mut watched = session.watched();
    watched.truncate(READ);
    if session.description.model_exchange.is_some() {
        let arguments = || Arguments { interface: Interface::ModelExchange, ..session.arguments("probe") };
        leak(session, ("instances for Model Exchange", LEFT, ""), &|| {
            let instance = session.made(&arguments())?;
            instance.bring_to(State::Continuous)?;
            instance.free()
        })?;
    }
    if session.description.co_simulation.is_none() {
        return Ok(());
    }
    leak(session, ("instances", LEFT, ""), &|| {
        let arguments = session.arguments("probe");
        let instance = session.instantiate(&arguments)?.ok_or_else(|| NotDetermined("no instance".into()))?;
        instance.initialize()?;
        instance.steps(2, session.h())?;
        let _ = (instance.snapshot(&watched)?, texts(&instance)?);
        instance.free()
    })
}

/// Steps of one instance within its default experiment, beyond which models diverge. The first third fills buffers that have an end.
fn grows(session: &Session) -> Result<(), NotDetermined> {
    if memory().is_none() {
        return Err(NotDetermined("this system does not report the memory of a process".into()));
    }
    let instance = session.stepping()?;
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    let span = (stop - session.start()) / f64::from(STEPS[0] + STEPS[1]);
    let shorter = session.flag("canHandleVariableCommunicationStepSize") && span > 0.0;
    let h = if shorter { session.h().min(span) } else { session.h() };
    let mut watched = session.watched();
    watched.truncate(READ_BY_STEP);
    let round = |most: u32| {
        let began = Instant::now();
        session.record_calls(&format!("up to {most} steps"), || {
            for k in 0..most {
                let ends = instance.time.get() + h > stop + 0.5 * h;
                if ends || instance.steps(1, h).is_err() {
                    return Ok(k);
                }
                let _ = (instance.snapshot(&watched)?, texts(&instance)?);
                let _ = take_events();
                if session.half_time_used() || began.elapsed() > Duration::from_millis(400) {
                    return Ok(k + 1);
                }
            }
            Ok(most)
        })
    };
    let first = round(STEPS[0])?;
    let before = memory();
    let n = round(STEPS[1])?;
    if n < 300 {
        let why = format!(
            "only {first} and then {n} steps within the default experiment and 0.4 s each: too few to measure memory"
        );
        return session.not_applicable(why);
    }
    let growth = growth(before);
    session.require(growth < (LEFT_BY_STEP * u64::from(n)).max(MINIMUM), || {
        format!("memory grew by {} kB in {n} steps, after {first} steps had been made", growth / 1000)
    });
    session.note(format!("{} kB more after {n} steps", growth / 1000));
    Ok(())
}

fn reloads(session: &Session) -> Result<(), NotDetermined> {
    // Another path, because the session keeps its copy loaded.
    let binary = second_binary(session, "reloaded")?;
    for k in 0..20 {
        session.record_call(&format!("loading the binary, round {}", k + 1));
        let duplicate = session.duplicate(&binary, 20 + k)?;
        {
            let instance = duplicate.stepping()?;
            instance.steps(3, session.h())?;
            instance.free()?;
        }
        session.record_call(&format!("unloading the binary, round {}", k + 1));
        duplicate.raw.close().map_err(NotDetermined)?;
        if session.half_time_used() {
            break;
        }
    }
    if let Ok(maps) = std::fs::read_to_string("/proc/self/maps") {
        let text = binary.to_string_lossy();
        session.require(!maps.lines().any(|l| l.ends_with(&*text)), || {
            format!("{} is still loaded after unloading", session.binary.file_name().unwrap_or_default().display())
        });
    }
    Ok(())
}
