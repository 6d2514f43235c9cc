//! Clocks in Event Mode of co-simulation (FMI 3.0.2, 2.2.8 and 2.3.5).

use crate::check::{Check, Levels, Run};
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::ticking::{CHANGED, Moment, NOT_YET_KNOWN, Served, UNCHANGED, clocks, is_periodic};
use fmu_import::Status;
use fmu_import::raw::{Arguments, flag_text, number_text};
use model_description::IntervalVariability::{Constant, Countdown, Fixed, Tunable};
use model_description::{Causality, IntervalVariability, ModelVariable};

const MUST: Levels = Levels(None, Some(Level::Must));
const SHOULD: Levels = Levels(None, Some(Level::Should));

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "K00", clause: "3.0.2, 2.3.5", levels: MUST, run: Run::Probe(served),
        requirement: "A simulation in which clocks tick when they are due runs: SetClock, UpdateDiscreteStates, GetIntervalDecimal and steps succeed.",
        tried: "Ticks each clock at the instants given by the description or GetIntervalDecimal, a triggered one at every third event, for 40 events.",
        fix: "Accept SetClock in Event Mode for every clock with causality input, and return new intervals after the update." },
    Check { id: "K01", clause: "3.0.2, 2.3.5", levels: MUST, run: Run::Probe(deactivated),
        requirement: "After UpdateDiscreteStates, a clock that was active is inactive.",
        tried: "Calls GetClock for each clock in the same run.", fix: "Deactivate every clock at the end of UpdateDiscreteStates." },
    Check { id: "K02", clause: "3.0.2, 2.2.8.4", levels: SHOULD, run: Run::Probe(activated),
        requirement: "GetClock returns 1 for the input clocks that the importer has activated, and 0 for the others.",
        tried: "Calls GetClock of each input clock after SetClock.", fix: "Keep a flag for each clock, and return it." },
    Check { id: "K03", clause: "3.0.2, 2.2.8.2", levels: MUST, run: Run::Probe(described),
        requirement: "Intervals and shifts of periodic clocks are those of the description or of SetIntervalDecimal.",
        tried: "Calls GetIntervalDecimal and GetShiftDecimal in Initialization Mode; sets the intervals of fixed and tunable clocks.",
        fix: "Use one value for the description and the functions." },
    Check { id: "K04", clause: "3.0.2, 2.2.8.4", levels: MUST, run: Run::Probe(qualified),
        requirement: "The qualifier of an interval is one of the three values; Changed is returned once; only a countdown clock has an interval \
            that is not yet known.",
        tried: "Calls GetIntervalDecimal twice after each update of a run.", fix: "Return fmi3IntervalChanged at the first call after a change, then \
            fmi3IntervalUnchanged." },
    Check { id: "K05", clause: "hardening", levels: Levels(None, Some(Level::Hard)), run: Run::Probe(counted),
        requirement: "An interval that the FMU returns is finite and not negative.",
        tried: "Looks at the intervals of a run.", fix: "Compute the interval from the time of the event." },
    Check { id: "K06", clause: "3.0.2, 2.3.5", levels: SHOULD, run: Run::Probe(refused),
        requirement: "SetClock of a clock that the FMU ticks, SetClock and GetClock in Step Mode return Error.",
        tried: "Makes these calls.", fix: "Check the causality of the clock and the mode." },
    Check { id: "K07", clause: "3.0.2, 2.2.8.3", levels: SHOULD, run: Run::Probe(closed),
        requirement: "A clocked variable can be set only while one of its clocks is active.",
        tried: "Sets each input on a clock in Event Mode while none of its clocks is active.", fix: "Check the clocks of a variable before setting it." },
    Check { id: "K08", clause: "3.0.2, 2.3.1", levels: SHOULD, run: Run::Probe(with_event_mode),
        requirement: "An FMU with clocks refuses an instantiation for co-simulation without Event Mode.",
        tried: "Instantiates with eventModeUsed = false.", fix: "Return NULL." },
];

