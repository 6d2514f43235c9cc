//! A warning when a run begins with inputs at 0 whose start values differ: some importers feed 0 or false to an unconnected
//! input.

use crate::instance::Instance;
use crate::message;
use fmu_core::log::WARNING;
use fmu_core::{Block, Causality, Exported, Kind, Model, Need, Slot};

impl<E: Exported> Instance<E> {
    /// Called when the first step, or continuous time, begins: names the inputs at 0 or false that the model reads and whose
    /// start values differ.
    #[cold]
    #[inline(never)]
    pub(crate) fn warn_of_unfed(&mut self) {
        self.begun = true;
        if !self.log.hears_model(&[]) {
            return;
        }
        let Some(mut fresh) = self.origin.starts(&E::CAN) else { return };
        let block = &mut self.current.block;
        let mut unfed = Vec::new();
        for index in E::Model::TABLE.indices() {
            let start = match E::Model::TABLE.entry(&mut fresh, index) {
                Some((meta, slot)) if meta.causality == Causality::Input && !is_zero(&slot) => slot.to_string(),
                _ => continue,
            };
            if let Some((meta, slot)) = E::Model::TABLE.entry(block, index)
                && is_zero(&slot)
            {
                let value = slot.to_string();
                if is_read::<E::Model>(block, meta.need) {
                    unfed.push(format!("{} = {value} (start value {start})", message::sized_name(block, index)));
                }
            }
        }
        if !unfed.is_empty() {
            let (name, at, unfed) = (&self.name, self.current.end, unfed.join(", "));
            let why = "some importers feed 0 to an input that is not connected";
            self.log.said(WARNING, &[], &format!("{name}: at {at} s: the run begins with {unfed}; {why}"));
        }
    }
}

fn is_zero(slot: &Slot<'_>) -> bool {
    match slot {
        Slot::Real(x) => **x == 0.0,
        Slot::Float32(x) => **x == 0.0,
        Slot::Boolean(x) => !**x,
        Slot::Integer(x) => x.get() == 0,
        _ => false,
    }
}

/// Whether the model reads an input with this need, at the present parameters.
fn is_read<M: Model>(block: &mut Block<M>, need: Need<'_>) -> bool {
    let Need::With { parameter, value } = need else { return true };
    let named = |index: &usize| {
        M::TABLE.locate(*index).is_some_and(|(name, ..)| {
            name.strip_suffix(parameter).is_some_and(|prefix| prefix.is_empty() || prefix.ends_with('.'))
        })
    };
    let found = M::TABLE.indices().find(named).and_then(|index| M::TABLE.entry(block, index));
    found.is_none_or(|(meta, slot)| match (meta.kind, &slot) {
        (Kind::Enumeration(of), Slot::Enumeration(x)) => {
            of.items.iter().any(|item| item.value == x.get() && item.name == value)
        }
        _ => slot.to_string() == value,
    })
}
