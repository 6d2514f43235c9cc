//! Angles in rad that look like degrees.

use fmu_core::log::Warnings;
use std::f64::consts::TAU;

/// Warns if the angle `x` (rad) of a parameter is larger than a turn.
pub fn warn(name: &'static str, x: f64, log: &mut Warnings<'_>) {
    if x.abs() > TAU {
        log.warn(name, || {
            format!("{name} = {x} rad is more than a turn; an angle of {x} degrees is {:.6} rad", x.to_radians())
        });
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn ninety_is_reported_and_a_turn_is_not() {
        for (x, said) in [
            (90.0, "angle = 90 rad is more than a turn; an angle of 90 degrees is 1.570796 rad"),
            (6.28, ""),
            (-3.2, ""),
        ] {
            let mut heard = String::new();
            super::warn("angle", x, &mut fmu_core::log::Warnings::to(&mut |(_, _, text)| heard = text()));
            assert_eq!(heard, said);
        }
    }
}
