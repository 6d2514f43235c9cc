//! Quantities, units and display units: the constants that every variable table names.
//!
//! A [`Quantity`] is the physical quantity of a variable: it has a name (the type definition in the XML), a [`Unit`] with its SI
//! base exponents, and at most one display unit that importers show by default. Each exists once: here or, for a quantity defined
//! by the author, next to the author's model.

use serde::{Deserialize, Serialize};

/// Exponents of the SI base units (FMI 3.0.2, 2.4.3 `BaseUnit`); the radian counts as a base unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Exponents {
    /// Kilogram.
    pub kg: i8,
    /// Meter.
    pub m: i8,
    /// Second.
    pub s: i8,
    /// Ampere.
    #[serde(rename = "A")]
    pub ampere: i8,
    /// Kelvin.
    #[serde(rename = "K")]
    pub kelvin: i8,
    /// Mole.
    pub mol: i8,
    /// Candela.
    pub cd: i8,
    /// Radian.
    pub rad: i8,
}

impl Exponents {
    /// Dimensionless.
    pub const NONE: Self = Self { kg: 0, m: 0, s: 0, ampere: 0, kelvin: 0, mol: 0, cd: 0, rad: 0 };

    /// Exponents of kilogram, meter, second and ampere.
    pub const fn mechanical(kg: i8, m: i8, s: i8, ampere: i8) -> Self {
        Self { kg, m, s, ampere, ..Self::NONE }
    }

    /// Sets the exponent of the kelvin.
    pub const fn with_kelvin(self, kelvin: i8) -> Self {
        Self { kelvin, ..self }
    }

    /// Sets the exponent of the radian.
    pub const fn with_rad(self, rad: i8) -> Self {
        Self { rad, ..self }
    }
}

/// A unit that an importer shows instead: `shown = factor * value + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `rpm`.
    pub name: &'static str,
    /// Factor from the unit to the display unit.
    pub factor: f64,
    /// Offset in the display unit.
    pub offset: f64,
}

/// A unit: `base value = factor * value` in the SI base units of `exponents`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name, for example `N.m`; empty for a number without a unit.
    pub name: &'static str,
    /// SI base exponents.
    pub exponents: Exponents,
    /// Factor to the coherent SI unit (1 for every SI unit).
    pub factor: f64,
}

impl Unit {
    /// A coherent SI unit.
    pub const fn si(name: &'static str, exponents: Exponents) -> Self {
        Self { name, exponents, factor: 1.0 }
    }
}

/// The physical quantity of a variable: the type definition that it refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Name of the type definition, for example `Voltage`; no variable may have this name.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: Unit,
    /// Unit that an importer shows by default, if it differs.
    pub display: Option<DisplayUnit>,
    /// The value is a difference: the factor of a display unit applies, its offset does not (FMI 2.0.5, 2.2.3;
    /// FMI 3.0.2, 2.4.4 `relativeQuantity`).
    pub relative: bool,
}

impl Quantity {
    /// A quantity shown in its own unit.
    pub const fn new(name: &'static str, unit: Unit) -> Self {
        Self { name, unit, display: None, relative: false }
    }

    /// Shows values in another unit.
    pub const fn shown_in(self, display: DisplayUnit) -> Self {
        Self { display: Some(display), ..self }
    }

    /// The quantity of a difference of two such values, under its own name: a band of 1 K is shown as 1 degC, and not as
    /// -272.15 degC.
    ///
    /// ```
    /// # use fmu_core::unit::{KELVIN, Quantity};
    /// const BAND: Quantity = KELVIN.relative("TemperatureDifference");
    /// ```
    pub const fn relative(self, name: &'static str) -> Self {
        Self { name, relative: true, ..self }
    }
}

const RAD_PER_S_UNIT: Unit = Unit::si("rad/s", Exponents::mechanical(0, 0, -1, 0).with_rad(1));

/// Degrees.
pub const DEGREE: DisplayUnit = DisplayUnit { name: "deg", factor: 180.0 / std::f64::consts::PI, offset: 0.0 };
/// Degrees Celsius.
pub const CELSIUS: DisplayUnit = DisplayUnit { name: "degC", factor: 1.0, offset: -273.15 };
/// Revolutions per minute.
pub const RPM: DisplayUnit = DisplayUnit { name: "rpm", factor: 30.0 / std::f64::consts::PI, offset: 0.0 };

