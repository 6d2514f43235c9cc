//! Options that the drive cannot do without, and that only some estimators have: the controller rejects them by name with any other one.
//!
//! All other options and values of a method (bandwidths, voltages, noise densities) have no effect with the estimators that do not read
//! them, and a warning names them ([`idle`](fmu_core::idle)): a set of values may hold those of several estimators.

use crate::estimator::{Class, Kind, Setup};
use fmu_core::Fault;

struct Choice {
    /// Name of its variable.
    name: &'static str,
    /// Whether it is on with this estimator.
    asked: fn(&Setup) -> bool,
    /// Whether an estimator has it.
    has: fn(Kind) -> bool,
    /// The function that other estimators lack.
    why: &'static str,
    /// How to turn it off.
    off: &'static str,
}

#[rustfmt::skip]
const CHOICES: &[Choice] = &[
    Choice { name: "start.mode", asked: |s| s.starts_by_injection, has: |kind| kind.class().injects(),
        why: "the start by injection needs an estimator that injects", off: "set start.mode = CurrentFrequency or Direct" },
    Choice { name: "weakening.use", asked: |s| s.weakens, has: |kind| kind.class() != Class::Injection,
        why: "injection leaves no voltage for field weakening", off: "set it to false" },
];

/// Checks that the estimator has the options that are on.
///
/// # Errors
/// It does not have one of them.
pub fn validate(kind: Kind, setup: &Setup) -> Result<(), Fault> {
    let Some(choice) = CHOICES.iter().find(|choice| (choice.asked)(setup) && !(choice.has)(kind)) else {
        return Ok(());
    };
    let names: Vec<&str> = Kind::ALL.iter().filter(|&&kind| (choice.has)(kind)).map(|kind| kind.name()).collect();
    let names = match names.as_slice() {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        one => one.concat(),
    };
    Err(Fault::new(format!(
        "{} is not allowed with {}: {}; {}, or set estimator = {names}",
        setup.tell(choice.name),
        setup.tell("estimator"),
        choice.why,
        choice.off
    )))
}
