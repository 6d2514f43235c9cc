//! A drive of the atlas.

use super::run::Approach;
use crate::compare::candidate::{Candidate, Class, Entry};
use drive::Pair;

/// A drive at rest, and what 1 means on the axes of the atlas.
#[derive(Clone)]
pub struct Drive {
    /// Name of estimator and machine.
    pub name: String,
    /// Plant and controller.
    pub pair: Pair,
    /// Rated mechanical speed in rad/s.
    pub speed: f64,
    /// Rated torque in N.m.
    pub torque: f64,
    /// How it comes to its speed.
    pub approach: Approach,
}

impl Drive {
    /// The drive of `fmu compare`.
    pub fn of(entry: Entry) -> Self {
        let Candidate { class, pair, torque, .. } = Candidate::new(entry);
        let rest = class == Class::FluxObserver;
        Self {
            name: entry.name.into(),
            pair,
            speed: if rest { 2.0 } else { 1.0 } * crate::runner::RATED_SPEED,
            torque,
            approach: if rest { Approach::Rest } else { Approach::Turning },
        }
    }
}