/// A number without a unit.
pub const ONE: Quantity = Quantity::new("Number", Unit::si("", Exponents::NONE));
/// Voltage in V.
pub const VOLT: Quantity = Quantity::new("Voltage", Unit::si("V", Exponents::mechanical(1, 2, -3, -1)));
/// Current in A.
pub const AMPERE: Quantity = Quantity::new("Current", Unit::si("A", Exponents::mechanical(0, 0, 0, 1)));
/// Resistance in Ohm.
pub const OHM: Quantity = Quantity::new("Resistance", Unit::si("Ohm", Exponents::mechanical(1, 2, -3, -2)));
/// Conductance in S.
pub const SIEMENS: Quantity = Quantity::new("Conductance", Unit::si("S", Exponents::mechanical(-1, -2, 3, 2)));
/// Reciprocal inductance in 1/H.
pub const PER_HENRY: Quantity =
    Quantity::new("ReciprocalInductance", Unit::si("1/H", Exponents::mechanical(-1, -2, 2, 2)));
/// Inductance in H.
pub const HENRY: Quantity = Quantity::new("Inductance", Unit::si("H", Exponents::mechanical(1, 2, -2, -2)));
/// Capacitance in F.
pub const FARAD: Quantity = Quantity::new("Capacitance", Unit::si("F", Exponents::mechanical(-1, -2, 4, 2)));
/// Rate of a voltage in V/s.
pub const VOLT_PER_S: Quantity = Quantity::new("VoltageRate", Unit::si("V/s", Exponents::mechanical(1, 2, -4, -1)));
/// Flux linkage in Wb.
pub const WEBER: Quantity = Quantity::new("FluxLinkage", Unit::si("Wb", Exponents::mechanical(1, 2, -2, -1)));
/// Torque in N.m.
pub const NEWTON_METER: Quantity = Quantity::new("Torque", Unit::si("N.m", Exponents::mechanical(1, 2, -2, 0)));
/// Power in W.
pub const WATT: Quantity = Quantity::new("Power", Unit::si("W", Exponents::mechanical(1, 2, -3, 0)));
/// Energy in J.
pub const JOULE: Quantity = Quantity::new("Energy", Unit::si("J", Exponents::mechanical(1, 2, -2, 0)));
/// Temperature in K, shown in degrees Celsius.
pub const KELVIN: Quantity =
    Quantity::new("Temperature", Unit::si("K", Exponents::NONE.with_kelvin(1))).shown_in(CELSIUS);
/// Temperature coefficient in 1/K.
pub const PER_KELVIN: Quantity =
    Quantity::new("TemperatureCoefficient", Unit::si("1/K", Exponents::NONE.with_kelvin(-1)));
/// Heat capacity in J/K.
pub const JOULE_PER_KELVIN: Quantity =
    Quantity::new("HeatCapacity", Unit::si("J/K", Exponents::mechanical(1, 2, -2, 0).with_kelvin(-1)));
/// Thermal conductance in W/K.
pub const WATT_PER_KELVIN: Quantity =
    Quantity::new("ThermalConductance", Unit::si("W/K", Exponents::mechanical(1, 2, -3, 0).with_kelvin(-1)));
/// Moment of inertia in kg.m2.
pub const KG_M2: Quantity = Quantity::new("Inertia", Unit::si("kg.m2", Exponents::mechanical(1, 2, 0, 0)));
/// Viscous friction in N.m.s/rad.
pub const NM_S_PER_RAD: Quantity =
    Quantity::new("ViscousFriction", Unit::si("N.m.s/rad", Exponents::mechanical(1, 2, -1, 0).with_rad(-1)));
/// Windage coefficient in N.m.s2/rad2.
pub const NM_S2_PER_RAD2: Quantity =
    Quantity::new("Windage", Unit::si("N.m.s2/rad2", Exponents::mechanical(1, 2, 0, 0).with_rad(-2)));
/// Coefficient of the square of a speed in s2/rad2.
pub const S2_PER_RAD2: Quantity =
    Quantity::new("PerSquareOfSpeed", Unit::si("s2/rad2", Exponents::mechanical(0, 0, 2, 0).with_rad(-2)));
