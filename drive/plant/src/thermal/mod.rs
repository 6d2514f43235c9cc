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
pub mod warm;

use crate::losses::Losses;
use crate::signals::PlantOutputs;
use crate::tables::{PARAMETERS, PlantParameters};
use drive_base::motor::Motor;
use fmu_core::unit::{KELVIN, WATT};
use fmu_core::{Fault, Field, Part, Row, Scalar, Table, enumeration, table};
use network::{NETWORK, Network};
use serde::{Deserialize, Serialize};

/// 20 degC in K: the start value of inputs, parameters and temperatures.
const T_20: f64 = 293.15;

enumeration! {
    /// Where the temperatures come from; values never change.
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
    /// Where the temperatures come from.
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

/// Temperatures in K.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Temperatures<S = f64> {
    /// Winding.
    pub winding: S,
    /// Stator iron.
    pub stator: S,
    /// Magnets.
    pub magnet: S,
    /// Inverter.
    pub inverter: S,
}

impl Temperatures {
    /// One temperature `T` (K) for all parts.
    pub fn all(T: f64) -> Self {
        Self { winding: T, stator: T, magnet: T, inverter: T }
    }

    /// Applies `f` to each and that of `other`.
    fn zip<T>(&self, other: &Self, f: impl Fn(f64, f64) -> T) -> Temperatures<T> {
        Temperatures {
            winding: f(self.winding, other.winding),
            stator: f(self.stator, other.stator),
            magnet: f(self.magnet, other.magnet),
            inverter: f(self.inverter, other.inverter),
        }
    }
}

impl<S: Scalar> Temperatures<S> {
    /// Applies `f` to each.
    pub fn map<T>(&self, f: impl Fn(S) -> T) -> Temperatures<T> {
        let &Self { winding, stator, magnet, inverter } = self;
        Temperatures { winding: f(winding), stator: f(stator), magnet: f(magnet), inverter: f(inverter) }
    }
}

/// Heat in W, positive out of the part that produces it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Heat<S = f64> {
    /// From the winding.
    pub winding: S,
    /// From the stator iron, including that of friction.
    pub iron: S,
    /// From the rotor with its magnets.
    pub magnet: S,
    /// From the inverter.
    pub inverter: S,
    /// To the coolant.
    pub coolant: S,
}

impl<S: Scalar> Heat<S> {
    /// Applies `f` to each.
    pub fn map<T>(&self, f: impl Fn(S) -> T) -> Heat<T> {
        let &Self { winding, iron, magnet, inverter, coolant } = self;
        Heat { winding: f(winding), iron: f(iron), magnet: f(magnet), inverter: f(inverter), coolant: f(coolant) }
    }
}

/// Inputs in K.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThermalInputs<S = f64> {
    /// Temperature of the coolant, for the network.
    pub coolant: S,
    /// Imposed temperatures.
    pub imposed: Temperatures<S>,
}

impl Default for ThermalInputs {
    fn default() -> Self {
        Self { coolant: T_20, imposed: Temperatures::all(T_20) }
    }
}

