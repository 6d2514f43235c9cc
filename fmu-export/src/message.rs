//! Texts of messages. Variable names are looked up only here, when a call fails or logging is on.

use crate::lifecycle::{self, Standard};
use crate::snapshot::Snapshot;
use fmu_core::description::TIME;
use fmu_core::digits::rounded;
use fmu_core::variable::position;
use fmu_core::{Block, Causality, Exported, Fault, IntegerType, Interface, Kind, Meta, Model, State, Variability};
use std::fmt::Display;

/// Full name of variable `index`, an element of an array as `name[1]`.
pub(crate) fn name<M: Model>(index: usize) -> String {
    match M::TABLE.locate(index) {
        Some((name, meta, element)) if meta.dimension.is_some() => name + &position(meta.shape, element),
        Some((name, ..)) => name,
        None => format!("variable {index}"),
    }
}

/// [`name`] with the present sizes of arrays, which determine the indices of a matrix in a description.
pub(crate) fn sized_name<M: Model>(block: &mut Block<M>, index: usize) -> String {
    if const { !M::TABLE.has_sizes() } {
        return name::<M>(index);
    }
    match M::TABLE.locate(index) {
        Some((name, meta, element)) if !meta.sized.is_empty() => {
            name + &position(&M::TABLE.extents(block, index), element)
        }
        _ => name::<M>(index),
    }
}

fn kind(kind: &Kind) -> String {
    match kind {
        Kind::Real(_) => "a real number".into(),
        Kind::Float32(_) => "a Float32".into(),
        Kind::Integer(IntegerType::Int32) => "an integer".into(),
        Kind::Integer(of) => format!("an integer of the type {}", of.name()),
        Kind::Boolean => "a truth value".into(),
        Kind::Enumeration(_) => "an enumeration".into(),
        Kind::Text => "a text".into(),
        Kind::Clock(_) => "a clock".into(),
        Kind::Binary { .. } => "bytes".into(),
    }
}

/// The value of an integer does not fit the Integer of FMI 2.0.
#[cold]
pub(crate) fn narrow<M: Model>(index: usize, value: i128, of: IntegerType) -> Fault {
    let (name, of) = (name::<M>(index), of.name());
    Fault::new(format!("{name} = {value} does not fit a 32-bit FMI 2.0 Integer; in FMI 3.0 it is {of}"))
}

/// No variable has this value reference.
#[cold]
pub(crate) fn unknown<E: Exported>(reference: u32, standard: Standard) -> Fault {
    // Time and the event indicators are variables in FMI 3.0 only.
    let (first, indicators) =
        if standard == Standard::Fmi3 { (TIME, E::CAN.indicators().len()) } else { (TIME + 1, 0) };
    let last = E::Model::TABLE.len() + E::CAN.scalars() + indicators + E::Model::TABLE.wide();
    Fault::new(format!("value reference {reference} does not exist; {first} to {last} do"))
}

/// The reference belongs to an element without a separate reference in FMI 3.0.
#[cold]
pub(crate) fn element<M: Model>(reference: u32, index: usize, element: usize) -> Fault {
    let first = reference as usize - element;
    let name = name::<M>(index);
    Fault::new(format!(
        "value reference {reference} does not exist; {name} belongs to the array with reference {first}"
    ))
}

/// The reference belongs to an element of the derivative of a state.
#[cold]
pub(crate) fn inner_derivative(reference: u32, state: &str, first: u32) -> Fault {
    Fault::new(format!(
        "value reference {reference} does not exist; it belongs to the array der({state}) with reference {first}"
    ))
}

/// The variable's type does not match the function.
#[cold]
pub(crate) fn type_of<M: Model>(index: usize, meta: &Meta, carries: &str) -> Fault {
    Fault::new(format!("{} is {}, and this function takes {carries}", name::<M>(index), kind(&meta.kind)))
}

/// The variable cannot be set, or not in this state.
#[cold]
pub(crate) fn fixed<M: Model>(index: usize, meta: &Meta, state: lifecycle::State) -> Fault {
    let name = name::<M>(index);
    Fault::new(match (meta.causality, meta.variability) {
        (Causality::Parameter, Variability::Fixed) => {
            format!("{name} is a fixed parameter: it can be set before and in Initialization Mode, and this is {state}")
        }
        (Causality::StructuralParameter, Variability::Tunable) => {
            format!(
                "{name} is a structural parameter: it can be set in Configuration Mode and in Reconfiguration Mode, and this is {state}"
            )
        }
        (Causality::StructuralParameter, _) => {
            format!("{name} is a fixed structural parameter: it can be set in Configuration Mode, and this is {state}")
        }
        _ if matches!(state, lifecycle::State::Configuration | lifecycle::State::Reconfiguration) => {
            format!("{name} is not a structural parameter: it cannot be set in {state}")
        }
        (Causality::Parameter | Causality::Input, _) => {
            format!("{name} changes at events only: it can be set in Event Mode, and this is {state}")
        }
        _ if meta.exact => {
            format!("{name} has a start value, which can be set before and in Initialization Mode, and this is {state}")
        }
        (_, Variability::Constant) => format!("{name} is a constant and cannot be set"),
        (Causality::CalculatedParameter, _) => format!("{name} is a calculated parameter and cannot be set"),
        (Causality::Output, _) => format!("{name} is an output and cannot be set"),
        _ => format!("{name} cannot be set"),
    })
}

