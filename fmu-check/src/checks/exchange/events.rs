//! Events of Model Exchange (FMI 2.0.5, 3.1 and 3.2.2; FMI 3.0.2, 2.3.5 and 3.1.1).

use crate::check::{Check, Levels, Run};
use crate::confidence::Confidence;
use crate::encoding::show;
use crate::exchange::{Importer, Jump};
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use model_description::{Causality, ModelVariable, Variability};
use std::cell::{Cell, RefCell};

const UPDATE: &str = "2.0.5, 3.2.2; 3.0.2, 2.3.5";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "E20", clause: UPDATE, levels: Levels::MUST, run: Run::Exchange(update_results),
        requirement: "Every update of the discrete states returns Booleans that are 0 or 1, and a time if it defines a next event (should: a finite time).",
        tried: "Looks at the results of every update.", fix: "Write all results before returning OK." },
    Check { id: "E21", clause: UPDATE, levels: Levels::SHOULD, run: Run::Exchange(next_event_time),
        requirement: "The next time event, from the first update after initialization on, is an absolute time after now.",
        tried: "Looks at nextEventTime of every update.", fix: "Return an absolute time after now, from the first update on." },
    Check { id: "E22", clause: UPDATE, levels: Levels::SHOULD, run: Run::Exchange(renewed),
        requirement: "An event before the next time event does not cancel that time event: the update returns it again.",
        tried: "Makes an event before the next time event and checks nextEventTime.", fix: "Compute the next time event in every update." },
    Check { id: "E23", clause: "hardening", levels: Levels::HARD, run: Run::Exchange(ends),
        requirement: "The iteration of an event ends within 100 updates.",
        tried: "Updates until no further update is needed.", fix: "End the iteration: newDiscreteStatesNeeded only if something has changed." },
    Check { id: "E24a", clause: UPDATE, levels: Levels::SHOULD, run: Run::Exchange(told_changes),
        requirement: "An update that changes a state sets valuesOfContinuousStatesChanged.",
        tried: "Compares states before and after every update.", fix: "Set valuesOfContinuousStatesChanged whenever a state is reinitialized." },
    Check { id: "E24b", clause: UPDATE, levels: Levels(Some(Level::Must), Some(Level::Should)), run: Run::Exchange(true_changes),
        requirement: "valuesOfContinuousStatesChanged is true only if a state has changed.",
        tried: "Compares states before and after every update.", fix: "Clear the flag if no state is reinitialized." },
    Check { id: "E24n", clause: UPDATE, levels: Levels::SHOULD, run: Run::Exchange(true_nominals),
        requirement: "nominalsOfContinuousStatesChanged is true only if a nominal has changed.",
        tried: "Reads the nominals after every update that sets the flag.", fix: "Clear the flag if no nominal changes." },
    Check { id: "E25", clause: "2.0.5, 3.2.2; 3.0.2, 3.1.1", levels: Levels::MUST, run: Run::Exchange(indicators),
        requirement: "After Event Mode no event indicator is 0 (hard: an indicator has more values than its two signs, so that a solver finds its zero).",
        tried: "Reads the event indicators after Event Mode and over a run.",
        fix: "Shift an indicator that is 0, with a small hysteresis, and return the expression that crosses 0, not its sign." },
    Check { id: "E26", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::MUST, run: Run::Exchange(discrete),
        requirement: "Discrete variables do not change in Continuous-Time Mode.",
        tried: "Reads discrete variables between events, and before each event.", fix: "Assign discrete variables in updates only." },
];

/// Steps of the integrator in a probe of events.
const STEPS: usize = 1000;

/// Looks at every event of a run; reports its count.
fn each_event(
    session: &Session,
    rule: &dyn Fn(f64, &crate::exchange::Event) -> Option<String>,
) -> Result<(), NotDetermined> {
    let (mut events, mut found) = (0, 0);
    let instance = session.excited()?;
    let result = Importer::survey(
        &instance,
        STEPS,
        &mut |instance, event| {
            events += 1;
            // One finding per kind is enough, except that the first event differs from the others.
            if found < 3
                && let Some(text) = rule(instance.time.get(), event)
            {
                found += 1;
                session.violated(format!("event {events}, t = {:?}: {text}", instance.time.get()));
            }
        },
        &mut |_, _| Ok(()),
    );
    session.note(format!("{events} events"));
    if found > 0 { Ok(()) } else { result }
}

