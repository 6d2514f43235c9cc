//! Logging and memory (FMI 2.0.5, 2.1.5; FMI 3.0.2, 2.3.1).

use super::shared::messages::{self, PERCENT, START};
use crate::check::{Check, Levels, Run};
use crate::checks::process::instances::only_once;
use crate::encoding::or_null;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use fmu_import::Status;
use fmu_import::raw::{Arguments, LogCall, Simple, allocations, take_events};
use std::ffi::CString;

const LOG: &str = "2.0.5, 2.1.5; 3.0.2, 2.3.1";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "G-L1b", clause: LOG, levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(categories),
        requirement: "Every message has a category from LogCategories, or NULL if there are none (in FMI 2.0 since 2.0.3).",
        tried: "Runs with an Error and logging on, and reads the categories of all messages.", fix: "List all categories that are used in LogCategories." },
    Check { id: "G-L2a", clause: LOG, levels: Levels::MUST, run: Run::Any(switch),
        requirement: "SetDebugLogging accepts an empty list, meaning all categories, and each category of LogCategories.",
        tried: "Switches logging with an empty list and with each category, also between steps.", fix: "Accept 0 categories with NULL, and every listed one." },
    Check { id: "G-L2b", clause: "hardening", levels: Levels::HARD, run: Run::Any(unknown),
        requirement: "A category that does not exist or is NULL gives Error without side effects.",
        tried: "Switches logging with an unknown category and with NULL.", fix: "Look the category up, and return Error." },
    Check { id: "G-L3a", clause: "3.0.2, 2.3.1", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(errors),
        requirement: "With logging on, every Error is accompanied by a message of that status.",
        tried: "Provokes an Error with logging on, resets, and provokes another.", fix: "Log in the function through which every Error is returned." },
    Check { id: "G-L3c", clause: LOG, levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Any(refusals),
        requirement: "With logging on, an instantiation that returns NULL is accompanied by a message.",
        tried: "Instantiates with a wrong token.", fix: "Log the reason before returning NULL." },
    Check { id: "G-L3b", clause: LOG, levels: Levels::SHOULD, run: Run::Probe(texts),
        requirement: "Messages are finished text in UTF-8: not empty, without control characters or a trailing line break, and with a value for \
            every conversion.",
        tried: "Reads the messages of a run with an Error and of an instantiation with a wrong token, with a % in the instance name and in the token.",
        fix: "Write UTF-8 without a line break at the end; in FMI 2.0 a message is a printf format, so pass text as the argument of \"%s\"." },
    Check { id: "G-L4", clause: LOG, levels: Levels::MUST, run: Run::Probe(identity),
        requirement: "Messages have the environment, and in FMI 2.0 the instance name, that were passed on instantiation.",
        tried: "Reads environment and name of all messages, also of the first of two instances.", fix: "Store both per instance." },
    Check { id: "G-L5", clause: LOG, levels: Levels::SHOULD, run: Run::Probe(silence),
        requirement: "With logging off, the FMU logs only errors.",
        tried: "Runs with an Error and logging off, resets, runs again, and reads the messages.", fix: "Check loggingOn before each message." },
    Check { id: "M01", clause: "2.0.5, 2.1.5", levels: Levels(Some(Level::Must), None), run: Run::Probe(memory),
        requirement: "With canNotUseMemoryManagementFunctions, the FMU does not call the memory functions of the importer, and they may be NULL.",
        tried: "Runs with counting memory functions, then with NULL instead.", fix: "Use malloc and free, or drop the flag." },
];

/// Name of the instance in most runs.
const NAME: &str = "a probe's name";

