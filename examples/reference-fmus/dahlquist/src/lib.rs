//! Dahlquist of the Reference-FMUs: dx/dt = -k x.

use fmu_core::unit::{Exponents, ONE, Quantity, Unit};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Fault, Info, Intermediate, Model, Row, State, Step, Table, integrate,
    table,
};
use serde::{Deserialize, Serialize};

/// The step of the solver in s.
const STEP: f64 = 0.1;
const PER_S: Quantity = Quantity::new("Rate", Unit::si("1/s", Exponents::mechanical(0, 0, -1, 0)));

#[derive(Clone, Serialize, Deserialize)]
struct Dahlquist {
    x: f64,
    k: f64,
}

impl Default for Dahlquist {
    fn default() -> Self {
        Self { x: 1.0, k: 1.0 }
    }
}

type V = Row<Block<Dahlquist>>;

impl Model for Dahlquist {
    type Outputs = f64;
    const INFO: Info = Info {
        name: "Dahlquist",
        description: "This model implements the Dahlquist test equation",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 10.0, step: STEP, fixed_step: Some(STEP), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::output("x", &ONE, "the only state", |m| &mut m.out).exact().intermediate(),
        V::parameter("k", &PER_S, "Rate of the decay", |m| &mut m.model.k),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, x: &mut f64) {
        *x = self.x;
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler::<Self, 1>(self, step, STEP)
    }
}

impl ContinuousTime for Dahlquist {
    const STATES: &'static [State<Self>] = &[State::new("x", &PER_S, |m: &mut Self| &mut m.x)];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = -self.k * self.x;
        Ok(())
    }
}

impl Intermediate for Dahlquist {
    fn longest(&self) -> f64 {
        STEP
    }
}

fmu_export::export!(Dahlquist: ContinuousTime + Intermediate);
