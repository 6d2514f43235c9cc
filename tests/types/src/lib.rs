//! A model with a variable of every type and causality, and with a resource file: every constructor of the table.

use fmu_core::unit::{KELVIN, ONE, PER_SECOND, Quantity, SECOND, VOLT};
use fmu_core::{
    Block, ContinuousTime, Elapsed, Experiment, Fault, Field, Info, Model, Resource, Row, State, Step, Table,
    enumeration, integrate, table,
};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

const BAND: Quantity = KELVIN.relative("TemperatureDifference");

enumeration! {
    #[derive(Serialize, Deserialize)]
    enum Fan("FanMode", "What the fan does") {
        1 Off "Stands still";
        2 On "Turns";
    }
}

/// A value of each type that is discrete in this model.
#[derive(Clone, Serialize, Deserialize)]
struct Each {
    real: f64,
    single: f32,
    truth: bool,
    fan: Fan,
    int8: i8,
    uint8: u8,
    int16: i16,
    uint16: u16,
    int32: i32,
    uint32: u32,
    int64: i64,
    uint64: u64,
}

impl Default for Each {
    fn default() -> Self {
        Self {
            real: 0.5,
            single: 0.1,
            truth: true,
            fan: Fan::On,
            int8: -1,
            uint8: 1,
            int16: -2,
            uint16: 2,
            int32: 3,
            uint32: 3,
            int64: -4,
            uint64: 4,
        }
    }
}

#[derive(Clone, Serialize, Deserialize)]
struct EveryType {
    voltage: f64,
    vector: [f64; 3],
    matrix: [[f64; 2]; 2],
    held: Each,
    fixed: Each,
    tuned: Each,
    local: Each,
    tau: f64,
    band: f64,
    rate: f64,
    weights: [[f64; 3]; 2],
    offsets: [f64; 2],
    label: String,
    x: f64,
    distances: [f64; 2],
    squares: Resource<Vec<[f64; 2]>>,
}

impl Default for EveryType {
    fn default() -> Self {
        Self {
            voltage: 1.0,
            vector: [1.0, 2.0, 3.0],
            matrix: [[1.0, 2.0], [3.0, 4.0]],
            held: Each::default(),
            fixed: Each::default(),
            tuned: Each::default(),
            local: Each::default(),
            tau: 0.5,
            band: 1.0,
            rate: 0.0,
            weights: [[1.0, 0.0, 0.0], [0.0, 1.0, 1.0]],
            offsets: [0.0, 0.5],
            label: "as built & <tested>".into(),
            x: 0.0,
            distances: [0.0; 2],
            squares: Resource::default(),
        }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    x: f64,
    sums: [f64; 2],
    transposed: [[f64; 2]; 2],
    square: f64,
    letters: i32,
    each: Each,
}

impl EveryType {
    /// The square of `n` from the file.
    fn square(&self, n: f64) -> f64 {
        self.squares.iter().find(|[x, _]| *x >= n).map_or(f64::MAX, |[_, y]| *y)
    }
}

type V = Row<Block<EveryType>>;

impl Model for EveryType {
    type Outputs = Outputs;

    const INFO: Info = Info {
        name: "EveryType",
        description: "A variable of every type and causality",
        author: "The tests",
        license: "MIT OR Apache-2.0",
        copyright: "None",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };

