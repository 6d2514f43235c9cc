//! Stair of the Reference-FMUs: counts the seconds, and ends the simulation at 10.

use fmu_core::{
    Block, ContinuousTime, Elapsed, Events, Experiment, Fault, Info, Model, Next, Outcome, Row, State, Step, Table,
    integrate, table,
};
use serde::{Deserialize, Serialize};

/// The step of the solver in s.
const STEP: f64 = 0.2;

#[derive(Clone, Serialize, Deserialize)]
struct Stair {
    counter: i32,
    /// Number of the next second.
    second: u64,
}

impl Default for Stair {
    fn default() -> Self {
        Self { counter: 1, second: 1 }
    }
}

type V = Row<Block<Stair>>;

impl Model for Stair {
    type Outputs = ();
    const INFO: Info = Info {
        name: "Stair",
        description: "This model generates a stair signal using time events",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 10.0, step: STEP, fixed_step: Some(STEP), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> =
        table![V::integer_output("counter", "counts the seconds", |m| &mut m.model.counter).at_most(10.0).exact()];

    fn initialize(&mut self) {
        self.second = 1;
    }

    fn output(&self, _now: Elapsed, (): &mut ()) {}

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler_hybrid::<Self, 0>(self, step, STEP)
    }
}

impl ContinuousTime for Stair {
    const STATES: &'static [State<Self>] = &[];

    fn derivatives(&self, _now: Elapsed, _: &mut [f64]) -> Result<(), Fault> {
        Ok(())
    }
}

impl Events for Stair {
    fn event(&mut self, now: Elapsed) -> Result<Outcome, Fault> {
        if self.next(now).is_due(now) {
            (self.counter, self.second) = (self.counter + 1, self.second + 1);
        }
        Ok(Outcome { terminate: self.counter >= 10, ..Outcome::default() })
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Grid { k: self.second, period: 1.0 }
    }
}

fmu_export::export!(Stair: Events);
