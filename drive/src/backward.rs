//! Watch in speed control for a shaft that its load turns backward although no limit acts: the speed loop is too weak.
//!
//! ```text
//! reported: the speed is against speed_ref, |speed| > |speed_ref|/5 + 10 rad/s, and has grown for 1 s
//! ```
//!
//! A reversal begins there too, but its speed falls. Derived here; speeds are mechanical, in rad/s.

use crate::happened::Happened;
use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// Time in s of growth after which it is reported.
const LONG: f64 = 1.0;

/// What has been seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Backward {
    /// Maximum speed against the direction of the reference.
    farthest: f64,
    /// Time in s in which it has grown.
    time: f64,
    found: Happened,
}

impl Backward {
    /// After an interval of `h` (s) that ends at this `speed` (rad/s), with speed control at work or not (`controls`).
    pub(crate) fn update(&mut self, h: f64, controls: bool, speed_ref: f64, speed: f64) {
        let turns = -speed * speed_ref.signum();
        if !controls || speed_ref == 0.0 || turns <= 0.2 * speed_ref.abs() + 10.0 {
            *self = Self::default();
        } else if turns > self.farthest {
            let grew = if self.farthest > 0.0 { h } else { 0.0 };
            (self.farthest, self.time) = (turns, self.time + grew);
        }
        self.found = self.found.followed_by(self.time > LONG - 0.5 * h);
    }

    /// Reports a shaft at this `speed` (rad/s), once.
    pub(crate) fn warn(self, speed_ref: f64, speed: f64, log: &mut Warnings<'_>) {
        if self.found == Happened::Now {
            log.warn("speed_loop", || {
                format!(
                    "the speed runs away from speed_ref = {speed_ref} rad/s and is {speed:.1} rad/s: the speed loop is too weak for its load, or \
                     the torque is not what the controller expects; check speed_loop.bandwidth, mechanics.J and the motor's data in the \
                     controller"
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shaft_that_the_load_turns_backward_is_seen() {
        let seen = |controls: bool, h: f64, of: fn(f64) -> (f64, f64)| {
            let mut backward = Backward::default();
            let mut t = 0.0;
            while t < 6.0 {
                let (speed_ref, speed) = of(t);
                backward.update(h, controls, speed_ref, speed);
                if backward.found == Happened::Now {
                    return true;
                }
                t += h;
            }
            false
        };
        for h in [1e-3, 0.1, 1.0] {
            assert!(seen(true, h, |t| (50.0, 50.0 - 25.0 * t)), "slowly");
            assert!(seen(true, h, |t| (-50.0, -50.0 + 100.0 * t)), "the same in reverse");
            assert!(!seen(false, h, |t| (50.0, 50.0 - 100.0 * t)), "in torque control, or with the gates off");
            assert!(!seen(true, h, |t| (0.0, -20.0 * t)), "no direction to hold");
            assert!(!seen(true, h, |t| (50.0, -100.0 + 30.0 * t)), "a reversal");
            let overcome = |t: f64| (50.0, if t < 1.3 { 50.0 - 60.0 * t } else { 10.0 + 10.0 * t });
            assert!(!seen(true, h, overcome), "a load step that the loop overcomes");
        }
    }
}
