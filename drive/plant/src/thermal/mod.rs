//! Temperatures: their sources, their effect on the machine, and the heat of the losses.
//!
//! ```text
//! R_s(T) = R_s (1 + alpha_R (T_winding - T_ref))          psi_M(T) = psi_M (1 + alpha_psi (T_magnet - T_ref))
//! Q_winding = p_cu          Q_iron = (1 - x_r) p_iron + p_friction          Q_magnet = x_r p_iron
//! Q_inverter = p_cond + p_sw                               Q_winding + Q_iron + Q_magnet + Q_inverter = p_loss
//! ```
//!
//! | `thermal.mode` | temperatures | `Q_coolant` |
//! |---|---|---|
//! | Constant | `thermal.T_start` | all losses, at once |
//! | Network | [`network`], which starts at `thermal.T_start` | heat flow from the network to the coolant |
//! | Imposed | the inputs `T_winding_imposed` ... | 0: the heat leaves through the four parts |
//!
//! Temperatures, and with them R_s(T) and psi_M(T), are constant over a step of the plant ([`warm`]). The controller has
//! separate estimates of both. When psi_M changes by Delta, the stored energy changes by 1.5 i_d Delta at constant flux
//! linkage: mJ over a warm-up, which no loss contains.
//!
//! Usual coefficients: copper 3.93e-3 /K, NdFeB -1.1e-3 /K, SmCo -0.4e-3 /K, ferrite -2e-3 /K at
//! 20 degC. T in K, Q in W, positive out of the part.

pub mod network;
pub mod parts;
pub mod warm;

use crate::losses::Losses;
use drive_base::implausible;
use drive_base::motor::Motor;
use fmu_core::log::Warnings;
use fmu_core::unit::KELVIN;
use fmu_core::{Field, Part, Row, Scalar, Table, enumeration, table};
use network::{NETWORK, Network};
use parts::T_20;
pub use parts::{Heat, THERMAL_INPUTS, Temperatures, ThermalInputs};
use serde::{Deserialize, Serialize};

enumeration! {
    /// Source of the temperatures; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum ThermalMode("ThermalMode", "Where the temperatures come from") {
        1 Constant "thermal.T_start, regardless of the losses";
        2 Network "The thermal network of machine and inverter with the coolant at T_coolant; Co-Simulation only";
        3 Imposed "The inputs T_winding_imposed, T_stator_imposed, T_magnet_imposed, T_inverter_imposed";
    }
}

/// Parameters of temperatures and heat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Thermal {
    /// Source of the temperatures.
    pub mode: ThermalMode,
    /// Temperature coefficient of the resistance in 1/K, >= 0.
    pub alpha_R: f64,
    /// Temperature coefficient of the permanent-magnet flux linkage in 1/K.
    pub alpha_psi: f64,
    /// Temperature in K at which the machine has the values of its parameters.
    pub T_ref: f64,
    /// All temperatures at the start in K.
    pub T_start: f64,
    /// Share of the iron loss that arises in the rotor, 0..1.
    pub rotor_share: f64,
    /// The network.
    pub network: Network,
}

impl Default for Thermal {
    fn default() -> Self {
        Self {
            mode: ThermalMode::Constant,
            alpha_R: 0.0,
            alpha_psi: 0.0,
            T_ref: T_20,
            T_start: T_20,
            rotor_share: 0.1,
            network: Network::default(),
        }
    }
}

/// Ratio of a value at the temperature `T` (K) to that at `T_ref` (K), with the coefficient `alpha` (1/K): exactly 1 for
/// alpha = 0.
#[inline]
pub fn factor<S: Scalar>(alpha: f64, T: S, T_ref: f64) -> S {
    (T - S::from(T_ref)) * alpha + S::from(1.0)
}

impl Thermal {
    /// The `motor` of the parameters at these temperatures.
    #[inline]
    pub fn motor<S: Scalar>(&self, motor: &Motor, at: &Temperatures<S>) -> Motor<S> {
        let &Motor { n_p, R_s, L_d, L_q, psi_M } = motor;
        let resistance = factor(self.alpha_R, at.winding, self.T_ref);
        let magnet = factor(self.alpha_psi, at.magnet, self.T_ref);
        Motor { n_p, R_s: resistance * R_s, L_d, L_q, psi_M: magnet * psi_M }
    }

