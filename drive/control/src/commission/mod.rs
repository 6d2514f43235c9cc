//! Self-commissioning without a shaft sensor and without a load machine. At standstill: offsets of the current sensors, R_s
//! with the loss of the inverter, L_d, L_q and their saturation; the rotor may be free or blocked. Then, in mode Spin, psi_M,
//! J, B and tau_coulomb of the turning machine, at up to half of its rated speed.
//!
//! [`Commission`] is called once a sample with the currents and the link's voltage, and commands voltage and gates. It keeps
//! no references and allocates nothing; a sample takes bounded time, at most one simulation of a record of 512 rows.
//!
//! ```text
//! Offsets      gates off: means of the phases                                        offsets
//! Probe        0 V: a turning rotor shows; then short pulses in six directions       probe
//! Align        direct current along 120 degrees until the rotor rests, less of it
//!              where the magnet rests beside it                                      align, alignment
//! Resistance   a staircase of currents, there and again at 0                         resistance, curve
//! Swing        the current turns to 0: the rotor swings, unless it is blocked        swing
//! Axes         small triangles of current at 0, 45, 90 and 135 degrees               excitation, axes
//! Saturation   large triangles along d and q, simulated until the currents fit       output_error
//! Start        a rotating current takes the rotor to 0.12 of the rated speed         starting, turning
//! Levels       levels of speed and sweeps between them, cut into parts               levels, circle, mechanics
//! Done         the gates are off; a spun rotor coasts from 0.1 of the rated speed
//! ```
//!
//! Each result has the relative half-width of its 95 % interval; 1 means refused. Faults end with the gates off, and what is
//! known by then stays shown: a blocked rotor in mode Spin ends in Refused with NotFollowing, because psi_M and J are what
//! its user has asked for, and shows what standstill tells.
//!
//! A free rotor shows which inductance is the magnet's (`alignment`); of a blocked one, the smaller inductance is taken as L_d.
//!
//! Limits: a load that is there from the first level to the last counts as friction; friction and inertia are those of the
//! whole shaft. B and tau_coulomb are told apart by 0.15 to 0.45 of the rated speed only, so that often just their sum is
//! accepted. J needs two turns in a sweep: a rotor that reaches its rated speed within some 10 ms gets none if it is slow.
//! Values scale with the gains of the sensors: currents that read 1 % high give R and L 1 % low, J and friction 1 % high; a
//! voltage that reads 1 % high gives R, L, psi_M, J and friction 1 % high.

mod align;
mod alignment;
mod axes;
mod bench;
mod circle;
mod curve;
mod excitation;
mod least_squares;
mod levels;
mod mechanics;
mod offsets;
mod output_error;
mod probe;
mod resistance;
mod results;
mod sequence;
mod setup;
mod starting;
mod swing;
mod turning;

pub use results::{Identified, LIMIT_DEAD, LIMIT_L, LIMIT_R, LIMIT_SATURATION, Results};
pub use sequence::Commission;
pub use setup::{CommissionSetup, Voltage};

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

use CommissionFault as Fault;

/// Integers of eight bytes: the size of a saved state does not depend on them.
mod fixed_size {
    #![expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a field by reference")]

    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        value.to_le_bytes().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        <[u8; 8]>::deserialize(deserializer).map(u64::from_le_bytes)
    }
}
