//! Saved states (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.7.4).

use crate::check::{Check, Levels, Run};
use crate::checks::life::shared::kept::{set_all, texts};
use crate::checks::process::instances::{LEFT_BY_STATE, leak};
use crate::encoding::or_null;
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::state::State;
use crate::trajectory::difference;
use fmu_import::Status;
use fmu_import::raw::SavedState;
use model_description::{Causality, CoSimulation, ModelVariable};
use std::cell::Cell;

const STATE: &str = "2.0.5, 2.1.8; 3.0.2, 2.2.7.4";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "F01a", clause: STATE, levels: Levels::MUST, run: Run::Probe(in_every_state),
        requirement: "A state can be saved, restored repeatedly and freed in every state of the life cycle, and the life cycle continues; freeing \
            sets the pointer to NULL.",
        tried: "Gets, sets twice and frees a state in each state of the life cycle, and makes the next call.",
        fix: "Allow the calls in all these states, and set the pointer to NULL after freeing." },
    Check { id: "F01b", clause: STATE, levels: Levels::MUST, run: Run::Probe(overwrite),
        requirement: "Saving into an existing state overwrites that state and no other, and freeing NULL is ignored.",
        tried: "Gets a state into an existing one, runs, restores, and compares; the same with the first of two states; frees NULL.",
        fix: "Overwrite the memory behind the pointer; return OK for NULL." },
    Check { id: "F01l", clause: "hardening", levels: Levels::HARD, run: Run::Probe(state_leaks),
        requirement: "Saving and freeing states, and saving into an existing state, leak no memory.",
        tried: "Saves and frees some thousand states, saves some thousand times into the same one, and measures memory.",
        fix: "Free in FreeFMUState what GetFMUState allocated, and let GetFMUState reuse the memory of the state passed to it." },
    Check { id: "F02a", clause: STATE, levels: Levels::MUST, run: Run::Probe(rerun_from_state),
        requirement: "A run from a restored state equals the run from the time of saving.",
        tried: "Saves, runs 50 steps, restores twice, and compares.",
        fix: "Save everything that a step reads: solver memory, buffers, counters, file positions." },
    Check { id: "F02b", clause: STATE, levels: Levels::MUST, run: Run::Probe(variables),
        requirement: "A restored state restores all variables: parameters, inputs and outputs.",
        tried: "Saves, changes inputs and parameters, steps, restores, and compares all variables.", fix: "Save parameters, inputs and outputs too." },
    Check { id: "F02c", clause: "2.0.5, 2.1.3; 3.0.2, 2.2.4", levels: Levels(Some(Level::Should), Some(Level::Must)), run: Run::Probe(after_error),
        requirement: "After an Error, a state saved earlier restores a working instance.",
        tried: "Saves, provokes an Error, restores, runs, and compares.",
        fix: "Allow SetFMUState in the state Error, and save the state of the life cycle." },
    Check { id: "F03a", clause: "hardening", levels: Levels::HARD, run: Run::Probe(other_instance),
        requirement: "A state can be set into another instance of the FMU.",
        tried: "Sets a state into another instance, runs, and compares.", fix: "Keep no pointer to the instance in the state." },
    Check { id: "F03b", clause: "hardening", levels: Levels::HARD, run: Run::Probe(null_states),
        requirement: "A NULL state and a NULL pointer to a state give Error.",
        tried: "Passes NULL states and NULL pointers.", fix: "Check the pointers." },
    Check { id: "F04a", clause: STATE, levels: Levels::MUST, run: Run::Probe(serialized),
        requirement: "A serialized state can be restored in another instance, and the run from it is the same.",
        tried: "Serializes, deserializes in another instance, runs, and compares; in Initialization Mode all variables.",
        fix: "Write every member by value, including parameters and the state of the life cycle." },
    Check { id: "F04b", clause: "hardening", levels: Levels::HARD, run: Run::Probe(equal_bytes),
        requirement: "Equal states give equal bytes: no addresses and no uninitialized memory.",
        tried: "Serializes two instances after the same run and compares.", fix: "Write no addresses, and clear padding." },
    Check { id: "F04c", clause: "hardening", levels: Levels::HARD, run: Run::Probe(corrupted),
        requirement: "Bytes that are not a state (empty, truncated, altered) give Error and never crash the process.",
        tried: "Deserializes truncated, altered and random bytes, and steps if they are accepted.",
        fix: "Start the bytes with a magic number, a version and a length, and end them with a checksum." },
    Check { id: "F04d", clause: "hardening", levels: Levels::HARD, run: Run::Probe(wrong_size),
        requirement: "A buffer of the wrong size gives Error, and the FMU writes nothing past it.",
        tried: "Serializes into buffers that are too small.", fix: "Compare the size before writing." },
];

