//! What the tuned drive will not do: told before it is tried.

use std::fmt;

/// What a limit is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// To start from any angle.
    Start,
    /// To take rated torque as a step.
    Load,
}

/// Something that the drive will not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// What it will not hold.
    pub what: What,
    /// At which speed in pu.
    pub level: f64,
    /// Why.
    pub reason: String,
    /// What helps.
    pub remedy: String,
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match self.what {
            What::Start => "START",
            What::Load => "LOAD",
        };
        write!(f, "will not hold {what} at {} pu: {}; {}", self.level, self.reason, self.remedy)
    }
}
