//! Roberts of the Reference-FMUs: Robertson's reaction as differential equations of y1 and y2, with y3 = 1 - y1 - y2. It is stiff:
//! for Model Exchange only. The original can also be a system of differential-algebraic equations.

use fmu_core::unit::{Exponents, ONE, Quantity, Unit};
use fmu_core::{
    Block, ContinuousTime, Differentiable, Dual, Elapsed, Events, Experiment, Fault, Indicator, Info, Model, Next,
    Outcome, Row, Scalar, State, Step, Table, table,
};
use serde::{Deserialize, Serialize};

const PER_S: Quantity = Quantity::new("Rate", Unit::si("1/s", Exponents::mechanical(0, 0, -1, 0)));

#[derive(Clone, Serialize, Deserialize)]
struct Roberts {
    y: [f64; 2],
}

impl Default for Roberts {
    fn default() -> Self {
        Self { y: [1.0, 0.0] }
    }
}

type V = Row<Block<Roberts>>;

impl Model for Roberts {
    type Outputs = [f64; 3];
    const INFO: Info = Info {
        name: "Roberts",
        description: "The reaction of three substances due to Robertson",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { start: 1e-5, stop: 1e8, step: 1e4, tolerance: Some(1e-4), fixed_step: None },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::output("y1", &ONE, "Share of the first substance", |m| &mut m.out[0]).nominal(1e-4).exact(),
        V::output("y2", &ONE, "Share of the second substance", |m| &mut m.out[1]).nominal(1e-2).exact(),
        V::output("y3", &ONE, "Share of the third substance", |m| &mut m.out[2]).nominal(1e-2),
        V::constant("y3_nominal", &ONE, "Magnitude of y3", 1e-2),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, y: &mut [f64; 3]) {
        let [y1, y2] = self.y;
        *y = [y1, y2, 1.0 - y1 - y2];
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Err(Fault::new("the equations are stiff, and the model has no solver"))
    }
}

/// The derivatives, of numbers or of numbers with their change.
fn f<S: Scalar>([y1, y2]: [S; 2]) -> [S; 2] {
    let y3 = S::from(1.0) - y1 - y2;
    [y1 * -0.04 + y2 * 1e4 * y3, y1 * 0.04 - y2 * 1e4 * y3 - y2 * 3e7 * y2]
}

impl ContinuousTime for Roberts {
    const STATES: &'static [State<Self>] =
        &[State::new("y1", &PER_S, |m: &mut Self| &mut m.y[0]), State::new("y2", &PER_S, |m: &mut Self| &mut m.y[1])];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&f(self.y));
        Ok(())
    }
}

impl Differentiable for Roberts {
    fn tangent(&self, _now: Elapsed, along: &Self, dx: &mut [f64], y: &mut [f64; 3]) -> Result<(), Fault> {
        let dual = |i: usize| Dual::new(self.y[i], along.y[i]);
        dx.copy_from_slice(&f([dual(0), dual(1)]).map(|d| d.change));
        *y = [along.y[0], along.y[1], -along.y[0] - along.y[1]];
        Ok(())
    }
}

/// The indicators only mark the points where a share becomes small.
impl Events for Roberts {
    const INDICATORS: &'static [Indicator] =
        &[Indicator { name: "g1", description: "y1 - 1e-4" }, Indicator { name: "g2", description: "y3 - 0.01" }];

    fn indicators(&self, _now: Elapsed, z: &mut [f64]) {
        let [y1, y2] = self.y;
        z.copy_from_slice(&[y1 - 1e-4, 1.0 - y1 - y2 - 0.01]);
    }

    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

fmu_export::export!(Roberts: ContinuousTime + Events + Differentiable + ModelExchangeOnly);
