//! Self-commissioning at standstill: offsets of the current sensors, R_s with the loss of the inverter, L_d, L_q and their
//! saturation, without a shaft sensor and without a load machine. The rotor may be free or blocked.
//!
//! [`Commission`] is called once a sample with the currents and the link's voltage, and commands voltage and gates. It keeps
//! no references and allocates nothing; a sample takes bounded time, at most one evaluation of [`output_error`].
//!
//! ```text
//! Offsets      gates off: means of the phases                                        offsets
//! Probe        0 V: a turning rotor shows; then short pulses in six directions       probe
//! Align        direct current along 120 degrees until the rotor rests                align
//! Resistance   a staircase of currents, there and again at 0                         resistance, curve
//! Swing        the current turns to 0: the rotor swings, unless it is blocked        swing
//! Axes         small triangles of current at 0, 45, 90 and 135 degrees               excitation, axes
//! Saturation   large triangles along d and q, simulated until the currents fit       output_error
//! ```
//!
//! Each result has the relative half-width of its 95 % interval; 1 means refused. Faults end with the gates off. All values
//! scale with the gains of the sensors: currents read 1 % high give R and L 1 % low.

mod align;
mod axes;
mod bench;
mod curve;
mod excitation;
mod least_squares;
mod offsets;
mod output_error;
mod probe;
mod resistance;
mod sequence;
mod swing;

pub use sequence::{Commission, Setup, Voltage};

use fmu_core::enumeration;
use serde::{Deserialize, Serialize};

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
        6 NotFollowing "The rotor turns at the start, or does not come to rest";
        10 Time "commission.t_max is over";
        11 Aborted "commission_start or enable became false";
    }
}

use CommissionFault as Fault;

/// A value and the half-width of its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identified {
    /// Value in its SI unit; 0 until known or if it is refused.
    pub value: f64,
    /// Relative half-width; 1: refused.
    pub u: f64,
}

impl Default for Identified {
    fn default() -> Self {
        Self { value: 0.0, u: 1.0 }
    }
}

impl Identified {
    /// The `value` if its relative half-width `u` is at most `limit`.
    fn within(value: f64, u: f64, limit: f64) -> Self {
        if u <= limit { Self { value, u } } else { Self::default() }
    }
}

/// What the commissioning has found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Stator resistance with one transistor in Ohm.
    pub R_s: Identified,
    /// L(0) in H of the d-axis and of the q-axis.
    pub L_d: Identified,
    /// L(0) in H of the q-axis.
    pub L_q: Identified,
    /// psi(i)/i - without the magnet - in H at `i_d` along the magnet.
    pub L_d_plus: Identified,
    /// psi(i)/i - without the magnet - in H at `i_d` against the magnet.
    pub L_d_minus: Identified,
    /// psi(i)/i in H at `i_q`.
    pub L_q_chord: Identified,
    /// Dead-time voltage of a leg in V, with the threshold of its devices.
    pub u_dead: Identified,
    /// Twice the current in A below which a leg loses less.
    pub i_zero: Identified,
    /// Second-order d-axis saturation coefficient in A/Wb2.
    pub s_2: Identified,
    /// Third-order d-axis saturation coefficient in A/Wb3.
    pub s_3: Identified,
    /// Currents in A of the chords.
    pub i_d: f64,
    /// Current in A of the q-axis chord.
    pub i_q: f64,
    /// Angle of the d-axis in rad at the end; of a blocked rotor modulo pi unless `north`.
    pub axis: f64,
    /// The rotor did not turn.
    pub blocked: bool,
    /// The saturation shows the magnet's north pole at `axis`.
    pub north: bool,
}

/// Integers of eight bytes: the size of a saved state does not depend on them.
mod fixed_size {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(value: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        value.to_le_bytes().serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        <[u8; 8]>::deserialize(deserializer).map(u64::from_le_bytes)
    }
}
