//! Watch in speed control for a speed that the drive cannot reach, at the limit of its torque: the speed runs away under a load, or stays
//! where it is.
//!
//! ```text
//! away = (speed at the beginning of the limit - speed) sign(speed_ref - speed)          > 0: the error grows although the limit acts
//! reported: away > |speed_ref|/2 + 1 rad/s once it has grown for 1 s, or at once away > 1.2 |speed_ref| + 10 rad/s, beyond standstill
//! reported: |speed_ref - speed| > |speed_ref|/50 + 1/2 rad/s whose minimum over 0.5 s is the same three times, to |speed_ref|/500
//! ```
//!
//! A start, a load step and a reversal run at the limit too, but there the error falls, or grows for less than that. Derived here;
//! speeds are mechanical, in rad/s.

use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// Time in s of growth after which half of the reference suffices.
const LONG: f32 = 1.0;
/// Time in s after which the report is not repeated.
const SAID: f32 = 0.5;
/// Time in s without the limit after which it begins anew: in field weakening, the limit follows the speed and leaves single samples out.
const BREAK: f32 = 5e-3;
/// Time in s over which the error of the speed has one minimum.
const SPAN: f32 = 0.5;

/// In single precision, which suffices here and takes half of the state.
#[expect(clippy::cast_possible_truncation, reason = "rounds")]
fn short(x: f64) -> f32 {
    x as f32
}

/// `x`, with -0 replaced by 0.
fn unsigned(x: f64) -> f64 {
    x + 0.0
}

