//! Temperatures: a network of winding, stator iron and rotor with the magnets, a second one of the inverter, and what
//! they change in the machine.
//!
//! ```text
//! R_s(T)  = R_s (1 + alpha_R (T_winding - T_ref))          psi_M(T) = psi_M (1 + alpha_psi (T_magnet - T_ref))
//! C_w T_w' = p_cu - G_ws (T_w - T_s)
//! C_s T_s' = (1 - x_r) p_iron + p_friction + G_ws (T_w - T_s) + G_sr (T_r - T_s) - G_sc (T_s - T_c)
//! C_r T_r' = x_r p_iron - G_sr (T_r - T_s)
//! C_i T_i' = p_cond + p_sw - G_i (T_i - T_c)
//! Q = G_sc (T_s - T_c) + G_i (T_i - T_c)                    heat to the coolant
//! ```
//!
//! The time constants are seconds to hours, so the network is no part of the machine's integration: it advances once per
//! step of the plant with the step's mean losses, by the trapezoidal rule, which is stable at any step.
//!
//! Lumped networks of this size are the field's usual ones; the equations are heat balances. T in K, C in J/K, G in W/K.

use crate::plant::losses::Losses;
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// Parameters of the network.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Thermal {
    /// Heat capacity of the winding, the stator iron, the rotor and the inverter in J/K, > 0.
    pub C_winding: f64,
    /// Stator.
    pub C_stator: f64,
    /// Rotor.
    pub C_rotor: f64,
    /// Inverter.
    pub C_inverter: f64,
    /// Conductance from the winding to the stator in W/K, > 0.
    pub G_ws: f64,
    /// From the stator to the coolant.
    pub G_sc: f64,
    /// From the rotor to the stator.
    pub G_sr: f64,
    /// From the inverter to the coolant.
    pub G_inverter: f64,
    /// Share of the iron loss that arises in the rotor, 0..1.
    pub rotor_share: f64,
}

/// Temperatures in K.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Temperatures {
    /// Winding.
    pub winding: f64,
    /// Stator iron.
    pub stator: f64,
    /// Magnets.
    pub magnet: f64,
    /// Inverter.
    pub inverter: f64,
}

impl Thermal {
    /// The network of the machine: d T/dt = matrix T + heat / capacity.
    fn matrix(&self) -> Matrix3<f64> {
        let &Self { C_winding, C_stator, C_rotor, G_ws, G_sc, G_sr, .. } = self;
        Matrix3::new(
            -G_ws / C_winding,
            G_ws / C_winding,
            0.0,
            G_ws / C_stator,
            -(G_ws + G_sr + G_sc) / C_stator,
            G_sr / C_stator,
            0.0,
            G_sr / C_rotor,
            -G_sr / C_rotor,
        )
    }

    /// The temperatures after a step of `h` (s) with the mean `losses` (W) and the coolant at `coolant` (K).
    pub fn step(&self, at: &Temperatures, losses: &Losses, coolant: f64, h: f64) -> Temperatures {
        let &Self { C_winding, C_stator, C_rotor, C_inverter, G_sc, G_inverter, rotor_share, .. } = self;
        let heat = Vector3::new(
            losses.cu / C_winding,
            ((1.0 - rotor_share) * losses.iron + losses.friction + G_sc * coolant) / C_stator,
            rotor_share * losses.iron / C_rotor,
        );
        let half = self.matrix() * (0.5 * h);
        let before = Vector3::new(at.winding, at.stator, at.magnet);
        let right = before + half * before + heat * h;
        // Diagonally dominant: it always has an inverse.
        let after = (Matrix3::identity() - half).try_inverse().map_or(before, |inverse| inverse * right);
        let k = 0.5 * h * G_inverter / C_inverter;
        let gained = h * (losses.cond + losses.sw) / C_inverter + 2.0 * k * coolant;
        let inverter = ((1.0 - k) * at.inverter + gained) / (1.0 + k);
        Temperatures { winding: after[0], stator: after[1], magnet: after[2], inverter }
    }

    /// Heat (W) to the `coolant` (K).
    pub fn to_coolant(&self, at: &Temperatures, coolant: f64) -> f64 {
        self.G_sc * (at.stator - coolant) + self.G_inverter * (at.inverter - coolant)
    }
}

