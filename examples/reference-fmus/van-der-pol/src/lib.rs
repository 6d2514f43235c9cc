//! VanDerPol of the Reference-FMUs: d²x/dt² = mu (1 - x²) dx/dt - x, with exact directional derivatives.

use fmu_core::unit::{Exponents, ONE, Quantity, Unit};
use fmu_core::{
    Block, ContinuousTime, Differentiable, Dual, Elapsed, Experiment, Fault, Info, Model, Row, Scalar, State, Step,
    Table, integrate, table,
};
use serde::{Deserialize, Serialize};

/// The step of the solver in s.
const STEP: f64 = 1e-2;
const PER_S: Quantity = Quantity::new("Rate", Unit::si("1/s", Exponents::mechanical(0, 0, -1, 0)));

#[derive(Clone, Serialize, Deserialize)]
struct VanDerPol {
    x: [f64; 2],
    mu: f64,
}

impl Default for VanDerPol {
    fn default() -> Self {
        Self { x: [2.0, 0.0], mu: 1.0 }
    }
}

type V = Row<Block<VanDerPol>>;

impl Model for VanDerPol {
    type Outputs = [f64; 2];
    const INFO: Info = Info {
        name: "VanDerPol",
        description: "This model implements the van der Pol oscillator",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 20.0, step: STEP, fixed_step: Some(STEP), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::output("x0", &ONE, "the first state", |m| &mut m.out[0]).exact(),
        V::output("x1", &ONE, "the second state", |m| &mut m.out[1]).exact(),
        V::parameter("mu", &ONE, "Damping", |m| &mut m.model.mu),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, x: &mut [f64; 2]) {
        *x = self.x;
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler::<Self, 2>(self, step, STEP)
    }
}

/// The derivatives, of numbers or of numbers with their change.
fn f<S: Scalar>([x0, x1]: [S; 2], mu: S) -> [S; 2] {
    [x1, mu * ((S::from(1.0) - x0 * x0) * x1) - x0]
}

impl ContinuousTime for VanDerPol {
    const STATES: &'static [State<Self>] =
        &[State::new("x0", &PER_S, |m: &mut Self| &mut m.x[0]), State::new("x1", &PER_S, |m: &mut Self| &mut m.x[1])];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.copy_from_slice(&f(self.x, self.mu));
        Ok(())
    }
}

impl Differentiable for VanDerPol {
    fn tangent(&self, _now: Elapsed, along: &Self, dx: &mut [f64], x: &mut [f64; 2]) -> Result<(), Fault> {
        let dual = |i: usize| Dual::new(self.x[i], along.x[i]);
        let change = f([dual(0), dual(1)], Dual::from(self.mu));
        dx.copy_from_slice(&change.map(|d| d.change));
        *x = along.x;
        Ok(())
    }
}

fmu_export::export!(VanDerPol: ContinuousTime + Differentiable);
