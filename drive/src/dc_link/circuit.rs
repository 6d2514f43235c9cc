//! The circuit of the DC link over an interval with a constant inverter current, solved exactly.
//!
//! ```text
//! C du/dt = (U - u) / R + I - u / R_chopper - i      i int u dt = energy of the inverter
//! ```
//!
//! u is an exponential with the time constant tau = C / (1/R + 1/R_chopper), so a stiff source requires no shorter
//! intervals, and the integrals of u and u^2 for the energies are closed forms. The inverter's energy over the interval is
//! known from the plant; the current for it is the smaller root of a quadratic equation. Thus no energy is lost between the
//! two, and u = (U + sqrt(U^2 - 4 R P)) / 2 holds exactly in steady state. U is the voltage of the source, R its resistance,
//! including the precharge resistance while active. A source at its limit, or one that blocks, has 1/R = 0 and the constant current I;
//! the voltage U - u is then lost in the limiter.
//!
//! With x = t / tau and s = du/dt at the start of the interval:
//!
//! ```text
//! u(t) = u_0 + s t phi_1    int u = u_0 t + s t^2 phi_2    int u^2 = u_0^2 t + 2 u_0 s t^2 phi_2 + s^2 t^3 phi_3
//! phi_1 = (1 - e^-x) / x    phi_2 = (x - 1 + e^-x) / x^2   phi_3 = (x - 2 (1 - e^-x) + (1 - e^-2x) / 2) / x^3
//! ```
//!
//! u, U in V, i in A, R in Ohm, C in F, energies in J.

use drive_base::math::exp;
use serde::{Deserialize, Serialize};

/// x below which the series are more exact than the closed forms.
const SMALL: f64 = 0.01;

/// phi_1 to phi_3.
fn phi(x: f64) -> [f64; 3] {
    if x < SMALL {
        return [
            1.0 + x * (-1.0 / 2.0 + x * (1.0 / 6.0 + x * (-1.0 / 24.0 + x * (1.0 / 120.0)))),
            1.0 / 2.0 + x * (-1.0 / 6.0 + x * (1.0 / 24.0 + x * (-1.0 / 120.0 + x * (1.0 / 720.0)))),
            1.0 / 3.0 + x * (-1.0 / 4.0 + x * (7.0 / 60.0 + x * (-1.0 / 24.0 + x * (31.0 / 2520.0)))),
        ];
    }
    let d = exp(-x);
    let gone = 1.0 - d;
    [gone / x, (x - gone) / (x * x), (x - 2.0 * gone + 0.5 * (1.0 - d * d)) / (x * x * x)]
}

/// Energies in J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkEnergy {
    /// From the source.
    pub source: f64,
    /// Lost between the source and the capacitor.
    pub resistor: f64,
    /// Lost in the chopper.
    pub chopper: f64,
}

impl LinkEnergy {
    /// These powers in W over `h` (s).
    pub(crate) fn times(&self, h: f64) -> Self {
        Self { source: self.source * h, resistor: self.resistor * h, chopper: self.chopper * h }
    }

    /// Adds the values of an interval.
    pub(crate) fn add(&mut self, piece: &Self) {
        self.source += piece.source;
        self.resistor += piece.resistor;
        self.chopper += piece.chopper;
    }
}

/// Source, capacitor and chopper.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circuit {
    /// Capacitance in F.
    pub(super) C: f64,
    /// Conductance of the source in S.
    pub(super) source: f64,
    /// Constant current of the source in A, in addition to that through its conductance.
    pub(super) fixed: f64,
    /// Conductance of the chopper in S; 0 while it is off.
    pub(super) chopper: f64,
    /// The source's voltage in V.
    pub(super) U: f64,
}

/// The end of an interval, and the energy and charge transferred in it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Piece {
    /// Voltage in V.
    pub(super) u: f64,
    /// Energies in J.
    pub(super) energy: LinkEnergy,
    /// Charge from the source in C.
    pub(super) charge: f64,
    /// Energy in J that the inverter took but the link could not supply.
    pub(super) owed: f64,
}

impl Circuit {
    /// Derivative of the voltage `u` (V) in V/s without the inverter.
    fn slope(&self, u: f64) -> f64 {
        ((self.U - u) * self.source + self.fixed - u * self.chopper) / self.C
    }

    /// Change of the voltage (V) by a constant current `i` (A) in `t` (s).
    pub(super) fn change(&self, t: f64, i: f64) -> f64 {
        let [phi_1, ..] = phi(t * (self.source + self.chopper) / self.C);
        i.abs() * t * phi_1 / self.C
    }

