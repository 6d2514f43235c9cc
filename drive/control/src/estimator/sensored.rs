//! The measured angle and speed (Kim & Sul, Fig. 1a): the reference for all estimators.
//!
//! Limits: only those of the sensor that the controller reads (`sensor.position`).

use crate::estimator::contract::{ContextOf, Estimate, Estimating, Sample};
use drive_base::math::wrap;
use serde::{Deserialize, Serialize};

/// State: the angle of the last sample, which keeps the estimate unwrapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Sensored {
    /// Electrical angle in rad, not wrapped.
    theta: f64,
}

impl<All> Estimating<All> for Sensored {
    fn start(_: &ContextOf<All>, sample: &Sample, _: f64, _: f64) -> (Self, Estimate) {
        (Self { theta: sample.theta_meas }, Estimate::new(sample.theta_meas, sample.w_meas, sample))
    }

    #[inline]
    fn update(&mut self, _: &ContextOf<All>, sample: &Sample) -> Estimate {
        self.theta += wrap(sample.theta_meas - self.theta);
        Estimate::new(self.theta, sample.w_meas, sample)
    }

    /// A sensor ignores an angle from another source.
    fn place(&mut self, _: &ContextOf<All>, _: &Sample, _: f64, _: f64) {}
}
