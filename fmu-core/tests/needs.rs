//! Inputs that need not be fed: their descriptions, and invalid rows.
#![allow(missing_docs)]

use fmu_core::unit::{KELVIN, VOLT};
use fmu_core::*;
use serde::{Deserialize, Serialize};

fmu_core::enumeration! {
    #[derive(Serialize, Deserialize)]
    enum Mode("Mode", "Where the temperature comes from") {
        1 Constant "";
        2 Network "";
    }
}

#[derive(Clone, Serialize, Deserialize)]
struct Part_ {
    mode: Mode,
    on: bool,
}

#[derive(Clone, Serialize, Deserialize)]
struct Heater<const VALUE: u8> {
    u: f64,
    bias: f64,
    coolant: f64,
    part: Part_,
}

impl<const VALUE: u8> Default for Heater<VALUE> {
    fn default() -> Self {
        Self { u: 0.0, bias: 0.0, coolant: 293.0, part: Part_ { mode: Mode::Constant, on: false } }
    }
}

#[derive(Clone, Default, Serialize, Deserialize)]
struct None_;

const PART: &Table<Part_> = table![
    Row::enumeration_parameter("thermal.mode", "Mode", &Field(|p: &mut Part_| &mut p.mode)),
    Row::boolean_parameter("on", "On", |p| &mut p.on),
];

impl<const VALUE: u8> Model for Heater<VALUE> {
    type Outputs = None_;
    const INFO: Info = Info {
        name: "Heater",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        Row::input("u", &VOLT, "Voltage", |m: &mut Block<Self>| &mut m.model.u).optional(),
        Row::input("bias", &VOLT, "Bias", |m: &mut Block<Self>| &mut m.model.bias).read_with("on", "true"),
        Row::input("T", &KELVIN, "Coolant", |m: &mut Block<Self>| &mut m.model.coolant).read_with(
            ["thermal.mode", "mode", "thermal", "u"][VALUE as usize % 4],
            ["Network", "Imposed"][VALUE as usize / 4],
        ),
        Row::part("plant.", &Part { table: PART, lens: |m: &mut Block<Self>| &mut m.model.part }),
    ];

    fn initialize(&mut self) {}

    fn output(&self, _: Elapsed, _: &mut None_) {}

    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fn words<const VALUE: u8>() -> Result<Vec<String>, String> {
    let described = Description::of::<Heater<VALUE>>().map_err(|fault| fault.to_string())?;
    Ok(described.variables.into_iter().take(3).map(|v| v.description).collect())
}

#[test]
fn descriptions_name_the_parameter_as_users_see_it() {
    let expected = [
        "Voltage; optional",
        "Bias; optional: read only with plant.on",
        "Coolant; optional: read only with plant.thermal.mode = Network",
    ];
    assert_eq!(words::<0>().unwrap(), expected);
    assert_eq!(words::<1>().unwrap(), expected, "a shorter name that fits one parameter");
}

#[test]
fn a_parameter_that_does_not_exist_is_a_fault() {
    let errors = [words::<2>(), words::<3>(), words::<4>()].map(Result::unwrap_err);
    assert_eq!(
        errors,
        [
            "T is read with thermal: expected one parameter of this name, found 0",
            "T is read with u: expected one parameter of this name, found 0",
            "T is read with plant.thermal.mode = Imposed, a value that it never has"
        ]
    );
}
