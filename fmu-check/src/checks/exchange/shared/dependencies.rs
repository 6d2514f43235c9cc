//! Dependencies proved by perturbation (FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8).

use crate::checks::life::shared::kept::set_all;
use crate::deviation::differ;
use crate::encoding::show;
use crate::exchange::Importer;
use crate::session::{NotDetermined, Session};
use crate::settable::settable;
use fmu_import::raw::Simple;
use model_description::{BaseType, ModelVariable, Unknown, Variability};
use std::collections::HashSet;

/// New, unchanged instances that confirm a finding.
const CONTROLS: usize = 2;

/// Values to read in each round: knowns times unknowns. With more of both, every n-th known is changed.
const READ: usize = 5_000_000;

/// Reports that the unknown, if it could be read both times, changes with a known that is not among its dependencies.
fn undeclared(session: &Session, unknown: &ModelVariable, known: &ModelVariable, (old, new): (&[u64], &[u64])) {
    if !old.is_empty() && !new.is_empty() {
        let (line, name, other) = (unknown.line, &unknown.name, &known.name);
        let [before, after] = [old, new].map(|bits| show(unknown, session.description.version, bits));
        let change = format!("{name} changes from {before} to {after} with {other}");
        let text = format!("line {line}: {change}, which is not among its dependencies");
        session.value_deviates(unknown, old, new.to_vec(), &text);
    }
}

/// Unmarks the variables whose values in a new instance, in which nothing was changed, differ from the first one's.
fn keep_steady(
    session: &Session,
    moved: bool,
    variables: &[&ModelVariable],
    before: &[Vec<u64>],
    steady: &mut [bool],
) -> Result<(), NotDetermined> {
    let control = session.initializing()?;
    if moved {
        set_all(&control, 3.0)?;
    }
    let found = control.snapshot(variables)?;
    control.free()?;
    steady.iter_mut().zip(found.iter().zip(before)).for_each(|(steady, (found, before))| *steady &= found == before);
    Ok(())
}

/// Changes every known that is not a dependency of an initial unknown and requires that the unknown stays the same.
pub(crate) fn dependencies_hold(session: &Session) -> Result<(), NotDetermined> {
    let numeric: HashSet<&str> = session.numeric().map(|v| v.name.as_str()).collect();
    let unknowns: Vec<_> = session
        .description
        .initial_unknowns
        .iter()
        .filter_map(|u| Some((session.description.referenced(u.reference)?, u.dependencies.as_ref()?)))
        .filter(|(v, _)| numeric.contains(v.name.as_str()) && v.clocks.is_empty())
        .collect();
    if unknowns.is_empty() {
        return session.not_applicable("no dependencies of initial unknowns are given");
    }
    let variables: Vec<_> = unknowns.iter().map(|(v, _)| *v).collect();
    // An unknown that differs without a change shows no dependency.
    let mut steady: Vec<bool> = variables.iter().map(|v| session.is_steady(v)).collect();
    let mut tried = 0;
    let knowns: Vec<_> = session.numeric().filter(|v| settable(v)).collect();
    let stride = knowns.len().div_ceil((READ / variables.len()).max(1));
    // Also where all knowns differ from their start values: a factor may be 0 there.
    for moved in [false, true] {
        let instance = session.initializing()?;
        if moved && set_all(&instance, 3.0).is_err() {
            break;
        }
        let before = instance.snapshot(&variables)?;
        for known in knowns.iter().step_by(stride.max(1)) {
            let Some(values) = session.different_value(known, 1.0) else { continue };
            if session.half_time_used() {
                break;
            }
            let one = session.initializing()?;
            if moved {
                set_all(&one, 3.0)?;
            }
            let start = one.get(known)?;
            let values =
                if moved && start.1 == values { session.different_value(known, 2.0).unwrap_or(values) } else { values };
            if !one.set(known, &values)?.is_ok() {
                continue;
            }
            tried += 1;
            let after = one.snapshot(&variables)?;
            let names = |d: &u32| session.description.referenced(*d).is_some_and(|v| v.name == known.name);
            let changed: Vec<usize> = (0..unknowns.len())
                .filter(|&k| steady[k] && before[k] != after[k] && !unknowns[k].1.iter().any(names))
                .collect();
            let _ = one.free();
            if !changed.is_empty() {
                for _ in 0..CONTROLS {
                    keep_steady(session, moved, &variables, &before, &mut steady)?;
                }
            }
            for k in changed.into_iter().filter(|&k| steady[k]) {
                undeclared(session, unknowns[k].0, known, (&before[k], &after[k]));
            }
        }
    }
    if !steady.contains(&true) {
        return session.not_applicable("every unknown differs between two instances in which nothing was changed");
    }
    session.note(format!("{tried} knowns were changed"));
    let unsteady = variables.iter().zip(&steady).filter(|(_, steady)| !**steady).map(|(v, _)| v.name.as_str());
    let unsteady: Vec<&str> = unsteady.collect();
    if !unsteady.is_empty() {
        session.note(format!("not compared, because they differ without a change: {}", unsteady.join(", ")));
    }
    Ok(())
}