fn can(session: &Session, flag: fn(&CoSimulation) -> bool) -> bool {
    session.description.co_simulation.as_ref().is_some_and(flag)
}

/// Ends a probe if the FMU does not have the capability.
macro_rules! needs {
    ($session:ident, $flag:ident) => {
        if !can($session, CoSimulation::$flag) {
            return $session.not_applicable(concat!(stringify!($flag), " is false"));
        }
    };
}

fn in_every_state(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    session.cases([State::Instantiated, State::Initialization, State::Step, State::Terminated], |state| {
        let instance = session.simulation(state)?;
        let mut saved = SavedState::NULL;
        let got = instance.call("GetFMUState", |raw| raw.get_state(instance.handle, Some(&mut saved)))?;
        session
            .require(got.is_ok() && saved != SavedState::NULL, || format!("GetFMUState in {state:?} returned {got}"));
        if !got.is_ok() {
            return Ok(());
        }
        for _ in 0..2 {
            let status = instance.call("SetFMUState", |raw| raw.set_state(instance.handle, saved))?;
            session.require(status.is_ok(), || format!("SetFMUState in {state:?} returned {status}"));
        }
        let status = instance.call("FreeFMUState", |raw| raw.free_state(instance.handle, Some(&mut saved)))?;
        session.require(status.is_ok(), || format!("FreeFMUState in {state:?} returned {status}"));
        let goes_on = match state {
            State::Instantiated => instance.initialize(),
            State::Initialization => instance.exit(),
            State::Step => instance.steps(1, session.h()),
            _ => Ok(()),
        };
        if let Err(why) = goes_on {
            session.failed(&format!("after SetFMUState in {state:?}"), why);
        }
        session.require(saved == SavedState::NULL, || {
            format!("FreeFMUState in {state:?} did not set the pointer to NULL")
        });
        Ok(())
    })
}

fn overwrite(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    session.case(|| {
        let (instance, h) = (session.stepping()?, session.h());
        let mut state = instance.save()?;
        instance.steps(5, h)?;
        let status = instance
            .call("GetFMUState(a state read before)", |raw| raw.get_state(instance.handle, Some(&mut state)))?;
        session.require(status.is_ok(), || format!("GetFMUState into a state read before returned {status}"));
        let time = instance.time.get();
        let first = instance.run(10, h)?;
        instance.restore(state, time)?;
        rerun_given_f02a(&instance, &first, "restored from a state that was overwritten")
    });
    session.case(|| {
        let (instance, h) = (session.stepping()?, session.h());
        instance.change_inputs(2)?;
        instance.steps(2, h)?;
        let (state, time) = (instance.save()?, instance.time.get());
        let first = instance.run(10, h)?;
        let _second = instance.save()?;
        instance.restore(state, time)?;
        rerun_given_f02a(&instance, &first, "restored from the first of two states")
    });
    session.case(|| {
        let instance = session.stepping()?;
        let mut state = SavedState::NULL;
        let status = instance.call("FreeFMUState(&NULL)", |raw| raw.free_state(instance.handle, Some(&mut state)))?;
        session.require(status.is_ok(), || format!("FreeFMUState of NULL returned {status}"));
        Ok(())
    });
    Ok(())
}

/// An instance after steps with changed inputs.
fn running_instance(session: &Session) -> Result<Instance<'_>, NotDetermined> {
    let instance = session.stepping()?;
    for k in 0..12 {
        instance.change_inputs(k)?;
        instance.steps(1, session.h())?;
    }
    Ok(instance)
}

/// Repeats the run from a restored state; a step that fails now, but did not before, counts as a difference.
fn rerun(instance: &Instance<'_>, first: &[Vec<Vec<u64>>], what: &str) {
    report(instance, first, instance.run(first.len(), instance.session.h()), what);
}

