//! The life cycle: allowed calls succeed, others are refused, and none crashes the process
//! (FMI 2.0.5, 2.1.5 and 4.2.4; FMI 3.0.2, 2.2.4, 2.3 and 4.2).

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::by_name::{configuration, null_instance, unsupported};
use crate::checks::life::shared::calls::attempt;
use crate::checks::life::shared::kept::{set_all, texts};
use crate::checks::process::instances::DISTURBED;
use crate::encoding::{or_null, show};
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{ENDED, NotDetermined, Session};
use crate::state::{Life, State::Error, State::Step};
use fmu_import::raw::{Arguments, Handle, Interface, Simple};
use model_description::{Causality, ModelVariable, Variability};
use std::ffi::CString;

const STATES: &str = "2.0.5, 4.2.4; 3.0.2, 4.2";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "L00", clause: STATES, levels: Levels::MUST, run: Run::Probe(minimal_run),
        requirement: "A minimal run succeeds: instantiation, initialization, steps, termination.",
        tried: "Instantiates, initializes, makes 10 steps of the default experiment, reads outputs, terminates.",
        fix: "Start with the call named in the finding; the other checks of the binary depend on this run." },
    Check { id: "X04", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::SHOULD, run: Run::Any(token),
        requirement: "Instantiation with a wrong token (GUID) returns NULL.",
        tried: "Instantiates with a wrong token.", fix: "Compare the argument with the token compiled in, and return NULL if it differs." },
    Check { id: "L01a", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Any(null_arguments),
        requirement: "Instantiation returns NULL if the instance name is NULL or empty or the token is NULL.",
        tried: "Instantiates with an empty name, without a name and without a token.", fix: "Check the arguments, and return NULL." },
    Check { id: "L01b", clause: "3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(without_logger),
        requirement: "An instance works without a log callback (hard, if logging is on).",
        tried: "Runs with NULL as the log callback, once with logging off and once with it on.", fix: "Check the pointer before every message." },
    Check { id: "L01c", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(without_resources),
        requirement: "An FMU without resources works without a resource path.",
        tried: "Runs without a resource path and with one that does not exist.", fix: "Read the path only if the FMU has resources." },
    Check { id: "L13", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::SHOULD, run: Run::Probe(long_names),
        requirement: "An instance name can have any length.",
        tried: "Runs with names of 300 and 5000 letters, and logging.", fix: "Allocate memory for the length of the name." },
    Check { id: "L02", clause: "2.0.5, 2.1.5", levels: Levels(Some(Level::Should), None), run: Run::Probe(callbacks),
        requirement: "The FMU does not read the struct of callbacks after fmi2Instantiate has returned.",
        tried: "Frees the struct of callbacks after fmi2Instantiate and makes the FMU log.", fix: "Copy the struct, not its pointer." },
    Check { id: "L03", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(interfaces),
        requirement: "Instantiation returns NULL for an interface that the FMU does not have and for event mode without hasEventMode.",
        tried: "Instantiates interfaces that the description does not have.", fix: "Return NULL for them." },
    Check { id: "L05", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Probe(free),
        requirement: "FreeInstance is allowed in every state and ignores NULL.",
        tried: "Frees instances in every state, and NULL.", fix: "Return at once for NULL; free everything that the instance owns at that moment." },
    Check { id: "L06", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Probe(reset),
        requirement: "Reset, in any state, restores a new instance: a second run equals the first.",
        tried: "Resets in every state and after parameters were set, runs again, and compares with a new instance.",
        fix: "Assign everything that instantiation assigns, including time, inputs, outputs and solver." },
    Check { id: "L07", clause: STATES, levels: Levels::MUST, run: Run::Probe(allowed),
        requirement: "Every call that the state allows succeeds.",
        tried: "Makes every allowed call in every state.", fix: "Add the named call to the table of allowed states." },
    Check { id: "L08", clause: "3.0.2, 2.2.4", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(refused),
        requirement: "Every call that the state does not allow returns Error, or is accepted with a message of status Warning.",
        tried: "Makes every call in every state that does not allow the call.",
        fix: "Check the state at the beginning of every function, log and return Error." },
    Check { id: "L08u", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::HARD, run: Run::Probe(unsupported),
        requirement: "A function of a capability that the FMU lacks returns Error in every state.",
        tried: "Calls the functions of missing capabilities in every state.", fix: "Return Error from stubs." },
    Check { id: "C03", clause: "3.0.2, 2.3.6", levels: Levels(None, Some(Level::Should)), run: Run::Probe(configuration),
        requirement: "Without structural parameters, configuration mode is refused.",
        tried: "Calls fmi3EnterConfigurationMode.", fix: "Return Error if there is no structural parameter." },
    Check { id: "L08n", clause: "3.0.2, 2.2.1", levels: Levels::HARD, run: Run::Probe(null_instance),
        requirement: "Every call without an instance (NULL) returns Error.",
        tried: "Calls every function with NULL as the instance.", fix: "Begin every function with a test of the instance." },
    Check { id: "L09a", clause: "3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(after_error),
        requirement: "After an Error, the next step is refused.",
        tried: "Provokes an Error, then makes a step.", fix: "Enter a state Error that refuses everything but Reset, SetFMUState and FreeInstance." },
    Check { id: "L09b", clause: "2.0.5, 2.1.3; 3.0.2, 2.2.4", levels: Levels::MUST, run: Run::Probe(recovery),
        requirement: "After an Error, Reset restores a working instance.",
        tried: "Provokes an Error, resets and runs.", fix: "Let Reset restore the state of a new instance, also from the state Error." },
    Check { id: "L10", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.8", levels: Levels::MUST, run: Run::Probe(terminated),
        requirement: "After Terminate, the last values can be read (hard: they have not changed).",
        tried: "Terminates and reads the outputs.", fix: "Keep the values until Reset or FreeInstance." },
    Check { id: "L12", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.2", levels: Levels::MUST, run: Run::Probe(past_stop_time),
        requirement: "A step beyond the stop time returns Error.",
        tried: "Steps to the stop time, then beyond it.", fix: "Compare t + h with stopTime, with a small tolerance for rounding." },
    Check { id: "L12r", clause: "hardening", levels: Levels::HARD, run: Run::Probe(rounded_stop_time),
        requirement: "An importer that accumulates the time, t = t + h, reaches the stop time, although the last step ends later by a rounding error.",
        tried: "Adds up steps until their sum exceeds their product, which is the stop time.",
        fix: "Compare t + h with stopTime, with a small tolerance for rounding." },
];

