//! Self-commissioning without a shaft sensor and without a load machine. At standstill: offsets of the current sensors, R_s
//! with the loss of the inverter, L_d, L_q and their saturation; the rotor may be free or blocked. Then, in mode Spin, psi_M,
//! J, B and tau_coulomb of the turning machine, at up to half of its rated speed.
//!
//! [`Commission`] is called once a sample with the currents and the link's voltage, and commands voltage and gates. It keeps no
//! references and allocates nothing; the work per sample is bounded, at most one simulation of a record of 512 rows.
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
//! Levels       levels of speed and sweeps between them, cut into parts               levels, trial, circle, mechanics
//! Done         the gates are off; a spun rotor coasts from 0.1 of the rated speed
//! ```
//!
//! Each result has the relative half-width of its 95 % interval; 1 means refused. Faults end with the gates off, and the results
//! obtained so far remain visible: a blocked rotor in mode Spin ends in Refused with NotFollowing, because psi_M and J were
//! requested, and the results at standstill are shown.
//!
//! A free rotor shows which inductance belongs to the magnet axis (`alignment`); if the rotor is blocked, the smaller inductance
//! is taken as L_d.
//!
//! Limits: a load present from the first level to the last counts as friction; friction and inertia belong to the whole shaft.
//! Only the range from 0.15 to 0.45 of the rated speed separates B from tau_coulomb, so often only their sum is accepted. J
//! needs two turns in a sweep: a rotor with few turns per second that reaches its rated speed within some 10 ms yields no J.
//! Values scale with the gains of the sensors: currents that read 1 % high give R and L 1 % low, J and friction 1 % high; a
//! voltage that reads 1 % high gives R, L, psi_M, J and friction 1 % high.

mod align;
mod alignment;
mod axes;
mod bench;
mod circle;
mod curve;
mod excitation;
mod exciting;
mod identified;
mod least_squares;
mod levels;
mod mechanics;
mod offsets;
mod output_error;
mod probe;
mod probing;
mod resistance;
mod resting;
mod results;
mod ripple;
mod sequence;
mod setup;
mod spinning;
mod starting;
mod status;
mod swing;
mod tensor;
mod trial;
mod turning;

pub use identified::Identified;
pub use results::{LIMIT_DEAD, LIMIT_L, LIMIT_R, LIMIT_SATURATION, Results};
pub use sequence::Commission;
pub use setup::{CommissionSetup, Voltage};
pub use status::{CommissionFault, CommissionMode, CommissionState};

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
