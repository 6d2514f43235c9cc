//! The integrators: order, events at their time, and a limit for endless events.
#![allow(missing_docs)]

use fmu_core::unit::{ONE, Quantity, Unit};
use fmu_core::*;
use serde::{Deserialize, Serialize};
use std::cell::Cell;

const RATE: Quantity = Quantity::new("TestRate", Unit::si("1/s", unit::Exponents::mechanical(0, 0, -1, 0)));

/// A model with two states, without variables: only its motion is tested.
macro_rules! model {
    ($model:ty) => {
        impl Model for $model {
            type Outputs = ();
            const INFO: Info = Info { name: stringify!($model), ..Info::DEFAULT };
            const TABLE: &'static Table<Block<Self>> = table![];
            fn initialize(&mut self) {}
            fn output(&self, _now: Elapsed, _out: &mut ()) {}
            fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
                unreachable!("the tests call the integrators")
            }
        }
    };
}

/// `steps` steps of `h` (s) by `advance`, from the start.
fn run<M>(
    model: &mut M,
    steps: u32,
    h: f64,
    advance: impl Fn(&mut M, &Step) -> Result<(), Fault>,
) -> Result<Elapsed, Fault> {
    let mut now = Elapsed::ZERO;
    for _ in 0..steps {
        let step = Step { start: now, h };
        advance(model, &step)?;
        now = step.end();
    }
    Ok(now)
}

/// A capacitor behind a resistor with a time constant of 1 s, on a voltage that falls with the same time constant.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Circuit {
    u: f64,
}

model!(Circuit);

impl ContinuousTime for Circuit {
    const STATES: &'static [State<Self>] = &[State::new("u", &RATE, |m| &mut m.u)];
    fn derivatives(&self, now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = (-now.seconds()).exp() - self.u;
        Ok(())
    }
}

#[test]
fn a_smooth_model_is_integrated_with_order_four() {
    // u = t e^-t.
    let error = |longest: f64| {
        let mut circuit = Circuit::default();
        run(&mut circuit, 2, 1.0, |m, step| integrate::smooth::<_, 1>(m, step, longest)).unwrap();
        (circuit.u - 2.0 * (-2.0_f64).exp()).abs()
    };
    let (coarse, fine) = (error(0.05), error(0.025));
    assert!((coarse / fine - 16.0).abs() < 1.5 && fine < 1e-8, "{coarse} {fine}");
}

#[test]
fn a_state_that_leaves_the_numbers_is_named() {
    let mut circuit = Circuit { u: f64::MAX };
    let step = Step { start: Elapsed::ZERO, h: 1e4 };
    let fault = integrate::smooth::<_, 1>(&mut circuit, &step, 1e4).unwrap_err();
    assert!(fault.message().starts_with('u') && fault.message().contains("a finite number"), "{fault}");
    assert!(circuit.u.is_finite(), "nothing changed");
    let fault = integrate::smooth::<_, 1>(&mut circuit, &Step { h: 1e9, ..step }, 1e-3).unwrap_err();
    assert!(fault.message().contains("at most 100000 s"), "{fault}");
}

/// Gravity in m/s2.
const G: f64 = 9.81;
/// Speed after a bounce over the speed before it.
const BOUNCE: f64 = 0.7;

/// A ball that falls from 1 m; slower than `rest` (m/s) it stays on the ground.
#[derive(Clone, Serialize, Deserialize)]
struct Ball {
    height: f64,
    speed: f64,
    rest: f64,
    resting: bool,
    /// Times of the bounces in s.
    bounces: Vec<f64>,
}

impl Default for Ball {
    fn default() -> Self {
        Self { height: 1.0, speed: 0.0, rest: 0.01, resting: false, bounces: Vec::new() }
    }
}

model!(Ball);

impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] =
        &[State::new("h", &RATE, |m| &mut m.height), State::<Self>::new("v", &RATE, |m| &mut m.speed).reinit()];
    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        (dx[0], dx[1]) = if self.resting { (0.0, 0.0) } else { (self.speed, -G) };
        Ok(())
    }
}

impl Events for Ball {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "Height" }];
    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        z[0] = self.height;
    }
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.height > 0.0 {
            return Ok(Outcome::default());
        }
        self.bounces.push(now.seconds());
        // Above the ground by the smallest number.
        (self.height, self.speed) = (f64::MIN_POSITIVE, -BOUNCE * self.speed);
        if self.speed < self.rest {
            (self.speed, self.resting) = (0.0, true);
        }
        Ok(Outcome { states_changed: true, ..Outcome::default() })
    }
    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

