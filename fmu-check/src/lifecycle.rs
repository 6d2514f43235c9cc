//! The life cycle: what is allowed goes through, what is not is refused, and nothing takes the process down
//! (FMI 2.0.5, 2.1.5 and 4.2.4; FMI 3.0.2, 2.2.3, 2.3 and 4.2).

use super::bench::{Bench, Blocked, fine};
use super::it::It;
use super::table::{allowed, configuration, nobody, refused, unsupported};
use super::{Check, Level, Levels, Run};
use fmu_import::Status;
use fmu_import::raw::{Handle, Interface, Simple};
use model_description::{Causality, FmiVersion};
use std::ffi::CString;

const STATES: &str = "2.0.5, 4.2.4; 3.0.2, 2.3 and 4.2";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "L00", requirement: "A plain life goes through: instantiation, initialisation, steps, termination.", clause: STATES, levels: Levels::MUST, run: Run::Probe(plain) },
    Check { id: "X04", requirement: "A wrong instantiation token (GUID) gives NULL.", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::SHOULD, run: Run::Probe(token) },
    Check { id: "L01a", requirement: "An instance name that is NULL or empty, and a token that is NULL, give NULL.", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(names) },
    Check { id: "L01b", requirement: "An instance lives without a log callback.", clause: "3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(mute) },
    Check { id: "L01c", requirement: "An FMU without resources needs no path to them.", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(homeless) },
    Check { id: "L02", requirement: "The struct of callbacks is not looked at after fmi2Instantiate.", clause: "2.0.5, 2.1.5", levels: Levels(Some(Level::Should), None), run: Run::Probe(callbacks) },
    Check { id: "L03", requirement: "An interface that the FMU does not have, or event mode without hasEventMode, gives NULL.", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Should)), run: Run::Probe(interfaces) },
    Check { id: "L05", requirement: "FreeInstance is allowed in every state, and does nothing with NULL.", clause: "2.0.5, 2.1.5; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Probe(free) },
    Check { id: "L06", requirement: "After Reset, in whatever state, an instance is a new one: a second run equals the first bit for bit.", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.1", levels: Levels::MUST, run: Run::Probe(reset) },
    Check { id: "L07", requirement: "Every call that the state allows succeeds.", clause: STATES, levels: Levels::MUST, run: Run::Probe(allowed) },
    Check { id: "L08", requirement: "Every call that the state does not allow returns Error.", clause: "3.0.2, 2.2.3", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(refused) },
    Check { id: "L08u", requirement: "A function of a capability that the FMU does not have returns Error in every state.", clause: "2.0.5, 2.3; 3.0.2, 2.5", levels: Levels::HARD, run: Run::Probe(unsupported) },
    Check { id: "C03", requirement: "Without structural parameters configuration mode is refused.", clause: "3.0.2, 2.3.2", levels: Levels(None, Some(Level::Should)), run: Run::Probe(configuration) },
    Check { id: "L08n", requirement: "Every call without an instance (NULL) returns Error.", clause: "3.0.2, 2.2.1", levels: Levels::HARD, run: Run::Probe(nobody) },
    Check { id: "L09a", requirement: "After an Error the next step is refused.", clause: "3.0.2, 2.3.1", levels: Levels(Some(Level::Hard), Some(Level::Must)), run: Run::Probe(after_error) },
    Check { id: "L09b", requirement: "After an Error Reset leads back to a working instance.", clause: "2.0.5, 4.2.4; 3.0.2, 2.2.3", levels: Levels::MUST, run: Run::Probe(recovery) },
    Check { id: "L10", requirement: "After Terminate the last values can be read.", clause: "2.0.5, 4.2.4; 3.0.2, 2.3.7", levels: Levels::MUST, run: Run::Probe(terminated) },
    Check { id: "L12", requirement: "A step beyond the stop time returns Error.", clause: "2.0.5, 2.1.6; 3.0.2, 2.3.3", levels: Levels::MUST, run: Run::Probe(beyond) },
];

fn plain(bench: &Bench) -> Result<(), Blocked> {
    let it = bench.stepping()?;
    it.steps(10, bench.h())?;
    let _ = it.snapshot(&bench.watched())?;
    let status = it.simple(Simple::Terminate)?;
    bench.require(fine(status), || format!("{} returned {status}", bench.raw.name("Terminate")));
    Ok(())
}

fn token(bench: &Bench) -> Result<(), Blocked> {
    let mut arguments = bench.arguments("probe");
    arguments.token = CString::new("{00000000-wrong-token}").ok();
    let made = bench.instantiate(&arguments)?;
    bench.require(made.is_none(), || format!("{} with another token made an instance", bench.instantiation()));
    Ok(())
}

fn names(bench: &Bench) -> Result<(), Blocked> {
    let empty = Some(CString::default());
    let cases =
        [("instanceName = NULL", None, true), ("instanceName = \"\"", empty, true), ("the token NULL", None, false)];
    for (what, value, name) in cases {
        bench.case(|| {
            let mut arguments = bench.arguments("probe");
            if name {
                arguments.name = value;
            } else {
                arguments.token = value;
            }
            let made = bench.instantiate(&arguments)?;
            bench.require(made.is_none(), || format!("{} with {what} made an instance", bench.instantiation()));
            Ok(())
        });
    }
    Ok(())
}

/// From a arguments to a few steps and an error.
fn short_life(bench: &Bench, arguments: &fmu_import::raw::Arguments, what: &str) -> Result<(), Blocked> {
    let Some(it) = bench.instantiate(arguments)? else {
        bench.violated(format!("{} with {what} returned NULL", bench.instantiation()));
        return Ok(());
    };
    it.enter()?;
    it.exit()?;
    it.steps(2, bench.h())?;
    let _ =
        it.call("DoStep(h=-1)", |raw| raw.do_step(it.handle, it.time.get(), -1.0, false, [true; 4]).map(|(s, _)| s))?;
    it.free()
}

fn mute(bench: &Bench) -> Result<(), Blocked> {
    let v2 = bench.md.version == FmiVersion::V2;
    bench.case(|| {
        let mut arguments = bench.arguments("probe");
        (arguments.logger, arguments.logging) = (false, true);
        short_life(bench, &arguments, "a log callback that is NULL")
    });
    if v2 {
        bench.case(|| {
            let mut arguments = bench.arguments("probe");
            (arguments.callbacks, arguments.logging) = (false, true);
            // NULL is not allowed here, so NULL is a good answer.
            if let Some(it) = bench.instantiate(&arguments)? {
                it.free()?;
            }
            Ok(())
        });
    }
    Ok(())
}

fn homeless(bench: &Bench) -> Result<(), Blocked> {
    if bench.has_resources() {
        return bench.not_applicable("the archive has resources");
    }
    let v2 = bench.md.version == FmiVersion::V2;
    let odd = if v2 { "file:/no%20such/pl%C3%A4ce#1" } else { "/no such/pl\u{e4}ce #1/" };
    for (what, path) in [("the resource path NULL", None), ("a resource path that does not exist", Some(odd))] {
        bench.case(|| {
            let mut arguments = bench.arguments("probe");
            arguments.resources = path.and_then(|p| CString::new(p).ok());
            short_life(bench, &arguments, what)
        });
    }
    Ok(())
}

fn callbacks(bench: &Bench) -> Result<(), Blocked> {
    let mut arguments = bench.arguments("probe");
    (arguments.lasting, arguments.logging) = (false, true);
    short_life(bench, &arguments, "good arguments")?;
    let late = fmu_import::raw::take_events().iter().filter(|e| e.late).count();
    bench.require(late == 0, || format!("{late} messages went through the struct after fmi2Instantiate had returned"));
    Ok(())
}

fn interfaces(bench: &Bench) -> Result<(), Blocked> {
    let v3 = bench.md.version == FmiVersion::V3;
    let mut cases = Vec::new();
    if bench.md.model_exchange.is_none() {
        cases.push(("model exchange", Interface::ModelExchange, false));
    }
    if v3 && bench.md.scheduled_execution.is_none() {
        cases.push(("scheduled execution", Interface::ScheduledExecution, false));
    }
    if v3 && !bench.flag("hasEventMode") {
        cases.push(("eventModeUsed = true", Interface::CoSimulation, true));
    }
    for (what, interface, event_mode) in cases {
        bench.case(|| {
            let mut arguments = bench.arguments("probe");
            (arguments.interface, arguments.event_mode) = (interface, event_mode);
            let made = bench.instantiate(&arguments)?;
            bench.require(made.is_none(), || format!("an instantiation for {what} made an instance"));
            Ok(())
        });
    }
    Ok(())
}

/// States that an instance can be brought to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    Instantiated,
    Initialisation,
    Step,
    Terminated,
    Error,
}

