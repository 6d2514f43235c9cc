//! Temperatures and heat of the parts: winding, stator iron, rotor with the magnets, and inverter. T in K, Q in W, positive out
//! of the part.

use fmu_core::unit::KELVIN;
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// 20 degC in K: the start value of inputs, parameters and temperatures.
pub(super) const T_20: f64 = 293.15;

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

    /// Applies `f` to each part and the same part of `other`.
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
    /// From the stator iron, including friction.
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
    /// Applies `f` to each part and the same part of `other`.
    pub fn zip<T>(&self, other: &Self, f: impl Fn(f64, f64) -> T) -> ThermalInputs<T> {
        ThermalInputs { coolant: f(self.coolant, other.coolant), imposed: self.imposed.zip(&other.imposed, f) }
    }
}

type I = Row<ThermalInputs>;

/// Inputs: temperatures set by the importer.
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