    /// Starts at the voltage `u` (V) and covers `t` (s), in which the inverter draws `energy` (J).
    pub(super) fn over(&self, u: f64, t: f64, energy: f64) -> Piece {
        let &Self { C, source, fixed, chopper, U } = self;
        let [phi_1, phi_2, phi_3] = phi(t * (source + chopper) / C);
        let free = self.slope(u);
        // int u = a - b i, so b i^2 - a i + energy = 0.
        let (a, b) = (u * t + free * t * t * phi_2, t * t * phi_2 / C);
        let square = a * a - 4.0 * b * energy;
        let i = if square < 0.0 {
            0.5 * a / b
        } else if energy == 0.0 {
            0.0
        } else {
            2.0 * energy / (a + square.sqrt())
        };
        let s = free - i / C;
        let end = (u + s * t * phi_1).max(0.0);
        let mean = u * t + s * t * t * phi_2;
        let squared = u * u * t + 2.0 * u * s * t * t * phi_2 + s * s * t * t * t * phi_3;
        let charge = source * (U * t - mean) + fixed * t;
        let energy_given = LinkEnergy {
            source: U * charge,
            resistor: source * (U * U * t - 2.0 * U * mean + squared) + fixed * (U * t - mean),
            chopper: chopper * squared,
        };
        let owed = if square < 0.0 { energy - i * mean } else { 0.0 };
        Piece { u: end, energy: energy_given, charge, owed }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circuit(R: f64, C: f64) -> Circuit {
        Circuit { C, source: 1.0 / R, fixed: 0.0, chopper: 1.0 / 30.0, U: 400.0 }
    }

    #[test]
    fn series_and_closed_forms_meet() {
        let (below, above) = (phi(SMALL * (1.0 - 1e-12)), phi(SMALL * (1.0 + 1e-12)));
        for (a, b) in below.iter().zip(above) {
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn the_energies_of_a_piece_are_balanced_whatever_the_time_constant_is() {
        for (R, C) in [(1e-4, 1e-4), (0.1, 5e-4), (100.0, 5e-3), (1e4, 1.0)] {
            for (u, energy) in [(350.0, 2.0), (390.0, -3.0), (0.0, 0.0), (400.0, 0.0)] {
                let piece = circuit(R, C).over(u, 1e-4, energy);
                let LinkEnergy { source, resistor, chopper } = piece.energy;
                let stored = 0.5 * C * (piece.u * piece.u - u * u);
                let rest = source - resistor - chopper - energy - stored;
                let passed = source.abs() + energy.abs() + stored.abs();
                assert!(rest.abs() < 1e-9 * passed.max(1e-3), "{R} Ohm, {C} F, {u} V: {rest} J of {passed} J");
                assert!(piece.owed == 0.0 && resistor >= 0.0 && chopper >= 0.0, "{piece:?}");
            }
        }
    }

    /// A source at its limit of 20 A charges 1 mF by 2 V in 100 us; 50 V of it are lost in the limiter.
    #[test]
    fn a_source_at_its_limit_supplies_a_constant_current() {
        let limited = Circuit { C: 1e-3, source: 0.0, fixed: 20.0, chopper: 0.0, U: 400.0 };
        let piece = limited.over(349.0, 1e-4, 0.0);
        assert!((piece.u - 351.0).abs() < 1e-9 && (piece.charge - 2e-3).abs() < 1e-12, "{piece:?}");
        assert!((piece.energy.source - 0.8).abs() < 1e-9 && (piece.energy.resistor - 0.1).abs() < 1e-9, "{piece:?}");
    }

    /// Against many small steps of the equation with a constant power.
    #[test]
    fn it_follows_a_constant_power() {
        let (circuit, power) = (circuit(0.1, 5e-4), 2e4);
        let (mut fine, n) = (380.0_f64, 10_000_u32);
        let h = 1e-4 / f64::from(n);
        for _ in 0..n {
            let slope = |u: f64| circuit.slope(u) - power / u / circuit.C;
            let middle = fine + 0.5 * h * slope(fine);
            fine += h * slope(middle);
        }
        let u = circuit.over(380.0, 1e-4, power * 1e-4).u;
        assert!((u - fine).abs() < 0.05 && (u - 380.0).abs() > 3.0, "{u} V, not {fine} V");
    }

    #[test]
    fn what_the_link_cannot_give_is_owed() {
        let circuit = Circuit { C: 1e-6, source: 1e-6, fixed: 0.0, chopper: 0.0, U: 400.0 };
        let piece = circuit.over(100.0, 1e-4, 1.0);
        assert!(piece.u < 0.1 && (piece.owed - (1.0 - 0.5e-6 * 1e4)).abs() < 1e-4, "{piece:?}");
    }
}