fn update_results(session: &Session) -> Result<(), NotDetermined> {
    let infinite = Cell::new(false);
    each_event(session, &|_, event| {
        event.updates.iter().find_map(|(u, _)| {
            let flags = [u.again, u.terminate, u.nominals_changed, u.states_changed, u.next_event_time_defined];
            let good = flags.iter().all(|f| matches!(f, 0 | 1));
            let time = u.next_event_time_defined == 0 || !u.next_event_time.is_nan();
            // An event at an infinite time never occurs, but an importer can still integrate up to it.
            if u.next_event_time_defined == 1 && u.next_event_time.is_infinite() && !infinite.replace(true) {
                session.lesser(Level::Should, format!("{u}: the time of the next event is infinite"));
            }
            (!good || !time).then(|| format!("{u}: a Boolean is not 0 or 1, or a result was not written"))
        })
    })
}

fn next_event_time(session: &Session) -> Result<(), NotDetermined> {
    each_event(session, &|t, event| {
        let next = event.next().filter(|_| event.ended() && !event.terminates())?;
        (next <= t).then(|| format!("nextEventTime is {next:?}, not after now"))
    })
}

fn ends(session: &Session) -> Result<(), NotDetermined> {
    each_event(session, &|_, event| {
        (!event.ended() && !event.terminates())
            .then(|| format!("after {} updates the FMU needs another", event.updates.len()))
    })
}

fn told_changes(session: &Session) -> Result<(), NotDetermined> {
    each_event(session, &|_, event| {
        let silent = event.updates.iter().filter(|(u, _)| u.states_changed == 0).find_map(|(_, jump)| jump.as_ref());
        silent.map(|Jump { state, from, to }| {
            let name = session.element_names(session.description.states()).get(*state).cloned().unwrap_or_default();
            format!("the state {name} changed from {from:?} to {to:?}, and valuesOfContinuousStatesChanged is false")
        })
    })
}

fn true_changes(session: &Session) -> Result<(), NotDetermined> {
    each_event(session, &|_, event| {
        let idle = event.updates.iter().any(|(u, jump)| jump.is_none() && u.states_changed == 1);
        idle.then(|| "valuesOfContinuousStatesChanged is true, and no state changed".into())
    })
}

fn true_nominals(session: &Session) -> Result<(), NotDetermined> {
    if session.states() == 0 {
        return session.not_applicable("there are no continuous states");
    }
    let instance = session.excited()?;
    let last = RefCell::new(instance.nominals()?);
    let mut idle = 0;
    Importer::survey(
        &instance,
        STEPS,
        &mut |instance, event| {
            let Ok(now) = instance.nominals() else { return };
            let reported = event.updates.iter().any(|(u, _)| u.nominals_changed == 1);
            if reported && *last.borrow() == now {
                idle += 1;
                if idle == 3 {
                    session.violated(format!(
                        "t = {:?}: nominalsOfContinuousStatesChanged is true for the third time, and the nominals are still {now:?}",
                        instance.time.get()
                    ));
                }
            }
            *last.borrow_mut() = now;
        },
        &mut |_, _| Ok(()),
    )
}

