//! An input and an output of every type: each output has the value of its input.

use fmu_core::unit::ONE;
use fmu_core::{
    Block, Bytes, Elapsed, Events, Experiment, Fault, Field, Info, Model, Next, Outcome, Row, Step, Table, enumeration,
    table,
};
use serde::{Deserialize, Serialize};

enumeration! {
    #[derive(Default, Serialize, Deserialize)]
    enum Choice("Option", "One of two options") {
        #[default]
        1 Option1 "First option";
        2 Option2 "Second option";
    }
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
struct Numbers {
    single: [f32; 2],
    double: [f64; 2],
    int8: i8,
    uint8: u8,
    int16: i16,
    uint16: u16,
    int32: i32,
    uint32: u32,
    int64: i64,
    uint64: u64,
    truth: bool,
    choice: Choice,
}

#[derive(Clone, Serialize, Deserialize)]
struct Feedthrough {
    fixed: f64,
    tunable: f64,
    numbers: Numbers,
    text: String,
    bytes: Bytes,
}

impl Default for Feedthrough {
    fn default() -> Self {
        let (text, bytes) = ("Set me!".into(), Bytes::from(b"foo"));
        Self { fixed: 0.0, tunable: 0.0, numbers: Numbers::default(), text, bytes }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct Outputs {
    numbers: Numbers,
    bytes: Bytes,
}

type V = Row<Block<Feedthrough>>;

/// Type and maximum size of the bytes.
const BYTES: (&str, usize) = ("application/octet-stream", 128);

impl Model for Feedthrough {
    type Outputs = Outputs;

    const INFO: Info = Info {
        name: "Feedthrough",
        description: "A model to test different variable types, causalities, and variabilities",
        author: env!("CARGO_PKG_AUTHORS"),
        license: env!("CARGO_PKG_LICENSE"),
        copyright: "The sensorless-drive developers; after the Reference-FMUs of the Modelica Association",
        experiment: Experiment { stop: 2.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };

    const TABLE: &'static Table<Block<Self>> = table![
        V::float32_input("Float32_continuous_input", &ONE, "", |m| &mut m.model.numbers.single[0]).continuous(),
        V::float32_output("Float32_continuous_output", &ONE, "", |m| &mut m.out.numbers.single[0]).continuous(),
        V::float32_input("Float32_discrete_input", &ONE, "", |m| &mut m.model.numbers.single[1]),
        V::float32_output("Float32_discrete_output", &ONE, "", |m| &mut m.out.numbers.single[1]),
        V::parameter("Float64_fixed_parameter", &ONE, "", |m| &mut m.model.fixed),
        V::parameter("Float64_tunable_parameter", &ONE, "", |m| &mut m.model.tunable).tunable(),
        V::input("Float64_continuous_input", &ONE, "", |m| &mut m.model.numbers.double[0]),
        V::output("Float64_continuous_output", &ONE, "", |m| &mut m.out.numbers.double[0]),
        V::discrete_input("Float64_discrete_input", &ONE, "", |m| &mut m.model.numbers.double[1]),
        V::discrete_output("Float64_discrete_output", &ONE, "", |m| &mut m.out.numbers.double[1]),
        V::int8_input("Int8_input", "", |m| &mut m.model.numbers.int8),
        V::int8_output("Int8_output", "", |m| &mut m.out.numbers.int8),
        V::uint8_input("UInt8_input", "", |m| &mut m.model.numbers.uint8),
        V::uint8_output("UInt8_output", "", |m| &mut m.out.numbers.uint8),
        V::int16_input("Int16_input", "", |m| &mut m.model.numbers.int16),
        V::int16_output("Int16_output", "", |m| &mut m.out.numbers.int16),
        V::uint16_input("UInt16_input", "", |m| &mut m.model.numbers.uint16),
        V::uint16_output("UInt16_output", "", |m| &mut m.out.numbers.uint16),
        V::integer_input("Int32_input", "", |m| &mut m.model.numbers.int32),
        V::integer_output("Int32_output", "", |m| &mut m.out.numbers.int32),
        V::uint32_input("UInt32_input", "", |m| &mut m.model.numbers.uint32),
        V::uint32_output("UInt32_output", "", |m| &mut m.out.numbers.uint32),
        V::int64_input("Int64_input", "", |m| &mut m.model.numbers.int64),
        V::int64_output("Int64_output", "", |m| &mut m.out.numbers.int64),
        V::uint64_input("UInt64_input", "", |m| &mut m.model.numbers.uint64),
        V::uint64_output("UInt64_output", "", |m| &mut m.out.numbers.uint64),
        V::boolean_input("Boolean_input", "", |m| &mut m.model.numbers.truth),
        V::boolean_output("Boolean_output", "", |m| &mut m.out.numbers.truth),
        V::text_input("String_input", "", |m| &mut m.model.text),
        V::text_output("String_output", "", |m| &m.model.text),
        V::binary_input("Binary_input", "", BYTES.0, BYTES.1, |m| &mut m.model.bytes),
        V::binary_output("Binary_output", "", BYTES.0, BYTES.1, |m| &mut m.out.bytes),
        V::enumeration_input("Enumeration_input", "", &Field(|m| &mut m.model.numbers.choice)),
        V::enumeration_output("Enumeration_output", "", &Field(|m| &mut m.out.numbers.choice)),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        out.numbers = self.numbers;
        out.bytes.clone_from(&self.bytes);
    }

    fn advance(&mut self, _step: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

/// For Model Exchange: no events of the model itself.
impl Events for Feedthrough {
    fn event(&mut self, _now: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }

    fn next(&self, _now: Elapsed) -> Next {
        Next::Never
    }
}

fmu_export::export!(Feedthrough: Events);
