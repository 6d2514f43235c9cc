//! A model with samples and other events: both are found, at their times, for any communication step.
#![allow(missing_docs)]

use fmu_core::unit::{ONE, PER_SECOND, SECOND};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Events, Fault, Info, Model, Next, Outcome, Row, State, Step, Table, integrate,
    table,
};
use serde::{Deserialize, Serialize};

const PERIOD: f64 = 0.1;

/// Counts samples; 0.25 s after the start, and 0.25 s later again, a delay ends.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Delayed {
    samples: u64,
    ends: Vec<f64>,
    count: f64,
    x: f64,
}

type V = Row<Block<Delayed>>;

impl Model for Delayed {
    type Outputs = ();
    const INFO: Info = Info { name: "Delayed", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::discrete_local("count", &ONE, "Samples", |m| &mut m.model.count),
        V::state("x", &SECOND, "Time", |m| &mut m.model.x),
        V::local("late", &PER_SECOND, "A local variable without a state", |m| &mut m.model.count),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, (): &mut ()) {}

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, { Self::SCALARS }>(self, step, 1.0)
    }
}

impl ContinuousTime for Delayed {
    const STATES: &'static [State<Self>] = &[State::new("x", &ONE, |m| &mut m.x)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = 1.0;
        Ok(())
    }
}

impl Delayed {
    fn sample(&self) -> Next {
        Next::Grid { k: self.samples, period: PERIOD }
    }

    fn delay(&self) -> Next {
        Next::At(Elapsed::periods(self.ends.len() as u64 + 1, 0.25))
    }
}

impl Events for Delayed {
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.sample().is_due(now) {
            self.samples += 1;
            self.count += 1.0;
        }
        if self.delay().is_due(now) {
            self.ends.push(self.x);
        }
        Ok(Outcome::default())
    }

    fn next(&self, now: Elapsed) -> Next {
        self.sample().or(self.delay(), now)
    }
}

#[test]
fn both_kinds_of_events_are_handled_at_their_times() {
    for steps in [1_u32, 3, 10] {
        let mut block = Block::<Delayed>::default();
        block.initialize();
        let h = 0.65 / f64::from(steps);
        for k in 0..steps {
            block.step(&Step { start: Elapsed::periods(k.into(), h), h }).unwrap();
        }
        let Delayed { samples, ends, x, .. } = &block.model;
        let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(*samples == 7 && ends.len() == 2, "{samples} {ends:?}");
        assert!(near(ends[0], 0.25) && near(ends[1], 0.5) && near(*x, 0.65), "{ends:?} {x}");
    }
}

#[test]
fn the_earlier_of_two_is_the_next() {
    let (now, at) = (Elapsed::ZERO.plus(1.0), |t: f64| Next::At(Elapsed::ZERO.plus(t)));
    assert_eq!((at(2.0).or(at(3.0), now), at(3.0).or(at(2.0), now)), (at(2.0), at(2.0)));
    assert_eq!((Next::Never.or(at(2.0), now), at(2.0).or(Next::Never, now)), (at(2.0), at(2.0)));
    assert_eq!(Next::Never.or(Next::Never, now), Next::Never);
}
