//! Random calls on a model with states whose importer may handle its events in Co-Simulation, and set its starts: Event Mode, early
//! return, exact start values.
#![allow(missing_docs)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions, rightly or not")]

#[path = "common/oracle.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]
mod oracle;
mod random;
mod solver;

use fmu_core::unit::{METER, METER_PER_S, METER_PER_S2, ONE};
use fmu_core::{
    Block, Capabilities, ContinuousTime, Elapsed, EventMode, Events, Exported, Fault, Indicator, Info, Model, Next,
    Outcome, Row, State, Step, Stop, Table, integrate, table,
};
use random::{Twin, random_calls};
use serde::{Deserialize, Serialize};
use solver::Kind;

/// A ball that bounces on the points of a grid of 1 ms, and takes a sample of its lift every 50 ms.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct Ball {
    u: f64,
    k: f64,
    h: f64,
    v: f64,
    held: f64,
    e: f64,
    samples: u64,
}

impl Default for Ball {
    fn default() -> Self {
        Self { u: 0.0, k: 0.0, h: 0.05, v: 0.0, held: 0.25, e: 0.7, samples: 0 }
    }
}

const PERIOD: f64 = 0.05;

type V = Row<Block<Ball>>;

impl Model for Ball {
    type Outputs = [f64; 3];
    const INFO: Info = Info { name: "Ball", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &METER_PER_S2, "Lift", |m| &mut m.model.u).at_least(-100.0).at_most(100.0),
        V::discrete_input("k", &ONE, "Lift, too", |m| &mut m.model.k).at_most(5.0),
        V::output("h", &METER, "Height", |m| &mut m.out[0]).at_least(-1e3).exact(),
        V::output("v", &METER_PER_S, "Velocity", |m| &mut m.out[1]).at_least(-1e9).at_most(1e9).exact(),
        V::output("energy", &ONE, "Per mass", |m| &mut m.out[2]),
        V::discrete_local("held", &ONE, "k at the last sample", |m| &mut m.model.held).at_most(5.0).exact(),
        V::parameter("e", &ONE, "Restitution", |m| &mut m.model.e).at_least(0.0).at_most(3.0).tunable(),
    ];

    fn validate(&self) -> Result<(), Fault> {
        if self.e > 1.0 { Err(Fault::new("e is greater than 1")) } else { Ok(()) }
    }

    fn initialize(&mut self) {
        self.samples = 0;
    }

    fn output(&self, _: Elapsed, out: &mut [f64; 3]) {
        *out = [self.h, self.v, 9.81 * self.h + 0.5 * self.v * self.v];
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler_hybrid::<Self, 2>(self, step, 1e-3)
    }
}

impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] = &[
        State::new("h", &METER_PER_S, |m: &mut Self| &mut m.h).reinit(),
        State::new("v", &METER_PER_S2, |m: &mut Self| &mut m.v).reinit(),
    ];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        if self.v.abs() > 1e6 {
            return Err(Fault::new("v is too large"));
        }
        dx.copy_from_slice(&[self.v, self.u + self.held - 9.81]);
        Ok(())
    }
}

impl Events for Ball {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "ground", description: "Above the ground" }];

    fn indicators(&self, _: Elapsed, z: &mut [f64]) {
        z[0] = self.h;
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        while self.next(now).is_due(now) {
            (self.held, self.samples) = (self.k, self.samples + 1);
        }
        let bounces = self.h <= 0.0 && self.v < 0.0;
        if bounces {
            (self.h, self.v) = (f64::MIN_POSITIVE, -self.v * self.e);
        }
        Ok(Outcome { states_changed: bounces, again: bounces, ..Outcome::default() })
    }

    fn next(&self, _: Elapsed) -> Next {
        Next::At(Elapsed::periods(self.samples + 1, PERIOD))
    }
}

impl EventMode for Ball {
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
        integrate::euler_to_event::<Self, 2>(self, step, 1e-3)
    }
}

fmu_export::export!(Ball: ContinuousTime + Events + EventMode);

// Value references, written down by hand.
const TIME: u32 = 0;
const U: u32 = 1;
const K: u32 = 2;
const H: u32 = 3;
const V_: u32 = 4;
const ENERGY: u32 = 5;
const HELD: u32 = 6;
const E: u32 = 7;
const DER_H: u32 = 8;
const DER_V: u32 = 9;

impl Twin for Ball {
    const CAN: Capabilities<Self> = fmi::This::CAN;
    const KINDS: &'static [Kind] = &[
        Kind::Me2,
        Kind::Me3,
        Kind::Cs2,
        Kind::Cs3 { event: false, early: false },
        Kind::Cs3 { event: false, early: true },
        Kind::Cs3 { event: true, early: false },
        Kind::Cs3 { event: true, early: true },
        Kind::Cs3 { event: true, early: true },
    ];
    const REALS: &'static [u32] = &[TIME, U, K, H, V_, ENERGY, HELD, E, DER_H, DER_V];
    const SET: &'static [u32] = &[U, U, K, E, H, V_, HELD];
    const VALUES: &'static [f64] = &[0.5, 1.0, 0.0, 2.0, 0.1, 0.7, 3.0, 5.0];

    fn is_healthy(&self) -> bool {
        self.fits() && self.clone().advance(&Step { start: Elapsed::ZERO, h: 1e-3 }).is_ok()
    }

    fn fits(&self) -> bool {
        self.e <= 1.0
    }
}

#[test]
fn random_calls_with_event_mode_and_exact_starts() {
    random_calls::<Ball>();
}
