//! Structural parameters, and the array sizes that they determine (FMI 3.0.2, 2.3.6, 2.3.7 and 2.4.7.2).

use crate::check::{Check, Levels, Run};
use crate::encoding::{bits, show};
use crate::instance::Instance;
use crate::level::Level;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use fmu_import::Status;
use fmu_import::raw::{Buffer, Simple};
use model_description::{BaseType, Causality, CoSimulation, Dimension, ModelVariable, Variability};

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "C04", clause: "3.0.2, 2.3.6", levels: Levels(None, Some(Level::Must)), run: Run::Probe(resized),
        requirement: "After Configuration Mode, arrays have the sizes set there, and the simulation runs.",
        tried: "Changes each structural parameter, reads the arrays that it sizes, and makes 3 steps.",
        fix: "Allocate arrays anew in ExitConfigurationMode, and loop up to their current sizes." },
    Check { id: "C05", clause: "3.0.2, 2.2.7.2", levels: Levels(None, Some(Level::Should)), run: Run::Probe(counts),
        requirement: "The number of values passed for a resized array is checked against its current size, and nothing is written past the values.",
        tried: "Reads and sets resized arrays with one value more, one less, and as many as before.",
        fix: "Compare nValues with the product of the current sizes before copying." },
    Check { id: "C06", clause: "3.0.2, 2.3.6", levels: Levels(None, Some(Level::Should)), run: Run::Probe(closed),
        requirement: "In Configuration Mode, only structural parameters can be set, and no step is made.",
        tried: "Sets an input and a parameter in Configuration Mode, and calls DoStep.", fix: "Compare causality and state before assigning." },
    Check { id: "C07", clause: "hardening", levels: Levels(None, Some(Level::Hard)), run: Run::Probe(bounds),
        requirement: "A structural parameter outside min and max is refused, at the latest when Configuration Mode ends.",
        tried: "Sets each to values outside the limits, up to the maximum of its type.", fix: "Compare with min and max before anything is allocated." },
    Check { id: "C08", clause: "3.0.2, 2.3.7", levels: Levels(None, Some(Level::Must)), run: Run::Probe(reconfigured),
        requirement: "A tunable structural parameter can be changed in Reconfiguration Mode, and the simulation continues.",
        tried: "Steps, changes each tunable one, reads the arrays that it sizes, and steps; tries a fixed one (should).",
        fix: "Allow EnterConfigurationMode in Step Mode, and compare the variability of what is set." },
    Check { id: "C09", clause: "3.0.2, 2.2.7.4", levels: Levels(None, Some(Level::Must)), run: Run::Probe(saved),
        requirement: "A saved state includes the array sizes.",
        tried: "Saves, changes each structural parameter, restores, and reads it and the arrays that it sizes.",
        fix: "Save structural parameters and arrays with their lengths." },
    Check { id: "C10", clause: "3.0.2, 2.3.1", levels: Levels(None, Some(Level::Must)), run: Run::Probe(reset),
        requirement: "Reset restores the initial array sizes.",
        tried: "Changes each structural parameter, resets, and reads it and the arrays that it sizes.",
        fix: "Let Reset set structural parameters to their start values, and allocate arrays anew." },
];

/// A structural parameter, and its new value.
#[derive(Clone, Copy)]
struct Size<'a> {
    session: &'a Session,
    v: &'a ModelVariable,
    start: u64,
    other: u64,
}

/// The structural parameters that have two values.
fn sizes(session: &Session) -> Vec<Size<'_>> {
    let structural = session.description.variables.iter().filter(|v| v.causality == Causality::StructuralParameter);
    structural
        .filter_map(|v| {
            let start = v.start.as_deref()?.trim().parse().ok()?;
            Some(Size { session, v, start, other: *session.different_value(v, 1.0)?.first()? })
        })
        .collect()
}

impl<'a> Size<'a> {
    /// The numeric arrays that it sizes, each with its number of elements if this parameter has the value `n`.
    fn arrays(&self, n: u64) -> Vec<(&'a ModelVariable, usize)> {
        let (reference, n) = (self.v.value_reference, usize::try_from(n).ok());
        let sized = self.session.numeric().filter(|v| v.clocks.is_empty());
        let sized = sized.filter(|v| v.dimensions.contains(&Dimension::Variable(reference)));
        let shape = |v: &ModelVariable| {
            let shape = self.session.description.shape_with(v, |other| n.filter(|_| other == reference));
            shape.unwrap_or_default().iter().product()
        };
        sized.map(|v| (v, shape(v))).collect()
    }

