//! The communication step that a compliant shaft allows, from the mechanical impedance of the drive.
//!
//! A drive with the impedance Z(s) = Z_0(s) + s J, where J is the rotor, turns a load behind a spring: K = c/s + d with c in N.m/rad, d in
//! N.m.s/rad, and J_L in kg.m2. At each step h the importer reads angle and speed of the rotor, extrapolates them at this speed
//! for the load, and holds the torque of the spring. A held value has the response H = (1 - e^(-s h)) / (s h), an angle
//! extrapolated at its speed E = 2 H - e^(-s h), and the loop at the samples is
//!
//! ```text
//! L(s) = sum over n of H K (1 - (E c/s + H d) / (s J_L + K)) / Z  at  s + j n 2 pi / h
//! ```
//!
//! The longest step is the one at which L passes through -1: starting from a short step, the command lengthens it by the delay
//! that L still allows. Derived here; for a spring much faster than drive and load, Z = s J, and the rule is h = 2 d / c. The
//! impedance of a drive at its shaft and its passivity: the package motulator-impedance.

use fmu_core::digits;
use fmu_sweep::frequency::{Complex64, ResponsePoint, crossovers};
use std::f64::consts::TAU;
use std::str::FromStr;

fn four(x: f64) -> String {
    digits::text(x, 4, 1e6)
}

/// A load behind a spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Train {
    stiffness: f64,
    damping: f64,
    inertia: f64,
}

impl FromStr for Train {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text}: expected stiffness and inertia above 0 and damping of at least 0, as 50,0.05,1.5e-3 (N.m/rad, N.m.s/rad, kg.m2)"
            )
        };
        let numbers: Vec<f64> =
            text.split(',').map(|x| x.trim().parse()).collect::<Result<_, _>>().map_err(|_| wrong())?;
        match numbers[..] {
            [stiffness, damping, inertia]
                if numbers.iter().all(|x| x.is_finite()) && stiffness > 0.0 && damping >= 0.0 && inertia > 0.0 =>
            {
                Ok(Self { stiffness, damping, inertia })
            }
            _ => Err(wrong()),
        }
    }
}

/// Points on which the loops are computed, because a resonance is narrower than the distance of two measured points; images of the
/// sampling on each side; rounds of lengthening, each by half of what the loop still allows, and the share at which they end.
const POINTS: u32 = 2000;
const IMAGES: i32 = 4;
const ROUNDS: (u32, f64) = (60, 2e-3);

/// The impedance of a drive without its rotor.
struct Control<'a> {
    rotor: f64,
    points: &'a [ResponsePoint],
}

impl Control<'_> {
    /// Z_0 at an angular frequency in rad/s, either sign; below the measured range the nearest value, above it 0.
    fn at(&self, w: f64) -> Complex64 {
        let f = w.abs() / TAU;
        let own = |k: usize| self.points[k].1 - Complex64::new(0.0, TAU * self.points[k].0 * self.rotor);
        let k = self.points.partition_point(|(other, _)| *other < f);
        let value = match k {
            0 => own(0),
            k if k == self.points.len() => Complex64::ZERO,
            k => {
                let share = (f / self.points[k - 1].0).ln() / (self.points[k].0 / self.points[k - 1].0).ln();
                own(k - 1) + (own(k) - own(k - 1)) * share
            }
        };
        if w < 0.0 { value.conj() } else { value }
    }
}

impl Train {
    /// The loop at an angular frequency `w` (rad/s), sampled with the step `h` (s).
    fn sampled(&self, control: &Control<'_>, h: f64, w: f64) -> Complex64 {
        let image = |n: i32| {
            let w = w + TAU / h * f64::from(n);
            let s = Complex64::new(0.0, w);
            let (stiffness, late) = (self.stiffness / s, (-s * h).exp());
            let (spring, held) = (stiffness + self.damping, (1.0 - late) / (s * h));
            let moves = ((2.0 * held - late) * stiffness + held * self.damping) / (s * self.inertia + spring);
            held * spring * (1.0 - moves) / (s * control.rotor + control.at(w))
        };
        (-IMAGES..=IMAGES).map(image).sum()
    }

    /// The longest step in s that is stable; `None`: no limit.
    fn longest(&self, control: &Control<'_>) -> Option<f64> {
        let (first, last) = (control.points[0].0, control.points[control.points.len() - 1].0);
        let mut h = 0.02 / last;
        for _ in 0..ROUNDS.0 {
            let highest = last.min(0.499 / h);
            let open = |k: u32| {
                let f = first * (highest / first).powf(f64::from(k) / f64::from(POINTS));
                (f, self.sampled(control, h, TAU * f))
            };
            let points: Vec<ResponsePoint> = (0..=POINTS).map(open).collect();
            // Without a delay, passive impedances are stable together: the phase of their loop is within 180 degrees.
            let delays = crossovers(&points).into_iter().map(|(f, phase)| (180.0 + phase) / (360.0 * f));
            let left = delays.reduce(f64::min)?;
            h += 0.5 * left;
            if left < ROUNDS.1 * h {
                break;
            }
        }
        Some(h)
    }

    /// What the command prints.
    pub(super) fn lines(&self, rotor: f64, impedance: &[ResponsePoint]) -> Vec<String> {
        if impedance.len() < 2 {
            return Vec::new();
        }
        let resonance = (self.stiffness * (1.0 / rotor + 1.0 / self.inertia)).sqrt() / TAU;
        let (first, last) = (impedance[0].0, impedance[impedance.len() - 1].0);
        let mut lines = vec![format!("the train resonates at {} Hz", four(resonance))];
        if !(first..=last).contains(&resonance) {
            lines.push(format!("no longest step: the resonance is not between {} and {} Hz", four(first), four(last)));
            return lines;
        }
        lines.push(match self.longest(&Control { rotor, points: impedance }) {
            Some(h) => format!("a compliant shaft is stable with steps below {} ms", four(1e3 * h)),
            None => format!("a compliant shaft has no longest step between {} and {} Hz", four(first), four(last)),
        });
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_rotor_allows_2_d_over_c() {
        let rotor = 1.5e-3;
        let f = |k: u32| 10.0_f64.powf(1.0 + f64::from(k) / 20.0);
        let mass: Vec<ResponsePoint> = (0..=60).map(|k| (f(k), Complex64::new(0.0, TAU * f(k) * rotor))).collect();
        // The rule applies to small damping, where the crossover is at the resonance.
        let train: Train = "500,0.02,1".parse().unwrap();
        let longest = train.longest(&Control { rotor, points: &mass });
        assert!((longest.unwrap() / (2.0 * 0.02 / 500.0) - 1.0).abs() < 0.02, "{longest:?}");
        for wrong in ["", "1,2", "0,1,1", "1,-1,1", "1,1,x", "1,1,1,1"] {
            assert!(wrong.parse::<Train>().unwrap_err().contains("expected stiffness"), "{wrong}");
        }
    }
}
