//! The limits of the references.

use drive_base::math::{at_least, at_most};
use serde::{Deserialize, Serialize};

/// Limits of the current references.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Maximum |i_q| in A, > 0.
    pub i_q: f64,
    /// Maximum phase current (peak) in A, > 0.
    pub i: f64,
    /// Maximum magnitude of the torque reference in N.m, > 0.
    pub tau: f64,
}

impl Limits {
    /// Maximum |i_q| in A beside `i_d` (A), which has priority.
    #[inline]
    pub fn i_q_beside(&self, i_d: f64) -> f64 {
        at_most(at_least(self.i * self.i - i_d * i_d, 0.0).sqrt(), self.i_q)
    }
}