use State::{Error, Initialisation, Instantiated, Step, Terminated};

/// An instance in a state.
pub(super) fn in_state(bench: &Bench, state: State) -> Result<It<'_>, Blocked> {
    match state {
        Instantiated => bench.fresh(),
        Initialisation => bench.initialising(),
        Step => {
            let it = bench.stepping()?;
            it.steps(2, bench.h())?;
            Ok(it)
        }
        Terminated => {
            let it = in_state(bench, Step)?;
            let status = it.simple(Simple::Terminate)?;
            if fine(status) { Ok(it) } else { Err(Blocked(format!("Terminate returned {status}"))) }
        }
        Error => {
            let it = in_state(bench, Step)?;
            it.provoke()?;
            Ok(it)
        }
    }
}

impl It<'_> {
    /// Makes the FMU return Error, by one of several mistakes.
    pub(super) fn provoke(&self) -> Result<String, Blocked> {
        let (t, h) = (self.time.get(), self.bench.h());
        if self.step_at(t, -h)? == Status::ERROR {
            return Ok(format!("DoStep(h={})", -h));
        }
        if self.simple(Simple::ExitInitializationMode)? == Status::ERROR {
            return Ok("ExitInitializationMode in step mode".into());
        }
        Err(Blocked("neither a negative step nor a call in a wrong state returned Error".into()))
    }
}