fn indicators(session: &Session) -> Result<(), NotDetermined> {
    if session.indicators() == 0 {
        return session.not_applicable("there are no event indicators");
    }
    let instance = session.excited()?;
    let all: RefCell<Vec<Vec<f64>>> = RefCell::new(vec![Vec::new(); session.indicators()]);
    Importer::survey(&instance, STEPS, &mut |_, _| (), &mut |importer, event| {
        let zero = importer.z.iter().position(|z| *z == 0.0).filter(|_| event);
        if let Some(k) = zero {
            let t = importer.instance.time.get();
            session.violated(format!("after the event at t = {t:?} event indicator {} is {:?}", k + 1, importer.z[k]));
        }
        all.borrow_mut().iter_mut().zip(&importer.z).for_each(|(all, z)| all.push(*z));
        Ok(())
    })?;
    for (i, all) in all.into_inner().iter().enumerate() {
        let (Some(first), len) = (all.first(), all.len()) else { continue };
        let is_sign = all.iter().all(|z| z.abs().to_bits() == first.abs().to_bits());
        if is_sign && len >= 20 && all.iter().any(|z| z.signum() != first.signum()) {
            let text = format!("event indicator {} is {first:?} or {:?} at all of {len} points", i + 1, -first);
            session.report(Some(Level::Hard), Confidence::Hint, text);
        }
    }
    Ok(())
}

fn discrete(session: &Session) -> Result<(), NotDetermined> {
    let fits = |v: &&ModelVariable| {
        v.variability == Variability::Discrete
            && v.clocks.is_empty()
            && session.is_steady(v)
            && matches!(v.causality, Causality::Output | Causality::Local)
    };
    let variables: Vec<_> = session.numeric().filter(fits).take(60).collect();
    if variables.is_empty() {
        return session.not_applicable("there are no discrete outputs or local variables");
    }
    let instance = session.excited()?;
    let mut importer = Importer::start(&instance)?;
    importer.watched.clone_from(&variables);
    let dt = session.integrator_step();
    let mut found = 0;
    session.record_calls(&format!("200 integrator steps of {dt} s with events"), || {
        let mut last = instance.snapshot(&variables)?;
        for _ in 0..200 {
            if importer.over {
                break;
            }
            let event = importer.step(dt, &mut |_, _| ())?;
            let now = instance.snapshot(&variables)?;
            let end = if event { &importer.before } else { &now };
            for (v, (old, new)) in variables.iter().zip(last.iter().zip(end)).filter(|(_, (old, new))| old != new) {
                found += 1;
                if found <= 10 {
                    let t = instance.time.get();
                    let [old, new] = [old, new].map(|bits| show(v, session.description.version, bits));
                    session.violated(format!(
                        "the discrete variable {} changed from {old} to {new} in Continuous-Time Mode before t = {t:?}",
                        v.name
                    ));
                }
            }
            last = now;
        }
        Ok(())
    })
}

fn renewed(session: &Session) -> Result<(), NotDetermined> {
    let instance = session.excited()?;
    let mut importer = Importer::start(&instance)?;
    let mut tried = 0;
    for _ in 0..10 {
        let (Some(next), t) = (importer.next, instance.time.get()) else { break };
        if importer.over || next <= t {
            break;
        }
        // To half the time, in short steps; a state event on the way may change the next time event.
        let half = t + 0.5 * (next - t);
        let steps = ((half - t) / session.integrator_step()).ceil().clamp(1.0, 200.0);
        let mut disturbed = false;
        for _ in 0..200 {
            if importer.over || disturbed || instance.time.get() + (half - t) / steps > half * (1.0 + 1e-15) {
                break;
            }
            disturbed = importer.step((half - t) / steps, &mut |_, _| ())?;
        }
        if importer.over {
            break;
        }
        if !disturbed {
            let event = importer.event(&mut |_, _| ())?;
            let (now, kept) = (instance.time.get(), importer.next);
            tried += 1;
            let lost = kept.is_none_or(|kept| kept > next + 1e-6 * (next - t));
            if lost && !event.jumped() && !event.terminates() {
                let kept = kept.map_or_else(|| "there is none".into(), |kept| format!("it is at {kept:?}"));
                session
                    .violated(format!("the next event was at {next:?}; after an unrequested event at {now:?}, {kept}"));
                return Ok(());
            }
        }
        // Continue to the time event itself.
        if let Some(next) = importer.next {
            let rest = next - instance.time.get();
            for _ in 0..60 {
                if importer.over || importer.step(rest / 50.0, &mut |_, _| ())? {
                    break;
                }
            }
        }
    }
    if tried == 0 { session.not_applicable("no time event was announced") } else { Ok(()) }
}
