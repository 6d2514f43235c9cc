//! The last sample interval [k - 1, k) in a turning frame, shared by the estimators in the estimated rotor frame.
//!
//! The inverter holds the voltage constant in stator axes, so its mean in the frame is its value seen from the middle
//! of the interval. R i and the cross terms use the mean of the two currents. The EMF then has no first-order bias in
//! T_s.

use crate::estimator::contract::Sample;
use drive_base::frame::{Axis, DqHat, Estimated};

/// Means over the interval, in the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Voltage in V.
    pub v: DqHat,
    /// Current in A.
    pub i: DqHat,
    /// Current at sample k - 1 in A.
    pub i_last: DqHat,
    /// Current at sample k in A.
    pub i_now: DqHat,
    /// Frame speed in rad/s.
    pub w_frame: f64,
}

impl Interval {
    /// The interval before `sample`, in the frame that turned from `theta_last` to `theta` (rad) within `T_s` (s).
    #[inline]
    pub fn new(theta_last: f64, theta: f64, sample: &Sample, T_s: f64) -> Self {
        let middle = Axis::<Estimated>::at(0.5 * (theta_last + theta));
        let i_last = Axis::<Estimated>::at(theta_last).from_stator(sample.i_last);
        let i_now = Axis::<Estimated>::at(theta).from_stator(sample.i);
        Self {
            v: middle.from_stator(sample.u),
            i: (i_last + i_now) * 0.5,
            i_last,
            i_now,
            w_frame: (theta - theta_last) / T_s,
        }
    }

    /// Factors of the terms with a speed and of p x for the finite rotation of the frame in `T_s` (s): sin(phi)/phi and cos(phi), with
    /// phi = w_f T_s / 2, as series up to phi^2. The change of a stator vector, seen from the middle of the interval, is
    ///
    /// (x_now e^{j phi} - x_last e^{-j phi}) / T_s = cos(phi) p x + j w_f (sin(phi) / phi) x_mean,   p x = (x_now - x_last) / T_s
    #[inline]
    pub fn turn(&self, T_s: f64) -> (f64, f64) {
        let turn = self.w_frame * T_s;
        (1.0 - turn * turn * (1.0 / 24.0), 1.0 - turn * turn * (1.0 / 8.0))
    }
}
