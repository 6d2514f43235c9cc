//! Signs of a lost rotor in the plant's quantities, at any reference: in the last 2 s of a run, cut into quarters of
//! 0.5 s,
//!
//! - the rotor turns against the estimated frame by a turn or more,
//! - or over two quarters, the mean of `speed_est` deviates from the rotor's speed by more than 5 % of the rated speed,
//! - or in two quarters, the speeds of rotor and estimate both swing by more than 10 % of the rated speed from peak to peak. An
//!   accelerating drive does not count as swinging: from quarter to quarter, its mean moves by as much as its peaks differ.
//!
//! A drive that misses its reference because of its limits is not lost: the outputs `current_limited` and `voltage_limited` say
//! so.

use std::f64::consts::TAU;

/// Duration of a quarter in s.
const QUARTER: f64 = 0.5;
/// Mean distance of the speeds, and swing from peak to peak, in pu.
const MEAN: f64 = 0.05;
const SWING: f64 = 0.1;

/// Sum, minimum and maximum.
#[derive(Clone, Copy, Debug)]
struct Signal {
    sum: f64,
    low: f64,
    high: f64,
}

impl Signal {
    const NONE: Self = Self { sum: 0.0, low: f64::INFINITY, high: f64::NEG_INFINITY };

    fn see(&mut self, x: f64) {
        *self = Self { sum: self.sum + x, low: self.low.min(x), high: self.high.max(x) };
    }
}

/// Observations in a quarter.
#[derive(Clone, Copy, Debug)]
struct Quarter {
    n: f64,
    speed: Signal,
    estimate: Signal,
    lock_lost: f64,
}

/// The last 2 s of a run.
#[derive(Clone, Debug)]
pub struct Outside {
    quarters: [Quarter; 4],
    slip: f64,
    limited: f64,
    angle: f64,
    n: f64,
}

impl Default for Outside {
    fn default() -> Self {
        let none = Quarter { n: 0.0, speed: Signal::NONE, estimate: Signal::NONE, lock_lost: 0.0 };
        Self { quarters: [none; 4], slip: 0.0, limited: 0.0, angle: 0.0, n: 0.0 }
    }
}

impl Outside {
    /// A sample at the time `t` (s) since the beginning of the last 2 s: speeds of rotor and estimate in pu, the rotor's angle
    /// ahead of the estimate in rad and its change, `lock_lost`, and whether a limit acts.
    pub fn see(
        &mut self,
        t: f64,
        (speed, estimate): (f64, f64),
        (angle, turned): (f64, f64),
        lock_lost: f64,
        limited: bool,
    ) {
        let index = (1..4).filter(|&k| t >= QUARTER * f64::from(k)).count();
        let quarter = &mut self.quarters[index];
        quarter.n += 1.0;
        quarter.speed.see(speed);
        quarter.estimate.see(estimate);
        quarter.lock_lost = quarter.lock_lost.max(lock_lost);
        self.slip += turned;
        self.angle = self.angle.max(angle.abs());
        self.limited += if limited { 1.0 } else { 0.0 };
        self.n += 1.0;
    }

    /// Whether the rotor turns against the frame, by the angle or by the mean of the speeds.
    pub fn slips(&self) -> bool {
        let apart = |a: &Quarter, b: &Quarter| {
            let sum = |q: &Quarter| q.estimate.sum - q.speed.sum;
            ((sum(a) + sum(b)) / (a.n + b.n)).abs() > MEAN
        };
        self.slip.abs() >= TAU || self.quarters.windows(2).any(|pair| apart(&pair[0], &pair[1]))
    }

    /// Whether rotor and estimate swing.
    pub fn swings(&self) -> bool {
        let by = |a: &Quarter, b: &Quarter, of: fn(&Quarter) -> Signal| {
            let mean = |q: &Quarter| of(q).sum / q.n;
            let [first, second] = [a, b].map(|q| of(q).high - of(q).low);
            first.min(second) > SWING.max(2.0 * (mean(a) - mean(b)).abs())
        };
        let both = |pair: &[Quarter]| by(&pair[0], &pair[1], |q| q.speed) && by(&pair[0], &pair[1], |q| q.estimate);
        self.quarters.windows(2).any(both)
    }

    /// Maximum `lock_lost`: a loss is visible in every second.
    pub fn lock_lost(&self) -> f64 {
        let second = |pair: &[Quarter]| pair[0].lock_lost.max(pair[1].lock_lost);
        self.quarters.windows(2).map(second).fold(f64::INFINITY, f64::min)
    }

    /// Whether the angle is right within 30 deg, a limit acts for most of the time, and the speed is above a
    /// tenth of the rated one: near standstill, an overload looks like a lost rotor.
    pub fn limited(&self) -> bool {
        let speed: f64 = self.quarters.iter().map(|q| q.speed.sum).sum();
        let share = |x: f64| (x / self.n).abs();
        self.angle.to_degrees() < 30.0 && share(self.limited) > 0.5 && share(speed) > 0.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(of: impl Fn(f64) -> ((f64, f64), f64)) -> Outside {
        let (mut outside, mut last) = (Outside::default(), of(0.0).1);
        for k in 0..20_000 {
            let t = 1e-4 * f64::from(k);
            let (speeds, angle) = of(t);
            outside.see(t, speeds, (angle, angle - last), 0.0, false);
            last = angle;
        }
        outside
    }

    #[test]
    fn a_slip_a_mean_and_a_swing_are_lost() {
        let held = seen(|t| ((0.3 + 0.04 * (20.0 * t).sin(), 0.33), 0.4 * (20.0 * t).sin()));
        assert!(!held.slips() && !held.swings());
        assert!(seen(|t| ((0.3, 0.3), 3.2 * t)).slips());
        assert!(seen(|_| ((0.3, 0.36), 0.0)).slips());
        let swing = |a: f64, b: f64| seen(|t| ((a * (20.0 * t).sin(), b * (20.0 * t).cos()), 0.0));
        assert!(swing(0.06, 0.06).swings() && !swing(0.04, 0.06).swings() && !swing(0.06, 0.04).swings());
        assert!(!seen(|t| ((t, t), 0.0)).swings(), "it accelerates");
    }
}
