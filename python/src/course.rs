//! Progress of a simulation: FMPy's regular points `start + (n + 1) interval`, the inputs and the rows.

use crate::input::{Input, is_close};
use crate::record::Record;

/// Times, inputs and rows of a simulation.
pub(crate) struct Course {
    pub(crate) start: f64,
    pub(crate) stop: f64,
    pub(crate) interval: f64,
    pub(crate) input: Input,
    pub(crate) record: Record,
    pub(crate) time: f64,
    /// Regular points reached so far.
    pub(crate) reached: u32,
    pub(crate) ended: bool,
}

impl Course {
    pub(crate) fn is_over(&self) -> bool {
        self.ended || self.time > self.stop || is_close(self.time, self.stop)
    }

    /// The next regular point.
    pub(crate) fn regular(&self) -> f64 {
        self.start + f64::from(self.reached + 1) * self.interval
    }
}

/// `limit` if `time` is later by more than rounding.
pub(crate) fn cut(time: f64, limit: f64) -> f64 {
    if time > limit && !is_close(time, limit) { limit } else { time }
}