    /// Sets it in Configuration Mode or Reconfiguration Mode; `false` if the FMU refuses this size when it leaves the mode.
    fn change(&self, instance: &Instance<'_>) -> Result<bool, NotDetermined> {
        instance.perform(Simple::EnterConfigurationMode)?;
        let name = format!("Set({})", self.v.name);
        instance.must(&name, instance.set(self.v, &[self.other])?)?;
        let left = instance.simple(Simple::ExitConfigurationMode)?;
        if !left.is_ok() {
            self.session.note(format!("{} = {} is refused: {left}", self.v.name, self.other));
        }
        Ok(left.is_ok())
    }

    /// Requires that it has this value and that its arrays have the corresponding number of elements.
    fn require(&self, instance: &Instance<'_>, n: u64, when: &str) -> Result<(), NotDetermined> {
        let (status, found) = instance.get(self.v)?;
        self.session.require(status.is_ok() && found == [n], || {
            let found = show(self.v, self.session.description.version, &found);
            format!("{when}, {} is {found} instead of {n} ({status})", self.v.name)
        });
        for (array, count) in self.arrays(n) {
            let (status, intact) = get(instance, array, count)?;
            self.session.require(status.is_ok() && intact, || {
                let (name, past) = (&array.name, if intact { "" } else { " and wrote past them" });
                format!("{when}, with {} = {n}, Get({name}) of {count} values returned {status}{past}", self.v.name)
            });
        }
        Ok(())
    }
}

/// Reads this number of values; also returns whether the memory behind them is intact.
fn get(instance: &Instance<'_>, v: &ModelVariable, count: usize) -> Result<(Status, bool), NotDetermined> {
    let mut buffer = Buffer::room(v.base, instance.session.description.version, count);
    let status = instance.call(&format!("Get({}, nValues={count})", v.name), |raw| {
        raw.get(instance.handle, v.base, Some(&[v.value_reference]), 1, Some(&mut buffer), count)
    })?;
    Ok((status, buffer.intact()))
}

/// The result of a call that the standard requires to succeed; a failure is a violation.
fn succeeds<T>(session: &Session, what: &str, outcome: Result<T, NotDetermined>) -> Option<T> {
    outcome.map_err(|why| session.failed(what, why)).ok()
}

