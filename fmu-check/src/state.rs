//! Saved states (FMI 2.0.5, 2.1.8; FMI 3.0.2, 2.2.6.4).

use super::bench::{Bench, Blocked, fine};
use super::it::It;
use super::lifecycle::{State, difference, in_state};
use super::{Check, Levels, Run};
use fmu_import::Status;
use fmu_import::raw::SavedState;
use model_description::{CoSimulation, ModelVariable};

const STATE: &str = "2.0.5, 2.1.8; 3.0.2, 2.2.6.4";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "F01a", requirement: "A state is got, set as often as wanted, and freed in every state of the life cycle; free gives back NULL.", clause: STATE, levels: Levels::MUST, run: Run::Probe(everywhere) },
    Check { id: "F01b", requirement: "Getting a state into one that was got before overwrites it, and freeing NULL is ignored.", clause: STATE, levels: Levels::MUST, run: Run::Probe(reuse) },
    Check { id: "F02a", requirement: "A run from a restored state equals the run from when it was saved, bit for bit.", clause: STATE, levels: Levels::MUST, run: Run::Probe(complete) },
    Check { id: "F02b", requirement: "A restored state has all variables as they were: parameters, inputs, outputs.", clause: STATE, levels: Levels::MUST, run: Run::Probe(variables) },
    Check { id: "F02c", requirement: "After an Error a state that was saved before leads back.", clause: "2.0.5, 4.2.4; 3.0.2, 2.2.3", levels: Levels::MUST, run: Run::Probe(rescue) },
    Check { id: "F03a", requirement: "A state can be set into another instance of the FMU.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(across) },
    Check { id: "F03b", requirement: "A state that is NULL, and a place for one that is NULL, give Error.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(none) },
    Check { id: "F04a", requirement: "A serialised state comes back in another instance: the run from it equals, bit for bit.", clause: STATE, levels: Levels::MUST, run: Run::Probe(serialised) },
    Check { id: "F04b", requirement: "Equal states give equal bytes: no addresses, nothing that is not initialised.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(bytes) },
    Check { id: "F04c", requirement: "Bytes that are no state (none, cut short, changed) give Error, and never take the process down.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(corrupted) },
    Check { id: "F04d", requirement: "A buffer of another size than asked for gives Error, and nothing is written behind it.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(sizes) },
];

fn can(bench: &Bench, flag: fn(&CoSimulation) -> bool) -> bool {
    bench.md.co_simulation.as_ref().is_some_and(flag)
}

/// Ends a probe of states where there are none.
macro_rules! needs {
    ($bench:ident, $flag:ident) => {
        if !can($bench, CoSimulation::$flag) {
            return $bench.not_applicable(concat!(stringify!($flag), " is false"));
        }
    };
}

fn everywhere(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    for state in [State::Instantiated, State::Initialisation, State::Step, State::Terminated] {
        bench.case(|| {
            let it = in_state(bench, state)?;
            let mut saved = SavedState::NULL;
            let got = it.call("GetFMUState", |raw| raw.get_state(it.handle, Some(&mut saved)))?;
            bench
                .require(fine(got) && saved != SavedState::NULL, || format!("GetFMUState in {state:?} returned {got}"));
            if !fine(got) {
                return Ok(());
            }
            for _ in 0..2 {
                let status = it.call("SetFMUState", |raw| raw.set_state(it.handle, saved))?;
                bench.require(fine(status), || format!("SetFMUState in {state:?} returned {status}"));
            }
            let status = it.call("FreeFMUState", |raw| raw.free_state(it.handle, Some(&mut saved)))?;
            bench.require(fine(status), || format!("FreeFMUState in {state:?} returned {status}"));
            bench
                .require(saved == SavedState::NULL, || format!("FreeFMUState in {state:?} left the pointer as it was"));
            Ok(())
        });
    }
    Ok(())
}

fn reuse(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    bench.case(|| {
        let (it, h) = (bench.stepping()?, bench.h());
        let mut state = it.save()?;
        it.steps(5, h)?;
        let status = it.call("GetFMUState(a state got before)", |raw| raw.get_state(it.handle, Some(&mut state)))?;
        bench.require(fine(status), || format!("GetFMUState into a state got before returned {status}"));
        let time = it.time.get();
        let first = it.run(10, h)?;
        it.restore(state, time)?;
        rerun(&it, &first, "restored from a state that was overwritten");
        Ok(())
    });
    bench.case(|| {
        let it = bench.stepping()?;
        let mut state = SavedState::NULL;
        let status = it.call("FreeFMUState(&NULL)", |raw| raw.free_state(it.handle, Some(&mut state)))?;
        bench.require(fine(status), || format!("FreeFMUState of NULL returned {status}"));
        Ok(())
    });
    Ok(())
}

/// An instance under way, with inputs moved.
fn under_way(bench: &Bench) -> Result<It<'_>, Blocked> {
    let it = bench.stepping()?;
    for k in 0..12 {
        it.excite(k)?;
        it.steps(1, bench.h())?;
    }
    Ok(it)
}

/// Runs again from where a state was restored; a step that fails now, and did not before, is a difference.
fn rerun(it: &It<'_>, first: &[Vec<Vec<u64>>], what: &str) {
    match it.run(first.len(), it.bench.h()) {
        Ok(second) => tell(it.bench, first, &second, what),
        Err(Blocked(why)) => it.bench.violated(format!("{what}: {why}")),
    }
}

fn tell(bench: &Bench, first: &[Vec<Vec<u64>>], second: &[Vec<Vec<u64>>], what: &str) {
    if let Some((k, i)) = difference(first, second) {
        let name = bench.watched().get(i).map_or("an output", |v| v.name.as_str()).to_owned();
        bench.violated(format!("{what}: {name} differs after {} steps", k + 1));
    }
}

fn complete(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    let (it, h) = (under_way(bench)?, bench.h());
    let (state, time) = (it.save()?, it.time.get());
    let first = it.run(50, h)?;
    for again in 1..=2 {
        it.restore(state, time)?;
        rerun(&it, &first, &format!("restored {again} times"));
        // A state must also undo what a longer run and other inputs did.
        it.excite(4)?;
        it.steps(7, h)?;
    }
    Ok(())
}

fn variables(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    let (it, h) = (under_way(bench)?, bench.h());
    let all: Vec<&ModelVariable> = bench.numeric().filter(|v| v.clocks.is_empty()).collect();
    let (state, time) = (it.save()?, it.time.get());
    let before = it.snapshot(&all)?;
    it.excite(1)?;
    for v in all.iter().filter(|v| v.variability == model_description::Variability::Tunable && v.base.is_float()) {
        if let Some(values) = bench.other_value(v, 1.0) {
            let _ = it.set(v, &values)?;
        }
    }
    it.steps(5, h)?;
    it.restore(state, time)?;
    for (v, (old, new)) in all.iter().zip(before.iter().zip(it.snapshot(&all)?)) {
        bench.require(*old == new, || format!("{} is not what it was when the state was saved", v.name));
    }
    Ok(())
}

fn rescue(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    let (it, h) = (under_way(bench)?, bench.h());
    let (state, time) = (it.save()?, it.time.get());
    let first = it.run(10, h)?;
    let how = it.provoke()?;
    let status = it.call("SetFMUState", |raw| raw.set_state(it.handle, state))?;
    if !fine(status) {
        bench.violated(format!("after {how} had returned Error, SetFMUState returned {status}"));
        return Ok(());
    }
    it.time.set(time);
    rerun(&it, &first, "restored after an Error");
    Ok(())
}

fn across(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    let (it, h) = (under_way(bench)?, bench.h());
    let (state, time) = (it.save()?, it.time.get());
    let first = it.run(20, h)?;
    let other = bench.stepping()?;
    let status = other.call("SetFMUState(of another instance)", |raw| raw.set_state(other.handle, state))?;
    if !fine(status) {
        bench.violated(format!("SetFMUState with the state of another instance returned {status}"));
        return Ok(());
    }
    other.time.set(time);
    rerun(&other, &first, "set into another instance");
    Ok(())
}

/// A call that ought to be refused.
type Call = fn(&It<'_>) -> Result<Status, Blocked>;

fn none(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_get_and_set_state);
    let cases: [(&str, Call); 2] = [
        ("SetFMUState(NULL)", |it| it.call("SetFMUState(NULL)", |raw| raw.set_state(it.handle, SavedState::NULL))),
        ("GetFMUState(NULL)", |it| it.call("GetFMUState(NULL)", |raw| raw.get_state(it.handle, None))),
    ];
    for (what, call) in cases {
        bench.case(|| {
            let status = call(&bench.stepping()?)?;
            bench.require(status == Status::ERROR, || format!("{what} returned {status}"));
            Ok(())
        });
    }
    Ok(())
}

fn serialised(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_serialize_state);
    let (it, h) = (under_way(bench)?, bench.h());
    let (state, time) = (it.save()?, it.time.get());
    let bytes = it.serialize(state)?;
    let first = it.run(30, h)?;
    let other = bench.stepping()?;
    let mut back = SavedState::NULL;
    let status = other.call("DeserializeFMUState", |raw| {
        let (status, state) = raw.deserialize(other.handle, Some(&bytes), bytes.len())?;
        back = state;
        Some(status)
    })?;
    if !fine(status) {
        bench.violated(format!("DeserializeFMUState of {} bytes just serialised returned {status}", bytes.len()));
        return Ok(());
    }
    other.restore(back, time)?;
    rerun(&other, &first, "deserialised in another instance");
    bench.note(format!("{} bytes", bytes.len()));
    Ok(())
}

fn bytes(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_serialize_state);
    let make = || {
        let it = under_way(bench)?;
        let state = it.save()?;
        it.serialize(state)
    };
    let (one, two) = (make()?, make()?);
    bench.require(one.len() == two.len(), || format!("{} and {} bytes", one.len(), two.len()));
    let places: Vec<_> = one.iter().zip(&two).enumerate().filter(|(_, (a, b))| a != b).map(|(i, _)| i).collect();
    if let Some(first) = places.first() {
        bench.violated(format!(
            "two instances with the same life differ in {} of {} bytes, first in byte {first}",
            places.len(),
            one.len()
        ));
    }
    Ok(())
}

fn corrupted(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_serialize_state);
    let it = under_way(bench)?;
    let state = it.save()?;
    let good = it.serialize(state)?;
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
        cases.push((format!("bit {bit} of byte {byte} of {n} changed"), Some(changed)));
    }
    for (what, bytes) in cases {
        bench.case(|| {
            let it = bench.stepping()?;
            let mut back = SavedState::NULL;
            let size = bytes.as_ref().map_or(n, Vec::len);
            let status = it.call(&format!("DeserializeFMUState({what})"), |raw| {
                let (status, state) = raw.deserialize(it.handle, bytes.as_deref(), size)?;
                back = state;
                Some(status)
            })?;
            bench.require(!fine(status), || format!("DeserializeFMUState of {what} returned {status}"));
            if fine(status) && back != SavedState::NULL {
                // What the FMU takes, it must be able to live with.
                let status = it.call(&format!("SetFMUState({what})"), |raw| raw.set_state(it.handle, back))?;
                if fine(status) {
                    let _ = it.step(bench.h())?;
                }
            }
            Ok(())
        });
    }
    Ok(())
}

fn sizes(bench: &Bench) -> Result<(), Blocked> {
    needs!(bench, can_serialize_state);
    let it = under_way(bench)?;
    let state = it.save()?;
    let n = it.serialize(state)?.len();
    for size in [0, n / 2, n.saturating_sub(1)] {
        bench.case(|| {
            let it = under_way(bench)?;
            let state = it.save()?;
            let mut intact = true;
            let status = it.call(&format!("SerializeFMUState(size={size} of {n})"), |raw| {
                let (status, _, whole) = raw.serialize(it.handle, state, size)?;
                intact = whole;
                Some(status)
            })?;
            bench.require(intact, || format!("SerializeFMUState into {size} of {n} bytes wrote behind them"));
            bench.require(!fine(status), || format!("SerializeFMUState into {size} of {n} bytes returned {status}"));
            Ok(())
        });
    }
    Ok(())
}
