//! Enumerations of the interface: the mode of the commissioning, its stage, and the reason why it stopped.

use fmu_core::enumeration;
use serde::{Deserialize, Serialize};

enumeration! {
    /// What is commissioned; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum CommissionMode("Commissioning", "Self-commissioning") {
        1 Off "None: commission_start has no effect";
        2 Standstill "Offsets, R_s, the inverter's dead time, L_d, L_q and saturation, with a rotor that is free or blocked";
        3 Spin "Also psi_M, J and friction: the rotor, without a load, turns at up to half of commission.speed";
    }
}

enumeration! {
    /// What the commissioning does; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum CommissionState("CommissionState", "What the commissioning does") {
        1 Idle "Not started";
        2 Offsets "Offsets of the current sensors, with the gates off";
        3 Probe "Short pulses in six directions";
        4 Align "A direct current aligns the rotor";
        5 Resistance "A staircase of direct currents";
        6 Swing "The rotor swings to another angle";
        7 Axes "Small triangles of current in four directions";
        8 Saturation "Large triangles of current along both axes";
        9 Start "A rotating current takes the rotor along";
        10 Levels "Levels of speed, and sweeps between them";
        11 Done "The results are shown";
        12 Refused "commission_fault has the reason; the gates are off";
    }
}

enumeration! {
    /// Why the commissioning has stopped; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum CommissionFault("CommissionFault", "Why the commissioning has stopped") {
        1 None "It has not";
        2 Current "A current above 1.35 commission.i";
        3 Voltage "u_dc fell by 20 %, or does not drive the currents";
        4 Resistance "The staircase gives no resistance";
        5 Inductance "The pulses or loops give no inductance";
        6 NotFollowing "The rotor turns at the start, does not come to rest, is blocked in mode Spin or does not follow the start";
        7 Lost "The observer has lost the turning rotor";
        8 Flux "The levels of speed give no flux linkage";
        9 Mechanics "The levels and sweeps do not fit inertia and friction";
        10 Time "commission.t_max is over";
        11 Aborted "commission_start or enable became false";
    }
}

#[expect(clippy::derivable_impls, reason = "the macro writes the variants")]
impl Default for CommissionState {
    fn default() -> Self {
        Self::Idle
    }
}

#[expect(clippy::derivable_impls, reason = "the macro writes the variants")]
impl Default for CommissionFault {
    fn default() -> Self {
        Self::None
    }
}
