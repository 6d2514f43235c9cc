//! The table of capabilities: derived properties, and refusals.
#![allow(missing_docs)]

use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::*;
use serde::{Deserialize, Serialize};

/// A state in addition to a sampled part.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Both {
    x: f64,
    n: i32,
    samples: u64,
    shown: i32,
}

type V = Row<Block<Both>>;

impl Model for Both {
    type Outputs = ();
    const INFO: Info = Info { name: "Both", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> =
        table![V::output("x", &ONE, "", |m| &mut m.model.x), V::integer_output("n", "", |m| &mut m.model.n)];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 1>(self, step, 0.1)
    }
}

impl ContinuousTime for Both {
    const STATES: &'static [State<Self>] = &[State::new("x", &PER_SECOND, |m: &mut Self| &mut m.x)];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = f64::from(self.n);
        Ok(())
    }
}

impl Sampled for Both {
    fn period(&self) -> f64 {
        0.5
    }
    fn samples(&self) -> u64 {
        self.samples
    }
    fn show(&mut self) {
        self.shown = self.n;
    }
    fn sample(&mut self) -> Result<(), Fault> {
        self.samples += 1;
        self.n += 1;
        Ok(())
    }
}

const NONE: Capabilities<Both> = Capabilities::NONE;

/// Its step integrates between the samples, so it is not a model with samples only.
#[test]
fn event_mode_is_for_models_without_states() {
    assert!(NONE.Sampled().event_mode());
    assert!(!NONE.ContinuousTime().Sampled().event_mode() && !NONE.Sampled().ContinuousTime().event_mode());
    assert!(!NONE.model_exchange() && NONE.Sampled().model_exchange() && NONE.ContinuousTime().model_exchange());
}

#[test]
fn samples_and_states_advance_together() {
    let mut both = Both::default();
    for k in 0..4_u32 {
        both.advance(&Step { start: Elapsed::ZERO.plus(f64::from(k) * 0.7), h: 0.7 }).unwrap();
    }
    // Samples at 0, 0.5, ... 2.5 s: 0.5 s each with 1, 2, ... 5, and 0.3 s with 6.
    assert!(both.samples == 6 && (both.x - (7.5 + 1.8)).abs() < 1e-12, "{} {}", both.samples, both.x);
}

/// Its one clock: when it becomes active, the outputs of the last sample become visible; its tick is the next sample.
#[test]
fn a_sampled_model_acts_on_its_clock() {
    let clock = const { NONE.Clocked().clocked }.unwrap();
    let (mut both, now) = (Both { n: 3, ..Both::default() }, Elapsed::ZERO);
    (clock.activate)(&mut both, 0, now);
    assert_eq!((both.shown, both.samples), (3, 0));
    (clock.tick)(&mut both, 0, now).unwrap();
    assert_eq!((both.shown, both.samples, both.n), (3, 1, 4));
    // The importer alone determines its ticks.
    assert_eq!(
        ((clock.interval)(&both, 0, now), (clock.ticked)(&mut both, 0), clock.feedthrough),
        (None, false, false)
    );
}

#[test]
fn another_interface_is_another_token() {
    let tokens =
        [NONE, NONE.Sampled(), NONE.ContinuousTime(), NONE.ContinuousTime().Sampled()].map(|can| can.hash().guid());
    for (i, token) in tokens.iter().enumerate() {
        assert!(tokens[..i].iter().all(|other| other.as_str() != token.as_str()));
    }
    assert_eq!(NONE.hash().guid().as_str(), Both::HASH.guid().as_str());
}

/// An integer row.
const WRONG: &[State<Both>] = &[State::new("n", &PER_SECOND, |m: &mut Both| &mut m.x)];

struct Nameless;

impl Exported for Nameless {
    type Model = Both;
    const CAN: Capabilities<Both> = {
        let mut can = NONE.ContinuousTime();
        if let Some(continuous) = &mut can.continuous {
            continuous.states = WRONG;
        }
        can
    };
}

#[test]
fn a_state_needs_a_continuous_row() {
    let fault = Description::exported::<Nameless>().unwrap_err();
    assert_eq!(fault.message(), "the state n has no continuous real output or state in the table");
}
