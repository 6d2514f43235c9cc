//! The thermal network: winding, stator iron and rotor with the magnets in a row, and the inverter apart.
//!
//! ```text
//! C_w T_w' = p_cu - G_ws (T_w - T_s)
//! C_s T_s' = (1 - x_r) p_iron + p_friction + G_ws (T_w - T_s) + G_sr (T_r - T_s) - G_sc (T_s - T_c)
//! C_r T_r' = x_r p_iron - G_sr (T_r - T_s)
//! C_i T_i' = p_cond + p_sw - G_i (T_i - T_c)
//! Q = G_sc (T_s - T_c) + G_i (T_i - T_c)                    heat to the coolant
//! ```
//!
//! The time constants are seconds to hours, so the network is not integrated with the machine: it advances once per
//! step of the plant with the step's mean losses, by the trapezoidal rule, which is stable at any step. The copper loss
//! grows with the winding's temperature; at constant current, alpha_R p (1/G_ws + 1/G_sc) >= 1, p the loss at T_ref, has
//! no steady state: the winding runs away.
//!
//! Lumped networks of this size are usual; the equations are heat balances. T in K, C in J/K, G in W/K.

use super::parts::{Heat, Temperatures};
use fmu_core::unit::{JOULE_PER_KELVIN, WATT_PER_KELVIN};
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters of the network; a conductance of 0 insulates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Network {
    /// Heat capacity of the winding, the stator iron, the rotor and the inverter in J/K, > 0.
    pub C_winding: f64,
    /// Stator.
    pub C_stator: f64,
    /// Rotor.
    pub C_rotor: f64,
    /// Inverter.
    pub C_inverter: f64,
    /// Conductance from the winding to the stator in W/K, >= 0.
    pub G_ws: f64,
    /// From the stator to the coolant.
    pub G_sc: f64,
    /// From the rotor to the stator.
    pub G_sr: f64,
    /// From the inverter to the coolant.
    pub G_inverter: f64,
}

impl Network {
    /// The temperatures after a step of `h` (s) with the `heat` (W) of its parts and the coolant at `coolant` (K).
    ///
    /// Solves the trapezoidal rule for the changes; winding and rotor, which are connected to the stator only, are eliminated.
    pub fn step(&self, at: &Temperatures, heat: &Heat, coolant: f64, h: f64) -> Temperatures {
        let &Self { C_winding, C_stator, C_rotor, C_inverter, G_ws, G_sc, G_sr, G_inverter } = self;
        let half = 0.5 * h;
        let (to_stator, from_rotor) = (G_ws * (at.winding - at.stator), G_sr * (at.magnet - at.stator));
        // Change by the net heat (W) at a constant stator temperature.
        let [by_winding, by_rotor] = [h / (C_winding + half * G_ws), h / (C_rotor + half * G_sr)];
        let (winding, rotor) = (by_winding * (heat.winding - to_stator), by_rotor * (heat.magnet - from_rotor));
        let net = heat.iron + to_stator + from_rotor - G_sc * (at.stator - coolant);
        let (g_ws, g_sr) = (0.5 * G_ws, 0.5 * G_sr);
        let capacity = C_stator + h * (g_ws * (1.0 - g_ws * by_winding) + g_sr * (1.0 - g_sr * by_rotor) + 0.5 * G_sc);
        let stator = h * (net + g_ws * winding + g_sr * rotor) / capacity;
        let inverter = h * (heat.inverter - G_inverter * (at.inverter - coolant)) / (C_inverter + half * G_inverter);
        Temperatures {
            winding: at.winding + winding + by_winding * g_ws * stator,
            stator: at.stator + stator,
            magnet: at.magnet + rotor + by_rotor * g_sr * stator,
            inverter: at.inverter + inverter,
        }
    }

    /// The steady temperatures (K) with the `heat` (W) of its parts and the coolant at `coolant` (K); not finite if a heated
    /// part is insulated.
    pub fn steady(&self, heat: &Heat, coolant: f64) -> Temperatures {
        let above = |heat: f64, G: f64| if heat == 0.0 { 0.0 } else { heat / G };
        let stator = coolant + above(heat.winding + heat.iron + heat.magnet, self.G_sc);
        Temperatures {
            winding: stator + above(heat.winding, self.G_ws),
            stator,
            magnet: stator + above(heat.magnet, self.G_sr),
            inverter: coolant + above(heat.inverter, self.G_inverter),
        }
    }

