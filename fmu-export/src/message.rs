//! Texts of messages. Variable names are looked up only here, when a call fails or logging is on.

use crate::lifecycle::State;
use crate::snapshot::Snapshot;
use fmu_core::description::TIME;
use fmu_core::{Causality, Fault, Kind, Meta, Model, Slot, Variability};
use std::fmt::Display;

/// Full name of variable `index`, an element of an array as `name[1]`.
pub(crate) fn name<M: Model>(index: usize) -> String {
    match M::TABLE.locate(index) {
        Some((name, meta, element)) if meta.dimension.is_some() => format!("{name}[{}]", element + 1),
        Some((name, ..)) => name,
        None => format!("variable {index}"),
    }
}

/// A value as text.
pub(crate) fn value(slot: &Slot<'_>) -> String {
    match slot {
        Slot::Real(x) => x.to_string(),
        Slot::Integer(x) => x.to_string(),
        Slot::Boolean(x) => x.to_string(),
        Slot::Enumeration(x) => x.get().to_string(),
    }
}

/// What a variable may be set to.
pub(crate) fn allowed(meta: &Meta) -> String {
    let Kind::Enumeration(enumeration) = meta.kind else { return meta.range.to_string() };
    let items: Vec<String> = enumeration.items.iter().map(|item| format!("{} ({})", item.value, item.name)).collect();
    items.join(", ")
}

fn kind(kind: &Kind) -> &'static str {
    match kind {
        Kind::Real(_) => "a real number",
        Kind::Integer => "an integer",
        Kind::Boolean => "a truth value",
        Kind::Enumeration(_) => "an enumeration",
    }
}

/// No variable has this value reference.
#[cold]
pub(crate) fn unknown<M: Model>(reference: u32) -> Fault {
    Fault::new(format!("value reference {reference} does not exist; 0 to {} do", M::TABLE.len()))
}

/// The reference belongs to an element that has no reference of its own in FMI 3.0.
#[cold]
pub(crate) fn element<M: Model>(reference: u32, index: usize, element: usize) -> Fault {
    let first = index - element + 1;
    let name = name::<M>(index);
    Fault::new(format!(
        "value reference {reference} does not exist; {name} belongs to the array with reference {first}"
    ))
}

/// The variable is not of the type that the function carries.
#[cold]
pub(crate) fn type_of<M: Model>(index: usize, meta: &Meta, carries: &str) -> Fault {
    Fault::new(format!("{} is {}, and this function carries {carries}", name::<M>(index), kind(&meta.kind)))
}

/// The variable cannot be set, or not now.
#[cold]
pub(crate) fn fixed<M: Model>(index: usize, meta: &Meta, state: State) -> Fault {
    let name = name::<M>(index);
    Fault::new(match (meta.causality, meta.variability) {
        (Causality::Parameter, Variability::Fixed) => {
            format!("{name} is a fixed parameter: it can be set before and in Initialization Mode, and this is {state}")
        }
        (Causality::CalculatedParameter, _) => format!("{name} is a calculated parameter and cannot be set"),
        (Causality::Output, _) => format!("{name} is an output and cannot be set"),
        _ => format!("{name} cannot be set"),
    })
}

/// The value is of the right type, and out of range.
#[cold]
pub(crate) fn range<M: Model>(index: usize, meta: &Meta, value: impl Display) -> Fault {
    Fault::value(&name::<M>(index), value, allowed(meta))
}

/// The number of values is not what the references need.
#[cold]
pub(crate) fn count(given: usize, needed: usize) -> Fault {
    Fault::value("nValues", given, format_args!("{needed} for these value references"))
}

/// How an instance starts: what differs from the start values.
pub(crate) fn start<M: Model>(instance: &str, current: &mut Snapshot<M>) -> String {
    let mut fresh = Snapshot::<M>::default();
    let mut changes = Vec::new();
    for index in 0..M::TABLE.len() {
        let (Some((meta, new)), Some((_, old))) =
            (M::TABLE.entry(&mut current.block, index), M::TABLE.entry(&mut fresh.block, index))
        else {
            continue;
        };
        if matches!(meta.causality, Causality::Input | Causality::Parameter) && value(&new) != value(&old) {
            changes.push(format!("{} = {}", name::<M>(index), value(&new)));
        }
    }
    let changes = if changes.is_empty() { "all start values unchanged".into() } else { changes.join(", ") };
    format!("{instance}: initialized at {} s with {changes}", current.end)
}

/// Value reference 0.
#[cold]
pub(crate) fn time(carries: &str) -> Fault {
    Fault::new(format!(
        "time (value reference {TIME}) is a real number that only a step changes; this call carries {carries}"
    ))
}
