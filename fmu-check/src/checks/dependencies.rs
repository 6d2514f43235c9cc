//! Dependencies proved by perturbation (FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8).

use crate::session::{NotDetermined, Session, settable};

/// Changes every known that is not a dependency of an initial unknown and requires that the unknown stays the same.
pub(super) fn dependencies_hold(session: &Session) -> Result<(), NotDetermined> {
    let unknowns: Vec<_> = session
        .description
        .initial_unknowns
        .iter()
        .filter_map(|u| Some((session.description.referenced(u.reference)?, u.dependencies.as_ref()?)))
        .filter(|(v, _)| session.numeric().any(|n| n.name == v.name) && v.clocks.is_empty())
        .collect();
    if unknowns.is_empty() {
        return session.not_applicable("no dependencies of initial unknowns are given");
    }
    let instance = session.initializing()?;
    let variables: Vec<_> = unknowns.iter().map(|(v, _)| *v).collect();
    let before = instance.snapshot(&variables)?;
    let mut tried = 0;
    for known in session.numeric().filter(|v| settable(v)) {
        let Some(values) = session.different_value(known, 1.0) else { continue };
        if session.half_time_used() {
            break;
        }
        let one = session.initializing()?;
        if !one.set(known, &values)?.is_ok() {
            continue;
        }
        tried += 1;
        let after = one.snapshot(&variables)?;
        for (((unknown, dependencies), old), new) in unknowns.iter().zip(&before).zip(&after) {
            let named =
                dependencies.iter().any(|d| session.description.referenced(*d).is_some_and(|v| v.name == known.name));
            session.require(named || old == new || old.is_empty() || new.is_empty(), || {
                format!(
                    "line {}: {} changes with {}, which is not among its dependencies",
                    unknown.line, unknown.name, known.name
                )
            });
        }
        let _ = one.free();
    }
    session.note(format!("{tried} knowns were changed"));
    Ok(())
}
