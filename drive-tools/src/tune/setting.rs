//! The values of both FMUs, each with its rule, and the machine data for a trial.

use super::motor::Located;
use drive::estimator::Kind;

/// Speeds in pu at which every drive is tried that reaches them, in addition to its highest speed.
pub const LEVELS: [f64; 3] = [0.1, 0.5, 1.0];

/// A value for a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Value of a real variable.
    Real(f64),
    /// Values of an array of real variables.
    Reals(Vec<f64>),
    /// Value of an integer.
    Integer(i32),
    /// Value of a Boolean.
    Boolean(bool),
    /// Value of an enumeration: the name of an item.
    Item(String),
}

/// A variable with its value and the origin of the value.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// Variable of the model.
    pub name: &'static str,
    /// The value, in the unit of the variable.
    pub value: Value,
    /// The rule.
    pub rule: String,
    /// Offset of the source value in the machine's file.
    pub origin: Option<usize>,
}

/// What the rules give for a machine and an estimator.
#[derive(Clone, Debug, PartialEq)]
pub enum Suited {
    /// The values.
    Tuned(Box<Tuned>),
    /// The machine does not suit the estimator.
    Refused(Unsuited),
}

/// Why a machine does not suit an estimator.
#[derive(Clone, Debug, PartialEq)]
pub struct Unsuited {
    /// The estimator.
    pub estimator: Kind,
    /// The reason with its numbers, the expected values, and the remedy.
    pub reason: String,
}

/// Values of both FMUs.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuned {
    /// Name of the machine.
    pub name: String,
    /// The estimator.
    pub estimator: Kind,
    /// Source of its data.
    pub source: String,
    /// Values of `PmsmPlant`.
    pub plant: Vec<Setting>,
    /// Values of `SensorlessController`.
    pub controller: Vec<Setting>,
    /// Warnings: values outside the ranges that the rules were tested in.
    pub notes: Vec<String>,
    /// Rated mechanical speed in rad/s.
    pub speed: f64,
    /// Rated torque in N.m.
    pub torque: f64,
    /// Highest mechanical speed in rad/s.
    pub top: f64,
    /// Load in N.m at the highest speed.
    pub top_torque: f64,
    /// Speeds in pu at which a trial applies the rated torque as a step.
    pub levels: Vec<f64>,
    /// Target of the observer or tracker in rad/s.
    pub observer: f64,
    /// Time in s at rest before the first speed reference, in which the rotor aligns itself.
    pub rest: f64,
}

/// A value as the machine's file gives it.
pub(super) fn given(name: &'static str, x: &Located) -> Setting {
    Setting { name, value: Value::Real(*x.get_ref()), rule: "as given".into(), origin: Some(x.span().start) }
}

/// A value by a rule.
pub(super) fn set(name: &'static str, value: Value, rule: &str) -> Setting {
    Setting { name, value, rule: rule.into(), origin: None }
}

/// A real value by a rule.
pub(super) fn real(name: &'static str, x: f64, rule: &str) -> Setting {
    set(name, Value::Real(x), rule)
}
