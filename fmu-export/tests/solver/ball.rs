//! A ball that bounces: two states, state and time events, every kind of variable that they concern.
//!
//! dh/dt = v, m dv/dt = m (u + 0.1 k - g) - c v |v| rho(h); at h = 0 the ball bounces with v = -r v, and rests if that
//! is slow. Every T seconds, `held` takes the value of u + k.

use fmu_core::log::Warnings;
use fmu_core::unit::{Exponents, ONE, Quantity, SECOND, Unit};
use fmu_core::{
    Block, ContinuousTime, Differentiable, Dual, Elapsed, Events, Experiment, Fault, Indicator, Info, Model, Next,
    Outcome, Row, Scalar, State, Step, Table, Warns, integrate, table,
};
use serde::{Deserialize, Serialize};

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Ball {
    pub u: f64,
    pub k: f64,
    pub h: f64,
    pub v: f64,
    pub c: f64,
    pub m: f64,
    pub r: f64,
    pub period: f64,
    pub h_start: f64,
    pub map: [f64; 2],
    pub c_m: f64,
    pub held: f64,
    pub ticks: u64,
    pub bounces: i32,
    pub resting: bool,
    pub v_mean: f64,
}

#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct Outputs {
    pub e: f64,
    pub a: f64,
    pub v_mean: f64,
    pub held: f64,
    pub bounces: i32,
    pub resting: bool,
}

// Value references, written down by hand: 1 + offset in the table, the array has two.
pub const TIME: u32 = 0;
pub const U: u32 = 1;
pub const K: u32 = 2;
pub const H: u32 = 3;
pub const E: u32 = 4;
pub const A: u32 = 5;
pub const HELD: u32 = 6;
pub const V: u32 = 7;
pub const C: u32 = 8;
pub const M: u32 = 9;
pub const R: u32 = 10;
pub const PERIOD: u32 = 11;
pub const H_START: u32 = 12;
pub const C_M: u32 = 13;
pub const BOUNCES: u32 = 14;
pub const RESTING: u32 = 15;
pub const MAP: u32 = 16;
pub const V_MEAN: u32 = 18;
pub const DER_H: u32 = 19;
pub const DER_V: u32 = 20;
pub const Z: u32 = 21;
pub const UNKNOWN: u32 = 22;

/// The ball is above the ground while this is added to its height.
const SHIFT: f64 = 1e-9;
/// A bounce slower than this is the last.
const SLOW: f64 = 0.05;

const HEIGHT: Quantity = Quantity::new("Height", Unit::si("m", Exponents::mechanical(0, 1, 0, 0)));
const VELOCITY: Quantity = Quantity::new("Velocity", Unit::si("m/s", Exponents::mechanical(0, 1, -1, 0)));
const ACCELERATION: Quantity = Quantity::new("Acceleration", Unit::si("m/s2", Exponents::mechanical(0, 1, -2, 0)));

impl Default for Ball {
    fn default() -> Self {
        Self {
            u: 0.0,
            k: 0.0,
            h: 0.0,
            v: 0.0,
            c: 0.1,
            m: 2.0,
            r: 0.7,
            period: 0.3,
            h_start: 1.0,
            map: [9.81, 0.01],
            c_m: 0.0,
            held: 0.0,
            ticks: 0,
            bounces: 0,
            resting: false,
            v_mean: 0.0,
        }
    }
}

impl Ball {
    /// dv/dt, from numbers with or without their changes.
    fn acceleration<S: Scalar>(&self, h: S, v: S, u: S) -> S {
        if self.resting {
            return S::from(0.0);
        }
        // The barometric formula, which ends at 44.3 km.
        let x = 1.0 - h.value() / 44_330.0;
        let rho = h.chain(x.powf(4.255), -4.255 / 44_330.0 * x.powf(3.255));
        let speed = if v.value() < 0.0 { -v } else { v };
        u + S::from(0.1 * self.k - self.map[0]) - v * speed * rho * self.c_m
    }

    fn energy<S: Scalar>(&self, h: S, v: S, now: Elapsed) -> S {
        v * v * (0.5 * self.m) + h * (self.m * self.map[0]) + S::from(self.map[1] * now.seconds().sin())
    }

    fn tick(&self) -> Next {
        Next::At(Elapsed::periods(self.ticks + 1, self.period))
    }
}

type Var = Row<Block<Ball>>;

impl Model for Ball {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Ball",
        description: "A ball that bounces",
        version: "1.0",
        experiment: Experiment { stop: 3.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    fn idle(&self, name: &str) -> Option<&'static str> {
        (name == "u" && self.u.to_bits() == 99.0_f64.to_bits()).then_some("that much lift has no effect")
    }