/// Angle in rad, shown in degrees.
pub const RADIAN: Quantity = Quantity::new("Angle", Unit::si("rad", Exponents::NONE.with_rad(1))).shown_in(DEGREE);
/// Speed of rotation in rad/s, shown in rpm.
pub const SPEED: Quantity = Quantity::new("Speed", RAD_PER_S_UNIT).shown_in(RPM);
/// Angular frequency in rad/s: bandwidths and poles, shown without conversion.
pub const RAD_PER_S: Quantity = Quantity::new("AngularFrequency", RAD_PER_S_UNIT);
/// Angular acceleration in rad/s2.
pub const RAD_PER_S2: Quantity =
    Quantity::new("AngularAcceleration", Unit::si("rad/s2", Exponents::mechanical(0, 0, -2, 0).with_rad(1)));
/// Rate in 1/s.
pub const PER_SECOND: Quantity = Quantity::new("Rate", Unit::si("1/s", Exponents::mechanical(0, 0, -1, 0)));
/// Time in s.
pub const SECOND: Quantity = Quantity::new("Time", Unit::si("s", Exponents::mechanical(0, 0, 1, 0)));
/// Length in m.
pub const METER: Quantity = Quantity::new("Length", Unit::si("m", Exponents::mechanical(0, 1, 0, 0)));
/// Area in m2.
pub const METER2: Quantity = Quantity::new("Area", Unit::si("m2", Exponents::mechanical(0, 2, 0, 0)));
/// Volume in m3.
pub const METER3: Quantity = Quantity::new("Volume", Unit::si("m3", Exponents::mechanical(0, 3, 0, 0)));
/// Speed along a line in m/s.
pub const METER_PER_S: Quantity = Quantity::new("Velocity", Unit::si("m/s", Exponents::mechanical(0, 1, -1, 0)));
/// Acceleration in m/s2.
pub const METER_PER_S2: Quantity = Quantity::new("Acceleration", Unit::si("m/s2", Exponents::mechanical(0, 1, -2, 0)));
/// Mass in kg.
pub const KILOGRAM: Quantity = Quantity::new("Mass", Unit::si("kg", Exponents::mechanical(1, 0, 0, 0)));
/// Force in N.
pub const NEWTON: Quantity = Quantity::new("Force", Unit::si("N", Exponents::mechanical(1, 1, -2, 0)));
/// Pressure in Pa.
pub const PASCAL: Quantity = Quantity::new("Pressure", Unit::si("Pa", Exponents::mechanical(1, -1, -2, 0)));

/// Stiffness of a spring in N/m.
pub const NEWTON_PER_M: Quantity = Quantity::new("Stiffness", Unit::si("N/m", Exponents::mechanical(1, 0, -2, 0)));
/// Damping of a translation in N.s/m.
pub const NEWTON_S_PER_M: Quantity = Quantity::new("Damping", Unit::si("N.s/m", Exponents::mechanical(1, 0, -1, 0)));
/// Stiffness of a torsion spring in N.m/rad.
pub const NM_PER_RAD: Quantity =
    Quantity::new("TorsionalStiffness", Unit::si("N.m/rad", Exponents::mechanical(1, 2, -2, 0).with_rad(-1)));
/// Momentum in kg.m/s.
pub const KG_M_PER_S: Quantity = Quantity::new("Momentum", Unit::si("kg.m/s", Exponents::mechanical(1, 1, -1, 0)));
/// Density in kg/m3.
pub const KG_PER_M3: Quantity = Quantity::new("Density", Unit::si("kg/m3", Exponents::mechanical(1, -3, 0, 0)));
/// Frequency in Hz.
pub const HERTZ: Quantity = Quantity::new("Frequency", Unit::si("Hz", Exponents::mechanical(0, 0, -1, 0)));
/// Charge in C.
pub const COULOMB: Quantity = Quantity::new("Charge", Unit::si("C", Exponents::mechanical(0, 0, 1, 1)));
/// Rate of a current in A/s.
pub const AMPERE_PER_S: Quantity = Quantity::new("CurrentRate", Unit::si("A/s", Exponents::mechanical(0, 0, -1, 1)));
/// Magnetic flux density in T.
pub const TESLA: Quantity = Quantity::new("FluxDensity", Unit::si("T", Exponents::mechanical(1, 0, -2, -1)));
/// Electric field strength in V/m.
pub const VOLT_PER_M: Quantity = Quantity::new("FieldStrength", Unit::si("V/m", Exponents::mechanical(1, 1, -3, -1)));
/// Rate of a temperature in K/s.
pub const KELVIN_PER_S: Quantity =
    Quantity::new("TemperatureRate", Unit::si("K/s", Exponents::mechanical(0, 0, -1, 0).with_kelvin(1)));
