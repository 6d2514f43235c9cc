//! The tuned values in the native models: the closed loop as the packed FMUs run it.

use super::setting::{Setting, Tuned, Value};
use drive::Pair;
use fmu_core::{Block, Kind, Model, Slot};

impl Tuned {
    /// Plant and controller with these values, at rest.
    ///
    /// # Panics
    /// If a value has no variable; [`check`](super::check) refuses such values first.
    pub fn pair(&self) -> Pair {
        Pair { plant: block(&self.plant), controller: block(&self.controller), ..Pair::default() }
    }

    /// A real value of the controller, if it is set.
    pub fn real(&self, name: &str) -> Option<f64> {
        self.controller.iter().find(|setting| setting.name == name).and_then(|setting| match setting.value {
            Value::Real(x) => Some(x),
            _ => None,
        })
    }

    /// These values, with one value of the controller replaced.
    pub fn with(&self, name: &'static str, value: Value) -> Self {
        let mut other = self.clone();
        other.controller.retain(|setting| setting.name != name);
        other.controller.push(Setting { name, value, rule: String::new(), origin: None });
        other
    }
}

/// A model with these values.
///
/// # Panics
/// As [`Tuned::pair`].
pub(super) fn block<M: Model>(settings: &[Setting]) -> Block<M> {
    let mut block = Block::default();
    for setting in settings {
        set(&mut block, setting);
    }
    block
}

fn set<M: Model>(block: &mut Block<M>, setting: &Setting) {
    let index = (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(name, ..)| name == setting.name));
    if let (Some(index), Value::Reals(values)) = (index, &setting.value) {
        for (element, value) in values.iter().enumerate() {
            match M::TABLE.entry(block, index + element) {
                Some((_, Slot::Real(x))) => *x = *value,
                _ => unreachable!("{} has another type", setting.name),
            }
        }
        return;
    }
    let (meta, slot) = index.and_then(|i| M::TABLE.entry(block, i)).expect("a variable of the model");
    match (slot, &setting.value, meta.kind) {
        (Slot::Real(x), Value::Real(value), _) => *x = *value,
        (Slot::Integer(x), Value::Integer(value), _) => {
            x.set((*value).into());
        }
        (Slot::Boolean(x), Value::Boolean(value), _) => *x = *value,
        (Slot::Enumeration(x), Value::Item(name), Kind::Enumeration(e)) => {
            x.set(e.items.iter().find(|item| item.name == name).expect("an item of the enumeration").value);
        }
        _ => unreachable!("{} has another type", setting.name),
    }
}
