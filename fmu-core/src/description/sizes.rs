//! Arrays whose sizes the importer chooses, and arrays of states.

use super::{ModelExchange, Value, Variable};
use crate::{Block, Capabilities, Causality, Fault, Model};

/// The interface for Model Exchange; `states` are the rows of the scalar states.
pub(super) fn exchange<M: Model>(can: &Capabilities<M>, states: &[usize]) -> Option<ModelExchange> {
    let after = |i: usize| can.reference(M::TABLE.len() + i);
    let mut number = 0;
    let mut firsts = Vec::new();
    for state in can.states() {
        firsts.push(number);
        number += state.most();
    }
    can.model_exchange().then(|| ModelExchange {
        states: firsts.iter().map(|&first| can.reference(states[first])).collect(),
        derivatives: firsts.iter().map(|&first| after(first)).collect(),
        indicators: (0..can.indicators().len()).map(|i| after(number + i)).collect(),
        event_mode: can.event_mode(),
        completed_steps: can.complete.is_some(),
        scheduled: can.scheduled,
        only: can.exchange_only,
    })
}

/// Checks that every array has the length given by its sizes, from the start on.
pub(super) fn check_sizes<M: Model>(can: &Capabilities<M>, fresh: &Block<M>) -> Result<(), Fault> {
    let Some(saving) = can.saved.as_ref().filter(|_| M::TABLE.has_sizes()) else { return Ok(()) };
    let mut started = saving.block(fresh);
    started.initialize();
    M::TABLE.check_sizes(&mut started)
}

/// Sets the extents of every array with structural sizes at the start, and of every derivative, which equal its state's.
pub(super) fn size<M: Model>(can: &Capabilities<M>, variables: &mut [Variable]) -> Result<(), Fault> {
    if !M::TABLE.has_sizes() && !can.has_arrays() {
        return Ok(());
    }
    let mut sizes: Vec<(String, u32, usize)> = Vec::new();
    for v in variables.iter().filter(|v| v.causality == Causality::StructuralParameter) {
        match v.start.as_deref() {
            Some([Value::Integer(n @ 1..)]) => {
                sizes.push((v.name.clone(), v.value_reference, usize::try_from(*n).unwrap_or(usize::MAX)));
            }
            _ => return Err(Fault::new(format!("{} must be greater than 0 at the start", v.name))),
        }
    }
    for v in variables.iter_mut().filter(|v| v.derivative.is_none()) {
        let Some((_, meta, _)) = M::TABLE.locate(can.index(v.value_reference)) else { continue };
        let prefix = v.name.strip_suffix(meta.name).unwrap_or_default();
        let named = |name: &&str| sizes.iter().find(|(full, ..)| full.strip_prefix(prefix) == Some(name));
        let found: Vec<_> = meta.sized.iter().filter_map(named).collect();
        if !found.is_empty() {
            v.sized = found.iter().map(|(_, reference, _)| *reference).collect();
            v.shape = found.iter().map(|(.., n)| *n).collect();
        }
    }
    for i in 0..variables.len() {
        let state = variables[i].derivative.and_then(|of| variables.iter().find(|v| v.value_reference == of));
        if let Some((shape, sized)) = state.map(|state| (state.shape.clone(), state.sized.clone())) {
            (variables[i].shape, variables[i].sized) = (shape, sized);
        }
    }
    Ok(())
}
