//! StateSpace of the Reference-FMUs: der(x) = A x + B u, y = C x + D u, whose numbers of inputs, states and outputs the importer
//! chooses. The original ignores x0, and sums B u over the outputs.

use fmu_core::unit::{ONE, PER_SECOND};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Fault, Info, Model, Resizable, Row, State, Step, Table, integrate,
    table,
};
use serde::{Deserialize, Serialize};

/// The step of the solver in s.
const STEP: f64 = 1e-3;
/// Maximum number of inputs, of states and of outputs.
const MOST: usize = 5;

/// The matrices are row by row.
#[derive(Clone, Serialize, Deserialize)]
struct StateSpace {
    m: u64,
    n: u64,
    r: u64,
    a: Vec<f64>,
    b: Vec<f64>,
    c: Vec<f64>,
    d: Vec<f64>,
    x0: Vec<f64>,
    u: Vec<f64>,
    x: Vec<f64>,
    /// The present numbers m, n and r of the arrays.
    sizes: [usize; 3],
}

impl Default for StateSpace {
    fn default() -> Self {
        let [a, b, c, d, x0, u, x] = [const { Vec::new() }; 7];
        let mut fresh = Self { m: 3, n: 3, r: 3, a, b, c, d, x0, u, x, sizes: [0; 3] };
        fresh.fit();
        fresh
    }
}

impl StateSpace {
    /// Fills the arrays whose sizes have changed: with identity matrices, zeros, and the inputs 1, 2, 3 and so on.
    fn fit(&mut self) {
        let [m, n, r] = [self.m, self.n, self.r].map(|n| usize::try_from(n).unwrap_or(0));
        let [m0, n0, r0] = self.sizes;
        let matrices = [
            (&mut self.a, (n, n), (n0, n0)),
            (&mut self.b, (n, m), (n0, m0)),
            (&mut self.c, (r, n), (r0, n0)),
            (&mut self.d, (r, m), (r0, m0)),
        ];
        for (matrix, (rows, columns), before) in matrices {
            if (rows, columns) != before {
                *matrix = (0..rows * columns).map(|i| f64::from(u8::from(i / columns == i % columns))).collect();
            }
        }
        if n != n0 {
            (self.x0, self.x) = (vec![0.0; n], vec![0.0; n]);
        }
        if m != m0 {
            self.u = (1_u8..).take(m).map(f64::from).collect();
        }
        self.sizes = [m, n, r];
    }
}

/// Adds the product of a matrix and a vector.
fn add_product(matrix: &[f64], vector: &[f64], sum: &mut [f64]) {
    for (i, sum) in sum.iter_mut().enumerate() {
        for (j, x) in vector.iter().enumerate() {
            *sum += matrix[i * vector.len() + j] * x;
        }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    y: Vec<f64>,
}

type V = Row<Block<StateSpace>>;

impl Model for StateSpace {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "StateSpace",
        description: "This model implements a linear time-invariant (LTI) system",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 10.0, step: 1.0, fixed_step: Some(STEP), ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::structural("m", "Number of inputs", |m| &mut m.model.m).at_most(5.0).tunable(),
        V::structural("n", "Number of states", |m| &mut m.model.n).at_most(5.0).tunable(),
        V::structural("r", "Number of outputs", |m| &mut m.model.r).at_most(5.0).tunable(),
        V::array_parameter("A", &ONE, "Matrix coefficient A", 25, |m| &mut m.model.a).sized(&["n", "n"]).tunable(),
        V::array_parameter("B", &ONE, "Matrix coefficient B", 25, |m| &mut m.model.b).sized(&["n", "m"]).tunable(),
        V::array_parameter("C", &ONE, "Matrix coefficient C", 25, |m| &mut m.model.c).sized(&["r", "n"]).tunable(),
        V::array_parameter("D", &ONE, "Matrix coefficient D", 25, |m| &mut m.model.d).sized(&["r", "m"]).tunable(),
        V::array_parameter("x0", &ONE, "Initial state vector", MOST, |m| &mut m.model.x0).sized(&["n"]),
        V::array_input("u", &ONE, "Input vector", MOST, |m| &mut m.model.u).sized(&["m"]),
        V::array_output("y", &ONE, "Output vector", MOST, |m| &mut m.out.y).sized(&["r"]),
        V::array_local("x", &ONE, "State vector", MOST, |m| &mut m.model.x).sized(&["n"]),
    ];

    fn initialize(&mut self) {
        self.x.clone_from(&self.x0);
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        out.y.clear();
        out.y.resize(self.sizes[2], 0.0);
        add_product(&self.c, &self.x, &mut out.y);
        add_product(&self.d, &self.u, &mut out.y);
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::euler::<Self, MOST>(self, step, STEP)
    }
}

impl ContinuousTime for StateSpace {
    const STATES: &'static [State<Self>] = &[State::array("x", &PER_SECOND, MOST, |m: &mut Self| &mut m.x)];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx.fill(0.0);
        add_product(&self.a, &self.x, dx);
        add_product(&self.b, &self.u, dx);
        Ok(())
    }
}

impl Resizable for StateSpace {
    fn resize(&mut self) -> Result<(), Fault> {
        self.fit();
        Ok(())
    }
}

fmu_export::export!(StateSpace: ContinuousTime + Resizable);
