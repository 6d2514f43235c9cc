//! A model with every kind of variable that fails on demand.

use fmu_core::unit::{AMPERE, OHM, SPEED, VOLT};
use fmu_core::{Block, Elapsed, Experiment, Fault, Field, Info, Model, Row, Step, Table, enumeration, table};
use serde::{Deserialize, Serialize};

#[derive(Clone, Serialize, Deserialize)]
pub struct Probe {
    u: f64,
    k: f64,
    on: bool,
    r: f64,
    map: [f64; 3],
    gain: f64,
    n: i32,
    mode: Mode,
    flag: bool,
    double_gain: f64,
    x: f64,
    steps: u64,
}

#[derive(Clone, Default, Serialize, Deserialize)]
pub struct Outputs {
    x: f64,
    count: i32,
    high: bool,
}

// Value references, written down by hand: 1 + offset in the table, the array has three.
pub const TIME: u32 = 0;
pub const U: u32 = 1;
pub const K: u32 = 2;
pub const ON: u32 = 3;
pub const X: u32 = 4;
pub const COUNT: u32 = 5;
pub const HIGH: u32 = 6;
pub const R: u32 = 7;
pub const MAP: u32 = 8;
pub const GAIN: u32 = 11;
pub const N: u32 = 12;
pub const MODE: u32 = 13;
pub const FLAG: u32 = 14;
pub const DOUBLE_GAIN: u32 = 15;
pub const UNKNOWN: u32 = 16;

/// Values of `mode`.
pub const FAULTY: i32 = Mode::Faulty as i32;
pub const PANICKY: i32 = Mode::Panicky as i32;
/// Value of `n` with which a step ends the process.
pub const ABORTING: i32 = 1_234_567;

enumeration! {
    #[derive(Serialize, Deserialize)]
    pub enum Mode("Mode", "What a step does") {
        1 Plain "";
        2 Faulty "";
        4 Panicky "";
    }
}

impl Default for Probe {
    fn default() -> Self {
        Self {
            u: 1.0,
            k: 0.0,
            on: true,
            r: 2.0,
            map: [0.0, 1.0, 2.0],
            gain: 1.0,
            n: 1,
            mode: Mode::Plain,
            flag: false,
            double_gain: 0.0,
            x: 0.0,
            steps: 0,
        }
    }
}

type V = Row<Block<Probe>>;

impl Model for Probe {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Probe",
        description: "A model for tests",
        version: "1.0",
        experiment: Experiment { stop: 1.0, step: 0.1, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("u", &VOLT, "Voltage", |m| &mut m.model.u),
        V::discrete_input("k", &VOLT, "Another", |m| &mut m.model.k).at_least(-5.0).at_most(5.0),
        V::boolean_input("on", "On", |m| &mut m.model.on),
        V::output("x", &AMPERE, "State", |m| &mut m.out.x),
        V::integer_output("count", "Steps done", |m| &mut m.out.count),
        V::boolean_output("high", "State above 1", |m| &mut m.out.high),
        V::parameter("motor.R", &OHM, "Resistance", |m| &mut m.model.r).above(0.0),
        V::array_parameter("map", &SPEED, "Map", 3, |m| &mut m.model.map).at_least(-1.0),
        V::parameter("gain", &OHM, "Gain", |m| &mut m.model.gain).at_least(0.0).at_most(10.0).tunable(),
        V::integer_parameter("n", "Count", |m| &mut m.model.n).at_least(1.0),
        V::enumeration_parameter("mode", "Mode", &Field(|m| &mut m.model.mode)),
        V::boolean_parameter("flag", "Flag", |m| &mut m.model.flag),
        V::calculated("double_gain", &OHM, "Twice the gain", |m| &mut m.model.double_gain),
    ];

    fn derive(&mut self) {
        self.double_gain = 2.0 * self.gain;
    }

    fn validate(&self) -> Result<(), Fault> {
        if self.double_gain * self.r > 100.0 {
            return Err(Fault::new("gain times motor.R is greater than 50"));
        }
        if self.map[0] <= self.map[2] { Ok(()) } else { Err(Fault::new("map[1] is greater than map[3]")) }
    }

    fn initialize(&mut self) {
        assert!(self.n != 13, "thirteen is bad luck");
        // Not a number with a map that `validate` refuses.
        let inverted = 0.0 * (self.map[2] - self.map[0]).min(0.0).sqrt();
        self.x = self.u / self.r * f64::from(self.n) + inverted;
        self.steps = 0;
    }

    fn output(&self, now: Elapsed, out: &mut Outputs) {
        out.x = self.x + 1e-3 * now.seconds();
        out.count = i32::try_from(self.steps).unwrap_or(i32::MAX);
        out.high = self.x > 1.0;
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        if self.n == ABORTING {
            std::process::abort();
        }
        match self.mode {
            Mode::Faulty => return Err(Fault::new("x left the finite numbers by 50 %, see #4")),
            Mode::Panicky => panic!("the model panicked"),
            Mode::Plain => {}
        }
        if self.on {
            self.x += step.h * (self.double_gain * self.u / self.r - 0.1 * self.x + self.k + self.map[1]);
        }
        self.steps += 1;
        Ok(())
    }
}