fn report(
    instance: &Instance<'_>,
    first: &[Vec<Vec<u64>>],
    second: Result<Vec<Vec<Vec<u64>>>, NotDetermined>,
    what: &str,
) {
    match second {
        Ok(second) => instance.session.compare(what, first, &second),
        Err(why) => instance.session.failed(what, why),
    }
}

/// Like [`rerun`], for a check that relies on F02a: if a run from a restored state differs in any case, it cannot decide.
fn rerun_given_f02a(instance: &Instance<'_>, first: &[Vec<Vec<u64>>], what: &str) -> Result<(), NotDetermined> {
    let (session, h) = (instance.session, instance.session.h());
    let same = |second: &Result<Vec<Vec<Vec<u64>>>, NotDetermined>, first: &[Vec<Vec<u64>>]| {
        second
            .as_ref()
            .is_ok_and(|second| difference(session.description.version, &session.watched(), first, second).is_none())
    };
    let second = instance.run(first.len(), h);
    if same(&second, first) {
        return Ok(());
    }
    session.prepare(|| {
        // Another instance, if the FMU supports several.
        let Ok(control) = running_instance(session) else { return Ok(()) };
        let (state, time) = (control.save()?, control.time.get());
        let first = control.run(first.len(), h)?;
        control.restore(state, time)?;
        if same(&control.run(first.len(), h), &first) {
            return Ok(());
        }
        Err(NotDetermined("see F02a: a run from a restored state differs in any case".into()))
    })?;
    report(instance, first, second, what);
    Ok(())
}

fn rerun_from_state(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let (instance, h) = (running_instance(session)?, session.h());
    let (state, time) = (instance.save()?, instance.time.get());
    let first = instance.run(50, h)?;
    for again in 1..=2 {
        instance.restore(state, time)?;
        rerun(&instance, &first, &format!("restored {}", if again == 1 { "once" } else { "twice" }));
        // A state must also undo what a longer run and other inputs did.
        instance.change_inputs(4)?;
        instance.steps(7, h)?;
    }
    Ok(())
}

fn variables(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let (instance, h) = (running_instance(session)?, session.h());
    // The time of the next step is an argument; F02a checks whether it is accepted.
    let comparable = |v: &&ModelVariable| v.clocks.is_empty() && v.causality != Causality::Independent;
    let all: Vec<&ModelVariable> = session.numeric().filter(comparable).collect();
    let (state, time) = (instance.save()?, instance.time.get());
    let before = instance.snapshot(&all)?;
    instance.change_inputs(1)?;
    for v in all.iter().filter(|v| v.variability == model_description::Variability::Tunable && v.base.is_float()) {
        if let Some(values) = session.different_value(v, 1.0) {
            let _ = instance.set(v, &values)?;
        }
    }
    instance.steps(5, h)?;
    instance.restore(state, time)?;
    for (v, (old, new)) in all.iter().zip(before.into_iter().zip(instance.snapshot(&all)?)) {
        session.compare_variables(&[*v], "restored, compared with the time of saving", &[vec![old]], &[vec![new]]);
    }
    in_initialization(session, &|| session.initializing(), &all)
}

/// Restores a state in Initialization Mode, where more variables can be set, including texts.
pub(crate) fn in_initialization<'b>(
    session: &'b Session,
    begin: &dyn Fn() -> Result<Instance<'b>, NotDetermined>,
    all: &[&ModelVariable],
) -> Result<(), NotDetermined> {
    // Not from the start values, which a state may omit unnoticed; from others if the FMU accepts them.
    let trial = begin()?;
    let instance = if set_all(&trial, 2.0).is_ok() { trial } else { begin()? };
    let (state, time) = (instance.save()?, instance.time.get());
    let (before, words) = (instance.snapshot(all)?, texts(&instance)?);
    // Refusals are not the subject of this check.
    if let Err(NotDetermined(why)) = set_all(&instance, 1.0) {
        session.note(why);
    }
    instance.restore(state, time)?;
    for (v, (old, new)) in all.iter().zip(before.into_iter().zip(instance.snapshot(all)?)) {
        session.compare_variables(&[*v], "restored, compared with the time of saving", &[vec![old]], &[vec![new]]);
    }
    for (old, new) in words.iter().zip(&texts(&instance)?).filter(|(old, new)| old != new) {
        session.violated(format!(
            "restored, {} is {}; it was {} at the time of saving",
            old.0,
            or_null(&new.1),
            or_null(&old.1)
        ));
    }
    Ok(())
}

