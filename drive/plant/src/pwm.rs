//! Parameters of the modulator of the switched inverter, and of its faults; [`switched`](crate::switched) has the model.

pub use drive_base::modulation::PwmUpdate;
use drive_base::overmodulation::{MODULATION, Modulation};
use fmu_core::unit::SECOND;
use fmu_core::{Field, Part, Row, Table, enumeration, table};
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

enumeration! {
    /// A switch that never conducts, with a working diode. Values never change.
    #[derive(Serialize, Deserialize)]
    pub enum OpenSwitch("OpenSwitch", "Switch that no longer conducts, unlike its diode") {
        1 None "All switches work";
        2 UpperA "Upper switch of phase a";
        3 LowerA "Lower switch of phase a";
        4 UpperB "Upper switch of phase b";
        5 LowerB "Lower switch of phase b";
        6 UpperC "Upper switch of phase c";
        7 LowerC "Lower switch of phase c";
    }
}

enumeration! {
    /// A phase of the machine that carries no current; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum OpenPhase("OpenPhase", "Phase that carries no current") {
        1 None "All phases are connected";
        2 A "Phase a";
        3 B "Phase b";
        4 C "Phase c";
    }
}

impl OpenPhase {
    /// Number of the leg.
    pub(crate) fn leg(self) -> Option<usize> {
        match self {
            Self::None => None,
            Self::A => Some(0),
            Self::B => Some(1),
            Self::C => Some(2),
        }
    }
}

/// Parameters of the modulator, for `inverter.mode` = Switched except `modulation`.
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
    /// Time in s from the start to the first extreme, 0 to half a carrier period.
    pub carrier_delay: f64,
    /// A switch that no longer conducts.
    pub open_switch: OpenSwitch,
    /// A phase that carries no current.
    pub open_phase: OpenPhase,
    /// References beyond the hexagon.
    pub modulation: Modulation,
}

impl Default for Pwm {
    fn default() -> Self {
        let (mode, update, zero_sequence) = (InverterMode::Average, PwmUpdate::Single, ZeroSequence::MinMax);
        let (open_switch, open_phase) = (OpenSwitch::None, OpenPhase::None);
        let modulation = Modulation::default();
        Self { mode, update, zero_sequence, pulse_min: 0.0, carrier_delay: 0.0, open_switch, open_phase, modulation }
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
    P::parameter(
        "inverter.carrier_delay",
        &SECOND,
        "Time from the start, and so from the samples of a controller, to the extremes of the carrier; 0: samples at the extremes",
        |p| { &mut p.carrier_delay }
    )
    .at_least(0.0),
    P::enumeration_parameter(
        "inverter.open_switch",
        "Fault: a switch that no longer conducts, unlike its diode",
        &Field(|p| { &mut p.open_switch })
    ),
    P::enumeration_parameter(
        "inverter.open_phase",
        "Fault: a phase that carries no current",
        &Field(|p| &mut p.open_phase)
    ),
    P::part("modulation.", &Part { table: MODULATION, lens: |p| &mut p.modulation }),
];