fn minimal_run(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.stepping()?;
    for k in 0..10 {
        let status = instance.step(session.h())?;
        if instance.over.get() {
            session.note(format!("the FMU ended the simulation after {k} steps"));
            break;
        }
        instance.must("DoStep", status)?;
    }
    let _ = instance.snapshot(&session.watched())?;
    let status = instance.simple(Simple::Terminate)?;
    session.require(status.is_ok(), || format!("{} returned {status}", session.raw.name("Terminate")));
    Ok(())
}

fn allowed(session: &Session) -> Result<(), NotDetermined> {
    attempt(session, Life::CoSimulation, '+');
    session.case(|| {
        let status = session.stepping()?.simple(Simple::Terminate)?;
        session.require(status.is_ok(), || format!("Terminate in Step, before the first step, returned {status}"));
        Ok(())
    });
    Ok(())
}

fn refused(session: &Session) -> Result<(), NotDetermined> {
    attempt(session, Life::CoSimulation, '-');
    Ok(())
}

fn token(session: &Session) -> Result<(), NotDetermined> {
    let mut arguments = session.arguments("probe");
    arguments.token = CString::new("{00000000-wrong-token}").ok();
    let created = session.instantiate(&arguments)?;
    session
        .require(created.is_none(), || format!("{} with a wrong token created an instance", session.instantiation()));
    Ok(())
}

fn null_arguments(session: &Session) -> Result<(), NotDetermined> {
    let empty = Some(CString::default());
    let cases =
        [("instanceName = NULL", None, true), ("instanceName = \"\"", empty, true), ("token = NULL", None, false)];
    session.cases(cases, |(what, value, name)| {
        let mut arguments = session.arguments("probe");
        if name {
            arguments.name = value;
        } else {
            arguments.token = value;
        }
        let created = session.instantiate(&arguments)?;
        session.require(created.is_none(), || format!("{} with {what} created an instance", session.instantiation()));
        Ok(())
    })
}

