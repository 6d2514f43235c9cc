//! A model that acts at the instants k T only: a filter of its inputs, shown one sample later.

use fmu_core::log::Warnings;
use fmu_core::unit::{ONE, SECOND};
use fmu_core::{Block, Elapsed, Experiment, Fault, Info, Model, Row, Sampled, Step, Table, Warns, integrate, table};
use serde::{Deserialize, Serialize};

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Sampler {
    pub x: f64,
    pub d: f64,
    pub on: bool,
    pub gain: f64,
    pub period: f64,
    pub fixed: f64,
    pub product: f64,
    pub samples: u64,
    pub computed: f64,
    pub shown: f64,
    pub derived: i32,
}

#[derive(Clone, Default, PartialEq, Debug, Serialize, Deserialize)]
pub struct Outputs {
    pub y: f64,
    pub count: i32,
    pub derived: i32,
}

// Value references, written down by hand.
pub const TIME: u32 = 0;
pub const X: u32 = 1;
pub const D: u32 = 2;
pub const ON: u32 = 3;
pub const Y: u32 = 4;
pub const COUNT: u32 = 5;
pub const GAIN: u32 = 6;
pub const PERIOD: u32 = 7;
pub const FIXED: u32 = 8;
pub const PRODUCT: u32 = 9;
pub const DERIVED: u32 = 10;
pub const UNKNOWN: u32 = 11;

impl Default for Sampler {
    fn default() -> Self {
        Self {
            x: 1.0,
            d: 0.0,
            on: true,
            gain: 1.0,
            period: 0.01,
            fixed: 1.0,
            product: 0.0,
            samples: 0,
            computed: 0.0,
            shown: 0.0,
            derived: 0,
        }
    }
}

type V = Row<Block<Sampler>>;

impl Model for Sampler {
    type Outputs = Outputs;
    const INFO: Info = Info {
        name: "Sampler",
        version: "1",
        experiment: Experiment { stop: 1.0, step: 1e-2, ..Experiment::DEFAULT },
        ..Info::DEFAULT
    };
    const TABLE: &'static Table<Block<Self>> = table![
        V::input("x", &ONE, "Input", |m| &mut m.model.x),
        V::discrete_input("d", &ONE, "Added", |m| &mut m.model.d).at_least(-5.0).at_most(5.0),
        V::boolean_input("on", "On", |m| &mut m.model.on),
        V::discrete_output("y", &ONE, "Filtered", |m| &mut m.out.y),
        V::integer_output("count", "Samples taken", |m| &mut m.out.count),
        V::parameter("gain", &ONE, "Gain", |m| &mut m.model.gain).at_least(0.0).at_most(10.0).tunable(),
        V::parameter("T", &SECOND, "Sample period", |m| &mut m.model.period).above(0.0),
        V::parameter("fixed", &ONE, "Factor", |m| &mut m.model.fixed).at_least(0.0).at_most(10.0),
        V::calculated("product", &ONE, "gain times fixed", |m| &mut m.model.product),
        V::integer_output("derived", "How often derive ran", |m| &mut m.out.derived),
    ];

    fn derive(&mut self) {
        self.product = self.gain * self.fixed;
        self.derived += 1;
    }

    fn validate(&self) -> Result<(), Fault> {
        if self.product > 50.0 { Err(Fault::new("gain times fixed is greater than 50")) } else { Ok(()) }
    }

    fn initialize(&mut self) {
        (self.samples, self.computed, self.shown) = (0, 0.25 * self.fixed, 0.25 * self.fixed);
    }

    fn output(&self, _now: Elapsed, out: &mut Outputs) {
        *out = Outputs { y: self.shown, count: i32::try_from(self.samples).unwrap_or(i32::MAX), derived: self.derived };
    }

    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::sampled(self, step)
    }
}

impl Sampled for Sampler {
    fn period(&self) -> f64 {
        self.period
    }

    fn samples(&self) -> u64 {
        self.samples
    }

    fn show(&mut self) {
        self.shown = self.computed;
    }

    fn sample(&mut self) -> Result<(), Fault> {
        if self.x > 1e6 {
            return Err(Fault::value("x", self.x, "at most 1e6"));
        }
        if self.on {
            self.computed = 0.9 * self.computed + self.product * self.x + self.d;
        }
        self.samples += 1;
        Ok(())
    }
}

impl Warns for Sampler {
    fn warn(&self, log: &mut Warnings<'_>) {
        if self.shown > 100.0 {
            log.warn("large", || format!("y = {} is large", self.shown));
        }
    }
}
