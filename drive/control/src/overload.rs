//! Watch in speed control for a load that the drive cannot hold: the speed runs away from its reference at the torque limit.
//!
//! ```text
//! away = (speed at the beginning of the limit - speed) sign(speed_ref - speed)          > 0: the error grows although the limit acts
//! reported: away > |speed_ref|/2 + 1 rad/s once it has grown for 1 s, or at once away > 1.2 |speed_ref| + 10 rad/s, beyond standstill
//! ```
//!
//! A start, a load step and a reversal run at the limit too, but there the error falls, or grows for less than that. Derived here;
//! speeds are mechanical, in rad/s.

use serde::{Deserialize, Serialize};

/// Time in s of growth after which half of the reference suffices.
const LONG: f64 = 1.0;
/// Time in s after which the report is not repeated.
const SAID: f64 = 0.5;

/// What has been seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overload {
    /// Whether the limit acts, the speed at its beginning, and whether that is below its reference.
    acts: bool,
    from: f64,
    below: bool,
    /// Maximum distance from that speed, and the time in s in which it has grown.
    farthest: f64,
    time: f64,
    /// Whether the speed has run away, and the time in s since then.
    is: bool,
    since: f64,
}

impl Overload {
    /// After an interval of `h` (s) from the speed `before` to `speed`, in which a torque limit acted (`limited`) against the
    /// error of the speed.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub fn update(&mut self, h: f64, limited: bool, speed_ref: f64, speeds: [f64; 2]) {
        if limited {
            self.at_limit(h, speed_ref, speeds);
        } else if self.acts {
            *self = Self::default();
        }
    }

    #[inline(never)]
    fn at_limit(&mut self, h: f64, speed_ref: f64, [before, speed]: [f64; 2]) {
        let below = speed_ref > speed;
        if !self.acts || below != self.below {
            (self.acts, self.from, self.below, self.farthest, self.time) = (true, before, below, 0.0, 0.0);
        }
        let (away, size) = (if below { self.from - speed } else { speed - self.from }, speed_ref.abs());
        if away > self.farthest {
            (self.farthest, self.time) = (away, self.time + h);
        }
        if self.is {
            self.since += h;
        }
        self.is |= away > 1.2 * size + 10.0 && size > 10.0 || self.time >= LONG && away > 0.5 * size + 1.0;
    }

    /// Whether it has just been found that the load exceeds the torque.
    pub fn reports(&self) -> bool {
        self.is && self.since < SAID
    }

    /// Whether the torque `tau` (N.m) is at one of its limits (N.m), and the `error` of the speed (rad/s) asks for more.
    pub fn limited(tau: f64, [low, high]: [f64; 2], error: f64) -> bool {
        error > 0.0 && tau >= 0.99 * high || error < 0.0 && tau <= 0.99 * low
    }

    /// The message, with the speed (rad/s), its reference (rad/s) and the limits (N.m).
    pub fn message([speed, speed_ref]: [f64; 2], [low, high]: [f64; 2]) -> String {
        format!(
            "the load exceeds the torque of the drive: at tau_min = {low:.4} N.m and tau_max = {high:.4} N.m, the speed runs away from \
             speed_ref = {speed_ref} rad/s and is {speed:.1} rad/s; lower the load, check that it is in N.m, or raise the limits of the \
             drive's current and torque"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a run over these (speed_ref, speed, limited) in steps of 0.1 s is reported.
    fn seen(run: impl IntoIterator<Item = (f64, f64, bool)>) -> bool {
        let (mut overload, mut before, mut any) = (Overload::default(), None, false);
        for (speed_ref, speed, limited) in run {
            overload.update(0.1, limited, speed_ref, [before.unwrap_or(speed), speed]);
            (before, any) = (Some(speed), any || overload.reports());
        }
        any
    }

    #[test]
    fn a_speed_that_runs_away_is_seen_and_a_start_is_not() {
        let steps = |f: fn(f64) -> (f64, f64, bool)| seen((0..40).map(|k| f(f64::from(k))));
        assert!(steps(|k| (50.0, 50.0 - 10.0 * k, true)), "turned backward");
        assert!(steps(|k| (-50.0, 10.0 * k - 50.0, true)), "the same in reverse");
        assert!(steps(|k| (50.0, 50.0 - 2.0 * k, true)), "slowly");
        assert!(steps(|k| (0.0, -0.5 * k, true)), "from standstill");
        assert!(!steps(|k| (50.0, (2.0 * k).min(50.0), true)), "a start");
        assert!(!steps(|k| (-50.0, (50.0 - 3.0 * k).max(-50.0), true)), "a reversal");
        assert!(!steps(|k| (50.0, if k < 5.0 { 50.0 - 8.0 * k } else { 10.0 + k }, true)), "a load step");
        assert!(!steps(|k| (50.0, 50.0 - 2.0 * k, false)), "coasting without a limit");
    }
}
