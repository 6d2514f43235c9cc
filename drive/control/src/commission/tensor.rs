//! The inductance over the direction of the current.

use drive_base::math::{atan2, sin_cos};
use serde::{Deserialize, Serialize};

/// 1/L about the circle in 1/H: its mean g_0, and g_c and g_s.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Tensor {
    mean: f64,
    cos: f64,
    sin: f64,
}

impl Tensor {
    /// 1/L(phi) through `y` (1/H) at 0, 60 and 120 degrees; the salient part at most 0.75 of the mean one.
    pub(super) fn through(y: [f64; 3]) -> Self {
        let half_sqrt_3 = 0.5 * drive_base::frame::SQRT_3;
        let mean = (y[0] + y[1] + y[2]) / 3.0;
        let cos = (2.0 / 3.0) * (y[0] - 0.5 * (y[1] + y[2]));
        let sin = (2.0 / 3.0) * half_sqrt_3 * (y[1] - y[2]);
        let size = (cos * cos + sin * sin).sqrt();
        let share = if size > 0.75 * mean { 0.75 * mean / size } else { 1.0 };
        Self { mean, cos: cos * share, sin: sin * share }
    }

    /// L in H at the angle `phi` (rad).
    pub(super) fn inductance(&self, phi: f64) -> f64 {
        let (s, c) = sin_cos(2.0 * phi);
        1.0 / (self.mean + self.cos * c + self.sin * s)
    }

    /// Angle of the smallest inductance in rad.
    pub(super) fn axis(&self) -> f64 {
        0.5 * atan2(self.sin, self.cos)
    }

    /// Half of the difference of the two values of 1/L in 1/H.
    fn size(&self) -> f64 {
        (self.cos * self.cos + self.sin * self.sin).sqrt()
    }

    /// Ratio of the two inductances, at least 1.
    pub(super) fn ratio(&self) -> f64 {
        (self.mean + self.size()) / (self.mean - self.size())
    }

    /// Difference of the two inductances in H, at least 0.
    pub(super) fn saliency(&self) -> f64 {
        1.0 / (self.mean - self.size()) - 1.0 / (self.mean + self.size())
    }

    /// This machine with its smallest inductance at 0 rad, or its largest one if the tensor is an `inverse`.
    pub(super) fn aligned(&self, inverse: bool) -> Self {
        Self { mean: self.mean, cos: if inverse { -self.size() } else { self.size() }, sin: 0.0 }
    }
}