impl ThermalInputs {
    /// Applies `f` to each and that of `other`.
    pub fn zip<T>(&self, other: &Self, f: impl Fn(f64, f64) -> T) -> ThermalInputs<T> {
        ThermalInputs { coolant: f(self.coolant, other.coolant), imposed: self.imposed.zip(&other.imposed, f) }
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

    /// The heat of the parts with these `losses`; the coolant receives all of it.
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

/// Rejects a network without heat capacities.
///
/// # Errors
/// Names the parameter and what to do.
pub fn validate(par: &PlantParameters) -> Result<(), Fault> {
    if par.thermal.mode != ThermalMode::Network {
        return Ok(());
    }
    let capacities: [Get; 4] = [
        |p| &mut p.thermal.network.C_winding,
        |p| &mut p.thermal.network.C_stator,
        |p| &mut p.thermal.network.C_rotor,
        |p| &mut p.thermal.network.C_inverter,
    ];
    for get in capacities {
        if *get(&mut par.clone()) <= 0.0 {
            let mode = PARAMETERS.tell(par, |p| &mut p.thermal.mode);
            let allowed = format!("greater than 0 with {mode}; set the heat capacity, or thermal.mode = 1 (Constant)");
            return Err(PARAMETERS.fault(par, get, allowed));
        }
    }
    Ok(())
}

/// Rejects temperatures at which the machine has no resistance or no magnet; `names` are those of the temperatures of
/// winding and magnets.
///
/// # Errors
/// Names the temperature, its effect and what to do.
#[inline]
pub fn check(par: &PlantParameters, at: &Temperatures, names: [&str; 2], remedy: &str) -> Result<(), Fault> {
    let Motor { R_s, psi_M, .. } = par.thermal.motor(&par.motor, at);
    let works = |x: f64| x > 0.0 && x.is_finite();
    if !works(R_s) {
        let effect = format!("resistance {R_s} Ohm");
        return Err(refused(par, (names[0], at.winding), |p| &mut p.thermal.alpha_R, &effect, remedy));
    }
    if !works(psi_M) {
        let effect = format!("permanent-magnet flux linkage {psi_M} Wb");
        return Err(refused(par, (names[1], at.magnet), |p| &mut p.thermal.alpha_psi, &effect, remedy));
    }
    Ok(())
}

type Get = fn(&mut PlantParameters) -> &mut f64;

#[cold]
fn refused(par: &PlantParameters, (name, T): (&str, f64), alpha: Get, effect: &str, remedy: &str) -> Fault {
    let [alpha, T_ref] = [PARAMETERS.tell(par, alpha), PARAMETERS.tell(par, |p| &mut p.thermal.T_ref)];
    Fault::new(format!(
        "{name} = {T} K with {alpha} and {T_ref} makes the {effect}, which must be greater than 0: {remedy}"
    ))
}

type P = Row<Thermal>;

/// Variables of the temperatures; their owner supplies the prefix `thermal.`.
pub const THERMAL: &Table<Thermal> = table![
    P::enumeration_parameter("mode", "Where the temperatures come from", &Field(|p| &mut p.mode)),
    P::parameter("T_ref", &KELVIN, "Temperature of motor.R_s and motor.psi_M", |p| &mut p.T_ref).above(0.0),
    P::parameter("T_start", &KELVIN, "All temperatures at the start", |p| &mut p.T_start).above(0.0),
    P::part("", &Part { table: NETWORK, lens: |p| &mut p.network }),
];

type I = Row<ThermalInputs>;

/// The temperatures that the importer sets.
pub const THERMAL_INPUTS: &Table<ThermalInputs> = table![
    I::input("T_coolant", &KELVIN, "Temperature of the coolant", |i| &mut i.coolant)
        .at_least(0.0)
        .nominal(300.0)
        .read_with("thermal.mode", "Network"),
    I::input("T_winding_imposed", &KELVIN, "Temperature of the winding", |i| &mut i.imposed.winding)
        .at_least(0.0)
        .nominal(300.0)
        .read_with("thermal.mode", "Imposed"),
    I::input("T_stator_imposed", &KELVIN, "Temperature of the stator iron", |i| &mut i.imposed.stator)
        .at_least(0.0)
        .nominal(300.0)
        .read_with("thermal.mode", "Imposed"),
    I::input("T_magnet_imposed", &KELVIN, "Temperature of the magnets", |i| &mut i.imposed.magnet)
        .at_least(0.0)
        .nominal(300.0)
        .read_with("thermal.mode", "Imposed"),
    I::input("T_inverter_imposed", &KELVIN, "Temperature of the inverter", |i| &mut i.imposed.inverter)
        .at_least(0.0)
        .nominal(300.0)
        .read_with("thermal.mode", "Imposed"),
];

type O = Row<PlantOutputs>;

/// Temperatures and heat.
pub const THERMAL_OUTPUTS: &Table<PlantOutputs> = table![
    O::output("T_winding", &KELVIN, "Temperature of the winding", |o| &mut o.temperatures.winding).nominal(300.0),
    O::output("T_stator", &KELVIN, "Temperature of the stator iron", |o| &mut o.temperatures.stator).nominal(300.0),
    O::output("T_magnet", &KELVIN, "Temperature of the magnets", |o| &mut o.temperatures.magnet).nominal(300.0),
    O::output("T_inverter", &KELVIN, "Temperature of the inverter", |o| &mut o.temperatures.inverter).nominal(300.0),
    O::output("Q_winding", &WATT, "Heat out of the winding, p_cu; a mean as p_cu is", |o| &mut o.heat.winding).mean(),
    O::output(
        "Q_iron",
        &WATT,
        "Heat out of the stator iron, (1 - iron.rotor_share) p_iron + p_friction; a mean as these are",
        |o| &mut o.heat.iron,
    )
    .mean(),
    O::output("Q_magnet", &WATT, "Heat out of rotor and magnets, iron.rotor_share p_iron; a mean as p_iron is", |o| {
        &mut o.heat.magnet
    },)
    .mean(),
    O::output("Q_inverter", &WATT, "Heat out of the inverter, p_cond + p_sw; a mean as these are", |o| {
        &mut o.heat.inverter
    })
    .mean(),
    O::output(
        "Q_coolant",
        &WATT,
        "Heat to the coolant, out of the FMU: Constant all losses, Network the heat flow from the network, Imposed 0",
        |o| &mut o.heat.coolant,
    )
    .mean(),
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
