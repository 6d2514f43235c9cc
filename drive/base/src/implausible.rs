//! Values that look like those of another unit: degrees instead of rad, degrees Celsius instead of K.

use fmu_core::log::Warnings;
use std::f64::consts::TAU;

/// Temperature in K below which no drive operates, -123 degC.
const COLDEST: f64 = 150.0;

/// Warns of an angle `x` (rad) of more than a turn.
pub fn angle(name: &'static str, x: f64, log: &mut Warnings<'_>) {
    if x.abs() > TAU {
        log.warn(name, || {
            format!("{name} = {x} rad is more than a turn; an angle of {x} degrees is {:.6} rad", x.to_radians())
        });
    }
}

/// Warns of a temperature `T` (K) at which no drive operates.
pub fn temperature(name: &'static str, T: f64, log: &mut Warnings<'_>) {
    if T < COLDEST {
        log.warn(name, || format!("{name} = {T} K is {:.2} degC; {T} degC is {:.2} K", T - 273.15, T + 273.15));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(warn: impl FnOnce(&mut Warnings<'_>)) -> String {
        let mut heard = String::new();
        warn(&mut Warnings::to(&mut |(_, _, text)| heard = text()));
        heard
    }

    #[test]
    fn other_units_are_reported_and_usual_values_are_not() {
        let ninety = "angle = 90 rad is more than a turn; an angle of 90 degrees is 1.570796 rad";
        for (x, said) in [(90.0, ninety), (TAU, ""), (-3.2, "")] {
            assert_eq!(heard(|log| angle("angle", x, log)), said);
        }
        for (T, said) in [(80.0, "T = 80 K is -193.15 degC; 80 degC is 353.15 K"), (233.15, ""), (450.0, "")] {
            assert_eq!(heard(|log| temperature("T", T, log)), said);
        }
    }
}
