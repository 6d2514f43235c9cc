//! A model with parameters of every type, which records their values in `load`.

use fmu_core::unit::VOLT;
use fmu_core::{
    Block, Bytes, Elapsed, Events, Fault, Field, Info, Model, Next, Outcome, Resource, Row, Step, Table, enumeration,
    table,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

enumeration! {
    #[derive(Serialize, Deserialize)]
    pub(crate) enum Fan("FanMode", "What the fan does") {
        1 Off "Stands still";
        2 On "Turns";
    }
}

#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct All {
    u: f64,
    real: f64,
    single: f32,
    n: i32,
    small: u8,
    large: u64,
    on: bool,
    fan: Fan,
    label: String,
    weights: [f64; 4],
    /// The preset in `load`.
    seen: Resource<f64>,
    doubled: f64,
    key: Bytes,
}

impl Default for All {
    fn default() -> Self {
        Self {
            u: 1.0,
            real: 2.0,
            single: 0.1,
            n: 3,
            small: 4,
            large: 5,
            on: false,
            fan: Fan::Off,
            label: "built".into(),
            weights: [1.0, 2.0, 3.0, 4.0],
            seen: Resource::default(),
            doubled: 0.0,
            key: Bytes::default(),
        }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
pub(crate) struct Outputs {
    y: f64,
    seen: f64,
}

type V = Row<Block<All>>;

impl Model for All {
    type Outputs = Outputs;
    const INFO: Info = Info { name: "All", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &VOLT, "", |m| &mut m.model.u).at_most(1e3),
        V::parameter("real", &VOLT, "", |m| &mut m.model.real).above(0.0).tunable(),
        V::float32_parameter("single", &VOLT, "", |m| &mut m.model.single).at_most(0.3),
        V::integer_parameter("n", "", |m| &mut m.model.n).at_least(1.0),
        V::uint8_parameter("small", "", |m| &mut m.model.small).at_most(200.0),
        V::uint64_parameter("large", "", |m| &mut m.model.large),
        V::boolean_parameter("on", "", |m| &mut m.model.on),
        V::enumeration_parameter("fan", "", &Field(|m| &mut m.model.fan)),
        V::text_parameter("label", "", |m| &mut m.model.label),
        V::array_parameter("weights", &VOLT, "", 4, |m| &mut m.model.weights).shape(&[2, 2]),
        V::calculated("doubled", &VOLT, "", |m| &mut m.model.doubled),
        V::output("y", &VOLT, "", |m| &mut m.out.y),
        V::output("seen", &VOLT, "", |m| &mut m.out.seen),
        V::text_constant("made", "", "here"),
        V::binary_parameter("key", "", "application/octet-stream", 8, |m| &mut m.model.key),
    ];

    fn load(&mut self, _: Option<&Path>) -> Result<(), Fault> {
        self.seen = self.real.into();
        Ok(())
    }

    fn derive(&mut self) {
        self.doubled = 2.0 * self.real;
    }

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, out: &mut Outputs) {
        out.y = self.u * self.real + self.weights[1];
        out.seen = *self.seen;
    }

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        self.u += 1.0;
        Ok(())
    }
}

impl Events for All {
    fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> {
        Ok(Outcome::default())
    }

    fn next(&self, _: Elapsed) -> Next {
        Next::Never
    }
}
