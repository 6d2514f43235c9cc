//! Inputs of the commissioning, and its commands to the inverter.

use super::status::CommissionMode;
use drive_base::frame::AlphaBeta;
use serde::{Deserialize, Serialize};

/// Inputs of the commissioning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CommissionSetup {
    /// Scope of the commissioning; `Off` disables it.
    pub mode: CommissionMode,
    /// Number of pole pairs, > 0.
    pub n_p: i32,
    /// Sample period in s, > 0.
    pub T_s: f64,
    /// Samples from taking the currents to the voltage acting: 0, 1 or 2.
    pub delay: i32,
    /// Maximum current of the commissioning in A, > 0: about one to two times the rated current.
    pub i: f64,
    /// Rated electrical speed in rad/s, > 0.
    pub speed: f64,
    /// Longest time in s, > 0.
    pub t_max: f64,
    /// Period of the PWM carrier in s: one or two sample periods.
    pub carrier: f64,
}

/// Command to the inverter until the next sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Voltage {
    /// Command in V.
    pub u: AlphaBeta,
    /// The gates are on.
    pub gates: bool,
}
