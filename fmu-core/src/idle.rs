//! Values that a user has set and that have no effect with the other values: found at the first step, and reported once, by
//! name.
//!
//! A model lists in [`Acts`] when its parameters and inputs act, and [`Model::idle`] evaluates the lists. A value that differs
//! from the start value counts as set, except a parameter set to 0 or false, which requests nothing. [`Watch`] looks at the
//! parameters once and at an input until it is set.

use crate::row::Slot;
use crate::table::Table;
use crate::variable::Causality;
use crate::{Block, Model};

/// When variables act, for a model with the parameters `P`.
pub struct Acts<P: 'static> {
    /// Names of parameters and inputs.
    pub names: &'static [&'static str],
    /// Whether they act.
    pub when: fn(&P) -> bool,
    /// The message if they do not.
    pub why: &'static str,
}

/// Why the variable `name` does not act with these parameters.
pub fn why<P>(all: &[Acts<P>], par: &P, name: &str) -> Option<&'static str> {
    let found = all.iter().find(|acts| acts.names.contains(&name))?;
    if (found.when)(par) { None } else { Some(found.why) }
}

/// The parameters and inputs of `table` that `all` does not name exactly once, and the names in `all` that the table lacks. A
/// test expects both to be empty.
pub fn unstated<P, W>(all: &[Acts<P>], table: &Table<W>) -> Vec<String> {
    let listed = |name: &str| all.iter().flat_map(|acts| acts.names).filter(|listed| **listed == name).count();
    let located = table.indices().filter_map(|index| table.locate(index)).filter(|(.., element)| *element == 0);
    let settable = |causality| matches!(causality, Causality::Parameter | Causality::Input);
    let names: Vec<String> = located.filter(|(_, meta, _)| settable(meta.causality)).map(|(name, ..)| name).collect();
    let unknown = all.iter().flat_map(|acts| acts.names).filter(|name| !names.iter().any(|own| own == *name));
    names.iter().filter(|name| listed(name) != 1).cloned().chain(unknown.map(|name| (*name).to_owned())).collect()
}

/// Parameters and inputs still to be checked.
#[derive(Debug, Default)]
pub struct Watch {
    begun: bool,
    /// Inputs with their start values.
    inputs: Vec<(usize, f64)>,
}

impl Watch {
    /// Passes the findings since the last call to `tell`, one message for each reason.
    pub fn look<M: Model>(&mut self, block: &mut Block<M>, mut tell: impl FnMut(&str)) {
        let mut found = Vec::new();
        if !std::mem::replace(&mut self.begun, true) {
            let mut start = Block::<M>::default();
            for index in M::TABLE.indices() {
                let Some((meta, slot)) = M::TABLE.entry(&mut start, index) else { continue };
                let (causality, Some(at_start)) = (meta.causality, number(&slot)) else { continue };
                match causality {
                    Causality::Input => self.inputs.push((index, at_start)),
                    Causality::Parameter => {
                        find(block, (index, at_start), &mut found);
                    }
                    _ => (),
                }
            }
        }
        self.inputs.retain(|&input| !find(block, input, &mut found));
        for (why, values) in found {
            tell(&format!("{}: {why}", values.join(", ")));
        }
    }
}

/// Whether the variable differs from its start value; if it does not act, its name and value are added to `found`.
fn find<M: Model>(
    block: &mut Block<M>,
    (index, at_start): (usize, f64),
    found: &mut Vec<(&'static str, Vec<String>)>,
) -> bool {
    let Some((meta, slot)) = M::TABLE.entry(block, index) else { return false };
    let off = meta.causality == Causality::Parameter
        && match &slot {
            Slot::Real(x) => **x == 0.0,
            Slot::Boolean(x) => !**x,
            _ => false,
        };
    if off || number(&slot).is_none_or(|value| value.to_bits() == at_start.to_bits()) {
        return false;
    }
    let name = M::TABLE.locate(index).map(|(name, ..)| name).unwrap_or_default();
    if let (Some(why), Some(shown)) = (block.model.idle(&name), M::TABLE.tell_index(block, index)) {
        match found.iter_mut().find(|(other, _)| *other == why) {
            Some((_, values)) => values.push(shown),
            None => found.push((why, vec![shown])),
        }
    }
    true
}

/// The value of a number, a Boolean or an enumeration.
#[expect(clippy::cast_precision_loss, reason = "compared with itself alone")]
fn number(slot: &Slot<'_>) -> Option<f64> {
    match slot {
        Slot::Real(x) => Some(**x),
        Slot::Boolean(x) => Some(f64::from(u8::from(**x))),
        Slot::Integer(x) => Some(x.get() as f64),
        Slot::Enumeration(x) => Some(f64::from(x.get())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::Row;
    use crate::unit::ONE;

    type V = Row<[f64; 4]>;

    const TABLE: &Table<[f64; 4]> = crate::table![
        V::parameter("a", &ONE, "", |m| &mut m[0]),
        V::input("b", &ONE, "", |m| &mut m[1]),
        V::parameter("c", &ONE, "", |m| &mut m[2]),
        V::output("y", &ONE, "", |m| &mut m[3]),
    ];

    fn acts(names: &'static [&'static str], why: &'static str) -> Acts<bool> {
        Acts { names, when: |on| *on, why }
    }

    #[test]
    fn each_parameter_and_input_is_stated_once() {
        assert_eq!(unstated(&[acts(&["a", "b"], ""), acts(&["c"], "")], TABLE), [""; 0]);
        assert_eq!(unstated(&[acts(&["a"], "")], TABLE), ["b", "c"]);
        assert_eq!(unstated(&[acts(&["a", "b"], ""), acts(&["c", "a"], "")], TABLE), ["a"], "twice");
        assert_eq!(unstated(&[acts(&["a", "b", "c", "y", "z"], "")], TABLE), ["y", "z"], "neither of them");
    }

    #[test]
    fn what_does_not_act_has_its_reason() {
        let all = [acts(&["a"], "first"), acts(&["b", "c"], "second")];
        assert_eq!([why(&all, &false, "a"), why(&all, &false, "c")], [Some("first"), Some("second")]);
        assert_eq!([why(&all, &true, "a"), why(&all, &false, "d")], [None, None]);
    }
}
