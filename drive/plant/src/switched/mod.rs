//! The switched inverter: its carrier, its bridge of six switches and diodes, and the machine between two instants.
//!
//! | file | contents |
//! |---|---|
//! | [`carrier`] | duty cycles, zero sequences, and the instants at which a leg is commanded |
//! | [`bridge`] | legs with dead time and diodes: which of them conduct, and which block |
//! | [`segment`] | the machine between two instants |
//! | [`run`] | a communication step: from instant to instant |
//!
//! `inverter.mode` = Average replaces all this by the mean over a PWM period ([`inverter`](crate::inverter)).

pub mod bridge;
pub mod carrier;
mod run;
mod segment;

use fmu_core::unit::SECOND;
use fmu_core::{Field, Row, Table, enumeration, table};
pub use run::Bridge;
use serde::{Deserialize, Serialize};

enumeration! {
    /// Model of the inverter; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum InverterMode("InverterMode", "Model of the inverter") {
        1 Average "The mean over a PWM period";
        2 Switched "Six switches with diodes, which a carrier of period inverter.T_pwm switches";
    }
}

enumeration! {
    /// Instants at which the carrier takes over the voltage references; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum PwmUpdate("PwmUpdate", "When new voltage references take effect") {
        1 Single "At the beginning of each carrier period";
        2 Double "At the beginning and in the middle of each carrier period";
    }
}

enumeration! {
    /// Common part of the three leg voltages; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum ZeroSequence("ZeroSequence", "Common part that the modulator adds to the voltage references") {
        1 MinMax "-(max + min)/2: as space-vector modulation, linear up to u_dc/sqrt(3)";
        2 None "None: the references as they are, linear up to u_dc/2";
        3 DpwmHigh "The highest leg stays at the upper rail";
        4 DpwmLow "The lowest leg stays at the lower rail";
        5 DpwmAlternating "The leg with the reference of the largest magnitude stays at its rail";
    }
}

/// Parameters of the modulator, for `inverter.mode` = Switched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pwm {
    /// Model of the inverter.
    pub mode: InverterMode,
    /// Instants at which the references take effect.
    pub update: PwmUpdate,
    /// Common part of the leg voltages.
    pub zero_sequence: ZeroSequence,
    /// Minimum width of a pulse in s, >= 0.
    pub pulse_min: f64,
}

impl Default for Pwm {
    fn default() -> Self {
        let (mode, update, zero_sequence) = (InverterMode::Average, PwmUpdate::Single, ZeroSequence::MinMax);
        Self { mode, update, zero_sequence, pulse_min: 0.0 }
    }
}

type P = Row<Pwm>;

/// Variables of the modulator.
pub const PWM: &Table<Pwm> = table![
    P::enumeration_parameter("inverter.mode", "Model of the inverter", &Field(|p| &mut p.mode)),
    P::enumeration_parameter("inverter.update", "When new voltage references take effect", &Field(|p| &mut p.update)),
    P::enumeration_parameter(
        "inverter.zero_sequence",
        "Common part that the modulator adds to the voltage references",
        &Field(|p| { &mut p.zero_sequence })
    ),
    P::parameter(
        "inverter.pulse_min",
        &SECOND,
        "Minimum width of a pulse; shorter ones are left out, shorter gaps filled; 0: none",
        |p| { &mut p.pulse_min }
    )
    .at_least(0.0),
];