    /// Warns of temperatures that look like degrees Celsius, and of coefficients that no material has.
    pub fn warn(&self, inputs: &ThermalInputs, log: &mut Warnings<'_>) {
        implausible::winding("winding.alpha", self.alpha_R, log);
        implausible::magnet("magnet.alpha", self.alpha_psi, log);
        let mut check = |name, T| implausible::temperature(name, T, log);
        check("thermal.T_ref", self.T_ref);
        match self.mode {
            ThermalMode::Constant => check("thermal.T_start", self.T_start),
            ThermalMode::Network => {
                check("thermal.T_start", self.T_start);
                check("T_coolant", inputs.coolant);
            }
            ThermalMode::Imposed => {
                let Temperatures { winding, stator, magnet, inverter } = inputs.imposed;
                check("T_winding_imposed", winding);
                check("T_stator_imposed", stator);
                check("T_magnet_imposed", magnet);
                check("T_inverter_imposed", inverter);
            }
        }
    }

    /// The heat of the parts with these `losses`, all of which reaches the coolant.
    #[inline]
    pub fn heat<S: Scalar>(&self, losses: &Losses<S>) -> Heat<S> {
        let magnet = losses.iron * self.rotor_share;
        let [iron, inverter] = [losses.iron - magnet + losses.friction, losses.cond + losses.sw];
        Heat { winding: losses.cu, iron, magnet, inverter, coolant: losses.sum() }
    }

    /// The heat of the parts with these `losses`, and that to the `coolant` (K) at the temperatures `at` (K).
    #[inline]
    pub fn heat_at<S: Scalar>(&self, coolant: S, at: &Temperatures<S>, losses: &Losses<S>) -> Heat<S> {
        let heat = self.heat(losses);
        match self.mode {
            ThermalMode::Constant => heat,
            ThermalMode::Network => Heat { coolant: self.network.to_coolant(at, coolant), ..heat },
            ThermalMode::Imposed => Heat { coolant: 0.0.into(), ..heat },
        }
    }
}

type P = Row<Thermal>;

/// Variables of the temperatures; their owner supplies the prefix `thermal.`.
pub const THERMAL: &Table<Thermal> = table![
    P::enumeration_parameter("mode", "Where the temperatures come from", &Field(|p| &mut p.mode)),
    P::parameter("T_ref", &KELVIN, "Temperature of motor.R_s and motor.psi_M", |p| &mut p.T_ref).above(0.0),
    P::parameter("T_start", &KELVIN, "All temperatures at the start", |p| &mut p.T_start).above(0.0),
    P::part("", &Part { table: NETWORK, lens: |p| &mut p.network }),
];

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact numbers")]
mod tests {
    use super::*;

    #[test]
    fn resistance_and_magnet_follow_the_temperature() {
        let thermal = Thermal { alpha_R: 3.93e-3, alpha_psi: -1.1e-3, ..Thermal::default() };
        let figures =
            [(-20.0, 0.84280, 1.0440), (80.0, 1.23580, 0.9340), (120.0, 1.39300, 0.8900), (150.0, 1.51090, 0.8570)];
        let cold = Motor::IPMSM_2_2_KW;
        for (t, resistance, magnet) in figures {
            let motor = thermal.motor(&cold, &Temperatures::all(t + 273.15));
            println!("{t} degC: {} {}", motor.R_s / cold.R_s, motor.psi_M / cold.psi_M);
            assert!((motor.R_s / cold.R_s - resistance).abs() < 1e-9);
            assert!((motor.psi_M / cold.psi_M - magnet).abs() < 1e-9);
        }
        assert_eq!(thermal.motor(&cold, &Temperatures::all(293.15)), cold);
        assert_eq!(Thermal::default().motor(&cold, &Temperatures::all(411.7)), cold);
    }

    #[test]
    fn the_heat_is_that_of_the_losses() {
        let heat = Thermal::default().heat(&Losses { cu: 1.0, iron: 20.0, cond: 300.0, sw: 4000.0, friction: 5e4 });
        let Heat { winding, iron, magnet, inverter, coolant } = heat;
        assert_eq!([winding, iron, magnet, inverter], [1.0, 50_018.0, 2.0, 4300.0]);
        assert_eq!(coolant, winding + iron + magnet + inverter);
    }
}
