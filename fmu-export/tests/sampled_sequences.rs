//! Random calls on a sampled model: Model Exchange, Event Mode, early return, Co-Simulation.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

#[path = "common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;
mod solver;

use fmu_core::{Capabilities, Exported};
use random::{Twin, random_calls};
use solver::sampler::*;
use solver::{Kind, sampler::Sampler};

fmu_export::export!(Sampler: Sampled);

impl Twin for Sampler {
    const CAN: Capabilities<Self> = fmi::This::CAN;
    const KINDS: &'static [Kind] = &[
        Kind::Me2,
        Kind::Me3,
        Kind::Cs2,
        Kind::Cs3 { event: false, early: false },
        Kind::Cs3 { event: false, early: true },
        Kind::Cs3 { event: true, early: false },
        Kind::Cs3 { event: true, early: true },
    ];
    const REALS: &'static [u32] = &[TIME, X, D, Y, GAIN, PERIOD, FIXED, PRODUCT];
    const SET: &'static [u32] = &[X, D, X, D, GAIN, FIXED];
    const VALUES: &'static [f64] = &[0.5, 1.0, 0.0, 2.0, 0.1, 0.7, 3.0, 5.0];

    fn is_healthy(&self) -> bool {
        self.fits() && self.x <= 1e6
    }

    fn fits(&self) -> bool {
        self.gain * self.fixed <= 50.0
    }
}

#[test]
fn random_calls_of_all_interfaces() {
    random_calls::<Sampler>();
}
