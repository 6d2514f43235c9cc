//! The built-in integrators: order, events where they are, what must end with an error.
#![allow(missing_docs, clippy::float_cmp)]

use fmu_core::unit::{ONE, SPEED};
use fmu_core::*;
use serde::{Deserialize, Serialize};

/// dx/dt = v, dv/dt = -1 - 0.1 v; at x = 0 it bounces without loss; every `period` it is counted.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Body {
    x: f64,
    v: f64,
    period: f64,
    ticks: u32,
    bounces: Vec<f64>,
    restless: bool,
    stuck: bool,
}

impl Model for Body {
    type Outputs = ();
    const INFO: Info = Info { name: "Body", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = &Table::new(
        const {
            &[
                Row::<Block<Body>>::output("x", &ONE, "", |m| &mut m.model.x),
                Row::<Block<Body>>::state("v", &ONE, "", |m| &mut m.model.v),
            ]
        },
    );
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::hybrid::<Self, 2>(self, step, 0.01)
    }
}

impl ContinuousTime for Body {
    const STATES: &'static [State<Self>] = &[
        State::new("x", &SPEED, |m: &mut Body| &mut m.x).reinit(),
        State::new("v", &SPEED, |m: &mut Body| &mut m.v).reinit(),
    ];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&[self.v, -1.0 - 0.1 * self.v]);
        Ok(())
    }
}

impl Events for Body {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "" }];
    fn indicators(&self, _: Elapsed, z: &mut [f64]) {
        z[0] = self.x + 1e-12;
    }
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        while !self.stuck && self.next(now).is_due(now) {
            self.ticks += 1;
        }
        if self.x <= 0.0 && self.v < 0.0 {
            (self.x, self.v) = (0.0, -self.v);
            self.bounces.push(now.seconds());
        }
        Ok(Outcome { again: self.restless, ..Outcome::default() })
    }
    fn next(&self, _: Elapsed) -> Next {
        if self.period > 0.0 { Next::At(Elapsed::periods(u64::from(self.ticks) + 1, self.period)) } else { Next::Never }
    }
}

/// Velocity and height after `t` from rest at height 1.
fn fall(t: f64) -> (f64, f64) {
    let e = (-0.1 * t).exp();
    (-10.0 * (1.0 - e), 1.0 - 10.0 * t + 100.0 * (1.0 - e))
}

fn high() -> Body {
    Body { x: 1.0, ..Body::default() }
}

#[test]
fn the_classical_method_is_of_fourth_order() {
    let error = |longest: f64| {
        let mut body = high();
        integrate::smooth::<Body, 2>(&mut body, &Step { start: Elapsed::ZERO, h: 1.0 }, longest).unwrap();
        (body.x - fall(1.0).1).abs()
    };
    let ratio = error(0.5) / error(0.25);
    assert!((14.0..18.0).contains(&ratio), "{ratio}");
}

#[test]
fn a_bounce_is_where_it_is_whatever_the_step() {
    // Height 0, by bisection on the exact solution.
    let (mut low, mut high_end) = (1.0, 2.0);
    while high_end - low > 1e-15 {
        let middle = f64::midpoint(low, high_end);
        *(if fall(middle).1 > 0.0 { &mut low } else { &mut high_end }) = middle;
    }
    for h in [0.003, 0.1, 0.7, 2.0] {
        let (mut body, mut now) = (high(), Elapsed::ZERO);
        while now.seconds() < 2.0 {
            body.advance(&Step { start: now, h }).unwrap();
            now = now.plus(h);
        }
        assert!((body.bounces[0] - low).abs() < 1e-9, "{} {low}", body.bounces[0]);
    }
}

/// An event that is due at the end of a step belongs to the next one, which has the inputs of that instant.
#[test]
fn an_event_at_a_communication_point() {
    for (period, h) in [(0.25, 0.25), (0.25, 0.5), (0.3, 0.1), (0.1, 0.3), (1e-3, 1e-3), (0.01, 0.025)] {
        for start in [0, 100_000] {
            let mut now = Elapsed::periods(start.into(), period);
            let mut body = Body { period, v: 100.0, ticks: start, ..high() };
            for n in 1..=40_u32 {
                body.advance(&Step { start: now, h })
                    .unwrap_or_else(|fault| panic!("{period} {h} {start} {n}: {fault}"));
                now = now.plus(h);
                // All instants before this one, and not this one.
                let all = (f64::from(n) * h / period - 1e-3).floor();
                assert_eq!(f64::from(body.ticks - start), all, "{period} {h} {start} {n}");
            }
        }
    }
}

#[test]
fn what_does_not_end_is_an_error() {
    let step = Step { start: Elapsed::ZERO, h: 1.0 };
    let restless = Body { restless: true, ..high() }.advance(&step).unwrap_err();
    assert_eq!(restless.message(), "the event at 0 s after the start does not settle");
    let stuck = Body { stuck: true, period: 0.5, ..high() }.advance(&step).unwrap_err();
    assert_eq!(stuck.message(), "0.5 s after the start, events follow each other without time between them");
    let long = Body::default().advance(&Step { start: Elapsed::ZERO, h: 1e9 }).unwrap_err();
    assert_eq!(long.message(), "the step size = 1000000000 s is not allowed: at most 1000000 s");
    let nan = integrate::smooth::<Body, 2>(&mut Body { v: f64::INFINITY, ..high() }, &step, 0.1).unwrap_err();
    assert!(
        nan.message().starts_with("x = ") && nan.message().ends_with("a finite number, 0 s after the start"),
        "{nan}"
    );
}