    #[expect(clippy::large_stack_arrays, reason = "a constant that never reaches the stack")]
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("voltage", &VOLT, "Input of the state", |m| &mut m.model.voltage),
        V::array_input("vector", &VOLT, "Three inputs", 3, |m| &mut m.model.vector),
        V::array_input("matrix", &ONE, "Four sampled inputs", 4, |m| m.model.matrix.as_flattened_mut())
            .shape(&[2, 2])
            .discrete(),
        V::discrete_input("in.real", &VOLT, "Sampled", |m| &mut m.model.held.real),
        V::float32_input("in.single", &VOLT, "Sampled", |m| &mut m.model.held.single).at_most(0.3),
        V::boolean_input("in.truth", "Sampled", |m| &mut m.model.held.truth),
        V::enumeration_input("in.fan", "Sampled", &Field(|m| &mut m.model.held.fan)),
        V::int8_input("in.int8", "Sampled", |m| &mut m.model.held.int8),
        V::uint8_input("in.uint8", "Sampled", |m| &mut m.model.held.uint8).at_most(200.0),
        V::int16_input("in.int16", "Sampled", |m| &mut m.model.held.int16),
        V::uint16_input("in.uint16", "Sampled", |m| &mut m.model.held.uint16),
        V::integer_input("in.int32", "Sampled", |m| &mut m.model.held.int32),
        V::uint32_input("in.uint32", "Sampled", |m| &mut m.model.held.uint32),
        V::int64_input("in.int64", "Sampled", |m| &mut m.model.held.int64),
        V::uint64_input("in.uint64", "Sampled", |m| &mut m.model.held.uint64),
        V::output("x", &VOLT, "The state", |m| &mut m.out.x),
        V::array_output("sums", &VOLT, "weights times vector, and offsets", 2, |m| &mut m.out.sums),
        V::array_output("transposed", &ONE, "matrix, transposed", 4, |m| m.out.transposed.as_flattened_mut())
            .shape(&[2, 2])
            .discrete(),
        V::discrete_output("square", &ONE, "Square of in.int32 from the file", |m| &mut m.out.square),
        V::float32_output("out.single", &VOLT, "As the input", |m| &mut m.out.each.single),
        V::boolean_output("out.truth", "As the input", |m| &mut m.out.each.truth),
        V::enumeration_output("out.fan", "As the input", &Field(|m| &mut m.out.each.fan)),
        V::int8_output("out.int8", "As the input", |m| &mut m.out.each.int8),
        V::uint8_output("out.uint8", "As the input", |m| &mut m.out.each.uint8),
        V::int16_output("out.int16", "As the input", |m| &mut m.out.each.int16),
        V::uint16_output("out.uint16", "As the input", |m| &mut m.out.each.uint16),
        V::integer_output("out.int32", "As the input", |m| &mut m.out.each.int32),
        V::uint32_output("out.uint32", "As the input", |m| &mut m.out.each.uint32),
        V::int64_output("out.int64", "As the input", |m| &mut m.out.each.int64),
        V::uint64_output("out.uint64", "As the input", |m| &mut m.out.each.uint64),
        V::integer_output("letters", "Length of the label", |m| &mut m.out.letters),
        V::text_output("status", "The label, while in.truth is true", |m| {
            if m.model.held.truth { &m.model.label } else { "off" }
        }),
        V::state("state", &VOLT, "The state again", |m| &mut m.model.x).nominal(2.0),
        V::array_local("distances", &VOLT, "Of the state from 1 V and 2 V", 2, |m| &mut m.model.distances),
        V::discrete_local("local.real", &ONE, "As the parameter", |m| &mut m.model.local.real),
        V::float32_local("local.single", &ONE, "As the parameter", |m| &mut m.model.local.single),
        V::boolean_local("local.truth", "As the parameter", |m| &mut m.model.local.truth),
        V::enumeration_local("local.fan", "As the parameter", &Field(|m| &mut m.model.local.fan)),
        V::int8_local("local.int8", "As the parameter", |m| &mut m.model.local.int8),
        V::uint8_local("local.uint8", "As the parameter", |m| &mut m.model.local.uint8),
        V::int16_local("local.int16", "As the parameter", |m| &mut m.model.local.int16),
        V::uint16_local("local.uint16", "As the parameter", |m| &mut m.model.local.uint16),
        V::integer_local("local.int32", "As the parameter", |m| &mut m.model.local.int32),
        V::uint32_local("local.uint32", "As the parameter", |m| &mut m.model.local.uint32),
        V::int64_local("local.int64", "As the parameter", |m| &mut m.model.local.int64),
        V::uint64_local("local.uint64", "Square of the parameter", |m| &mut m.model.local.uint64),
        V::parameter("tau", &SECOND, "Time constant of the state", |m| &mut m.model.tau).above(0.0),
        V::calculated("rate", &PER_SECOND, "1/tau", |m| &mut m.model.rate),
        V::parameter("band", &BAND, "Added to the start of the state", |m| &mut m.model.band).at_least(0.0),
        V::array_parameter("offsets", &VOLT, "Of sums", 2, |m| &mut m.model.offsets).tunable(),
        V::array_parameter("weights", &ONE, "Of vector, in sums", 6, |m| m.model.weights.as_flattened_mut())
            .shape(&[2, 3]),
        V::text_parameter("label", "A text", |m| &mut m.model.label),
        V::text_constant("revision", "Another", "r1 \u{b5}"),
        V::float32_parameter("fixed.single", &ONE, "Shown by the local", |m| &mut m.model.fixed.single),
        V::boolean_parameter("fixed.truth", "Shown by the local", |m| &mut m.model.fixed.truth),
        V::enumeration_parameter("fixed.fan", "Shown by the local", &Field(|m| &mut m.model.fixed.fan)),
        V::int8_parameter("fixed.int8", "Shown by the local", |m| &mut m.model.fixed.int8),
        V::uint8_parameter("fixed.uint8", "Shown by the local", |m| &mut m.model.fixed.uint8),
        V::int16_parameter("fixed.int16", "Shown by the local", |m| &mut m.model.fixed.int16),
        V::uint16_parameter("fixed.uint16", "Shown by the local", |m| &mut m.model.fixed.uint16),
        V::integer_parameter("fixed.int32", "Shown by the local", |m| &mut m.model.fixed.int32).at_least(-9.0),
        V::uint32_parameter("fixed.uint32", "Shown by the local", |m| &mut m.model.fixed.uint32),
        V::int64_parameter("fixed.int64", "Shown by the local", |m| &mut m.model.fixed.int64),
        V::uint64_parameter("fixed.uint64", "Shown by the local", |m| &mut m.model.fixed.uint64),
        V::parameter("tuned.real", &ONE, "Shown by the local", |m| &mut m.model.tuned.real).tunable(),
        V::integer_parameter("tuned.int32", "Shift of square", |m| &mut m.model.tuned.int32).at_least(0.0).tunable(),
    ];