fn state_leaks(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let instance = session.stepping()?;
    instance.steps(1, session.h())?;
    leak(session, ("states", LEFT_BY_STATE, ""), &|| {
        let mut state = instance.save()?;
        let status = instance.call("FreeFMUState", |raw| raw.free_state(instance.handle, Some(&mut state)))?;
        instance.must("FreeFMUState", status)
    })?;
    let state = Cell::new(instance.save()?);
    let save_again = || {
        let mut again = state.get();
        let status = instance
            .call("GetFMUState(a state read before)", |raw| raw.get_state(instance.handle, Some(&mut again)))?;
        let other = state.replace(again) != again;
        instance.must("GetFMUState", status).map(|()| other)
    };
    let why =
        if save_again()? { ": it returned another state, and neither reused nor freed the given one" } else { "" };
    leak(session, ("states saved into an existing one", LEFT_BY_STATE, why), &|| save_again().map(|_| ()))
}

fn after_error(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let (instance, h) = (running_instance(session)?, session.h());
    let (state, time) = (instance.save()?, instance.time.get());
    let first = instance.run(10, h)?;
    let how = instance.provoke()?;
    let status = instance.call("SetFMUState", |raw| raw.set_state(instance.handle, state))?;
    if !status.is_ok() {
        session.violated(format!("after {how} had returned Error, SetFMUState returned {status}"));
        return Ok(());
    }
    instance.time.set(time);
    rerun_given_f02a(&instance, &first, "restored after an Error")
}

fn other_instance(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let (instance, h) = (running_instance(session)?, session.h());
    let (state, time) = (instance.save()?, instance.time.get());
    let first = instance.run(20, h)?;
    let other = session.stepping()?;
    let status = other.call("SetFMUState(of another instance)", |raw| raw.set_state(other.handle, state))?;
    if !status.is_ok() {
        session.violated(format!("SetFMUState with the state of another instance returned {status}"));
        return Ok(());
    }
    other.time.set(time);
    rerun_given_f02a(&other, &first, "set into another instance")
}

/// A call that ought to be refused.
type Attempt = fn(&Instance<'_>) -> Result<Status, NotDetermined>;

fn null_states(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_get_and_set_state);
    let cases: [(&str, Attempt); 2] = [
        ("SetFMUState(NULL)", |instance| {
            instance.call("SetFMUState(NULL)", |raw| raw.set_state(instance.handle, SavedState::NULL))
        }),
        ("GetFMUState(NULL)", |instance| {
            instance.call("GetFMUState(NULL)", |raw| raw.get_state(instance.handle, None))
        }),
    ];
    session.cases(cases, |(what, call)| {
        let status = call(&session.stepping()?)?;
        session.require(status == Status::ERROR, || format!("{what} returned {status}"));
        Ok(())
    })
}

fn serialized(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_serialize_state);
    let (instance, h) = (running_instance(session)?, session.h());
    let (state, time) = (instance.save()?, instance.time.get());
    let bytes = match instance.serialize(state) {
        Ok(bytes) => bytes,
        Err(why) => {
            session.failed("a state of a running instance", why);
            return Ok(());
        }
    };
    let first = instance.run(30, h)?;
    let other = session.stepping()?;
    let (status, back) =
        other.call_for("DeserializeFMUState", |raw| raw.deserialize(other.handle, Some(&bytes), bytes.len()))?;
    if !status.is_ok() {
        session.violated(format!("DeserializeFMUState of {} bytes just serialized returned {status}", bytes.len()));
        return Ok(());
    }
    other.restore(back, time)?;
    rerun_given_f02a(&other, &first, "deserialized in another instance")?;
    session.note(format!("{} bytes", bytes.len()));
    serialized_variables(session)
}