/// The log of a run with an error by an instance of this name, and the environment of the instance.
fn log_of_a_run(session: &Session, name: &str, logging: bool) -> Result<(Vec<LogCall>, usize), NotDetermined> {
    let _ = take_events();
    let mut arguments = session.arguments(name);
    arguments.logging = logging;
    let environment = arguments.environment;
    let instance = session.instantiate(&arguments)?.ok_or_else(|| NotDetermined("no instance".into()))?;
    // The FMU keeps its own copy of the name.
    drop(arguments);
    instance.initialize()?;
    instance.steps(5, session.h())?;
    if let Err(NotDetermined(why)) = instance.provoke() {
        session.note(why);
    }
    // The arguments of the instantiation stay valid. L06 checks the reset itself.
    session.prepare(|| {
        if instance.simple(Simple::Reset)?.is_ok() {
            instance.experiment(session.start(), None);
            let _ = instance.initialize().and_then(|()| instance.steps(2, session.h()));
        }
        Ok(())
    })?;
    instance.free()?;
    Ok((take_events(), environment))
}

/// A message, and its format if that explains the text.
fn show(event: &LogCall) -> String {
    let category = event.category.as_deref().unwrap_or("NULL");
    let text = event.text.as_ref().or(event.broken.as_ref()).map_or_else(|| "NULL".into(), |text| format!("{text:?}"));
    let format = event.format.as_ref().map(|format| format!(", from the printf format {format:?}")).unwrap_or_default();
    format!("{} [{category}] {text}{format}", Status(event.status))
}

fn categories(session: &Session) -> Result<(), NotDetermined> {
    let known: Vec<&str> = session.description.log_categories.iter().map(|c| c.name.as_str()).collect();
    let (events, _) = log_of_a_run(session, NAME, true)?;
    for event in &events {
        let good = event.category.as_deref().map_or(known.is_empty(), |c| known.contains(&c));
        session.require(good, || format!("{}; the categories are: {}", show(event), known.join(", ")));
    }
    session.note(format!("{} messages", events.len()));
    Ok(())
}

fn switch(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.fresh()?;
    for on in [true, false] {
        let status = instance
            .call(&format!("SetDebugLogging({on}, 0, NULL)"), |raw| raw.debug_logging(instance.handle, on, None, 0))?;
        session.require(status.is_ok(), || format!("SetDebugLogging({on}, 0, NULL) returned {status}"));
        for category in &session.description.log_categories {
            let name = CString::new(category.name.as_str()).unwrap_or_default();
            let call = format!("SetDebugLogging({on}, 1, {})", category.name);
            let status = instance.call(&call, |raw| raw.debug_logging(instance.handle, on, Some(&[Some(&name)]), 1))?;
            session.require(status.is_ok(), || format!("{call} returned {status}"));
        }
    }
    if session.description.co_simulation.is_none() {
        return Ok(());
    }
    // Between steps, it changes no result.
    let plain = session.stepping()?.run(6, session.h())?;
    let instance = session.stepping()?;
    let mut rows = instance.run(3, session.h())?;
    let status =
        instance.call("SetDebugLogging(false, 0, NULL)", |raw| raw.debug_logging(instance.handle, false, None, 0))?;
    if status.is_ok() {
        rows.extend(instance.run(3, session.h())?);
        session.compare("after SetDebugLogging", &plain, &rows);
    }
    Ok(())
}

fn unknown(session: &Session) -> Result<(), NotDetermined> {
    session.cases([("no such category", CString::new("no such category").ok()), ("NULL", None)], |(what, name)| {
        let instance = session.fresh()?;
        let call = format!("SetDebugLogging(true, 1, {what})");
        let status =
            instance.call(&call, |raw| raw.debug_logging(instance.handle, true, Some(&[name.as_deref()]), 1))?;
        session.require(!status.is_ok(), || format!("{call} returned {status}"));
        Ok(())
    })
}