    fn load(&mut self, resources: Option<&Path>) -> Result<(), Fault> {
        let folder = resources.ok_or_else(|| Fault::new("EveryType needs the folder of its resources"))?;
        let file = folder.join("tables/squares.csv");
        let text = fs::read_to_string(&file).map_err(|e| Fault::new(format!("{}: {e}", file.display())))?;
        let row = |line: &str| Some([line.split_once(',')?.0.parse().ok()?, line.split_once(',')?.1.parse().ok()?]);
        let rows: Option<Vec<[f64; 2]>> = text.lines().map(row).collect();
        let rows = rows.ok_or_else(|| Fault::new(format!("{}: two numbers a line are needed", file.display())))?;
        assert!(!rows.is_empty(), "a table without rows");
        self.squares = rows.into();
        Ok(())
    }

    fn derive(&mut self) {
        self.rate = 1.0 / self.tau;
        let square = self.fixed.uint64.saturating_mul(self.fixed.uint64);
        self.local = Each { real: self.tuned.real, uint64: square, ..self.fixed.clone() };
    }

    fn initialize(&mut self) {
        self.x = self.band;
        self.settle();
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        out.x = self.x;
        for (sum, (weights, offset)) in out.sums.iter_mut().zip(self.weights.iter().zip(self.offsets)) {
            *sum = offset + weights.iter().zip(self.vector).map(|(w, v)| w * v).sum::<f64>();
        }
        out.transposed = [0, 1].map(|i| [0, 1].map(|k| self.matrix[k][i]));
        out.square = self.square(f64::from(self.held.int32) + f64::from(self.tuned.int32) - 3.0);
        out.letters = i32::try_from(self.label.chars().count()).unwrap_or(i32::MAX);
        out.each = self.held.clone();
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 1>(self, step, 1e-2)?;
        self.settle();
        Ok(())
    }
}

impl ContinuousTime for EveryType {
    const STATES: &'static [State<Self>] = &[State::new("state", &VOLT_PER_S, |m: &mut Self| &mut m.x)];

    fn derivatives(&self, _now: Elapsed, dx: &mut [f64]) -> Result<(), Fault> {
        dx[0] = self.rate * (self.voltage + self.vector[2] - self.x);
        Ok(())
    }

    fn settle(&mut self) {
        self.distances = [self.x - 1.0, self.x - 2.0];
    }
}

/// The rate of a voltage.
const VOLT_PER_S: Quantity = {
    use fmu_core::unit::{Exponents, Unit};
    Quantity::new("VoltageRate", Unit::si("V/s", Exponents::mechanical(1, 2, -4, -1)))
};

fmu_export::export!(EveryType: ContinuousTime);
