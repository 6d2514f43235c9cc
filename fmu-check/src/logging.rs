//! Logging and memory (FMI 2.0.5, 2.1.5; FMI 3.0.2, 2.3.1).

use super::bench::{Bench, Blocked, fine};
use super::{Check, Level, Levels, Run};
use fmu_import::Status;
use fmu_import::raw::{Event, allocations, take_events};
use model_description::FmiVersion;
use std::ffi::CString;

const LOG: &str = "2.0.5, 2.1.5; 3.0.2, 2.3.1";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "G-L1b", requirement: "Messages come with a category of LogCategories, or NULL where there are none.", clause: LOG, levels: Levels::MUST, run: Run::Probe(categories) },
    Check { id: "G-L2a", requirement: "SetDebugLogging takes no category, meaning all, and each of LogCategories.", clause: LOG, levels: Levels::MUST, run: Run::Probe(switch) },
    Check { id: "G-L2b", requirement: "A category that does not exist or is NULL gives Error and does no harm.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(unknown) },
    Check { id: "G-L3a", requirement: "An Error comes with a message of that status when logging is on.", clause: "3.0.2, 2.2.3", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(errors) },
    Check { id: "G-L3b", requirement: "Messages are UTF-8, not empty, and without a line break at the end.", clause: LOG, levels: Levels::SHOULD, run: Run::Probe(texts) },
    Check { id: "G-L4", requirement: "Messages come with the environment, and in FMI 2.0 with the name, that the instance was made with.", clause: LOG, levels: Levels::MUST, run: Run::Probe(identity) },
    Check { id: "G-L5", requirement: "With logging off there is no message but of errors.", clause: LOG, levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(silence) },
    Check { id: "M01", requirement: "With canNotUseMemoryManagementFunctions the importer's memory functions are not used, and may be NULL.", clause: "2.0.5, 2.1.5 and 4.3.1", levels: Levels(Some(Level::Must), None), run: Run::Probe(memory) },
];

/// A life with mistakes in it, and what was logged; the environment and the name that it was made with.
fn talk(bench: &Bench, logging: bool) -> Result<(Vec<Event>, usize, String), Blocked> {
    let _ = take_events();
    let mut arguments = bench.arguments("a probe's name");
    arguments.logging = logging;
    let environment = arguments.environment;
    let it = bench.instantiate(&arguments)?.ok_or_else(|| Blocked("no instance".into()))?;
    // The FMU keeps its own copy of the name.
    drop(arguments);
    it.enter()?;
    it.exit()?;
    it.steps(5, bench.h())?;
    if let Err(Blocked(why)) = it.provoke() {
        bench.note(why);
    }
    it.free()?;
    Ok((take_events(), environment, "a probe's name".into()))
}

fn show(event: &Event) -> String {
    let category = event.category.as_deref().unwrap_or("NULL");
    format!("{} [{category}] {:?}", Status(event.status), event.text.as_deref().unwrap_or("(none, or not UTF-8)"))
}

fn categories(bench: &Bench) -> Result<(), Blocked> {
    let known: Vec<&str> = bench.md.log_categories.iter().map(|c| c.name.as_str()).collect();
    let (events, ..) = talk(bench, true)?;
    for event in &events {
        let good = event.category.as_deref().map_or(known.is_empty(), |c| known.contains(&c));
        bench.require(good, || format!("{}; the categories are: {}", show(event), known.join(", ")));
    }
    bench.note(format!("{} messages", events.len()));
    Ok(())
}

fn switch(bench: &Bench) -> Result<(), Blocked> {
    let it = bench.fresh()?;
    for on in [true, false] {
        let status =
            it.call(&format!("SetDebugLogging({on}, 0, NULL)"), |raw| raw.debug_logging(it.handle, on, None, 0))?;
        bench.require(fine(status), || format!("SetDebugLogging({on}, 0, NULL) returned {status}"));
        for category in &bench.md.log_categories {
            let name = CString::new(category.name.as_str()).unwrap_or_default();
            let call = format!("SetDebugLogging({on}, 1, {})", category.name);
            let status = it.call(&call, |raw| raw.debug_logging(it.handle, on, Some(&[Some(&name)]), 1))?;
            bench.require(fine(status), || format!("{call} returned {status}"));
        }
    }
    Ok(())
}

fn unknown(bench: &Bench) -> Result<(), Blocked> {
    for (what, name) in [("no such category", CString::new("no such category").ok()), ("NULL", None)] {
        bench.case(|| {
            let it = bench.fresh()?;
            let call = format!("SetDebugLogging(true, 1, {what})");
            let status = it.call(&call, |raw| raw.debug_logging(it.handle, true, Some(&[name.as_deref()]), 1))?;
            bench.require(!fine(status), || format!("{call} returned {status}"));
            Ok(())
        });
    }
    Ok(())
}

fn errors(bench: &Bench) -> Result<(), Blocked> {
    let _ = take_events();
    let mut arguments = bench.arguments("probe");
    arguments.logging = true;
    let it = bench.instantiate(&arguments)?.ok_or_else(|| Blocked("no instance".into()))?;
    it.enter()?;
    it.exit()?;
    it.steps(2, bench.h())?;
    let _ = take_events();
    let how = it.provoke()?;
    let events = take_events();
    let told = events.iter().any(|e| e.status == Status::ERROR.0);
    bench.require(told, || format!("{how} returned Error, and {} messages came, none with that status", events.len()));
    Ok(())
}

fn texts(bench: &Bench) -> Result<(), Blocked> {
    let (events, ..) = talk(bench, true)?;
    for event in &events {
        let good = event.text.as_deref().is_some_and(|t| !t.trim().is_empty() && !t.ends_with(['\n', '\r']));
        bench.require(good, || show(event));
    }
    bench.note(format!("{} messages", events.len()));
    Ok(())
}

fn identity(bench: &Bench) -> Result<(), Blocked> {
    let (events, environment, name) = talk(bench, true)?;
    for event in &events {
        bench.require(event.environment == environment, || format!("{} came with another environment", show(event)));
        if bench.md.version == FmiVersion::V2 {
            let told = event.instance.as_deref();
            bench.require(told == Some(&name), || {
                format!("{} came with the instance name {told:?}, not {name:?}", show(event))
            });
        }
    }
    if events.is_empty() {
        return Err(Blocked("the FMU logged nothing".into()));
    }
    Ok(())
}

fn silence(bench: &Bench) -> Result<(), Blocked> {
    let (events, ..) = talk(bench, false)?;
    for event in events.iter().filter(|e| e.status < Status::ERROR.0) {
        bench.violated(format!("with loggingOn = false: {}", show(event)));
    }
    Ok(())
}

fn memory(bench: &Bench) -> Result<(), Blocked> {
    if !bench.flag("canNotUseMemoryManagementFunctions") {
        return bench.not_applicable("canNotUseMemoryManagementFunctions is false");
    }
    for given in [true, false] {
        bench.case(|| {
            let mut arguments = bench.arguments("probe");
            arguments.memory = given;
            let Some(it) = bench.instantiate(&arguments)? else {
                bench.violated("fmi2Instantiate with memory functions that are NULL returned NULL");
                return Ok(());
            };
            it.enter()?;
            it.exit()?;
            it.steps(5, bench.h())?;
            it.free()?;
            let used = allocations();
            bench.require(used == 0, || format!("the memory functions were called {used} times"));
            Ok(())
        });
    }
    Ok(())
}
