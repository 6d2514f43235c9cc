//! Connections between plant and controller: the measured quantities, and the terminals that exist on both.
//!
//! `phases` and `sensor` exist on the plant and, mirrored, on the controller; members with the same name connect. The
//! inverter is inside the plant, so the phases carry references and measured values: signals, which a connection makes equal.

use crate::frame::Phases;
use fmu_core::{Icon, Member};
use serde::{Deserialize, Serialize};

/// Quantities measured by the sensors of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Stator currents in A.
    pub i: Phases,
    /// Electrical angle in rad, in (-pi, pi].
    pub theta_e: f64,
    /// Mechanical speed in rad/s.
    pub speed: f64,
}

/// What a controller commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Commanded {
    /// Stator voltage references in V.
    pub u: Phases,
    /// Whether the gates switch.
    pub enable: bool,
    /// Active short circuit, regardless of `enable`.
    pub asc: bool,
}

/// The signals between controller and inverter; the variables of `enable` and `asc` differ between the two sides.
pub const fn phases(enable: Member, asc: Member) -> [Member; 8] {
    [
        Member::signal("u_a"),
        Member::signal("u_b"),
        Member::signal("u_c"),
        enable,
        asc,
        Member::signal("i_a"),
        Member::signal("i_b"),
        Member::signal("i_c"),
    ]
}

/// Icon of the terminal `phases`.
pub const PHASES: Icon = Icon { name: "phases", svg: include_str!("../icons/phases.svg"), color: [217, 72, 15] };

/// Icon of the terminal `sensor`.
pub const SENSOR: Icon = Icon { name: "sensor", svg: include_str!("../icons/sensor.svg"), color: [43, 138, 62] };
