//! Watch in speed control for a speed that does not come to rest at its reference, although reference and load are constant: a speed
//! loop faster than the torque that it asks for, or a torque limit that acts on one side of standstill only.
//!
//! ```text
//! e = speed_ref - speed, over spans of 1 s:
//! reported: the maximum of |e| exceeds |speed_ref|/10 + 5 rad/s and has not fallen by 2 % in three spans in succession, in which the
//!           minimum of |e| is the same to |speed_ref|/500 + 0.01 rad/s (0 in an oscillation)
//! ```
//!
//! A start at the limit approaches its reference without crossing it, and a damped oscillation falls. [`Overload`](drive_control::overload::Overload) reports
//! a torque that stays at its limit. Derived here; speeds are mechanical, in rad/s.

use crate::happened::Happened;
use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// Length of a span in s.
const SPAN: f64 = 1.0;
/// Number of spans in succession after which it is reported.
const MANY: u8 = 3;

/// Minimum and maximum of a span.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Errors {
    least: f64,
    most: f64,
}

impl Errors {
    const NONE: Self = Self { least: f64::INFINITY, most: f64::NEG_INFINITY };

    /// Maximum of |e|.
    fn farthest(self) -> f64 {
        self.most.max(-self.least)
    }

    /// Minimum of |e|: 0 if e changes its sign.
    fn nearest(self) -> f64 {
        self.least.max(-self.most).max(0.0)
    }
}

/// What has been seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Unsettled {
    /// Reference in rad/s and load in N.m of the spans.
    constant: [f64; 2],
    /// The present span, its duration in s, and the last span.
    now: Errors,
    time: f64,
    last: Errors,
    /// Whether the torque left its limit in the present span.
    free: bool,
    /// Number of spans without progress.
    held: u8,
    found: Happened,
}

impl Default for Unsettled {
    fn default() -> Self {
        let none = Errors::NONE;
        Self { constant: [0.0; 2], now: none, time: 0.0, last: none, free: false, held: 0, found: Happened::default() }
    }
}

impl Unsettled {
    /// After an interval of `h` (s) in speed control that ends at this `speed` (rad/s), with the torque at its limit or not (`limited`).
    pub(crate) fn update(&mut self, h: f64, limited: bool, [speed_ref, tau_load]: [f64; 2], speed: f64) {
        let constant = [speed_ref, tau_load];
        if constant.map(f64::to_bits) != self.constant.map(f64::to_bits) {
            *self = Self { constant, found: self.found, ..Self::default() };
        }
        self.free |= !limited;
        let error = speed_ref - speed;
        (self.now.least, self.now.most) = (self.now.least.min(error), self.now.most.max(error));
        self.time += h;
        if self.time >= SPAN * (1.0 - 1e-9) {
            let (now, size) = (self.now, speed_ref.abs());
            let away = self.free && now.farthest() > 0.1 * size + 5.0 && now.farthest() >= 0.98 * self.last.farthest();
            let same = (now.nearest() - self.last.nearest()).abs() <= 0.002 * size + 0.01;
            self.held = if away && same { self.held.saturating_add(1) } else { 0 };
            (self.last, self.now, self.time, self.free) = (now, Errors::NONE, 0.0, false);
        }
        self.found = self.found.followed_by(self.held >= MANY);
    }

    /// Reports a speed that does not settle, once, with the bandwidths (rad/s) of the torque and of the speed loop.
    pub(crate) fn warn(&self, [torque, speed]: [f64; 2], log: &mut Warnings<'_>) {
        if self.found == Happened::Now {
            let ([speed_ref, _], Errors { least, most }) = (self.constant, self.last);
            log.warn("settles", || {
                format!(
                    "the speed does not settle at speed_ref = {speed_ref} rad/s: for more than 3 s it has been between {:.1} and {:.1} rad/s, \
                     with a constant load; check speed_loop.bandwidth = {speed} rad/s, which must be a small part of current.bandwidth = \
                     {torque} rad/s, speed_loop.t_is, mechanics.J, and the limits of the torque",
                    speed_ref - most,
                    speed_ref - least
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a run of 12 s over these (speed_ref, tau_load, speed) is reported, in steps of `h` (s).
    fn seen(h: f64, limited: bool, of: fn(f64) -> (f64, f64, f64)) -> bool {
        let (mut watch, mut t, mut found) = (Unsettled::default(), 0.0, 0);
        while t < 12.0 {
            let (speed_ref, tau_load, speed) = of(t);
            watch.update(h, limited, [speed_ref, tau_load], speed);
            found += i32::from(watch.found == Happened::Now);
            t += h;
        }
        assert!(found < 2, "once");
        found > 0
    }

    #[test]
    fn an_oscillation_is_seen_and_a_start_is_not() {
        for h in [1e-3, 0.01, 0.1] {
            assert!(seen(h, false, |t| (50.0, 1.0, 50.0 + 20.0 * (9.0 * t).sin())), "an oscillation");
            assert!(seen(h, false, |t| (0.0, 1.0, 8.0 * (9.0 * t).sin())), "at standstill");
            assert!(seen(h, false, |t| (-50.0, 1.0, -50.0 + (2.0 + t) * (9.0 * t).sin())), "a growing oscillation");
            assert!(seen(h, false, |t| (50.0, 1.0, 0.4 * (300.0 * t).sin())), "held at standstill");
            assert!(
                !seen(h, false, |t| (50.0, 1.0, 50.0 + 40.0 * (-0.1 * t).exp() * (9.0 * t).sin())),
                "a damped oscillation"
            );
            assert!(!seen(h, false, |t| (50.0, 1.0, (2.0 * t).min(50.0))), "a slow start");
            assert!(!seen(h, false, |t| (50.0, 1.0, 50.0 - 50.0 * (-0.05 * t).exp())), "a slow loop");
            assert!(!seen(h, false, |t| (50.0, 1.0, 50.0 + 4.0 * (9.0 * t).sin())), "a ripple");
            assert!(!seen(h, false, |t| (50.0, (9.0 * t).sin(), 50.0 + 20.0 * (9.0 * t).sin())), "with the load");
            assert!(!seen(h, false, |t| (50.0 * (t / 3.0).sin(), 1.0, 0.0)), "a reference that moves");
        }
        assert!(!seen(0.01, true, |_| (50.0, 1.0, 40.0)), "held by the limit");
    }
}