/// The variable cannot be changed now.
#[cold]
pub(crate) fn kept<M: Model>(
    block: &mut Block<M>,
    index: usize,
    meta: &Meta,
    state: lifecycle::State,
    value: impl Display,
) -> Fault {
    let held = M::TABLE.entry(block, index).map_or_else(String::new, |(_, slot)| slot.to_string());
    Fault::new(format!("{}; it is {held}, and the call sets {value}", fixed::<M>(index, meta, state)))
}

/// The value is of the right type, and out of range.
#[cold]
pub(crate) fn range<M: Model>(block: &mut Block<M>, index: usize, meta: &Meta, value: impl Display) -> Fault {
    Fault::value(&sized_name(block, index), value, meta.allowed())
}

/// The number of values does not match the references.
#[cold]
pub(crate) fn count(given: usize, needed: usize) -> Fault {
    Fault::value("nValues", given, format_args!("{needed} for these value references"))
}

/// A model that an importer cannot keep.
#[cold]
pub(crate) fn lacks(flag: &str, kept: &str) -> Fault {
    Fault::new(format!("not supported: the state of this model cannot be {kept}, and the description has no {flag}"))
}

/// A time in s without its rounding errors.
pub(crate) fn at(time: f64) -> String {
    format!("at {} s", rounded(time, 12))
}

/// The start of an instance: the values that differ from the start values, if these are known.
pub(crate) fn start<M: Model>(instance: &str, current: &mut Snapshot<M>, starts: Option<Block<M>>) -> String {
    let Some(mut fresh) = starts else { return format!("{instance}: initialized {}", at(current.end)) };
    fresh.initialize();
    let mut changes = Vec::new();
    for index in M::TABLE.indices() {
        let (Some((meta, new)), Some((_, old))) =
            (M::TABLE.entry(&mut current.block, index), M::TABLE.entry(&mut fresh, index))
        else {
            continue;
        };
        if meta.takes_start() && new.to_string() != old.to_string() {
            let value = new.to_string();
            changes.push(format!("{} = {value}", sized_name(&mut current.block, index)));
        }
    }
    let changes = if changes.is_empty() { "all start values unchanged".into() } else { changes.join(", ") };
    format!("{instance}: initialized {} with {changes}", at(current.end))
}

/// A real number that no setter changes, requested with another type.
#[cold]
pub(crate) fn real(time: bool, carries: &str) -> Fault {
    Fault::new(if time {
        format!(
            "time (value reference {TIME}) is a real number that only a step or SetTime changes; this call takes {carries}"
        )
    } else {
        format!("a derivative or an event indicator is a real number; this call takes {carries}")
    })
}

/// Name of the derivative of a state.
pub(crate) fn derivative<M>(state: &State<M>) -> String {
    format!("der({})", state.name)
}

/// Name of the derivative or event indicator at a position after the table.
pub(crate) fn calculated<E: Exported>(after: usize) -> String {
    match E::CAN.state_of(after) {
        Some((state, _)) => derivative(state),
        None => E::CAN.indicators().get(after - E::CAN.scalars()).map_or_else(String::new, |i| i.name.to_owned()),
    }
}

/// Nominal value of a variable: from its row, or 1.
pub(crate) fn nominal<M: Model>(block: &mut Block<M>, index: usize) -> f64 {
    M::TABLE.entry(block, index).and_then(|(meta, _)| meta.nominal).map_or(1.0, f64::abs)
}

/// An FMU state of an instance for another interface.
#[cold]
pub(crate) fn interface(theirs: Interface, ours: Interface) -> Fault {
    Fault::new(format!("the FMU state is of an instance {}, and this is one {}", made_for(theirs), made_for(ours)))
}

/// The interface of an instance.
pub(crate) fn made_for(interface: Interface) -> &'static str {
    match interface {
        Interface::CoSimulation => "for Co-Simulation without Event Mode",
        Interface::EventMode => "for Co-Simulation with Event Mode",
        Interface::ModelExchange => "for Model Exchange",
        Interface::ScheduledExecution => "for Scheduled Execution",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_has_no_rounding_errors() {
        assert_eq!([0.1 + 0.2, 0.826_000_000_000_000_1, 1e-7].map(at), ["at 0.3 s", "at 0.826 s", "at 0.0000001 s"]);
    }
}