#[test]
fn a_ball_bounces_when_it_reaches_the_ground() {
    let first = (2.0 / G).sqrt();
    for (h, steps) in [(1e-3, 4000), (0.013, 308), (0.5, 8)] {
        let mut ball = Ball::default();
        run(&mut ball, steps, h, |m, step| integrate::hybrid::<_, 2>(m, step, 10e-3)).unwrap();
        let (mut expected, mut flight) = (first, 2.0 * first);
        assert_eq!(ball.bounces.len(), 18, "h = {h} s: 0.7^18 of 4.4 m/s is below 0.01 m/s");
        for bounce in &ball.bounces {
            assert!((bounce - expected).abs() < 1e-9, "h = {h} s: {bounce} s, not {expected} s");
            flight *= BOUNCE;
            expected += flight;
        }
        assert!(ball.resting && ball.height > 0.0 && ball.speed == 0.0, "h = {h} s: {} m", ball.height);
    }
}

#[test]
fn events_without_end_are_refused() {
    // Without rest, the bounces come ever closer: 2.6 s after the start, infinitely many have passed.
    let mut ball = Ball { rest: -1.0, ..Ball::default() };
    let fault = run(&mut ball, 1, 3.0, |m, step| integrate::hybrid::<_, 2>(m, step, 10e-3)).unwrap_err();
    assert!(fault.message().contains("events follow each other"), "{fault}");
    assert!(ball.height > -1e-9, "{} m", ball.height);
}

/// Falls at 1 m/s from 1 m; counts how often its indicator is computed.
#[derive(Clone, Serialize, Deserialize)]
struct Lift {
    height: f64,
    landed: Option<f64>,
    looks: Cell<u32>,
}

model!(Lift);

impl Default for Lift {
    fn default() -> Self {
        Self { height: 1.0, landed: None, looks: Cell::new(0) }
    }
}

impl ContinuousTime for Lift {
    const STATES: &'static [State<Self>] = &[State::new("h", &RATE, |m| &mut m.height)];
    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = -1.0;
        Ok(())
    }
}

impl Events for Lift {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "Height" }];
    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        self.looks.set(self.looks.get() + 1);
        z[0] = self.height;
    }
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.height <= 0.0 && self.landed.is_none() {
            self.landed = Some(now.seconds());
        }
        Ok(Outcome::default())
    }
    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

/// Bisection alone needs 30 evaluations to find a crossing within 1e-9 of the step.
#[test]
fn a_straight_crossing_is_found_along_the_line() {
    let mut lift = Lift::default();
    run(&mut lift, 1, 1.3, |m, step| integrate::hybrid::<_, 1>(m, step, 2.0)).unwrap();
    assert!((lift.landed.unwrap() - 1.0).abs() < 1e-8, "{:?} s", lift.landed);
    assert!(lift.looks.get() < 15, "{} evaluations", lift.looks.get());
}

/// Switches the sign of its state's derivative at given times; or at k `period`, if that is not 0.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Switch {
    x: f64,
    off: bool,
    period: f64,
    k: u64,
    /// Values of x at the events.
    seen: Vec<f64>,
    broken: bool,
}

model!(Switch);

impl Switch {
    /// The time of switching number `k`.
    fn at(k: u64) -> Elapsed {
        Elapsed::ZERO.plus([0.0, 0.1, 0.1 + 1e-7, 0.3, 0.55, 1e9][usize::try_from(k).unwrap()])
    }
}

impl ContinuousTime for Switch {
    const STATES: &'static [State<Self>] = &[State::new("x", &ONE, |m| &mut m.x)];
    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = if self.off { -1.0 } else { 1.0 };
        Ok(())
    }
}

impl Events for Switch {
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        let due = match self.next(now) {
            Next::Grid { k, period } => SampleGrid { period }.reached(k, now),
            Next::At(time) => now.since(time) > -1e-12,
            Next::Never => false,
        };
        if due && !self.broken {
            (self.off, self.k) = (!self.off, self.k + 1);
            self.seen.push(self.x);
        }
        Ok(Outcome::default())
    }
    fn next(&self, _now: Elapsed) -> Next {
        if self.period > 0.0 { Next::Grid { k: self.k, period: self.period } } else { Next::At(Self::at(self.k)) }
    }
}

#[test]
fn time_events_are_met_exactly() {
    // Steps that end at an event, between events and long after several.
    for (h, steps) in [(0.05, 12), (0.1, 6), (0.07, 9), (0.6, 1), (0.0125, 48)] {
        let mut switch = Switch::default();
        let end = run(&mut switch, steps, h, |m, step| integrate::hybrid::<_, 1>(m, step, 3e-3)).unwrap();
        let expected = [0.0, -0.1, -0.1 + 1e-7, -0.3 + 2e-7, -0.05 + 2e-7];
        assert_eq!(switch.seen.len(), 5, "h = {h} s");
        for (seen, expected) in switch.seen.iter().zip(expected) {
            assert!((seen - expected).abs() < 1e-14, "h = {h} s: {:?}", switch.seen);
        }
        let left = end.seconds() - 0.55;
        assert!((switch.x - (-0.05 + 2e-7 - left)).abs() < 1e-14, "h = {h} s: {}", switch.x);
    }
}