fn free(bench: &Bench) -> Result<(), Blocked> {
    bench.case(|| {
        bench.calling(&format!("{}(NULL)", bench.raw.name("FreeInstance")));
        bench.raw.free(Handle::NULL).ok_or_else(|| Blocked("FreeInstance is missing".into()))
    });
    for state in [Instantiated, Initialisation, Step, Terminated, Error] {
        bench.case(|| match in_state(bench, state) {
            Ok(it) => it.free(),
            // Some FMUs return no Error; that is told elsewhere.
            Err(Blocked(why)) => {
                bench.note(format!("{state:?}: {why}"));
                Ok(())
            }
        });
    }
    Ok(())
}

fn reset(bench: &Bench) -> Result<(), Blocked> {
    let run = |it: &It<'_>| {
        it.enter()?;
        it.exit()?;
        it.run(20, bench.h())
    };
    let first = run(&bench.fresh()?)?;
    let names: Vec<_> = bench.watched().iter().map(|v| v.name.clone()).collect();
    for state in [Instantiated, Initialisation, Step, Terminated, Error] {
        bench.case(|| {
            let Ok(it) = in_state(bench, state) else { return Ok(()) };
            // What was set must be forgotten.
            if matches!(state, Step) {
                it.excite(1)?;
                it.steps(3, bench.h())?;
            }
            let status = it.simple(Simple::Reset)?;
            if !fine(status) {
                bench.violated(format!("Reset after {state:?} returned {status}"));
                return Ok(());
            }
            it.experiment(bench.start(), None);
            let second = run(&it)?;
            if let Some((k, i)) = difference(&first, &second) {
                bench.violated(format!(
                    "Reset after {state:?}: {} differs from a new instance's after {} steps",
                    names[i],
                    k + 1
                ));
            }
            Ok(())
        });
    }
    bench.case(|| {
        let it = bench.fresh()?;
        for v in bench.md.variables.iter().filter(|v| v.causality == Causality::Parameter && v.base.is_float()) {
            if let Some(values) = bench.other_value(v, 1.0) {
                let _ = it.set(v, &values)?;
            }
        }
        let _ = it.simple(Simple::Reset)?;
        it.experiment(bench.start(), None);
        let second = run(&it)?;
        if let Some((k, i)) = difference(&first, &second) {
            bench.violated(format!("Reset after setting parameters: {} differs after {} steps", names[i], k + 1));
        }
        Ok(())
    });
    Ok(())
}

/// The first place where two trajectories differ: step and variable.
pub(super) fn difference(a: &[Vec<Vec<u64>>], b: &[Vec<Vec<u64>>]) -> Option<(usize, usize)> {
    if a.len() != b.len() {
        return Some((a.len().min(b.len()), 0));
    }
    a.iter().zip(b).enumerate().find_map(|(k, (x, y))| Some((k, x.iter().zip(y).position(|(x, y)| x != y)?)))
}

fn after_error(bench: &Bench) -> Result<(), Blocked> {
    let it = in_state(bench, Step)?;
    let how = it.provoke()?;
    let status = it.step_at(it.time.get(), bench.h())?;
    bench.require(!fine(status), || format!("after {how} had returned Error, DoStep returned {status}"));
    Ok(())
}

fn recovery(bench: &Bench) -> Result<(), Blocked> {
    let it = in_state(bench, Step)?;
    let how = it.provoke()?;
    let status = it.simple(Simple::Reset)?;
    if !fine(status) {
        bench.violated(format!("after {how} had returned Error, Reset returned {status}"));
        return Ok(());
    }
    it.experiment(bench.start(), None);
    if let Err(Blocked(why)) = it.enter().and_then(|()| it.exit()).and_then(|()| it.steps(5, bench.h())) {
        bench.violated(format!("after {how} had returned Error, and a Reset: {why}"));
    }
    Ok(())
}

fn terminated(bench: &Bench) -> Result<(), Blocked> {
    let it = in_state(bench, Step)?;
    let watched = bench.watched();
    let before = it.snapshot(&watched)?;
    let status = it.simple(Simple::Terminate)?;
    if !fine(status) {
        return Err(Blocked(format!("Terminate returned {status}")));
    }
    for (v, old) in watched.iter().zip(before) {
        let (status, now) = it.get(v)?;
        bench.require(fine(status), || format!("Get({}) after Terminate returned {status}", v.name));
        bench.require(!fine(status) || now == old, || format!("{} changed with Terminate", v.name));
    }
    Ok(())
}

fn beyond(bench: &Bench) -> Result<(), Blocked> {
    let (h, start) = (bench.h(), bench.start());
    let it = bench.fresh()?;
    it.experiment(start, Some(start + 4.0 * h));
    it.enter()?;
    it.exit()?;
    it.steps(3, h)?;
    // The last step may be a hair late, by rounding.
    let t = it.time.get();
    let last = it.step_at(t, start + 4.0 * h - t)?;
    bench.require(fine(last), || format!("the step that ends at the stop time returned {last}"));
    let status = it.step_at(start + 4.0 * h, h)?;
    bench.require(!fine(status), || {
        format!("stopTime={}: DoStep(t={}, h={h}) returned {status}", start + 4.0 * h, start + 4.0 * h)
    });
    Ok(())
}