/// Instantiates with the arguments, initializes, makes two steps and an invalid one.
fn short_run(session: &Session, arguments: &Arguments, what: &str, level: Level) -> Result<(), NotDetermined> {
    let Some(instance) = session.instantiate(arguments)? else {
        session.lesser(level, format!("{} with {what} returned NULL", session.instantiation()));
        return Ok(());
    };
    instance.initialize()?;
    instance.steps(2, session.h())?;
    // A call that no importer may make, to provoke a message.
    session.lenient(Level::Hard, || {
        instance.call("DoStep(h=-1)", |raw| {
            raw.do_step(instance.handle, instance.time.get(), -1.0, false, [true; 4]).map(|(s, _)| s)
        })
    })?;
    instance.free()
}

fn long_names(session: &Session) -> Result<(), NotDetermined> {
    let plain = session.stepping()?.run(5, session.h())?;
    session.cases([300, 5000], |length| {
        let name = CString::new("n".repeat(length)).ok();
        let arguments = Arguments { name, logging: true, ..session.arguments("probe") };
        let Some(instance) = session.instantiate(&arguments)? else {
            session.violated(format!("{} with a name of {length} letters returned NULL", session.instantiation()));
            return Ok(());
        };
        instance.initialize()?;
        let rows = instance.run(5, session.h())?;
        if rows != plain && session.stepping()?.run(5, session.h())? != plain {
            return Err(NotDetermined(DISTURBED.into()));
        }
        session.compare(&format!("with a name of {length} letters"), &plain, &rows);
        let _ = instance.simple(Simple::Terminate)?;
        instance.free()
    })
}

fn without_logger(session: &Session) -> Result<(), NotDetermined> {
    let v2 = session.is_v2();
    session.case(|| {
        let arguments = Arguments { logger: false, ..session.arguments("probe") };
        short_run(session, &arguments, "a NULL log callback", Level::Must)
    });
    // FMI 3.0.2 leaves open what happens if logging is switched on nevertheless.
    session.case(|| {
        let arguments = Arguments { logger: false, logging: true, ..session.arguments("probe") };
        session
            .lenient(Level::Hard, || short_run(session, &arguments, "a NULL log callback and loggingOn", Level::Hard))
    });
    if v2 {
        session.case(|| {
            let arguments = Arguments { callbacks: false, logging: true, ..session.arguments("probe") };
            // The standard does not allow NULL here, so the FMU may return NULL.
            if let Some(instance) = session.instantiate(&arguments)? {
                instance.free()?;
            }
            Ok(())
        });
    }
    Ok(())
}

fn without_resources(session: &Session) -> Result<(), NotDetermined> {
    if session.has_resources() {
        return session.not_applicable("the archive has resources");
    }
    let v2 = session.is_v2();
    // Z09 has the paths with other characters.
    let odd = if v2 { "file:///there/is/none" } else { "/there/is/none/" };
    session.cases(
        [("a NULL resource path", None), ("a resource path that does not exist", Some(odd))],
        |(what, path)| {
            let mut arguments = session.arguments("probe");
            arguments.resources = path.and_then(|p| CString::new(p).ok());
            short_run(session, &arguments, what, Level::Must)
        },
    )
}

fn callbacks(session: &Session) -> Result<(), NotDetermined> {
    let arguments = Arguments { lasting: false, logging: true, ..session.arguments("probe") };
    short_run(session, &arguments, "valid arguments", Level::Must)?;
    let late = fmu_import::raw::take_events().iter().filter(|e| e.late).count();
    session.require(late == 0, || {
        format!("{late} messages were sent through the struct after fmi2Instantiate had returned")
    });
    Ok(())
}

fn interfaces(session: &Session) -> Result<(), NotDetermined> {
    let v3 = !session.is_v2();
    let mut cases = Vec::new();
    if session.description.model_exchange.is_none() {
        cases.push(("the description has no ModelExchange", Interface::ModelExchange, false));
    }
    if v3 && session.description.scheduled_execution.is_none() {
        cases.push(("the description has no ScheduledExecution", Interface::ScheduledExecution, false));
    }
    if v3 && !session.flag("hasEventMode") {
        cases.push(("hasEventMode is false, and eventModeUsed was true", Interface::CoSimulation, true));
    }
    session.cases(cases, |(lacks, interface, event_mode)| {
        let arguments = Arguments { interface, event_mode, ..session.arguments("probe") };
        let created = session.instantiate(&arguments)?;
        session.require(created.is_none(), || {
            format!("{} created an instance, although {lacks}", session.function_for(interface))
        });
        Ok(())
    })
}