/// Events of a run.
const EVENTS: usize = 40;

/// Ends a probe of an FMU without clocks, or whose clocks cannot be served.
macro_rules! needs_clocks {
    ($session:ident) => {
        if clocks($session, true).is_empty() && clocks($session, false).is_empty() {
            return $session.not_applicable("there are no clocks");
        }
        if !$session.flag("hasEventMode") {
            return $session.not_applicable("hasEventMode is false");
        }
        if !$session.flag("canHandleVariableCommunicationStepSize") {
            return $session
                .not_applicable("steps cannot end where clocks tick (canHandleVariableCommunicationStepSize)");
        }
    };
}

fn served(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let run = Served::start(session).and_then(|mut served| served.run(EVENTS, &mut |_, _, _| Ok(())));
    if let Err(why) = run {
        session.failed("when clocks tick as they are due", why);
    }
    Ok(())
}

fn deactivated(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let mut found = false;
    Served::start(session)?.run(EVENTS, &mut |served, moment, due| {
        for &i in due.iter().filter(|_| matches!(moment, Moment::Updated)) {
            let v = served.clocks[i].v;
            let (status, active) = served.instance.clock(v)?;
            if status.is_ok() && active != 0 && !std::mem::replace(&mut found, true) {
                session.violated(format!(
                    "after UpdateDiscreteStates, GetClock({}) gave {}",
                    v.name,
                    flag_text(active.into())
                ));
            }
        }
        Ok(())
    })
}

fn activated(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let mut found = false;
    Served::start(session)?.run(EVENTS, &mut |served, moment, due| {
        for (i, clock) in served.clocks.iter().enumerate().filter(|_| matches!(moment, Moment::Active)) {
            // A clock that depends on another clock can be queried only while the other is active.
            if !due.contains(&i) && !clock.v.clocks.is_empty() {
                continue;
            }
            let (status, active) = served.instance.clock(clock.v)?;
            let wanted = u8::from(due.contains(&i));
            let right = status.is_ok() && active == wanted;
            if !right && !std::mem::replace(&mut found, true) {
                let name = &clock.v.name;
                let active = flag_text(active.into());
                session.violated(format!("GetClock({name}) returned {status} and gave {active} instead of {wanted}"));
            }
        }
        Ok(())
    })
}

/// Whether two times in s are equal up to rounding.
fn equal(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

fn described(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let periodic: Vec<_> = clocks(session, true).into_iter().filter(|(_, timing)| is_periodic(timing.ticks)).collect();
    if periodic.is_empty() {
        return session.not_applicable("there is no clock with a period");
    }
    session.cases(periodic, |(v, timing)| {
        let instance = session.initializing()?;
        let mut wanted = timing.interval;
        if let (Fixed | Tunable, Some(interval)) = (timing.ticks, timing.interval) {
            wanted = Some(0.5 * interval);
            let call = format!("SetIntervalDecimal({} = {})", v.name, 0.5 * interval);
            let set =
                instance.call(&call, |raw| raw.set_interval(instance.handle, v.value_reference, 0.5 * interval))?;
            session.require(set.is_ok(), || format!("{call} in Initialization Mode returned {set}"));
            if !set.is_ok() {
                return Ok(());
            }
        }
        // An interval set by the importer need not be readable.
        if timing.ticks == Constant || timing.interval.is_none() {
            let (status, (interval, _)) = instance.interval(v)?;
            session.require(status.is_ok() && wanted.is_none_or(|wanted| equal(interval, wanted)), || {
                let (wanted, interval) = (wanted.map(|x| format!(" instead of {x} s")), number_text(interval));
                let wanted = wanted.unwrap_or_default();
                format!("GetIntervalDecimal({}) returned {status} and gave {interval} s{wanted}", v.name)
            });
            let instance = session.initializing()?;
            let (status, shift) = instance.shift(v)?;
            let fits = timing.interval.is_none() || equal(shift, timing.shift);
            session.require(status.is_ok() && fits, || {
                let (wanted, shift) = (timing.shift, number_text(shift));
                format!("GetShiftDecimal({}) returned {status} and gave {shift} s instead of {wanted} s", v.name)
            });
        }
        Ok(())
    })
}

/// A clock, its kind, and the intervals and qualifiers from two calls.
type Answers<'a> = (&'a ModelVariable, IntervalVariability, Vec<(f64, i32)>);