/// Changes every continuous state and input of Model Exchange that is not a dependency of an output or derivative and requires
/// that these stay the same.
pub(crate) fn exchange_dependencies(session: &Session) -> Result<(), NotDetermined> {
    let d = &session.description;
    let given = |u: &'_ Unknown| Some((d.referenced(u.reference)?, u.dependencies.clone()?));
    let numeric: HashSet<&str> = session.numeric().map(|v| v.name.as_str()).collect();
    let unknowns: Vec<(&ModelVariable, Vec<u32>)> = d
        .outputs
        .iter()
        .chain(&d.derivatives)
        .filter_map(given)
        .filter(|(v, _)| numeric.contains(v.name.as_str()) && v.clocks.is_empty())
        .collect();
    if unknowns.is_empty() {
        return session.not_applicable("no dependencies of outputs and derivatives are given");
    }
    let variables: Vec<_> = unknowns.iter().map(|(v, _)| *v).collect();
    let compare = |known: &ModelVariable, before: &[Vec<u64>], after: &[Vec<u64>]| {
        for (((unknown, dependencies), old), new) in unknowns.iter().zip(before).zip(after) {
            // In FMI 2.0 a variable may have several names.
            let same = |v: &ModelVariable| v.value_reference == known.value_reference && v.base == known.base;
            let named = same(unknown) || dependencies.iter().any(|r| d.referenced(*r).is_some_and(same));
            let reals = |bits: &[u64]| bits.iter().map(|b| f64::from_bits(*b)).collect::<Vec<_>>();
            let changed = if unknown.base == BaseType::Float64 { differ(&reals(old), &reals(new)) } else { old != new };
            if !named && changed {
                undeclared(session, unknown, known, (old, new));
            }
        }
    };
    let instance = session.excited()?;
    let mut importer = Importer::start(&instance)?;
    importer.run(50, &mut |_| Ok(()))?;
    if importer.over {
        return Err(NotDetermined("the FMU ends the simulation at once".into()));
    }
    let (x, mut tried, mut at) = (instance.states()?, 0, 0);
    let before = instance.snapshot(&variables)?;
    for state in d.states() {
        let mut moved = x.clone();
        for value in moved.iter_mut().skip(at).take(session.elements(state)) {
            *value += 1e-3 * value.abs().max(state.nominal.unwrap_or(1.0).abs());
        }
        at += session.elements(state);
        if instance.set_states(&moved)?.is_ok() {
            compare(state, &before, &instance.snapshot(&variables)?);
            tried += 1;
        }
        instance.must("SetContinuousStates", instance.set_states(&x)?)?;
    }
    // Discrete inputs change in Event Mode only.
    for discrete in [false, true] {
        if discrete {
            instance.perform(Simple::EnterEventMode)?;
        }
        let before = instance.snapshot(&variables)?;
        for input in session.number_inputs().filter(|v| (v.variability == Variability::Discrete) == discrete) {
            let (Some(values), (_, old)) = (session.different_value(input, 9.0), instance.get(input)?) else {
                continue;
            };
            if instance.set(input, &values)?.is_ok() {
                compare(input, &before, &instance.snapshot(&variables)?);
                tried += 1;
            }
            instance.must("Set", instance.set(input, &old)?)?;
        }
    }
    session.note(format!("{tried} states and inputs were changed"));
    Ok(())
}