fn free(session: &Session) -> Result<(), NotDetermined> {
    session.case(|| {
        session.record_call(&format!("{}(NULL)", session.raw.name("FreeInstance")));
        session.raw.free(Handle::NULL).ok_or_else(|| NotDetermined("FreeInstance is missing".into()))
    });
    session.cases(Life::CoSimulation.states().iter().chain([&Error]), |&state| match session.simulation(state) {
        Ok(instance) => instance.free(),
        // Some FMUs return no Error; another check reports that.
        Err(NotDetermined(why)) => {
            session.note(format!("{state:?}: {why}"));
            Ok(())
        }
    })
}

fn reset(session: &Session) -> Result<(), NotDetermined> {
    let run = |instance: &Instance<'_>| {
        instance.initialize()?;
        instance.run(20, session.h())
    };
    let first = run(&session.fresh()?)?;
    for &state in Life::CoSimulation.states().iter().chain([&Error]) {
        session.case(|| {
            let Ok(instance) = session.simulation(state) else { return Ok(()) };
            // Reset must discard what was set.
            if matches!(state, Step) {
                instance.change_inputs(1)?;
                instance.steps(3, session.h())?;
            }
            let status = instance.simple(Simple::Reset)?;
            if !status.is_ok() {
                session.violated(format!("Reset in {state:?} returned {status}"));
                return Ok(());
            }
            instance.experiment(session.start(), None);
            match run(&instance) {
                Ok(second) => {
                    session.compare(
                        &format!("after Reset in {state:?}, compared with a new instance"),
                        &first,
                        &second,
                    );
                }
                Err(why) => session.failed(&format!("after Reset in {state:?}"), why),
            }
            Ok(())
        });
    }
    // Values set before and during the run, and values changed by events.
    session.case(|| {
        let (fresh, instance) = (session.initializing()?, session.fresh()?);
        if let Err(NotDetermined(why)) = set_all(&instance, 1.0) {
            session.note(why);
        }
        let begun = instance.initialize().and_then(|()| past_an_event(&instance));
        if let Err(NotDetermined(why)) = begun {
            session.note(why);
        }
        for v in
            session.numeric().filter(|v| v.variability == Variability::Tunable && v.causality == Causality::Parameter)
        {
            if let Some(values) = session.different_value(v, 2.0) {
                let _ = instance.set(v, &values)?;
            }
        }
        instance.perform(Simple::Reset)?;
        instance.experiment(session.start(), None);
        instance.enter()?;
        let all: Vec<&ModelVariable> = session.numeric().filter(|v| v.clocks.is_empty()).collect();
        for (v, (old, new)) in all.iter().zip(fresh.snapshot(&all)?.into_iter().zip(instance.snapshot(&all)?)) {
            if !old.is_empty() && !new.is_empty() {
                session.compare_variables(
                    &[*v],
                    "after Reset, compared with a new instance",
                    &[vec![old]],
                    &[vec![new]],
                );
            }
        }
        let [old, new] = [texts(&fresh)?, texts(&instance)?];
        for (old, new) in old.iter().zip(&new).filter(|(old, new)| old != new) {
            session.violated(format!(
                "after Reset, {} is {}; in a new instance it is {}",
                old.0,
                or_null(&new.1),
                or_null(&old.1)
            ));
        }
        instance.perform(Simple::Reset)?;
        instance.experiment(session.start(), None);
        let second = run(&instance)?;
        session.compare(
            "after Reset of an instance whose parameters were set, compared with a new instance",
            &first,
            &second,
        );
        Ok(())
    });
    Ok(())
}

