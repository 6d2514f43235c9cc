//! A result with the half-width of its interval.

use serde::{Deserialize, Serialize};

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
    pub(super) fn within(value: f64, u: f64, limit: f64) -> Self {
        if u <= limit { Self { value, u } } else { Self::default() }
    }
}
