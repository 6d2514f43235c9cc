//! A rotor that the estimate no longer follows: unlike the controller, the drive knows both.
//!
//! ```text
//! ahead = integral of n_p (speed_est - speed)          from the last time that the estimate was right
//! right: |theta_est - theta_e| < 1 rad for 0.5 s        lost: |ahead| > 5 turns for 0.5 s
//! ```
//!
//! A controller that has lost the rotor may see voltages that fit its machine, and reports a speed that it does not have: `lock_lost`
//! then stays below 1. The integral needs no more than the values at the end of each communication step; the estimate of a drive that
//! accelerates lags by less than two turns. Angles are electrical, in rad; derived here.

use drive_base::math::wrap;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Largest error in rad of an estimate that is right.
const RIGHT: f64 = 1.0;

/// Smallest slip in rad of an estimate that is lost.
const LOST: f64 = 5.0 * TAU;

/// Time in s after which either counts.
const SETTLED: f64 = 0.5;

/// The slip of the estimate against the rotor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Slip {
    /// Angle in rad by which the estimate turned more than the rotor.
    ahead: f64,
    /// Time in s for which the estimate has been right.
    right: f64,
    /// Time in s for which it has been lost.
    lost: f64,
}

impl Slip {
    /// Counts a step of `h` (s) at whose end the estimate has this `error` (rad) and turns faster than the rotor by `faster` (rad/s).
    pub(super) fn count(&mut self, h: f64, error: f64, faster: f64) {
        self.ahead += faster * h;
        self.right = if wrap(error).abs() < RIGHT { self.right + h } else { 0.0 };
        if self.right > SETTLED {
            *self = Self { right: self.right, ..Self::default() };
        }
        self.lost = if self.ahead.abs() > LOST { self.lost + h } else { 0.0 };
    }

    /// Whether the estimate has lost the rotor.
    pub(super) fn is_lost(self) -> bool {
        self.lost > SETTLED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the estimate is lost after 3 s, in steps of `h` (s), with an error (rad) that follows from the time.
    fn lost(h: f64, error: impl Fn(f64) -> f64) -> bool {
        let (mut slip, mut t, mut lost) = (Slip::default(), 0.0, false);
        while t < 3.0 {
            slip.count(h, error(t + h), (error(t + h) - error(t)) / h);
            (t, lost) = (t + h, slip.is_lost());
        }
        lost
    }

    #[test]
    fn an_estimate_that_slips_is_lost() {
        for h in [1e-4, 1e-3, 1e-2] {
            assert!(lost(h, |t| 2100.0 * t) && lost(h, |t| -30.0 * t), "{h} s");
            // A swing, a lag that settles, and a rotor that is found again.
            assert!(!lost(h, |t| 0.9 * (40.0 * t).sin()) && !lost(h, |t| 8.0 * (-5.0 * t).exp()), "{h} s");
            assert!(!lost(h, |t| if t < 1.0 { 500.0 * t } else { 80.0 * TAU }), "{h} s");
        }
    }
}
