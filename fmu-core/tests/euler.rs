//! Euler's method on its grid, and the way to the next event.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_core::unit::{METER, METER_PER_S, METER_PER_S2};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Events, Fault, Indicator, Info, Model, Next, Outcome, Row, State, Step, Table,
    integrate, table,
};
use serde::{Deserialize, Serialize};

#[derive(Clone, Default, Serialize, Deserialize)]
struct Ball {
    h: f64,
    v: f64,
    /// Events end the simulation at this number of bounces.
    bounces: u32,
    last: u32,
    /// An instant that is due once.
    alarm: Option<f64>,
}

type V = Row<Block<Ball>>;

impl Model for Ball {
    type Outputs = ();
    const INFO: Info = Info { name: "Ball", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::state("h", &METER, "Height", |m| &mut m.model.h),
        V::state("v", &METER_PER_S, "Velocity", |m| &mut m.model.v),
    ];

    fn initialize(&mut self) {
        (self.h, self.last) = (1.0, if self.last == 0 { u32::MAX } else { self.last });
    }

    fn output(&self, _: Elapsed, (): &mut ()) {}

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 2>(self, step, 1e-2)
    }
}

impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] =
        &[State::new("h", &METER_PER_S, |m| &mut m.h), State::new("v", &METER_PER_S2, |m| &mut m.v)];

    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&[self.v, -9.81]);
        Ok(())
    }
}

impl Events for Ball {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "" }];

    fn indicators(&self, _: Elapsed, z: &mut [f64]) {
        z[0] = self.h;
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.next(now).is_due(now) {
            self.alarm = None;
            self.v = 0.0;
        }
        if self.h <= 0.0 && self.v < 0.0 {
            (self.h, self.v, self.bounces) = (f64::MIN_POSITIVE, -0.7 * self.v, self.bounces + 1);
        }
        Ok(Outcome { terminate: self.bounces >= self.last, ..Outcome::default() })
    }

    fn next(&self, _: Elapsed) -> Next {
        self.alarm.map_or(Next::Never, |at| Next::At(Elapsed::ZERO.plus(at)))
    }
}

fn ball() -> Ball {
    let mut ball = Ball::default();
    ball.initialize();
    ball
}

/// Time (s) of the first bounce.
fn fall() -> f64 {
    (2.0_f64 / 9.81).sqrt()
}

#[test]
fn the_grid_has_the_same_bits_whatever_the_step_is() {
    let (mut h, mut v) = (1.0, 0.0);
    for _ in 0..300 {
        (h, v) = (h + 1e-3 * v, v + 1e-3 * -9.81);
    }
    for steps in [1_u32, 3, 7, 300, 999] {
        let (mut ball, mut now, size) = (ball(), Elapsed::ZERO, 0.3 / f64::from(steps));
        for _ in 0..steps {
            integrate::euler::<Ball, 2>(&mut ball, &Step { start: now, h: size }, 1e-3).unwrap();
            now = now.plus(size);
        }
        assert_eq!((ball.h, ball.v), (h, v), "{steps} steps");
    }
    // The remainder of a step is left to the next one.
    let mut ball = ball();
    integrate::euler::<Ball, 2>(&mut ball, &Step { start: Elapsed::ZERO, h: 0.9e-3 }, 1e-3).unwrap();
    assert_eq!(ball.v, 0.0);
    integrate::euler::<Ball, 2>(&mut ball, &Step { start: Elapsed::ZERO.plus(0.9e-3), h: 0.2e-3 }, 1e-3).unwrap();
    assert_eq!(ball.v, 1e-3 * -9.81);
    let why = integrate::euler::<Ball, 2>(&mut ball, &Step { start: Elapsed::ZERO, h: 1e9 }, 1e-3).unwrap_err();
    assert!(why.message().contains("at most 100000 s"), "{why}");
}

#[test]
fn a_step_leads_to_the_first_event() {
    let step = Step { start: Elapsed::ZERO, h: 1.0 };
    let mut located = ball();
    let stop = integrate::to_event::<Ball, 2>(&mut located, &step, 1e-2).unwrap();
    assert!((stop.at.seconds() - fall()).abs() < 1e-9 && stop.event && located.bounces == 0, "{stop:?}");
    let mut gridded = ball();
    let stop = integrate::euler_to_event::<Ball, 2>(&mut gridded, &step, 1e-3).unwrap();
    assert_eq!((stop.at, stop.event), (Elapsed::periods(453, 1e-3), true));
    // The next step begins with the event.
    let step = Step { start: stop.at, h: 0.1 };
    let stop = integrate::euler_to_event::<Ball, 2>(&mut gridded, &step, 1e-3).unwrap();
    assert_eq!((stop.at, stop.event, gridded.bounces), (step.end(), false, 1));
    // An instant that is due, inside the step and at its end.
    for (h, inside) in [(0.2, true), (0.1, false)] {
        let mut ball = Ball { alarm: Some(0.1), ..ball() };
        let step = Step { start: Elapsed::ZERO, h };
        let stop = integrate::to_event::<Ball, 2>(&mut ball, &step, 1e-2).unwrap();
        assert_eq!(
            (stop.event, stop.at.seconds(), stop.settles, step.end().since(stop.at) > 1e-9),
            (true, 0.1, false, inside)
        );
    }
}

#[test]
fn without_events_it_is_the_advance() {
    let step = Step { start: Elapsed::ZERO, h: 0.4 };
    let (mut advanced, mut stopped) = (ball(), ball());
    advanced.advance(&step).unwrap();
    let stop = integrate::to_event::<Ball, 2>(&mut stopped, &step, 1e-2).unwrap();
    assert_eq!((stop.at, stop.event, stopped.h, stopped.v), (step.end(), false, advanced.h, advanced.v));
}

#[test]
fn an_event_ends_the_simulation() {
    let step = Step { start: Elapsed::ZERO, h: 2.0 };
    let mut ball = Ball { last: 2, ..Ball::default() };
    ball.initialize();
    let mut located = ball.clone();
    let end = located.advance(&step).unwrap_err().ends().unwrap();
    assert!((end.seconds() - fall() * 2.4).abs() < 1e-6 && located.bounces == 2, "{end:?}");
    let end = integrate::euler_hybrid::<Ball, 2>(&mut ball, &step, 1e-3).unwrap_err();
    let (mut h, mut v, mut bounces, mut k) = (1.0, 0.0, 0, 0);
    while bounces < 2 {
        (h, v, k) = (h + 1e-3 * v, v + 1e-3 * -9.81, k + 1);
        if h <= 0.0 {
            (h, v, bounces) = (f64::MIN_POSITIVE, -0.7 * v, bounces + 1);
        }
    }
    assert_eq!((end.ends(), ball.bounces), (Some(Elapsed::periods(k, 1e-3)), 2), "{end}");
    assert_eq!(Fault::new("an error").ends(), None);
}