    /// Heat (W) to the `coolant` (K).
    pub fn to_coolant<S: Scalar>(&self, at: &Temperatures<S>, coolant: S) -> S {
        (at.stator - coolant) * self.G_sc + (at.inverter - coolant) * self.G_inverter
    }
}

type P = Row<Network>;

/// Variables of the network; their owner supplies the prefix `thermal.`.
pub const NETWORK: &Table<Network> = table![
    P::parameter("C_winding", &JOULE_PER_KELVIN, "Heat capacity of the winding; Network: above 0", |p| {
        &mut p.C_winding
    })
    .at_least(0.0),
    P::parameter("C_stator", &JOULE_PER_KELVIN, "Heat capacity of the stator iron; Network: above 0", |p| {
        &mut p.C_stator
    })
    .at_least(0.0),
    P::parameter("C_rotor", &JOULE_PER_KELVIN, "Heat capacity of the rotor with its magnets; Network: above 0", |p| {
        &mut p.C_rotor
    },)
    .at_least(0.0),
    P::parameter("C_inverter", &JOULE_PER_KELVIN, "Heat capacity of the inverter; Network: above 0", |p| {
        &mut p.C_inverter
    })
    .at_least(0.0),
    P::parameter("G_ws", &WATT_PER_KELVIN, "Thermal conductance from the winding to the stator; 0: insulated", |p| {
        &mut p.G_ws
    },)
    .at_least(0.0),
    P::parameter("G_sc", &WATT_PER_KELVIN, "Thermal conductance from the stator to the coolant; 0: insulated", |p| {
        &mut p.G_sc
    },)
    .at_least(0.0),
    P::parameter("G_sr", &WATT_PER_KELVIN, "Thermal conductance from the stator to the rotor; 0: insulated", |p| {
        &mut p.G_sr
    },)
    .at_least(0.0),
    P::parameter(
        "G_inverter",
        &WATT_PER_KELVIN,
        "Thermal conductance from the inverter to the coolant; 0: insulated",
        |p| &mut p.G_inverter,
    )
    .at_least(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::losses::Losses;
    use crate::thermal::{Thermal, factor};
    use nalgebra::Matrix3;

    const ZERO: f64 = 273.15;
    const ALPHA: f64 = 3.93e-3;

    /// Networks of the machines a, b, c of `tests/lossy`: C of winding, stator, rotor; G_ws, G_sc, G_sr.
    fn networks() -> [Network; 3] {
        [
            [1200.0, 6000.0, 2500.0, 12.0, 6.0, 1.5],
            [150.0, 900.0, 250.0, 2.0, 1.2, 0.3],
            [2500.0, 12_000.0, 6000.0, 60.0, 150.0, 8.0],
        ]
        .map(|[C_winding, C_stator, C_rotor, G_ws, G_sc, G_sr]| Network {
            C_winding,
            C_stator,
            C_rotor,
            C_inverter: 500.0,
            G_ws,
            G_sc,
            G_sr,
            G_inverter: 20.0,
        })
    }

    /// A tenth of the iron loss heats the rotor.
    fn heat(losses: &Losses) -> Heat {
        Thermal::default().heat(losses)
    }

    /// The network of the machine: d T/dt = matrix T + heat / capacity.
    fn matrix(network: &Network) -> Matrix3<f64> {
        let &Network { C_winding, C_stator, C_rotor, G_ws, G_sc, G_sr, .. } = network;
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

    /// Of each machine: coolant in degC, copper loss at 20 degC and iron loss in W, then in degC: steady and after 600 s; time constants.
    const FIGURES: [[[f64; 3]; 4]; 3] = [
        [[20.0, 180.60, 61.64], [87.380, 68.345, 72.454], [48.461, 34.181, 23.493], [2479.5, 822.1, 81.76]],
        [[40.0, 45.11, 7.90], [133.570, 100.950, 103.583], [88.172, 62.338, 47.841], [1397.9, 530.5, 63.20]],
        [[65.0, 661.23, 264.18], [86.204, 72.316, 75.619], [85.787, 71.957, 69.999], [795.6, 101.9, 30.84]],
    ];

    /// The temperatures (degC) after `time` (s), in steps of `h` (s), with a copper loss that depends on the winding's.
    fn after(network: &Network, [coolant, p_20, iron]: [f64; 3], time: f64, h: f64) -> [f64; 3] {
        let coolant = coolant + ZERO;
        let mut at = Temperatures { winding: coolant, stator: coolant, magnet: coolant, inverter: coolant };
        let mut left = time / h;
        while left > 0.5 {
            let losses = Losses { cu: p_20 * factor(ALPHA, at.winding, ZERO + 20.0), iron, ..Losses::default() };
            at = network.step(&at, &heat(&losses), coolant, h);
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
    fn the_steady_temperatures_stay() {
        let network = &networks()[0];
        let heat = heat(&Losses { cu: 228.42, iron: 61.64, cond: 30.0, sw: 10.0, friction: 4.0 });
        let at = network.steady(&heat, 293.15);
        let after = network.step(&at, &heat, 293.15, 300.0);
        for (a, b) in [(at.winding, after.winding), (at.stator, after.stator), (at.magnet, after.magnet)] {
            assert!((a - b).abs() < 1e-9 && a > 330.0, "{at:?} {after:?}");
        }
        assert!((at.inverter - after.inverter).abs() < 1e-9 && (at.inverter - 295.15).abs() < 1e-9, "{at:?}");
        let insulated = Network { G_ws: 0.0, ..network.clone() };
        assert!(!insulated.steady(&heat, 293.15).winding.is_finite());
    }

    #[test]
    fn time_constants_of_three_machines() {
        for (network, [_, _, _, wanted]) in networks().iter().zip(FIGURES) {
            let mut found: Vec<f64> = matrix(network).complex_eigenvalues().iter().map(|x| -1.0 / x.re).collect();
            found.sort_by(|a, b| b.total_cmp(a));
            println!("{found:.2?} of {wanted:?} s");
            assert!(found.iter().zip(wanted).all(|(got, wanted)| (got / wanted - 1.0).abs() < 1e-3), "{found:?}");
        }
    }

    #[test]
    fn a_step_is_the_trapezoidal_rule() {
        let network = &networks()[1];
        let (at, h) = (Temperatures { winding: 390.0, stator: 350.0, magnet: 330.0, inverter: 320.0 }, 40.0);
        let losses = Losses { cu: 60.0, iron: 20.0, cond: 9.0, sw: 4.0, friction: 5.0 };
        let after = network.step(&at, &heat(&losses), 313.15, h);
        let rate = |t: &Temperatures| {
            let m = matrix(network) * nalgebra::Vector3::new(t.winding, t.stator, t.magnet);
            let stator = (18.0 + 5.0 + 1.2 * 313.15) / 900.0;
            [m[0] + 60.0 / 150.0, m[1] + stator, m[2] + 2.0 / 250.0, (13.0 - 20.0 * (t.inverter - 313.15)) / 500.0]
        };
        let list = |t: &Temperatures| [t.winding, t.stator, t.magnet, t.inverter];
        let (before, found, first, last) = (list(&at), list(&after), rate(&at), rate(&after));
        for k in 0..4 {
            let wanted = before[k] + 0.5 * h * (first[k] + last[k]);
            assert!(
                (found[k] - wanted).abs() < 1e-10 && (wanted - before[k]).abs() > 0.1,
                "{k}: {} {wanted}",
                found[k]
            );
        }
    }

    #[test]
    fn above_a_current_the_winding_runs_away() {
        // Current, relative to the operating point, at which alpha p (1/G_ws + 1/G_sc) is 1.
        for (network, ([losses, ..], wanted)) in networks().iter().zip(FIGURES.iter().zip([2.374, 2.057, 4.061])) {
            let [coolant, p_20, iron] = *losses;
            let r = 1.0 / network.G_ws + 1.0 / network.G_sc;
            assert!(((1.0 / (ALPHA * p_20 * r)).sqrt() - wanted).abs() < 5e-4);
            let late = |current: f64| {
                let at = |time| after(network, [coolant, p_20 * current * current, iron], time, 100.0)[0];
                [at(2e6), at(4e6)]
            };
            let ([settling, settled], [rising, risen]) = (late(0.99 * wanted), late(1.01 * wanted));
            println!("{wanted}: {settling} to {settled} degC below, {rising} to {risen} degC above");
            assert!((settled / settling - 1.0).abs() < 1e-6 && risen > 2.0 * rising, "{settled} {risen}");
        }
    }

    #[test]
    fn a_long_step_is_stable_and_the_heat_arrives() {
        let network = &networks()[2];
        let losses = Losses { cu: 600.0, iron: 200.0, cond: 300.0, sw: 200.0, friction: 100.0 };
        let mut at = Temperatures { winding: 300.0, stator: 300.0, magnet: 300.0, inverter: 300.0 };
        for _ in 0..2000 {
            at = network.step(&at, &heat(&losses), 338.15, 1e3);
        }
        let q: f64 = network.to_coolant(&at, 338.15);
        assert!((q / losses.sum() - 1.0).abs() < 1e-9, "{q} W");
    }
}