fn errors(session: &Session) -> Result<(), NotDetermined> {
    let _ = take_events();
    let arguments = Arguments { logging: true, ..session.arguments("probe") };
    let instance = session.instantiate(&arguments)?.ok_or_else(|| NotDetermined("no instance".into()))?;
    instance.initialize()?;
    instance.steps(2, session.h())?;
    for when in ["", " after Reset"] {
        if !when.is_empty() {
            if !instance.simple(Simple::Reset)?.is_ok() {
                break;
            }
            instance.experiment(session.start(), None);
            session.prepare(|| instance.initialize())?;
        }
        let _ = take_events();
        let how = instance.provoke()?;
        let events = take_events();
        let reported = events.iter().any(|e| e.status == Status::ERROR.0);
        session.require(reported, || {
            format!("{how}{when} returned Error, but none of the {} messages has that status", events.len())
        });
    }
    Ok(())
}

fn refusals(session: &Session) -> Result<(), NotDetermined> {
    let _ = take_events();
    let token = CString::new("{00000000-wrong-token}").ok();
    let arguments = Arguments { logging: true, token, ..session.arguments("probe") };
    if session.instantiate(&arguments)?.is_some() {
        return session.not_applicable("a wrong token is not refused");
    }
    session
        .require(!take_events().is_empty(), || format!("{} returned NULL without a message", session.instantiation()));
    Ok(())
}

fn texts(session: &Session) -> Result<(), NotDetermined> {
    let (mut events, _) = log_of_a_run(session, &format!("{START}{PERCENT}"), true)?;
    let token = CString::new(format!("{{{START}{PERCENT}}}")).ok();
    let arguments = Arguments { logging: true, token, ..session.arguments("probe") };
    session.prepare(|| session.instantiate(&arguments)?.map_or(Ok(()), Instance::free))?;
    events.extend(take_events());
    session.note(format!("{} messages", events.len()));
    for event in &events {
        if let Some((confidence, why)) = messages::fault(event) {
            session.report(None, confidence, format!("{}: {why}", show(event)));
        }
    }
    Ok(())
}

fn identity(session: &Session) -> Result<(), NotDetermined> {
    let (events, environment) = log_of_a_run(session, NAME, true)?;
    whose(session, &events, environment, NAME);
    if events.is_empty() {
        return Err(NotDetermined("the FMU logged no message".into()));
    }
    if only_once(session) {
        return Ok(());
    }
    // Of two instances, the one that was made first.
    let arguments = Arguments { logging: true, ..session.arguments("the first") };
    let environment = arguments.environment;
    let instance = session.made(&arguments)?;
    let other = session.made(&Arguments { logging: true, ..session.arguments("the second") })?;
    let _ = take_events();
    instance.initialize()?;
    instance.steps(2, session.h())?;
    let _ = instance.provoke();
    whose(session, &take_events(), environment, "the first");
    other.free()?;
    instance.free()
}

/// Requires that these messages name this instance.
fn whose(session: &Session, events: &[LogCall], environment: usize, name: &str) {
    for event in events {
        session.require(event.environment == environment, || format!("{} has another environment", show(event)));
        if session.is_v2() {
            session.require(event.instance.as_deref() == Some(name), || {
                let found = or_null(&event.instance);
                format!("{} has the instance name {found}, expected {name:?}", show(event))
            });
        }
    }
}

fn silence(session: &Session) -> Result<(), NotDetermined> {
    let (events, _) = log_of_a_run(session, NAME, false)?;
    for event in events.iter().filter(|e| e.status < Status::ERROR.0) {
        session.violated(format!("with loggingOn = false: {}", show(event)));
    }
    Ok(())
}

fn memory(session: &Session) -> Result<(), NotDetermined> {
    if !session.flag("canNotUseMemoryManagementFunctions") {
        return session.not_applicable("canNotUseMemoryManagementFunctions is false");
    }
    session.cases([true, false], |given| {
        let arguments = Arguments { memory: given, ..session.arguments("probe") };
        let Some(instance) = session.instantiate(&arguments)? else {
            session.violated("fmi2Instantiate with NULL memory functions returned NULL");
            return Ok(());
        };
        instance.initialize()?;
        instance.steps(5, session.h())?;
        instance.free()?;
        let used = allocations();
        session.require(used == 0, || format!("the FMU called the memory functions {used} times"));
        Ok(())
    })
}