/// What has been seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Overload {
    /// Whether the limit acts, the speed at its beginning, and whether that is below its reference.
    acts: bool,
    from: f64,
    below: bool,
    /// Maximum distance from that speed, and the time in s in which it has grown.
    farthest: f64,
    time: f32,
    /// Whether the speed has run away, and the time in s since then, or before that the time since the limit last acted.
    is: bool,
    since: f32,
    /// Number of spans in which the smallest error of the speed has not changed, that error in the present span and in the last one, and
    /// the time in s since the beginning of the present one.
    same: u8,
    nearest: f32,
    last: f32,
    span: f32,
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
            self.since += short(h);
            if self.is || self.since > BREAK {
                *self = Self::default();
            }
        }
    }

    #[inline(never)]
    fn at_limit(&mut self, h: f64, speed_ref: f64, [before, speed]: [f64; 2]) {
        if !self.is {
            self.since = 0.0;
        }
        let (below, error) = (speed_ref > speed, (speed_ref - speed).abs());
        if !self.acts || below != self.below {
            (self.acts, self.from, self.below, self.farthest, self.time) = (true, before, below, 0.0, 0.0);
            (self.nearest, self.last, self.span, self.same) = (short(error), f32::INFINITY, 0.0, 0);
        }
        (self.nearest, self.span) = (self.nearest.min(short(error)), self.span + short(h));
        if self.span >= SPAN {
            let is_same = (self.nearest - self.last).abs() <= short(0.002 * speed_ref.abs() + 0.01);
            self.same = if is_same { self.same.saturating_add(1) } else { 0 };
            (self.nearest, self.last, self.span) = (short(error), self.nearest, 0.0);
        }
        let (away, size) = (if below { self.from - speed } else { speed - self.from }, speed_ref.abs());
        if away > self.farthest {
            (self.farthest, self.time) = (away, self.time + short(h));
        }
        if self.is {
            self.since += short(h);
        }
        self.is |= away > 1.2 * size + 10.0 && size > 10.0 || self.time >= LONG && away > 0.5 * size + 1.0;
    }

    /// Whether the torque `tau` (N.m) is at one of its limits (N.m), and the `error` of the speed (rad/s) asks for more.
    pub fn limited(tau: f64, [low, high]: [f64; 2], error: f64) -> bool {
        error > 0.0 && tau >= 0.99 * high || error < 0.0 && tau <= 0.99 * low
    }

    /// Whether it has just been found that the load exceeds the torque.
    fn runs_away(&self) -> bool {
        self.is && self.since < SAID
    }

    /// Whether it has just been found that the speed stays away from its reference `speed_ref` (rad/s).
    fn stays(&self, speed_ref: f64) -> bool {
        !self.is && self.same == 2 && self.last > short(0.02 * speed_ref.abs() + 0.5)
    }

    /// Reports what has been found, with the speed (rad/s), which may be `estimated`, its reference (rad/s) and the limits of the
    /// torque (N.m).
    pub fn warn(
        &self,
        estimated: bool,
        [speed, speed_ref]: [f64; 2],
        limits: impl FnOnce() -> [f64; 2],
        log: &mut Warnings<'_>,
    ) {
        let name = if estimated { "speed_est" } else { "the speed" };
        if self.runs_away() {
            let [low, high] = limits().map(unsigned);
            log.warn("overload", || {
                let (or, and) = if estimated {
                    (", or the estimate is wrong", ", and check the controller's data of the machine")
                } else {
                    ("", "")
                };
                format!(
                    "the load exceeds the torque of the drive{or}: at tau_min = {low:.4} N.m and tau_max = {high:.4} N.m, {name} runs away \
                     from speed_ref = {speed_ref} rad/s and is {speed:.1} rad/s; lower the load, check that it is in N.m, or raise the \
                     limits of the drive's current and torque{and}"
                )
            });
        } else if self.stays(speed_ref) {
            let [low, high] = limits().map(unsigned);
            log.warn("speed_ref", || {
                format!(
                    "speed_ref = {speed_ref} rad/s is not reached: for more than 1 s, {name} has stayed at {speed:.1} rad/s, with the torque at \
                     its limit, tau_min = {low:.4} N.m or tau_max = {high:.4} N.m, or the voltage at that of the link; check that speed_ref is \
                     in rad/s, lower the load, raise u_dc or the limits of current and torque, or use field weakening"
                )
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a run over these (speed_ref, speed, limited) in steps of 0.1 s is reported as one that runs away or stays.
    fn seen(run: impl IntoIterator<Item = (f64, f64, bool)>) -> (bool, bool) {
        let (mut overload, mut before, mut any, mut stays) = (Overload::default(), None, false, false);
        for (speed_ref, speed, limited) in run {
            overload.update(0.1, limited, speed_ref, [before.unwrap_or(speed), speed]);
            (before, any) = (Some(speed), any || overload.runs_away());
            stays |= overload.stays(speed_ref);
        }
        (any, stays)
    }

    #[test]
    fn a_speed_that_runs_away_or_stays_is_seen_and_a_start_is_not() {
        let steps = |f: fn(f64) -> (f64, f64, bool)| seen((0..40).map(|k| f(f64::from(k))));
        assert!(steps(|k| (50.0, 50.0 - 10.0 * k, true)).0, "turned backward");
        assert!(steps(|k| (-50.0, 10.0 * k - 50.0, true)).0, "the same in reverse");
        assert!(steps(|k| (50.0, 50.0 - 2.0 * k, true)).0, "slowly");
        assert!(steps(|k| (0.0, -0.5 * k, true)).0, "from standstill");
        let none = (false, false);
        assert_eq!(steps(|k| (50.0, (2.0 * k).min(50.0), true)), none, "a start");
        assert_eq!(steps(|k| (50.0, 0.05 * k, true)), none, "a slow start: 1 % in a second");
        assert_eq!(steps(|k| (-50.0, (50.0 - 3.0 * k).max(-50.0), true)), none, "a reversal");
        assert_eq!(steps(|k| (50.0, if k < 5.0 { 50.0 - 8.0 * k } else { 10.0 + k }, true)), none, "a load step");
        assert_eq!(steps(|k| (50.0, 50.0 - 2.0 * k, false)), none, "coasting without a limit");
        let stays = (false, true);
        assert_eq!(steps(|k| (50.0, (4.0 * k).min(45.0), true)), stays, "a reference that is not reached");
        assert_eq!(steps(|k| (-50.0, (-4.0 * k).max(-45.0), true)), stays, "the same in reverse");
        assert_eq!(steps(|k| (50.0, 40.0 - k % 2.0, true)), stays, "with an oscillation");
        assert_eq!(steps(|k| (50.0, (4.0 * k).min(48.7), true)), none, "almost reached");
        assert_eq!(steps(|k| (50.0, 45.0, k % 8.0 > 0.0)), none, "limited for less than a second at a time");
    }
}
