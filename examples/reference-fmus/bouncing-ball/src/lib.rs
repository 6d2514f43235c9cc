//! BouncingBall of the Reference-FMUs: a ball that bounces until it rests. The original then sets its parameter g to 0; here the
//! ball has a discrete state for that.

use fmu_core::unit::{DisplayUnit, METER, METER_PER_S, METER_PER_S2, ONE};
use fmu_core::{
    Alias, Block, ContinuousTime, Elapsed, EventMode, Events, Experiment, Fault, Indicator, Info, Model, Next, Outcome,
    Row, State, Step, Stop, Table, integrate, table,
};
use serde::{Deserialize, Serialize};

/// The step of the solver in s.
const STEP: f64 = 1e-3;
/// The foot of 1959.
const FOOT: DisplayUnit = DisplayUnit { name: "ft", factor: 1.0 / 0.3048, offset: 0.0 };
/// Velocity in m/s below which the ball stops bouncing.
const V_MIN: f64 = 0.1;
/// Depth in m that a ball on its way up may have.
const EPSILON: f64 = 1e-10;

#[derive(Clone, Serialize, Deserialize)]
struct BouncingBall {
    h: f64,
    v: f64,
    g: f64,
    e: f64,
    rests: bool,
}

impl Default for BouncingBall {
    fn default() -> Self {
        Self { h: 1.0, v: 0.0, g: -9.81, e: 0.7, rests: false }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    h: f64,
    v: f64,
}

type V = Row<Block<BouncingBall>>;

impl Model for BouncingBall {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "BouncingBall",
        description: "This model calculates the trajectory, over time, of a ball dropped from a height of 1 m",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 3.0, step: 1e-2, fixed_step: Some(STEP), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::output("h", &METER, "Position of the ball", |m| &mut m.out.h).exact().aliases(&[Alias {
            name: "h_ft",
            description: "Position of the ball",
            display: Some(FOOT),
        }]),
        V::output("v", &METER_PER_S, "Velocity of the ball", |m| &mut m.out.v).exact(),
        V::parameter("g", &METER_PER_S2, "Gravity acting on the ball", |m| &mut m.model.g),
        V::parameter("e", &ONE, "Coefficient of restitution", |m| &mut m.model.e).at_least(0.5).at_most(1.0).tunable(),
        V::constant("v_min", &METER_PER_S, "Velocity below which the ball stops bouncing", V_MIN),
        V::boolean_local("rests", "The ball has stopped bouncing", |m| &mut m.model.rests),
    ];

    fn initialize(&mut self) {
        self.rests = false;
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        *out = Outputs { h: self.h, v: self.v };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler_hybrid::<Self, 2>(self, step, STEP)
    }
}

impl ContinuousTime for BouncingBall {
    const STATES: &'static [State<Self>] = &[
        State::new("h", &METER_PER_S, |m: &mut Self| &mut m.h).reinit(),
        State::new("v", &METER_PER_S2, |m: &mut Self| &mut m.v).reinit(),
    ];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&[self.v, if self.rests { 0.0 } else { self.g }]);
        Ok(())
    }
}

impl Events for BouncingBall {
    const INDICATORS: &'static [Indicator] = &[Indicator { name: "z", description: "Position, with hysteresis" }];

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        let rises = self.h > -EPSILON && self.h <= 0.0 && self.v > 0.0;
        z[0] = if rises { -EPSILON } else { self.h };
    }

    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        let bounces = self.h <= 0.0 && self.v < 0.0;
        if bounces {
            (self.h, self.v) = (f64::MIN_POSITIVE, -self.v * self.e);
            self.rests = self.v < V_MIN;
            self.v = if self.rests { 0.0 } else { self.v };
        }
        Ok(Outcome { states_changed: bounces, ..Outcome::default() })
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

impl EventMode for BouncingBall {
    fn to_event(&mut self, step: &Step) -> Result<Stop, Fault> {
        integrate::euler_to_event::<Self, 2>(self, step, STEP)
    }
}

fmu_export::export!(BouncingBall: ContinuousTime + Events + EventMode);
