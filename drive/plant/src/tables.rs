//! The plant's parameters, and the tables of its variables.

use crate::flux_map::{FLUX_MAP, FluxMap};
use crate::inverter::{INVERTER, Inverter};
use crate::iron::{IRON, Iron};
use crate::losses::flow::{Dissipation, Winding};
use crate::machine::Magnetics;
use crate::mechanics::{MECHANICS, Mechanics};
use crate::power::{ENERGY, POWERS};
use crate::pwm::{InverterMode, PWM};
use crate::saturation::{SATURATION, Saturation};
use crate::signals::PlantOutputs;
use crate::thermal::{THERMAL, Thermal};
use drive_base::frame::Dq;
use drive_base::motor::{MOTOR, Motor};
use fmu_core::unit::{AMPERE, KELVIN, NEWTON_METER, ONE, PER_KELVIN, RADIAN, S2_PER_RAD2, SPEED, WATT, WEBER};
use fmu_core::{Part, Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// The parameters of machine, inverter and shaft.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlantParameters {
    /// The machine.
    pub motor: Motor,
    /// Its saturation.
    pub saturation: Saturation,
    /// A map instead of inductances and saturation.
    pub flux_map: FluxMap,
    /// Inertia and friction.
    pub mechanics: Mechanics,
    /// State at the start.
    pub initial: Initial,
    /// The inverter.
    pub inverter: Inverter,
    /// Iron loss of the machine.
    pub iron: Iron,
    /// Winding parameters other than its resistance.
    pub winding: Winding,
    /// Temperatures and heat.
    pub thermal: Thermal,
}

impl PlantParameters {
    /// The relation between current and flux linkage.
    #[inline]
    pub fn magnetics(&self) -> Magnetics<'_> {
        if self.flux_map.used {
            Magnetics::Map(&self.flux_map)
        } else if self.saturation.is_none() {
            Magnetics::Linear
        } else {
            Magnetics::Polynomial(&self.saturation)
        }
    }

    /// Whether the current follows from the inductances alone.
    #[inline]
    pub fn is_linear(&self) -> bool {
        self.saturation.is_none() && !self.flux_map.used
    }

    /// Whether the inverter is the average one, its legs are ideal and the constant resistance of the winding is the only loss of the machine, which allows the
    /// fastest step. Every parameter is named, so a new one does not compile until it is considered here.
    pub fn is_ideal(&self) -> bool {
        let Self {
            motor: _,
            saturation: _,
            flux_map: _,
            inverter,
            mechanics: _,
            initial: _,
            iron,
            winding,
            thermal: _,
        } = self;
        let Inverter { dead_time, T_pwm: _, i_zero: _, devices, pwm } = inverter;
        let Winding { k_ac } = winding;
        pwm.mode == InverterMode::Average && *dead_time == 0.0 && devices.is_none() && iron.is_none() && *k_ac == 0.0
    }

    /// Whether the inverter is switched by its carrier.
    #[inline]
    pub fn is_switched(&self) -> bool {
        self.inverter.pwm.mode == InverterMode::Switched
    }

    /// Resistance and conductance with the stator resistance `R_s` (Ohm) at standstill, at the electrical speed `w` (rad/s).
    #[inline]
    pub fn dissipation<S: Scalar>(&self, R_s: S, w: S) -> Dissipation<S> {
        Dissipation::at(&self.winding, &self.iron, R_s, w)
    }

    /// The smallest inductance in H, over all states of a map.
    pub fn least_inductance(&self) -> f64 {
        if self.flux_map.used { self.flux_map.least_inductance() } else { self.motor.L_d.min(self.motor.L_q) }
    }
}

/// Initial position and speed of the rotor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Initial {
    /// Electrical rotor angle in rad.
    pub theta_e: f64,
    /// Mechanical speed in rad/s.
    pub speed: f64,
}

type O = Row<PlantOutputs>;

/// The plant's outputs.
pub const OUTPUTS: &Table<PlantOutputs> = table![
    O::output("speed", &SPEED, "Mechanical rotor speed", |o| &mut o.speed).nominal(100.0),
    O::output("angle", &RADIAN, "Mechanical rotor angle, not wrapped", |o| &mut o.angle).unbounded().nominal(1.0),
    O::output("theta_e", &RADIAN, "Electrical rotor angle from phase a to the d axis, in (-pi, pi]", |o| {
        &mut o.theta_e
    }),
    O::output("tau_e", &NEWTON_METER, "Electromagnetic torque at the instant", |o| &mut o.tau_e),
    O::output(
        "tau_shaft",
        &NEWTON_METER,
        "Torque of the shaft on the load: tau_load, or with mechanics.imposed tau_e minus friction; mean over the last \
                 step, as p_mech (PmsmDrive: over the last T_s; Model Exchange: at the instant)",
        |o| &mut o.powers.tau_shaft,
    )
    .mean(),
    O::output("i_a", &AMPERE, "Stator current of phase a, positive into the machine", |o| &mut o.i.a),
    O::output("i_b", &AMPERE, "Stator current of phase b", |o| &mut o.i.b),
    O::output("i_c", &AMPERE, "Stator current of phase c", |o| &mut o.i.c),
    O::output("i_d", &AMPERE, "d-axis stator current", |o| &mut o.i_d),
    O::output("i_q", &AMPERE, "q-axis stator current", |o| &mut o.i_q),
    O::part("", &Part { table: POWERS, lens: |o| &mut o.powers }),
    O::output(
        "efficiency",
        &ONE,
        "p_mech / p_in of a motor, p_in / p_mech of a generator, else 0; of the means (Model Exchange: at the instant)",
        |o| &mut o.efficiency,
    )
    .mean(),
    O::part("energy_", &Part { table: ENERGY, lens: |o| &mut o.energy }),
    O::part("", &Part { table: THERMAL_OUTPUTS, lens: |o| o }),
];