/// Thermal resistance in K/W.
pub const KELVIN_PER_WATT: Quantity =
    Quantity::new("ThermalResistance", Unit::si("K/W", Exponents::mechanical(-1, -2, 3, 0).with_kelvin(1)));
/// Specific heat capacity in J/(kg.K).
pub const J_PER_KG_K: Quantity =
    Quantity::new("SpecificHeatCapacity", Unit::si("J/(kg.K)", Exponents::mechanical(0, 2, -2, 0).with_kelvin(-1)));
/// Thermal conductivity in W/(m.K).
pub const W_PER_M_K: Quantity =
    Quantity::new("ThermalConductivity", Unit::si("W/(m.K)", Exponents::mechanical(1, 1, -3, 0).with_kelvin(-1)));
/// Heat transfer coefficient in W/(m2.K).
pub const W_PER_M2_K: Quantity =
    Quantity::new("HeatTransferCoefficient", Unit::si("W/(m2.K)", Exponents::mechanical(1, 0, -3, 0).with_kelvin(-1)));
/// Heat flux in W/m2.
pub const W_PER_M2: Quantity = Quantity::new("HeatFlux", Unit::si("W/m2", Exponents::mechanical(1, 0, -3, 0)));
/// Specific energy or enthalpy in J/kg.
pub const J_PER_KG: Quantity = Quantity::new("SpecificEnthalpy", Unit::si("J/kg", Exponents::mechanical(0, 2, -2, 0)));
/// Mass flow in kg/s.
pub const KG_PER_S: Quantity = Quantity::new("MassFlow", Unit::si("kg/s", Exponents::mechanical(1, 0, -1, 0)));
/// Volume flow in m3/s.
pub const M3_PER_S: Quantity = Quantity::new("VolumeFlow", Unit::si("m3/s", Exponents::mechanical(0, 3, -1, 0)));
/// Rate of a pressure in Pa/s.
pub const PASCAL_PER_S: Quantity = Quantity::new("PressureRate", Unit::si("Pa/s", Exponents::mechanical(1, -1, -3, 0)));
/// Dynamic viscosity in Pa.s.
pub const PASCAL_S: Quantity = Quantity::new("DynamicViscosity", Unit::si("Pa.s", Exponents::mechanical(1, -1, -1, 0)));
/// Kinematic viscosity or diffusivity in m2/s.
pub const METER2_PER_S: Quantity = Quantity::new("Diffusivity", Unit::si("m2/s", Exponents::mechanical(0, 2, -1, 0)));
/// Flow resistance in Pa.s/m3.
pub const PASCAL_S_PER_M3: Quantity =
    Quantity::new("FlowResistance", Unit::si("Pa.s/m3", Exponents::mechanical(1, -4, -1, 0)));
/// Flow conductance in kg/(s.Pa).
pub const KG_PER_S_PA: Quantity =
    Quantity::new("FlowConductance", Unit::si("kg/(s.Pa)", Exponents::mechanical(0, 1, 1, 0)));
/// Specific power in W/kg.
pub const W_PER_KG: Quantity = Quantity::new("SpecificPower", Unit::si("W/kg", Exponents::mechanical(0, 2, -3, 0)));
/// Jerk in m/s3.
pub const METER_PER_S3: Quantity = Quantity::new("Jerk", Unit::si("m/s3", Exponents::mechanical(0, 1, -3, 0)));
/// Rate of a force in N/s.
pub const NEWTON_PER_S: Quantity = Quantity::new("ForceRate", Unit::si("N/s", Exponents::mechanical(1, 1, -3, 0)));
/// Rate of a mass flow in kg/s2.
pub const KG_PER_S2: Quantity = Quantity::new("MassFlowRate", Unit::si("kg/s2", Exponents::mechanical(1, 0, -2, 0)));
/// Magnetic field strength in A/m.
pub const AMPERE_PER_M: Quantity =
    Quantity::new("MagneticFieldStrength", Unit::si("A/m", Exponents::mechanical(0, -1, 0, 1)));
/// Current density in A/m2.
pub const AMPERE_PER_M2: Quantity =
    Quantity::new("CurrentDensity", Unit::si("A/m2", Exponents::mechanical(0, -2, 0, 1)));
/// Resistivity in Ohm.m.
pub const OHM_METER: Quantity = Quantity::new("Resistivity", Unit::si("Ohm.m", Exponents::mechanical(1, 3, -3, -2)));
/// Electrical conductivity in S/m.
pub const SIEMENS_PER_M: Quantity =
    Quantity::new("ElectricalConductivity", Unit::si("S/m", Exponents::mechanical(-1, -3, 3, 2)));