/// The bytes of an instance in Initialization Mode transfer its complete state to an instance with the start values.
fn serialized_variables(session: &Session) -> Result<(), NotDetermined> {
    let all: Vec<&ModelVariable> =
        session.numeric().filter(|v| v.clocks.is_empty() && v.causality != Causality::Independent).collect();
    let (instance, other) = (session.initializing()?, session.initializing()?);
    if set_all(&instance, 2.0).is_err() {
        return Ok(());
    }
    let bytes = instance.serialize(instance.save()?)?;
    let (status, back) =
        other.call_for("DeserializeFMUState", |raw| raw.deserialize(other.handle, Some(&bytes), bytes.len()))?;
    other.must("DeserializeFMUState", status)?;
    other.restore(back, session.start())?;
    for (v, (old, new)) in all.iter().zip(instance.snapshot(&all)?.into_iter().zip(other.snapshot(&all)?)) {
        session.compare_variables(&[*v], "deserialized, compared with the original", &[vec![old]], &[vec![new]]);
    }
    for (old, new) in texts(&instance)?.iter().zip(&texts(&other)?).filter(|(old, new)| old != new) {
        session.violated(format!(
            "deserialized, {} is {}; it was {} in the original",
            old.0,
            or_null(&new.1),
            or_null(&old.1)
        ));
    }
    // The model may reject these values in combination.
    if let (Ok(()), Err(why)) = (instance.exit(), other.exit()) {
        session.failed("deserialized in Initialization Mode", why);
    }
    Ok(())
}

fn equal_bytes(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_serialize_state);
    let make = || {
        let instance = running_instance(session)?;
        let state = instance.save()?;
        instance.serialize(state)
    };
    let (one, two) = (make()?, make()?);
    session.require(one.len() == two.len(), || {
        format!("two instances after the same run give {} and {} bytes", one.len(), two.len())
    });
    let places: Vec<_> = one.iter().zip(&two).enumerate().filter(|(_, (a, b))| a != b).map(|(i, _)| i).collect();
    if let Some(first) = places.first() {
        session.violated(format!(
            "two instances after the same run differ in {} of {} bytes, first in byte {first}",
            places.len(),
            one.len()
        ));
    }
    Ok(())
}

fn corrupted(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_serialize_state);
    let instance = running_instance(session)?;
    let state = instance.save()?;
    let good = instance.serialize(state)?;
    let n = good.len();
    let mut cases: Vec<(String, Option<Vec<u8>>)> = vec![("NULL".into(), None), ("no bytes".into(), Some(Vec::new()))];
    cases.extend(
        [1, n / 2, n.saturating_sub(1)]
            .iter()
            .map(|&k| (format!("the first {k} of {n} bytes"), Some(good[..k.min(n)].to_vec()))),
    );
    cases.push(("zeros".into(), Some(vec![0; n])));
    cases.push(("0xff".into(), Some(vec![0xff; n])));
    let mut random = 0x9e37_79b9_u32;
    for _ in 0..60 {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let (byte, bit) = (random as usize / 64 % n.max(1), random % 8);
        let mut changed = good.clone();
        if let Some(b) = changed.get_mut(byte) {
            *b ^= 1 << bit;
        }
        cases.push((format!("bit {bit} of byte {byte} of {n} flipped"), Some(changed)));
    }
    session.cases(cases, |(what, bytes)| {
        let instance = session.stepping()?;
        let size = bytes.as_ref().map_or(n, Vec::len);
        let (status, back) = instance.call_for(&format!("DeserializeFMUState({what})"), |raw| {
            raw.deserialize(instance.handle, bytes.as_deref(), size)
        })?;
        session.require(!status.is_ok(), || format!("DeserializeFMUState of {what} returned {status}"));
        if status.is_ok() && back != SavedState::NULL {
            // If the FMU accepts the bytes, it must keep working.
            let status = instance.call(&format!("SetFMUState({what})"), |raw| raw.set_state(instance.handle, back))?;
            if status.is_ok() {
                let _ = instance.step(session.h())?;
            }
        }
        Ok(())
    })
}

fn wrong_size(session: &Session) -> Result<(), NotDetermined> {
    needs!(session, can_serialize_state);
    let instance = running_instance(session)?;
    let state = instance.save()?;
    let n = instance.serialize(state)?.len();
    session.cases([0, n / 2, n.saturating_sub(1)], |size| {
        let instance = running_instance(session)?;
        let state = instance.save()?;
        let (status, intact) = instance.call_for(&format!("SerializeFMUState(size={size} of {n})"), |raw| {
            raw.serialize(instance.handle, state, size).ok().flatten().map(|(status, _, intact)| (status, intact))
        })?;
        session.require(intact, || format!("SerializeFMUState into {size} of {n} bytes wrote past them"));
        session.require(!status.is_ok(), || format!("SerializeFMUState into {size} of {n} bytes returned {status}"));
        Ok(())
    })
}
