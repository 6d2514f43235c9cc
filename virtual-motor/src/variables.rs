//! The variables of `PmsmPlant` by their names, and by the FMU's value references.

use crate::error::{Error, ErrorCode, Result};
use drive::PmsmPlant;
use fmu_core::variable::position;
use fmu_core::{Block, Causality, Constant, Kind, Meta, Model, Slot, Variability};
use std::sync::OnceLock;

type Whole = Block<PmsmPlant>;

// An element of a wide array would have another reference in the FMU.
const _: () = assert!(PmsmPlant::TABLE.wide() == 0);

/// Inputs that an advance sets from its arguments.
const COMMANDED: [&str; 4] = ["u_a", "u_b", "u_c", "enable"];

/// The names of all variables, in the order of the table; elements of arrays as `name[1,2]`.
pub(crate) fn names() -> &'static [String] {
    static NAMES: OnceLock<Vec<String>> = OnceLock::new();
    NAMES.get_or_init(|| {
        let name = |index| {
            let (name, meta, element) = PmsmPlant::TABLE.locate(index)?;
            let place = meta.dimension.map(|_| position(meta.shape, element));
            Some(name + &place.unwrap_or_default())
        };
        PmsmPlant::TABLE.indices().map_while(name).collect()
    })
}

/// The number of the variable `name`: its value reference in the FMU `PmsmPlant`, from 1 on.
///
/// # Errors
/// No variable has this name.
pub fn find(name: &str) -> Result<u32> {
    let place = names().iter().position(|known| known == name);
    let reference = place.and_then(|place| u32::try_from(place + 1).ok());
    reference.ok_or_else(|| {
        let text = format_args!("PmsmPlant has no variable {name:?}: `fmu info` lists its variables");
        Error::new(ErrorCode::UnknownVariable, text)
    })
}

/// The name of the variable with this number.
///
/// # Errors
/// No variable has this number.
pub fn name(variable: u32) -> Result<&'static str> {
    let name = index(variable).and_then(|index| names().get(index));
    name.map(String::as_str).ok_or_else(|| unknown(variable))
}

/// The index in the table.
fn index(variable: u32) -> Option<usize> {
    (variable as usize).checked_sub(1)
}

fn entry(block: &mut Whole, variable: u32) -> Result<(&'static Meta, Slot<'_>)> {
    let entry = index(variable).and_then(|index| PmsmPlant::TABLE.entry(block, index));
    entry.ok_or_else(|| unknown(variable))
}

#[cold]
fn unknown(variable: u32) -> Error {
    Error::value(ErrorCode::UnknownVariable, "variable", variable, format_args!("1 to {}", names().len()))
}

/// The value of a variable: a Boolean as 0 or 1, an enumeration as its number.
#[expect(clippy::cast_precision_loss, reason = "integers of 32 bits")]
pub(crate) fn read(block: &mut Whole, variable: u32) -> Result<f64> {
    Ok(match entry(block, variable)?.1 {
        Slot::Real(x) => *x,
        Slot::Float32(x) => (*x).into(),
        Slot::Integer(x) => x.get() as f64,
        Slot::Boolean(x) => u8::from(*x).into(),
        Slot::Enumeration(x) => x.get().into(),
        Slot::Constant(Constant::Real(x)) => x,
        _ => f64::NAN,
    })
}

/// Sets a variable of a motor, which has `begun` or not; returns whether it is a parameter.
///
/// # Errors
/// Names the variable, its value and what is allowed; the variable keeps its value.
pub(crate) fn write(block: &mut Whole, variable: u32, value: f64, begun: bool) -> Result<bool> {
    let (meta, slot) = entry(block, variable)?;
    if let Some(why) = kept(meta, begun) {
        return Err(Error::new(ErrorCode::NotSettable, format_args!("{} {why}", name(variable)?)));
    }
    if put(meta, slot, value) {
        return Ok(meta.causality == Causality::Parameter);
    }
    let allowed = match meta.kind {
        Kind::Boolean => "0 (false) or 1 (true)".into(),
        Kind::Integer(_) => format!("an integer, {}", meta.allowed()),
        _ => meta.allowed(),
    };
    Err(Error::value(ErrorCode::BadValue, name(variable)?, value, allowed))
}

