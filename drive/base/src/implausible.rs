//! Values that look like those of another unit: degrees instead of rad, degrees Celsius instead of K, percent instead of 1.

use fmu_core::digits::rounded;
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

/// Temperature coefficients (1/K) of a winding: up to five times that of copper.
pub const WINDING: (f64, f64) = (0.0, 0.02);

/// Temperature coefficients (1/K) of a magnet: from five times that of ferrite to a constant flux linkage.
pub const MAGNET: (f64, f64) = (-0.01, 1e-3);

/// PWM periods (s) of inverters.
pub const PERIOD: (f64, f64) = (2e-7, 0.01);

/// Warns of a temperature coefficient `alpha` (1/K) that no winding has.
pub fn winding(name: &'static str, alpha: f64, log: &mut Warnings<'_>) {
    if alpha > WINDING.1 {
        log.warn(name, || {
            format!("{name} = {alpha} 1/K: copper has 0.00393 1/K; {alpha} %/K is {} 1/K", rounded(0.01 * alpha, 6))
        });
    }
}

/// Warns of a temperature coefficient `alpha` (1/K) that no magnet has.
pub fn magnet(name: &'static str, alpha: f64, log: &mut Warnings<'_>) {
    if alpha > MAGNET.1 {
        log.warn(name, || {
            format!("{name} = {alpha} 1/K: the magnet strengthens as it warms; NdFeB weakens, by -0.0011 1/K")
        });
    } else if alpha < MAGNET.0 {
        log.warn(name, || {
            format!("{name} = {alpha} 1/K: NdFeB has -0.0011 1/K; {alpha} %/K is {} 1/K", rounded(0.01 * alpha, 6))
        });
    }
}

/// Warns of a PWM period `T` (s) that no inverter has.
pub fn period(name: &'static str, T: f64, log: &mut Warnings<'_>) {
    if !(PERIOD.0..=PERIOD.1).contains(&T) {
        log.warn(name, || format!("{name} = {T} s is a switching frequency of {} Hz", rounded(1.0 / T, 4)));
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
        let percent = "alpha = 0.393 1/K: copper has 0.00393 1/K; 0.393 %/K is 0.00393 1/K";
        for (alpha, said) in [(0.393, percent), (3.93e-3, ""), (0.0, "")] {
            assert_eq!(heard(|log| winding("alpha", alpha, log)), said);
        }
        let sign = "alpha = 0.0011 1/K: the magnet strengthens as it warms; NdFeB weakens, by -0.0011 1/K";
        let percent = "alpha = -0.11 1/K: NdFeB has -0.0011 1/K; -0.11 %/K is -0.0011 1/K";
        for (alpha, said) in [(1.1e-3, sign), (-0.11, percent), (-2e-3, ""), (0.0, "")] {
            assert_eq!(heard(|log| magnet("alpha", alpha, log)), said);
        }
        let (slow, fast) =
            ("T = 0.1 s is a switching frequency of 10 Hz", "T = 0.0000001 s is a switching frequency of 10000000 Hz");
        for (T, said) in [(0.1, slow), (1e-7, fast), (1e-4, ""), (5e-7, "")] {
            assert_eq!(heard(|log| period("T", T, log)), said);
        }
    }
}