/// A case for each structural parameter that has two values.
fn each(session: &Session, case: impl Fn(&Size<'_>) -> Result<(), NotDetermined>) -> Result<(), NotDetermined> {
    let sizes = sizes(session);
    if sizes.is_empty() {
        return session.not_applicable("there is no structural parameter with two values");
    }
    session.cases(sizes, |size| case(&size))
}

fn resized(session: &Session) -> Result<(), NotDetermined> {
    each(session, |size| {
        let instance = session.fresh()?;
        let changed = size.change(&instance);
        let Some(true) = succeeds(session, "Configuration Mode", changed) else { return Ok(()) };
        size.require(&instance, size.other, "after Configuration Mode")?;
        let run = instance.initialize().and_then(|()| instance.steps(3, session.h()));
        if succeeds(session, &format!("with {} = {}", size.v.name, size.other), run).is_some() {
            size.require(&instance, size.other, "after 3 steps")?;
        }
        Ok(())
    })
}

fn counts(session: &Session) -> Result<(), NotDetermined> {
    each(session, |size| {
        let before = size.arrays(size.start);
        for ((array, count), (_, before)) in size.arrays(size.other).into_iter().zip(before).take(4) {
            let mut wrong = vec![count + 1, count.saturating_sub(1), before];
            wrong.retain(|n| *n != count);
            wrong.dedup();
            for n in wrong {
                // An Error ends the instance.
                let instance = session.fresh()?;
                if !size.change(&instance)? {
                    return Ok(());
                }
                let (status, intact) = get(&instance, array, n)?;
                session.require(status == Status::ERROR && intact, || {
                    let past = if intact { "" } else { ", and wrote past them" };
                    format!("Get({}) of {n} values instead of {count} returned {status}{past}", array.name)
                });
                if settable(array) {
                    let instance = session.fresh()?;
                    let _ = size.change(&instance)?;
                    let status = instance.set(array, &vec![bits(array.base, 0.0); n])?;
                    session.require(status == Status::ERROR, || {
                        format!("Set({}) of {n} values instead of {count} returned {status}", array.name)
                    });
                }
            }
        }
        Ok(())
    })
}

fn closed(session: &Session) -> Result<(), NotDetermined> {
    if sizes(session).is_empty() {
        return session.not_applicable("there is no structural parameter with two values");
    }
    let configuring = || {
        let instance = session.fresh()?;
        instance.perform(Simple::EnterConfigurationMode).map(|()| instance)
    };
    for causality in [Causality::Input, Causality::Parameter] {
        let found = session.numeric().find(|v| v.causality == causality && settable(v));
        let Some((v, values)) = found.and_then(|v| Some((v, session.different_value(v, 1.0)?))) else { continue };
        session.case(|| {
            let status = configuring()?.set(v, &values)?;
            session.require(status == Status::ERROR, || {
                format!("Set({}) in Configuration Mode returned {status}", v.name)
            });
            Ok(())
        });
    }
    session.case(|| {
        let instance = configuring()?;
        let status = instance.step(session.h())?;
        session.require(status == Status::ERROR, || format!("DoStep in Configuration Mode returned {status}"));
        Ok(())
    });
    Ok(())
}

fn bounds(session: &Session) -> Result<(), NotDetermined> {
    let maximum = |base| match base {
        BaseType::UInt64 => u64::MAX,
        BaseType::UInt32 => u32::MAX.into(),
        _ => i32::MAX.unsigned_abs().into(),
    };
    each(session, |size| {
        let (min, max) = (size.v.min.unwrap_or(0.0), size.v.max.unwrap_or(f64::INFINITY));
        let mut values = Vec::new();
        if min >= 1.0 {
            values.push(bits(size.v.base, min - 1.0));
        }
        if max < 1e9 {
            values.extend([bits(size.v.base, max + 1.0), maximum(size.v.base)]);
        }
        for value in values {
            let instance = session.fresh()?;
            instance.perform(Simple::EnterConfigurationMode)?;
            let set = instance.set(size.v, &[value])?;
            let left = if set.is_ok() { instance.simple(Simple::ExitConfigurationMode)? } else { set };
            session.require(!left.is_ok(), || format!("{} = {value}, outside min and max, was accepted", size.v.name));
        }
        Ok(())
    })
}

fn reconfigured(session: &Session) -> Result<(), NotDetermined> {
    let sizes = sizes(session);
    let tunable = |size: &&Size<'_>| size.v.variability == Variability::Tunable;
    if !sizes.iter().any(|size| tunable(&size)) {
        return session.not_applicable("there is no tunable structural parameter with two values");
    }
    session.cases(&sizes, |size| {
        let instance = session.stepping()?;
        instance.steps(2, session.h())?;
        if !tunable(&size) {
            instance.perform(Simple::EnterConfigurationMode)?;
            let status = instance.set(size.v, &[size.other])?;
            if status.is_ok() {
                let text = format!("Set({}), a fixed one, in Reconfiguration Mode returned {status}", size.v.name);
                session.lesser(Level::Should, text);
            }
            return Ok(());
        }
        let Some(true) = succeeds(session, "Reconfiguration Mode", size.change(&instance)) else { return Ok(()) };
        size.require(&instance, size.other, "after Reconfiguration Mode")?;
        succeeds(session, "after Reconfiguration Mode", instance.steps(3, session.h()));
        Ok(())
    })
}

fn saved(session: &Session) -> Result<(), NotDetermined> {
    if !session.description.co_simulation.as_ref().is_some_and(CoSimulation::can_get_and_set_state) {
        return session.not_applicable("can_get_and_set_state is false");
    }
    each(session, |size| {
        let instance = session.fresh()?;
        let state = instance.save()?;
        if size.change(&instance)? {
            instance.restore(state, session.start())?;
            size.require(&instance, size.start, "in a state from before")?;
        }
        Ok(())
    })
}

fn reset(session: &Session) -> Result<(), NotDetermined> {
    each(session, |size| {
        let instance = session.fresh()?;
        if size.change(&instance)? {
            instance.perform(Simple::Reset)?;
            size.require(&instance, size.start, "after Reset")?;
        }
        Ok(())
    })
}