/// Permittivity in F/m.
pub const FARAD_PER_M: Quantity = Quantity::new("Permittivity", Unit::si("F/m", Exponents::mechanical(-1, -3, 4, 2)));
/// Permeability in H/m.
pub const HENRY_PER_M: Quantity = Quantity::new("Permeability", Unit::si("H/m", Exponents::mechanical(1, 1, -2, -2)));

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Exponents of a product.
    fn product(factors: &[(&Quantity, i8)]) -> Exponents {
        factors.iter().fold(Exponents::NONE, |sum, (quantity, power)| {
            let of = quantity.unit.exponents;
            let add = |sum: i8, of: i8| sum + power * of;
            Exponents::mechanical(add(sum.kg, of.kg), add(sum.m, of.m), add(sum.s, of.s), add(sum.ampere, of.ampere))
                .with_kelvin(add(sum.kelvin, of.kelvin))
                .with_rad(add(sum.rad, of.rad))
        })
    }

    #[test]
    fn quantities_are_shown_in_their_display_units() {
        let shown = |of: Quantity, value: f64| of.display.map(|unit| (unit.name, unit.factor * value + unit.offset));
        let [deg, celsius, rpm] = [shown(RADIAN, PI / 2.0), shown(KELVIN, 300.0), shown(SPEED, 10.0 * PI)];
        let near = |found: Option<(&str, f64)>, unit: &str, value: f64| {
            assert!(found.is_some_and(|(name, x)| name == unit && (x - value).abs() < 1e-12), "{found:?}");
        };
        near(deg, "deg", 90.0);
        near(celsius, "degC", 26.85);
        near(rpm, "rpm", 300.0);
        let band = KELVIN.relative("TemperatureDifference");
        assert_eq!((band.name, band.unit, band.display), ("TemperatureDifference", KELVIN.unit, KELVIN.display));
        assert_eq!((band.relative, KELVIN.relative, VOLT.display), (true, false, None));
    }

    /// The products below do not see a base unit that is missing everywhere.
    #[test]
    fn each_exponent_is_that_of_its_base_unit() {
        let all = |of: &Quantity| {
            let Exponents { kg, m, s, ampere, kelvin, mol, cd, rad } = of.unit.exponents;
            [kg, m, s, ampere, kelvin, mol, cd, rad]
        };
        assert_eq!(all(&KILOGRAM), [1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(all(&METER), [0, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(all(&SECOND), [0, 0, 1, 0, 0, 0, 0, 0]);
        assert_eq!(all(&AMPERE), [0, 0, 0, 1, 0, 0, 0, 0]);
        assert_eq!(all(&KELVIN), [0, 0, 0, 0, 1, 0, 0, 0]);
        assert_eq!(all(&RADIAN), [0, 0, 0, 0, 0, 0, 0, 1]);
    }

    #[test]
    fn units_fit_together() {
        for (quantity, factors) in [
            (ONE, &[][..]),
            (VOLT, &[(&JOULE, 1), (&COULOMB, -1)]),
            (OHM, &[(&VOLT, 1), (&AMPERE, -1)]),
            (SIEMENS, &[(&OHM, -1)]),
            (WEBER, &[(&VOLT, 1), (&SECOND, 1)]),
            (HENRY, &[(&WEBER, 1), (&AMPERE, -1)]),
            (PER_HENRY, &[(&HENRY, -1)]),
            (FARAD, &[(&COULOMB, 1), (&VOLT, -1)]),
            (VOLT_PER_S, &[(&VOLT, 1), (&SECOND, -1)]),
            (NEWTON_METER, &[(&NEWTON, 1), (&METER, 1)]),
            (PER_KELVIN, &[(&KELVIN, -1)]),
            (JOULE_PER_KELVIN, &[(&JOULE, 1), (&KELVIN, -1)]),
            (WATT_PER_KELVIN, &[(&WATT, 1), (&KELVIN, -1)]),
            (SPEED, &[(&RADIAN, 1), (&SECOND, -1)]),
            (RAD_PER_S, &[(&SPEED, 1)]),
            (RAD_PER_S2, &[(&SPEED, 1), (&SECOND, -1)]),
            (NM_S_PER_RAD, &[(&NEWTON_METER, 1), (&SPEED, -1)]),
            (NM_S2_PER_RAD2, &[(&NEWTON_METER, 1), (&SPEED, -2)]),
            (S2_PER_RAD2, &[(&SPEED, -2)]),
            (PER_SECOND, &[(&SECOND, -1)]),
            (METER2, &[(&METER, 2)]),
            (METER3, &[(&METER, 3)]),
            (METER_PER_S, &[(&METER, 1), (&SECOND, -1)]),
            (METER_PER_S2, &[(&METER, 1), (&SECOND, -2)]),
            (NEWTON, &[(&KILOGRAM, 1), (&METER_PER_S2, 1)]),
            (PASCAL, &[(&NEWTON, 1), (&METER2, -1)]),
            (KG_M2, &[(&KILOGRAM, 1), (&METER2, 1)]),
            (JOULE, &[(&NEWTON, 1), (&METER, 1)]),
            (WATT, &[(&PASCAL, 1), (&METER3, 1), (&SECOND, -1)]),
            (WATT, &[(&VOLT, 1), (&AMPERE, 1)]),
            (NEWTON_PER_M, &[(&NEWTON, 1), (&METER, -1)]),
            (NEWTON_S_PER_M, &[(&NEWTON, 1), (&SECOND, 1), (&METER, -1)]),
            (NM_PER_RAD, &[(&NEWTON_METER, 1), (&RADIAN, -1)]),
            (KG_M_PER_S, &[(&KILOGRAM, 1), (&METER_PER_S, 1)]),
            (KG_PER_M3, &[(&KILOGRAM, 1), (&METER3, -1)]),
            (HERTZ, &[(&SECOND, -1)]),
            (COULOMB, &[(&AMPERE, 1), (&SECOND, 1)]),
            (AMPERE_PER_S, &[(&AMPERE, 1), (&SECOND, -1)]),
            (TESLA, &[(&WEBER, 1), (&METER2, -1)]),
            (VOLT_PER_M, &[(&VOLT, 1), (&METER, -1)]),
            (KELVIN_PER_S, &[(&KELVIN, 1), (&SECOND, -1)]),
            (KELVIN_PER_WATT, &[(&WATT_PER_KELVIN, -1)]),
            (J_PER_KG_K, &[(&JOULE_PER_KELVIN, 1), (&KILOGRAM, -1)]),
            (W_PER_M_K, &[(&WATT_PER_KELVIN, 1), (&METER, -1)]),
            (W_PER_M2_K, &[(&WATT_PER_KELVIN, 1), (&METER2, -1)]),
            (W_PER_M2, &[(&WATT, 1), (&METER2, -1)]),
            (J_PER_KG, &[(&JOULE, 1), (&KILOGRAM, -1)]),
            (KG_PER_S, &[(&KILOGRAM, 1), (&SECOND, -1)]),
            (M3_PER_S, &[(&METER3, 1), (&SECOND, -1)]),
            (PASCAL_PER_S, &[(&PASCAL, 1), (&SECOND, -1)]),
            (PASCAL_S, &[(&PASCAL, 1), (&SECOND, 1)]),
            (METER2_PER_S, &[(&PASCAL_S, 1), (&KG_PER_M3, -1)]),
            (PASCAL_S_PER_M3, &[(&PASCAL, 1), (&M3_PER_S, -1)]),
            (KG_PER_S_PA, &[(&KG_PER_S, 1), (&PASCAL, -1)]),
            (W_PER_KG, &[(&WATT, 1), (&KILOGRAM, -1)]),
            (METER_PER_S3, &[(&METER_PER_S2, 1), (&SECOND, -1)]),
            (NEWTON_PER_S, &[(&NEWTON, 1), (&SECOND, -1)]),
            (KG_PER_S2, &[(&KG_PER_S, 1), (&SECOND, -1)]),
            (AMPERE_PER_M, &[(&AMPERE, 1), (&METER, -1)]),
            (AMPERE_PER_M2, &[(&AMPERE, 1), (&METER2, -1)]),
            (OHM_METER, &[(&OHM, 1), (&METER, 1)]),
            (SIEMENS_PER_M, &[(&SIEMENS, 1), (&METER, -1)]),
            (FARAD_PER_M, &[(&FARAD, 1), (&METER, -1)]),
            (HENRY_PER_M, &[(&HENRY, 1), (&METER, -1)]),
        ] {
            assert_eq!(quantity.unit.exponents, product(factors), "{}", quantity.name);
        }
    }
}
