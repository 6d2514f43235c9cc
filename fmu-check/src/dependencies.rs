//! Dependencies proved by perturbation (FMI 2.0.5, 2.2.8; FMI 3.0.2, 2.4.8).

use super::bench::{Bench, Blocked, fine, settable};

/// Perturbs every known that an initial unknown does not name, and looks whether the unknown moves.
pub(super) fn dependencies_hold(bench: &Bench) -> Result<(), Blocked> {
    let unknowns: Vec<_> = bench
        .md
        .initial_unknowns
        .iter()
        .filter_map(|u| Some((bench.md.referenced(u.reference)?, u.dependencies.as_ref()?)))
        .filter(|(v, _)| bench.numeric().any(|n| n.name == v.name) && v.clocks.is_empty())
        .collect();
    if unknowns.is_empty() {
        return bench.not_applicable("no dependencies of initial unknowns are given");
    }
    let it = bench.initialising()?;
    let variables: Vec<_> = unknowns.iter().map(|(v, _)| *v).collect();
    let before = it.snapshot(&variables)?;
    let mut tried = 0;
    for known in bench.numeric().filter(|v| settable(v)) {
        let Some(values) = bench.other_value(known, 1.0) else { continue };
        if bench.late() {
            break;
        }
        let one = bench.initialising()?;
        if !fine(one.set(known, &values)?) {
            continue;
        }
        tried += 1;
        let after = one.snapshot(&variables)?;
        for (((unknown, dependencies), old), new) in unknowns.iter().zip(&before).zip(&after) {
            let named = dependencies.iter().any(|d| bench.md.referenced(*d).is_some_and(|v| v.name == known.name));
            bench.require(named || old == new || old.is_empty() || new.is_empty(), || {
                format!(
                    "line {}: {} moves with {}, which its dependencies do not name",
                    unknown.line, unknown.name, known.name
                )
            });
        }
        let _ = one.free();
    }
    bench.note(format!("{tried} knowns were moved"));
    Ok(())
}