#[test]
fn events_on_a_grid_are_met_once_each() {
    for (h, steps) in [(1e-3, 100), (0.7e-3, 143), (4.3e-3, 23), (1e-4 / 3.0, 3000)] {
        let mut switch = Switch { period: 1e-3, ..Switch::default() };
        let end = run(&mut switch, steps, h, |m, step| integrate::hybrid::<_, 1>(m, step, 1.0)).unwrap();
        // An event at the end itself belongs to the next step.
        let due = (1..200).take_while(|&k| SampleGrid { period: 1e-3 }.passed(k, end)).count() + 1;
        assert_eq!(switch.seen.len(), due, "h = {h} s");
        for (k, seen) in switch.seen.iter().enumerate() {
            let expected = if k % 2 == 0 { 0.0 } else { -1e-3 };
            assert!((seen - expected).abs() < 1e-12, "h = {h} s, event {k}: {seen}");
        }
    }
}

#[test]
fn an_event_that_does_not_go_away_is_refused() {
    let mut switch = Switch { broken: true, ..Switch::default() };
    let fault = run(&mut switch, 1, 1.0, |m, step| integrate::hybrid::<_, 1>(m, step, 1e-3)).unwrap_err();
    assert!(fault.message().contains("events follow each other without time between them"), "{fault}");
}

/// An event that wants another update each time.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Restless {
    x: f64,
}

model!(Restless);

impl ContinuousTime for Restless {
    const STATES: &'static [State<Self>] = &[State::new("x", &RATE, |m| &mut m.x)];
    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = 0.0;
        Ok(())
    }
}

impl Events for Restless {
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome { again: true, ..Outcome::default() })
    }
    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

#[test]
fn an_event_that_never_settles_is_refused() {
    let fault = run(&mut Restless::default(), 1, 0.5, integrate_by_hybrid).unwrap_err();
    assert_eq!(fault.message(), "the event at 0 s after the start does not settle");
}

fn integrate_by_hybrid(m: &mut Restless, step: &Step) -> Result<(), Fault> {
    integrate::hybrid::<_, 1>(m, step, 0.1)
}

/// Columns of water that drain into a tank: x' = -x, and the tank fills by their sum.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Columns {
    x: Vec<f64>,
    tank: f64,
}

model!(Columns);

impl ContinuousTime for Columns {
    const STATES: &'static [State<Self>] =
        &[State::array("x", &RATE, 4, |m: &mut Self| &mut m.x), State::new("tank", &RATE, |m| &mut m.tank)];
    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        for (dx, x) in dx.iter_mut().zip(&self.x) {
            *dx = -x;
        }
        dx[self.x.len()] = self.x.iter().sum();
        Ok(())
    }
}

#[test]
fn arrays_of_states_are_integrated_at_their_present_length() {
    for n in [2, 4] {
        let mut columns = Columns { x: (1..=n).map(f64::from).collect(), tank: 0.0 };
        run(&mut columns, 10, 0.1, |m, step| integrate::smooth::<_, { Columns::SCALARS }>(m, step, 0.01)).unwrap();
        let (left, all) = ((-1.0_f64).exp(), f64::from(n * (n + 1) / 2));
        for (x, start) in columns.x.iter().zip(1..=n) {
            assert!((x - left * f64::from(start)).abs() < 1e-9, "{x}");
        }
        assert!((columns.tank - all * (1.0 - left)).abs() < 1e-9, "{}", columns.tank);
    }
}

/// Counts its samples, one each 0.5 s; shows the last count at the next.
#[derive(Clone, Default, Serialize, Deserialize)]
struct Sampler {
    samples: u64,
    shown: u64,
}

model!(Sampler);

impl Sampled for Sampler {
    fn period(&self) -> f64 {
        0.5
    }
    fn samples(&self) -> u64 {
        self.samples
    }
    fn show(&mut self) {
        self.shown = self.samples;
    }
    fn sample(&mut self) -> Result<(), Fault> {
        self.samples += 1;
        Ok(())
    }
}

/// A sample at the end of a step belongs to the next step; its instant shows the last one.
#[test]
fn samples_inside_a_step_are_taken() {
    let mut sampler = Sampler::default();
    let mut step = |start: f64, h| {
        integrate::sampled(&mut sampler, &Step { start: Elapsed::ZERO.plus(start), h }).unwrap();
        (sampler.samples, sampler.shown)
    };
    // 0 s; 0.5 s shows it and, inside the next step, is taken; 1 s shows that.
    assert_eq!([step(0.0, 0.25), step(0.25, 0.25), step(0.5, 0.5)], [(1, 0), (1, 1), (2, 2)]);
    assert_eq!(step(1.0, 1.75), (6, 5));
    let fault = integrate::sampled(&mut sampler, &Step { start: Elapsed::ZERO, h: 1e8 }).unwrap_err();
    assert!(fault.message().contains("at most 10000000 sample periods of 0.5 s"), "{fault}");
}