/// A value at the temperature `T` (K) over its value at `T_ref` (K), with the coefficient `alpha` (1/K).
#[inline]
pub fn factor(alpha: f64, T: f64, T_ref: f64) -> f64 {
    1.0 + alpha * (T - T_ref)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ZERO: f64 = 273.15;
    const ALPHA: f64 = 3.93e-3;

    /// The networks of the reference's machines a, b, c: C of winding, stator, rotor; G_ws, G_sc, G_sr.
    fn networks() -> [Thermal; 3] {
        [
            [1200.0, 6000.0, 2500.0, 12.0, 6.0, 1.5],
            [150.0, 900.0, 250.0, 2.0, 1.2, 0.3],
            [2500.0, 12_000.0, 6000.0, 60.0, 150.0, 8.0],
        ]
        .map(|[C_winding, C_stator, C_rotor, G_ws, G_sc, G_sr]| Thermal {
            C_winding,
            C_stator,
            C_rotor,
            C_inverter: 500.0,
            G_ws,
            G_sc,
            G_sr,
            G_inverter: 20.0,
            rotor_share: 0.1,
        })
    }

    /// Of each machine: coolant in degC, copper loss at 20 degC and iron loss in W, then in degC: steady and after 600 s; time constants.
    const FIGURES: [[[f64; 3]; 4]; 3] = [
        [[20.0, 180.60, 61.64], [87.380, 68.345, 72.454], [48.461, 34.181, 23.493], [2479.5, 822.1, 81.76]],
        [[40.0, 45.11, 7.90], [133.570, 100.950, 103.583], [88.172, 62.338, 47.841], [1397.9, 530.5, 63.20]],
        [[65.0, 661.23, 264.18], [86.204, 72.316, 75.619], [85.787, 71.957, 69.999], [795.6, 101.9, 30.84]],
    ];

    /// The temperatures (degC) after `time` (s) with the copper loss that follows the winding, in steps of `h` (s).
    fn after(network: &Thermal, [coolant, p_20, iron]: [f64; 3], time: f64, h: f64) -> [f64; 3] {
        let coolant = coolant + ZERO;
        let mut at = Temperatures { winding: coolant, stator: coolant, magnet: coolant, inverter: coolant };
        let mut left = time / h;
        while left > 0.5 {
            let losses = Losses { cu: p_20 * factor(ALPHA, at.winding, ZERO + 20.0), iron, ..Losses::default() };
            at = network.step(&at, &losses, coolant, h);
            left -= 1.0;
        }
        [at.winding - ZERO, at.stator - ZERO, at.magnet - ZERO]
    }

    #[test]
    fn temperatures_of_three_machines() {
        for (network, [losses, steady, late, _]) in networks().iter().zip(FIGURES) {
            let [found, after] = [after(network, losses, 1e5, 10.0), after(network, losses, 600.0, 0.1)];
            println!("{found:.3?} of {steady:?}, {after:.3?} of {late:?} degC");
            for (got, wanted) in found.iter().zip(steady).chain(after.iter().zip(late)) {
                assert!((got - wanted).abs() < 0.01, "{got} degC, not {wanted} degC");
            }
            // The closed form of the winding.
            let [coolant, p_20, iron] = losses;
            let r = 1.0 / network.G_ws + 1.0 / network.G_sc;
            let closed = (coolant + p_20 * (1.0 - 20.0 * ALPHA) * r + iron / network.G_sc) / (1.0 - ALPHA * p_20 * r);
            assert!((found[0] - closed).abs() < 1e-3, "{} {closed}", found[0]);
        }
    }

    #[test]
    fn time_constants_of_three_machines() {
        for (network, [_, _, _, wanted]) in networks().iter().zip(FIGURES) {
            let mut found: Vec<f64> = network.matrix().complex_eigenvalues().iter().map(|x| -1.0 / x.re).collect();
            found.sort_by(|a, b| b.total_cmp(a));
            println!("{found:.2?} of {wanted:?} s");
            assert!(found.iter().zip(wanted).all(|(got, wanted)| (got / wanted - 1.0).abs() < 1e-3), "{found:?}");
        }
    }

    #[test]
    fn a_long_step_is_stable_and_the_heat_arrives() {
        let network = &networks()[2];
        let losses = Losses { cu: 600.0, iron: 200.0, cond: 300.0, sw: 200.0, friction: 100.0 };
        let mut at = Temperatures { winding: 300.0, stator: 300.0, magnet: 300.0, inverter: 300.0 };
        for _ in 0..2000 {
            at = network.step(&at, &losses, 338.15, 1e3);
        }
        let q = network.to_coolant(&at, 338.15);
        assert!((q / losses.sum() - 1.0).abs() < 1e-9, "{q} W");
    }

    #[test]
    fn resistance_and_magnet_follow_the_temperature() {
        let figures =
            [(-20.0, 0.84280, 1.0440), (80.0, 1.23580, 0.9340), (120.0, 1.39300, 0.8900), (150.0, 1.51090, 0.8570)];
        for (t, resistance, magnet) in figures {
            assert!((factor(ALPHA, t + ZERO, 293.15) - resistance).abs() < 1e-9);
            assert!((factor(-1.1e-3, t + ZERO, 293.15) - magnet).abs() < 1e-9);
        }
    }
}