/// Why a variable cannot be set.
fn kept(meta: &Meta, begun: bool) -> Option<&'static str> {
    if COMMANDED.contains(&meta.name) && meta.causality == Causality::Input {
        return Some("is set by every advance, from the duty cycles or the gate signals");
    }
    match (meta.causality, meta.variability) {
        (Causality::Input, _) | (Causality::Parameter, Variability::Tunable) => None,
        (Causality::Parameter, _) => begun.then_some("is a fixed parameter: it can be set before the first advance"),
        (Causality::Output, _) => Some("is an output and cannot be set"),
        _ => Some("cannot be set"),
    }
}

/// Writes an allowed value.
fn put(meta: &Meta, slot: Slot<'_>, value: f64) -> bool {
    match slot {
        Slot::Real(x) if meta.range.contains(value) => {
            *x = value;
            true
        }
        Slot::Integer(x) => {
            let Kind::Integer(of) = meta.kind else { return false };
            whole(value).is_some_and(|value| of.allows(value.into(), &meta.range) && x.set(value.into()))
        }
        Slot::Boolean(x) => match whole(value) {
            Some(value @ (0 | 1)) => {
                *x = value == 1;
                true
            }
            _ => false,
        },
        Slot::Enumeration(x) => whole(value).is_some_and(|value| x.set(value)),
        _ => false,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "an integer of this range")]
fn whole(value: f64) -> Option<i32> {
    let fits = value.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&value);
    fits.then_some(value as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_variable_is_found_by_its_name() {
        assert!(names().len() > 150, "{}", names().len());
        for (place, known) in names().iter().enumerate() {
            let variable = find(known).unwrap();
            assert_eq!((variable as usize, name(variable).unwrap()), (place + 1, known.as_str()));
            assert!(read(&mut Block::default(), variable).unwrap().is_finite(), "{known}");
        }
        assert!(find("flux_map.w[108]").is_ok() && find("flux_map.w[109]").is_err());
    }

    #[test]
    fn wrong_values_are_refused_by_name() {
        let mut block = Block::<PmsmPlant>::default();
        for (known, value, begun, text) in [
            ("motor.R_s", -1.0, false, "motor.R_s = -1 is not allowed: greater than 0"),
            ("motor.R_s", f64::NAN, false, "motor.R_s = NaN is not allowed: greater than 0"),
            ("motor.n_p", 2.5, false, "motor.n_p = 2.5 is not allowed: an integer, at least 1 and at most 1000"),
            ("inverter.mode", 3.0, false, "inverter.mode = 3 is not allowed: 1 (Average), 2 (Switched)"),
            ("asc", 0.5, true, "asc = 0.5 is not allowed: 0 (false) or 1 (true)"),
            ("motor.L_d", 1e-3, true, "motor.L_d is a fixed parameter: it can be set before the first advance"),
            ("u_b", 1.0, false, "u_b is set by every advance, from the duty cycles or the gate signals"),
            ("speed", 1.0, false, "speed is an output and cannot be set"),
        ] {
            let error = write(&mut block, find(known).unwrap(), value, begun).unwrap_err();
            assert_eq!(error.to_string(), text);
            let fresh = read(&mut Block::default(), find(known).unwrap()).unwrap();
            let kept = read(&mut block, find(known).unwrap()).unwrap();
            assert_eq!(kept.to_bits(), fresh.to_bits(), "{known}");
        }
        for number in [0, u32::try_from(names().len()).unwrap() + 1, u32::MAX] {
            let error = read(&mut block, number).unwrap_err();
            assert_eq!(error.code(), ErrorCode::UnknownVariable);
            assert_eq!(name(number).unwrap_err(), error);
        }
        assert_eq!(find("motor.r_s").unwrap_err().code(), ErrorCode::UnknownVariable);
    }
}
