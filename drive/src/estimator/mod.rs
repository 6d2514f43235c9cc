//! Estimators of rotor angle and speed: one file each, one row in the list here.

pub mod rasmussen;

use crate::frame::AlphaBeta;
use fmu_core::{Enumeration, Item};

/// The estimators, in the order of the interface: the value never changes, new ones are appended.
pub static ESTIMATORS: Enumeration = Enumeration {
    name: "Estimator",
    description: "Estimator of rotor angle and speed",
    items: &[Item {
        value: 1,
        name: "Rasmussen",
        description: "Full-order flux observer with PI speed adaptation, Rasmussen 2006, eq (16) and (21)",
    }],
};

/// What a controller knows at sample k.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Stator current measured at the sample, in A.
    pub i: AlphaBeta,
    /// Stator voltage command that acted since the last sample, in V: limited, without dead-time compensation.
    pub u: AlphaBeta,
}

/// What an estimator knows at sample k.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Electrical rotor angle in rad, not wrapped.
    pub theta: f64,
    /// Electrical speed in rad/s.
    pub w: f64,
}
