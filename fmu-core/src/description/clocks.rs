//! The clocks that variables are on, and what follows from them.

use super::{Variable, VariableKind};
use crate::Fault;
use crate::kinds::Kinds;
use crate::model::Model;
use crate::variable::{Causality, Variability};

/// The clocks of every variable. A clocked variable has no value before its first tick, and between events it depends on the
/// ticks.
pub(super) fn put_on_clocks<M: Model>(variables: &mut [Variable], feedthrough: bool) -> Result<(), Fault> {
    if const { !M::TABLE.kinds().meets(Kinds::CLOCK) } {
        return Ok(());
    }
    let clocks: Vec<(String, u32, Causality)> = variables
        .iter()
        .filter(|v| matches!(v.kind, VariableKind::Clock(_)))
        .map(|v| (v.name.clone(), v.value_reference, v.causality))
        .collect();
    for v in variables.iter_mut() {
        let Some(index) = v.value_reference.checked_sub(1) else { continue };
        for name in M::TABLE.clocks_of(index as usize).split_whitespace() {
            let found = clocks.iter().find(|(clock, ..)| clock == name);
            let none = || Fault::new(format!("{} is on the clock {name}, which does not exist", v.name));
            v.clocks.push(found.ok_or_else(none)?.1);
        }
        if !v.clocks.is_empty() && v.variability == Variability::Continuous {
            v.variability = Variability::Discrete;
        }
    }
    let inputs: Vec<(u32, Vec<u32>)> = variables
        .iter()
        .filter(|v| v.causality == Causality::Input && !v.clocks.is_empty() && feedthrough)
        .filter(|v| !matches!(v.kind, VariableKind::Clock(_)))
        .map(|v| (v.value_reference, v.clocks.clone()))
        .collect();
    let ticked = || clocks.iter().filter(|(.., causality)| *causality == Causality::Input).map(|(_, of, _)| *of);
    for v in variables.iter_mut() {
        let clock = matches!(v.kind, VariableKind::Clock(_));
        if !clock && v.clocks.is_empty() {
            continue;
        }
        v.initial_dependencies = None;
        if v.causality == Causality::Output {
            let mut on = if v.clocks.is_empty() { ticked().collect() } else { v.clocks.clone() };
            let read = inputs.iter().filter(|(_, clocks)| clocks.iter().any(|clock| on.contains(clock)));
            let read: Vec<u32> = read.map(|(input, _)| *input).collect();
            on.extend(read);
            v.dependencies = Some(on);
        }
    }
    Ok(())
}