/// Temperatures and heat.
const THERMAL_OUTPUTS: &Table<PlantOutputs> = table![
    O::output("T_winding", &KELVIN, "Temperature of the winding", |o| &mut o.temperatures.winding).nominal(300.0),
    O::output("T_stator", &KELVIN, "Temperature of the stator iron", |o| &mut o.temperatures.stator).nominal(300.0),
    O::output("T_magnet", &KELVIN, "Temperature of the magnets", |o| &mut o.temperatures.magnet).nominal(300.0),
    O::output("T_inverter", &KELVIN, "Temperature of the inverter", |o| &mut o.temperatures.inverter).nominal(300.0),
    O::output("Q_winding", &WATT, "Heat out of the winding, p_cu; mean like p_cu", |o| &mut o.heat.winding).mean(),
    O::output(
        "Q_iron",
        &WATT,
        "Heat out of the stator iron, (1 - iron.rotor_share) p_iron + p_friction; mean like these",
        |o| &mut o.heat.iron,
    )
    .mean(),
    O::output("Q_magnet", &WATT, "Heat out of rotor and magnets, iron.rotor_share p_iron; mean like p_iron", |o| {
        &mut o.heat.magnet
    },)
    .mean(),
    O::output("Q_inverter", &WATT, "Heat out of the inverter, p_cond + p_sw; mean like these", |o| {
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

type P = Row<PlantParameters>;

/// The plant's parameters.
pub const PARAMETERS: &Table<PlantParameters> = table![
    P::part("motor.", &Part { table: MOTOR, lens: |p| &mut p.motor }),
    P::part("saturation.", &Part { table: SATURATION, lens: |p| &mut p.saturation }),
    P::part("flux_map.", &Part { table: FLUX_MAP, lens: |p| &mut p.flux_map }),
    P::part("mechanics.", &Part { table: MECHANICS, lens: |p| &mut p.mechanics }),
    P::parameter("initial.theta_e", &RADIAN, "Electrical rotor angle at the start", |p| &mut p.initial.theta_e),
    P::parameter("initial.speed", &SPEED, "Mechanical rotor speed at the start", |p| &mut p.initial.speed),
    P::part("inverter.", &Part { table: INVERTER, lens: |p| &mut p.inverter }),
    P::part("iron.", &Part { table: IRON, lens: |p| &mut p.iron }),
    P::parameter("iron.rotor_share", &ONE, "Share of the iron loss that heats the rotor", |p| {
        &mut p.thermal.rotor_share
    })
    .at_least(0.0)
    .at_most(1.0),
    P::parameter(
        "winding.k_ac",
        &S2_PER_RAD2,
        "Growth of the resistance with the square of the electrical speed, R_s (1 + k_ac w^2); 0: none",
        |p| &mut p.winding.k_ac,
    )
    .at_least(0.0),
    P::parameter(
        "winding.alpha",
        &PER_KELVIN,
        "Temperature coefficient of the resistance, R_s (1 + alpha (T_winding - T_ref)); copper 3.93e-3; 0: none",
        |p| &mut p.thermal.alpha_R,
    )
    .at_least(0.0)
    .nominal(4e-3),
    P::parameter(
        "magnet.alpha",
        &PER_KELVIN,
        "Temperature coefficient of the permanent-magnet flux linkage; NdFeB -1.1e-3; 0: none",
        |p| &mut p.thermal.alpha_psi,
    )
    .nominal(1e-3),
    P::part("thermal.", &Part { table: THERMAL, lens: |p| &mut p.thermal }),
    P::part("", &Part { table: PWM, lens: |p| &mut p.inverter.pwm }),
];

type S = Row<Dq>;

/// The flux linkage: the states of the plant and of `PmsmDrive` that are not outputs.
pub const FLUX: &Table<Dq> = table![
    S::state("psi_d", &WEBER, "d-axis stator flux linkage", |psi| psi.parts_mut().0).nominal(0.1),
    S::state("psi_q", &WEBER, "q-axis stator flux linkage", |psi| psi.parts_mut().1).nominal(0.1),
];
