//! Random calls on a continuous model with events: Model Exchange and Co-Simulation.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

#[path = "common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;
mod solver;

use fmu_core::{Capabilities, Elapsed, Exported, Model, Step};
use random::{Twin, random_calls};
use solver::ball::*;
use solver::{Kind, ball::Ball};

fmu_export::export!(Ball: ContinuousTime + Events);

impl Twin for Ball {
    const CAN: Capabilities<Self> = fmi::This::CAN;
    const KINDS: &'static [Kind] =
        &[Kind::Me2, Kind::Me3, Kind::Me2, Kind::Me3, Kind::Cs2, Kind::Cs3 { event: false, early: true }];
    const REALS: &'static [u32] = &[TIME, U, K, H, E, A, HELD, V, C, M, H_START, C_M, MAP, V_MEAN, DER_H, DER_V];
    const SET: &'static [u32] = &[U, U, U, K, C, V, M];
    const VALUES: &'static [f64] = &[0.5, 1.0, 0.0, 2.0, 0.1, 0.7, 3.0, 5.0];

    fn is_healthy(&self) -> bool {
        let mut next = self.clone();
        next.derive();
        self.fits() && next.advance(&Step { start: Elapsed::ZERO, h: 1e-3 }).is_ok()
    }

    fn fits(&self) -> bool {
        self.c / self.m <= 10.0
    }
}

#[test]
fn random_calls_of_all_interfaces() {
    random_calls::<Ball>();
}
