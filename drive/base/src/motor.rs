//! Electrical parameters of the machine: the plant's true ones, or the controller's estimates of them.

use fmu_core::unit::{Exponents, HENRY, OHM, Quantity, Unit, WEBER};
use fmu_core::{Row, Table, table};
use serde::{Deserialize, Serialize};

/// Unit of the second-order saturation coefficient A/Wb2.
pub const A_PER_WB2: Quantity = Quantity::new("SaturationOfSecondOrder", Unit::si("A/Wb2", per_weber(2)));
/// Unit of the third-order saturation coefficient A/Wb3.
pub const A_PER_WB3: Quantity = Quantity::new("SaturationOfThirdOrder", Unit::si("A/Wb3", per_weber(3)));

/// Exponents of an ampere per weber to the power of `n`: 1 Wb = 1 kg.m2.s-2.A-1.
const fn per_weber(n: i8) -> Exponents {
    Exponents::mechanical(-n, -2 * n, 2 * n, 1 + n)
}

/// A permanent-magnet synchronous machine, salient in general; `S` is the type of the values that depend on temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Motor<S = f64> {
    /// Number of pole pairs (Z_p in Rasmussen).
    pub n_p: i32,
    /// Stator resistance in Ohm, > 0.
    pub R_s: S,
    /// d-axis inductance in H, > 0.
    pub L_d: f64,
    /// q-axis inductance in H, > 0.
    pub L_q: f64,
    /// Permanent-magnet flux linkage in Wb, peak-valued, > 0.
    pub psi_M: S,
}

impl Default for Motor {
    /// The reference motor, 800 W; its values are assumed, because the paper omits its table.
    fn default() -> Self {
        Self { n_p: 3, R_s: 2.0, L_d: 6e-3, L_q: 6e-3, psi_M: 0.15 }
    }
}

impl Motor {
    /// The 2.2 kW interior-magnet machine of the Kim & Sul figures (source: `motors/ipmsm-2.2kw.toml`).
    pub const IPMSM_2_2_KW: Self = Self { n_p: 3, R_s: 3.6, L_d: 36e-3, L_q: 51e-3, psi_M: 0.545 };

    /// Torque per ampere of i_q in N.m/A: K = 1.5 n_p psi_M.
    #[inline]
    pub fn torque_constant(&self) -> f64 {
        1.5 * f64::from(self.n_p) * self.psi_M
    }

    /// Torque in N.m for the currents `i_d` and `i_q` (A): 1.5 n_p (psi_M + (L_d - L_q) i_d) i_q.
    #[inline]
    pub fn torque(&self, i_d: f64, i_q: f64) -> f64 {
        1.5 * f64::from(self.n_p) * (self.psi_M + (self.L_d - self.L_q) * i_d) * i_q
    }
}

type P = Row<Motor>;

/// Variables of the machine; their owner supplies the prefix `motor.`.
pub const MOTOR: &Table<Motor> = table![
    P::integer_parameter("n_p", "Number of pole pairs", |m| &mut m.n_p).at_least(1.0).at_most(1000.0),
    P::parameter("R_s", &OHM, "Stator resistance", |m| &mut m.R_s).above(0.0).tunable(),
    P::parameter("L_d", &HENRY, "d-axis inductance", |m| &mut m.L_d).above(0.0),
    P::parameter("L_q", &HENRY, "q-axis inductance", |m| &mut m.L_q).above(0.0),
    P::parameter("psi_M", &WEBER, "Permanent-magnet flux linkage (peak)", |m| &mut m.psi_M).above(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// The torque is 1.5 n_p times the cross product of flux linkage and current.
    #[test]
    fn the_torque_is_that_of_flux_linkage_and_current() {
        let motor = Motor::IPMSM_2_2_KW;
        for (i_d, i_q) in [(0.0, 4.0), (-3.0, 5.0), (2.0, -6.0)] {
            let [psi_d, psi_q] = [motor.psi_M + motor.L_d * i_d, motor.L_q * i_q];
            let expected = 1.5 * 3.0 * (psi_d * i_q - psi_q * i_d);
            assert!((motor.torque(i_d, i_q) - expected).abs() < 1e-12, "{i_d} A, {i_q} A");
        }
        assert!((motor.torque(0.0, 2.0) - 2.0 * motor.torque_constant()).abs() < 1e-12);
    }
}