    const TABLE: &'static Table<Block<Self>> = table![
        Var::input("u", &ACCELERATION, "Lift", |m| &mut m.model.u).at_least(-100.0).at_most(100.0),
        Var::discrete_input("k", &ONE, "Tenfold lift", |m| &mut m.model.k).at_least(-5.0).at_most(5.0),
        Var::output("h", &HEIGHT, "Height", |m| &mut m.model.h),
        Var::output("e", &ONE, "Energy", |m| &mut m.out.e).nominal(10.0),
        Var::output("a", &ACCELERATION, "Acceleration", |m| &mut m.out.a),
        Var::discrete_output("held", &ONE, "u + k at the last tick", |m| &mut m.out.held),
        Var::state("v", &VELOCITY, "Velocity", |m| &mut m.model.v).nominal(5.0).at_least(-1e9).at_most(1e9),
        Var::parameter("c", &ONE, "Drag", |m| &mut m.model.c).at_least(0.0).tunable(),
        Var::parameter("m", &ONE, "Mass", |m| &mut m.model.m).above(0.0),
        Var::parameter("r", &ONE, "Restitution", |m| &mut m.model.r).at_least(0.0).at_most(1.0),
        Var::parameter("T", &SECOND, "Time between two ticks", |m| &mut m.model.period).above(0.0),
        Var::parameter("h_start", &HEIGHT, "Height at the start", |m| &mut m.model.h_start).at_least(0.0),
        Var::calculated("c_m", &ONE, "Drag over mass", |m| &mut m.model.c_m),
        Var::integer_output("bounces", "Bounces so far", |m| &mut m.out.bounces),
        Var::boolean_output("resting", "The ball lies on the ground", |m| &mut m.out.resting),
        Var::array_parameter("map", &ONE, "Gravity, and what swings", 2, |m| &mut m.model.map),
        Var::output("v_mean", &VELOCITY, "Mean velocity over a step", |m| &mut m.out.v_mean).mean(),
    ];

    fn derive(&mut self) {
        self.c_m = self.c / self.m;
    }

    fn validate(&self) -> Result<(), Fault> {
        if self.c_m > 10.0 { Err(Fault::new("c / m is greater than 10")) } else { Ok(()) }
    }

    fn initialize(&mut self) {
        (self.h, self.v, self.held) = (self.h_start, 0.0, self.u + self.k);
        (self.ticks, self.bounces, self.resting, self.v_mean) = (0, 0, false, 0.0);
    }

    fn output(&self, now: Elapsed, out: &mut Outputs) {
        *out = Outputs {
            e: self.energy(self.h, self.v, now),
            a: self.acceleration(self.h, self.v, self.u),
            v_mean: self.v_mean,
            held: self.held,
            bounces: self.bounces,
            resting: self.resting,
        };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        let h = self.h;
        integrate::hybrid::<Self, 2>(self, step, 1e-3)?;
        self.v_mean = (self.h - h) / step.h;
        Ok(())
    }
}

impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] = &[
        State::new("h", &VELOCITY, |m: &mut Ball| &mut m.h).reinit(),
        State::new("v", &ACCELERATION, |m: &mut Ball| &mut m.v).reinit(),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        if self.v.abs() > 1e6 {
            return Err(Fault::value("v", self.v, "at most 1e6 in magnitude"));
        }
        dx.copy_from_slice(&[if self.resting { 0.0 } else { self.v }, self.acceleration(self.h, self.v, self.u)]);
        Ok(())
    }

    fn observe(&self, now: Elapsed, out: &mut Outputs) {
        self.output(now, out);
        out.v_mean = self.v;
    }
}

impl Differentiable for Ball {
    fn tangent(&self, now: Elapsed, along: &Self, dx: &mut [f64], out: &mut Outputs) -> Result<(), Fault> {
        let [h, v, u] =
            [(self.h, along.h), (self.v, along.v), (self.u, along.u)].map(|(x, change)| Dual::new(x, change));
        let a = self.acceleration(h, v, u).change;
        dx.copy_from_slice(&[if self.resting { 0.0 } else { along.v }, a]);
        (out.e, out.v_mean) = (self.energy(h, v, now).change, along.v);
        if a != 0.0 {
            // Otherwise it is zero already.
            out.a = a;
        }
        Ok(())
    }
}

impl Events for Ball {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "ground", description: "Height above the ground" }];

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        z[0] = if self.resting { 1.0 } else { self.h + SHIFT };
    }

    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        let mut outcome = Outcome::default();
        while self.tick().is_due(now) {
            self.held = self.u + self.k;
            self.ticks += 1;
        }
        let up = self.u + 0.1 * self.k > self.map[0];
        if self.resting && up {
            self.resting = false;
        }
        if !self.resting && self.h <= 0.0 && self.v < 0.0 {
            (self.h, self.v) = (0.0, -self.r * self.v);
            self.bounces += 1;
            outcome.states_changed = true;
            outcome.again = true;
        } else if !self.resting && self.h == 0.0 && (0.0..SLOW).contains(&self.v) && !up {
            outcome.states_changed = self.v != 0.0;
            (self.v, self.resting) = (0.0, true);
        }
        Ok(outcome)
    }

    fn next(&self, _now: Elapsed) -> Next {
        self.tick()
    }
}

impl Warns for Ball {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.h < 0.5 {
            log.warn("low", || format!("the ball is {} m above the ground", self.h));
        }
        if self.v.abs() > 2.0 {
            log.warn("fast", || format!("the ball moves at {} m/s", self.v));
        }
    }
}