/// The intervals that the FMU returns in a run, each with the result of a second call; also if the run ends too early.
fn intervals(session: &Session) -> Result<Vec<Answers<'_>>, NotDetermined> {
    let mut served = Served::start(session)?;
    served.twice = true;
    let ended = served.run(EVENTS, &mut |_, _, _| Ok(()));
    if served.intervals.is_empty() {
        ended?;
    }
    let clocks = &served.clocks;
    Ok(served.intervals.into_iter().map(|(i, answers)| (clocks[i].v, clocks[i].timing.ticks, answers)).collect())
}

fn qualified(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    for (v, ticks, answers) in intervals(session)? {
        let qualifiers: Vec<i32> = answers.iter().map(|(_, qualifier)| *qualifier).collect();
        let good = match qualifiers[..] {
            [NOT_YET_KNOWN, second] => ticks == Countdown && second == NOT_YET_KNOWN,
            [CHANGED | UNCHANGED, second] => second == UNCHANGED,
            _ => false,
        };
        if !good {
            let given = qualifiers.into_iter().map(flag_text).collect::<Vec<_>>().join(" and ");
            session.violated(format!("two calls of GetIntervalDecimal({}) gave the qualifiers {given}", v.name));
            break;
        }
    }
    Ok(())
}

fn counted(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    for (v, _, answers) in intervals(session)? {
        let wrong = answers.iter().find(|(x, qualifier)| *qualifier == CHANGED && !(x.is_finite() && *x >= 0.0));
        if let Some((interval, _)) = wrong {
            session.violated(format!("GetIntervalDecimal({}) gave {} s", v.name, number_text(*interval)));
            break;
        }
    }
    Ok(())
}

fn refused(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let in_event_mode = |v: &ModelVariable| {
        let instance = Served::start(session)?.instance;
        let status = instance.tick(v)?;
        session.require(status == Status::ERROR, || {
            format!("SetClock({}), which the FMU ticks, returned {status}", v.name)
        });
        Ok(())
    };
    session.cases(clocks(session, false).first(), |(v, _)| in_event_mode(v))?;
    session.cases(clocks(session, true).first(), |(v, _)| {
        for gets in [false, true] {
            let mut served = Served::start(session)?;
            served.event(&mut |_, _, _| Ok(()))?;
            let instance = &served.instance;
            let (name, status) =
                if gets { ("GetClock", instance.clock(v)?.0) } else { ("SetClock", instance.tick(v)?) };
            session.require(status == Status::ERROR, || format!("{name}({}) in Step Mode returned {status}", v.name));
        }
        Ok(())
    })
}

fn closed(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let clocked = |v: &&ModelVariable| v.causality == Causality::Input && !v.clocks.is_empty();
    let inputs: Vec<_> = session.numeric().filter(clocked).collect();
    if inputs.is_empty() {
        return session.not_applicable("no input is on a clock");
    }
    session.cases(inputs, |v| {
        let Some(values) = session.different_value(v, 1.0) else { return Ok(()) };
        // No clock is active before the importer calls SetClock.
        let status = Served::start(session)?.instance.set(v, &values)?;
        session.require(status == Status::ERROR, || {
            format!("Set({}) in Event Mode, while no clock is active, returned {status}", v.name)
        });
        Ok(())
    })
}

fn with_event_mode(session: &Session) -> Result<(), NotDetermined> {
    needs_clocks!(session);
    let made = session.instantiate(&Arguments { event_mode: false, ..session.arguments("probe") })?;
    session.require(made.is_none(), || {
        "fmi3InstantiateCoSimulation with eventModeUsed = false created an instance".into()
    });
    Ok(())
}