/// Runs past the first change of a variable that is not a floating-point number, or 400 steps.
fn past_an_event(instance: &Instance<'_>) -> Result<(), NotDetermined> {
    let session = instance.session;
    let discrete: Vec<&ModelVariable> = session.watched().into_iter().filter(|v| !v.base.is_float()).take(20).collect();
    let before = instance.snapshot(&discrete)?;
    let stop = session.description.default_experiment.stop.unwrap_or(f64::INFINITY);
    for k in 0..400 {
        if session.half_time_used() || instance.time.get() + session.h() > stop {
            break;
        }
        instance.change_inputs(k)?;
        instance.steps(1, session.h())?;
        if instance.snapshot(&discrete)? != before {
            return instance.steps(2, session.h());
        }
    }
    Ok(())
}

fn after_error(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.simulation(Step)?;
    let how = instance.provoke()?;
    let status = instance.step_at(instance.time.get(), session.h())?;
    session.require(!status.is_ok(), || format!("after {how} had returned Error, DoStep returned {status}"));
    Ok(())
}

fn recovery(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.simulation(Step)?;
    let how = instance.provoke()?;
    let status = instance.simple(Simple::Reset)?;
    if !status.is_ok() {
        session.violated(format!("after {how} had returned Error, Reset returned {status}"));
        return Ok(());
    }
    instance.experiment(session.start(), None);
    if let Err(why) = instance.initialize().and_then(|()| instance.steps(5, session.h())) {
        session.failed(&format!("after {how} had returned Error and Reset had succeeded"), why);
    }
    Ok(())
}

fn terminated(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.stepping()?;
    instance.change_inputs(2)?;
    instance.steps(2, session.h())?;
    let watched = session.watched();
    // A value that cannot be read before cannot be read after.
    let watched: Vec<_> =
        watched.into_iter().filter(|v| instance.get(v).is_ok_and(|(status, _)| status.is_ok())).collect();
    let before = instance.snapshot(&watched)?;
    let status = instance.simple(Simple::Terminate)?;
    if !status.is_ok() {
        return Err(NotDetermined(format!("Terminate returned {status}")));
    }
    for (v, old) in watched.iter().zip(before) {
        let (status, now) = instance.get(v)?;
        session.require(status.is_ok(), || format!("Get({}) after Terminate returned {status}", v.name));
        if status.is_ok() && now != old {
            let [old, new] = [&old, &now].map(|bits| show(v, session.description.version, bits));
            session.lesser(Level::Hard, format!("Terminate changed {} from {old} to {new}", v.name));
        }
    }
    Ok(())
}

fn past_stop_time(session: &Session) -> Result<(), NotDetermined> {
    let (h, start) = (session.h(), session.start());
    let instance = session.fresh()?;
    instance.experiment(start, Some(start + 4.0 * h));
    instance.initialize()?;
    instance.steps(3, h)?;
    let ended = || NotDetermined(format!("{ENDED} before the stop time"));
    // Rounding may make the last step end slightly late.
    let t = instance.time.get();
    let last = instance.step_at(t, start + 4.0 * h - t)?;
    if instance.over.get() {
        return Err(ended());
    }
    session.require(last.is_ok(), || format!("the step that ends at the stop time returned {last}"));
    let status = instance.step_at(start + 4.0 * h, h)?;
    session.require(!status.is_ok(), || {
        format!("stopTime={}: DoStep(t={}, h={h}) returned {status}", start + 4.0 * h, start + 4.0 * h)
    });
    Ok(())
}
fn rounded_stop_time(session: &Session) -> Result<(), NotDetermined> {
    let (h, start) = (session.h(), session.start());
    let mut sum = start;
    let exceeding = (1..=1000_u32).find_map(|n| {
        sum += h;
        let stop = start + f64::from(n) * h;
        (n > 1 && sum > stop).then_some((n, stop))
    });
    let Some((n, stop)) = exceeding else {
        return session.not_applicable("no sum of steps exceeds their product");
    };
    let instance = session.fresh()?;
    instance.experiment(start, Some(stop));
    instance.initialize()?;
    for _ in 1..n {
        instance.steps(1, h)?;
    }
    let t = instance.time.get();
    let last = instance.step_at(t, h)?;
    if instance.over.get() {
        return Err(NotDetermined(format!("{ENDED} before the stop time")));
    }
    session.require(last.is_ok(), || {
        format!(
            "stopTime={stop}: DoStep(t={t}, h={h}), step {n}, ends {:.1e} s later and returned {last}",
            t + h - stop
        )
    });
    Ok(())
}
