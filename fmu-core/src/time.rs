//! Time since the start: a sum of steps without rounding drift, and a sample grid counted in integers.
//!
//! An importer's communication points are rounded, often accumulated, and after 1e7 steps they are off by more than any
//! sensible tolerance. The instance therefore adds up the step sizes itself, in two doubles (Knuth's two-sum, exact to about
//! 1e-32 relative), and a sampled model compares that sum with `k T_s` for an integer k.

use serde::{Deserialize, Serialize};

/// Instants closer than this fraction of the sample period are the same instant. An importer may compute the step as the
/// difference of two times, which at 1e6 s are rounded to 1.2e-10 s: more than a millionth of a period of 50 us.
pub const SAME_INSTANT: f64 = 1e-5;

/// Time since the start of the simulation in s, as an unevaluated sum of two doubles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Elapsed {
    high: f64,
    low: f64,
}

impl Elapsed {
    /// The start.
    pub const ZERO: Self = Self { high: 0.0, low: 0.0 };

    /// The time from `start` to `time`, both in s.
    pub fn between(start: f64, time: f64) -> Self {
        let (high, low) = two_sum(time, -start);
        Self { high, low }
    }

    /// `k` periods, without rounding.
    pub fn periods(k: u64, period: f64) -> Self {
        let k = count(k);
        let high = k * period;
        Self { high, low: f64::mul_add(k, period, -high) }
    }

    /// This instant and `h` seconds.
    #[inline]
    pub fn plus(self, h: f64) -> Self {
        let (high, error) = two_sum(self.high, h);
        let low = self.low + error;
        // Dekker's sum, as exact as `two_sum` because the first number is the larger one.
        let sum = high + low;
        Self { high: sum, low: low - (sum - high) }
    }

    /// Seconds since the start, rounded to one double.
    pub fn seconds(self) -> f64 {
        self.high + self.low
    }

    /// Seconds from `earlier` to this instant.
    pub fn since(self, earlier: Self) -> f64 {
        (self.high - earlier.high) + (self.low - earlier.low)
    }

    /// This instant minus `k` periods in s, rounded once.
    pub fn minus_periods(self, k: u64, period: f64) -> f64 {
        let k = count(k);
        let product = k * period;
        // |k * period - product| is recovered exactly by a fused multiply-add.
        let error = f64::mul_add(k, period, -product);
        (self.high - product) + (self.low - error)
    }
}

/// `a + b` and its rounding error.
#[inline]
fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let b_in = sum - a;
    let a_in = sum - b_in;
    (sum, (a - a_in) + (b - b_in))
}

/// An integer count as a double, exact below 2^53 (2.8 million years at 100 Hz, 285 000 years at 1 kHz).
#[inline]
#[expect(clippy::cast_precision_loss, reason = "a count of samples stays below 2^53")]
fn count(k: u64) -> f64 {
    k as f64
}

/// The interval of one communication step: its start and its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Time since the start of the simulation at the beginning of the step.
    pub start: Elapsed,
    /// Step size in s, finite and positive.
    pub h: f64,
}

impl Step {
    /// Time since the start of the simulation at the end of the step.
    #[inline]
    pub fn end(&self) -> Elapsed {
        self.start.plus(self.h)
    }
}

/// The instants `k T_s` since the start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleGrid {
    /// Sample period in s, positive.
    pub period: f64,
}

impl SampleGrid {
    /// Instants closer than this many seconds are the same instant.
    #[inline]
    pub fn width(&self) -> f64 {
        SAME_INSTANT * self.period
    }

    /// Instant `k` of a simulation that began at `start` (s), rounded once.
    pub fn instant(&self, k: u64, start: f64) -> f64 {
        f64::mul_add(count(k), self.period, start)
    }

    /// Whether instant `k` is at `now` or before it.
    #[inline]
    pub fn reached(&self, k: u64, now: Elapsed) -> bool {
        self.past(k, now) >= -self.width()
    }

    /// Whether instant `k` is before `now` and not the same instant.
    #[inline]
    pub fn passed(&self, k: u64, now: Elapsed) -> bool {
        self.past(k, now) > self.width()
    }

    /// Seconds from instant `k` to `now`: exact enough to be on the right side of +-[`width`](Self::width), otherwise rounded
    /// like `now`. One subtraction, unless its result is too close to decide.
    #[inline]
    pub(crate) fn past(self, k: u64, now: Elapsed) -> f64 {
        let product = count(k) * self.period;
        let past = now.high - product;
        // Twice the maximum contribution of the low part of `now` and of the rounding of the product.
        let doubt = 2.0 * (now.low.abs() + f64::EPSILON * product);
        if (past.abs() - self.width()).abs() > doubt { past } else { self.past_exactly(k, now) }
    }

    #[cold]
    fn past_exactly(self, k: u64, now: Elapsed) -> f64 {
        now.minus_periods(k, self.period)
    }

    /// The first instant after `now` that is not the same instant; `now` is not before the start.
    pub fn first_after(&self, now: Elapsed) -> u64 {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates; a time is not negative"
        )]
        let mut k = (now.seconds() / self.period) as u64;
        // The quotient is correct to within one or two instants, unless doubles can no longer distinguish instants.
        for _ in 0..3 {
            if self.reached(k, now) {
                k = k.saturating_add(1);
            }
        }
        k
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::Draw;

    #[test]
    fn ten_million_steps_do_not_drift() {
        let h = 1e-4 / 3.0;
        let mut now = Elapsed::ZERO;
        for _ in 0..10_000_000 {
            now = now.plus(h);
        }
        // 1e7 steps of the double h, exactly: the product rounded once.
        assert!((now.seconds() - 1e7 * h).abs() < 1e-13, "{}", now.seconds());
        assert!(SampleGrid { period: 3.0 * h }.reached(3_333_333, now));
        assert!(!SampleGrid { period: 3.0 * h }.reached(3_333_334, now));
    }

    #[test]
    fn the_next_instant_is_found_from_anywhere() {
        let grid = SampleGrid { period: 1e-4 };
        for (t, k) in [(0.0, 1), (1e-4, 2), (1e-4 - 5e-10, 2), (1e-4 - 5e-9, 1), (2.5e-4, 3), (0.9999, 10_000)] {
            assert_eq!(grid.first_after(Elapsed::ZERO.plus(t)), k, "after {t} s");
        }
        assert!(grid.first_after(Elapsed::ZERO.plus(1e300)) > 0, "an absurd time also ends");
        let (early, late) = (Elapsed::ZERO.plus(1e6), Elapsed::ZERO.plus(1e6).plus(1e-9));
        assert!((late.since(early) - 1e-9).abs() < 1e-24, "a nanosecond after 1e6 s");
    }

    /// The fast subtraction gives the same decision as the exact one, at every distance from +-`width` and for any low part of
    /// the time.
    #[test]
    fn the_quick_comparison_decides_as_the_exact_one() {
        let (mut draw, mut exactly) = (Draw(1), 0);
        let mut random = move || draw.bits() >> 11;
        for _ in 0..200_000 {
            let period = count(random() % 1_000_000 + 1) * 1e-9;
            let (grid, k) = (SampleGrid { period }, random() >> (random() % 53));
            let side = [-grid.width(), 0.0, grid.width(), period][usize::try_from(random() % 4).unwrap()];
            let at = Elapsed::periods(k, period).plus(side);
            let near = Elapsed {
                low: at.low + at.high * f64::EPSILON * 0.25 * count(random() % 9) - at.high * f64::EPSILON,
                ..at
            };
            for now in [at, near, at.plus(side * f64::EPSILON), at.plus(-at.high * f64::EPSILON), at.plus(at.low)] {
                let exact = now.minus_periods(k, period);
                let (reached, passed) = (exact >= -grid.width(), exact > grid.width());
                let case = format!("{k} {period} {now:?}: {exact}");
                assert_eq!((grid.reached(k, now), grid.passed(k, now)), (reached, passed), "{case}");
                exactly += u32::from(grid.past(k, now).to_bits() == exact.to_bits());
            }
        }
        assert!(exactly > 100_000, "the test comes close: {exactly}");
    }

    #[test]
    fn an_instant_is_its_periods_after_the_start() {
        let grid = SampleGrid { period: 0.1 };
        assert_eq!(grid.instant(0, 2.5).to_bits(), 2.5_f64.to_bits());
        assert_eq!(grid.instant(3, 0.0).to_bits(), (3.0_f64 * 0.1).to_bits());
        // 0.1 as a double is above 0.1 by 5.55e-18, which a product rounded on its own would lose.
        assert!((grid.instant(10, -1.0) - 5.55e-17).abs() < 1e-19, "{}", grid.instant(10, -1.0));
    }

    /// Both of two times count with all their digits.
    #[test]
    fn the_time_between_two_is_exact() {
        let (start, time) = (1e6, 1e-9);
        assert_eq!(Elapsed::between(start, start), Elapsed::ZERO);
        assert!((Elapsed::between(-start, time).since(Elapsed::ZERO.plus(start)) - time).abs() < 1e-24);
        assert!((Elapsed::between(start, time).seconds() + start - time).abs() < 1e-9);
    }

    #[test]
    fn periods_are_a_sum_of_periods() {
        let sum = (0..3).fold(Elapsed::ZERO, |now, _| now.plus(0.1));
        assert!(Elapsed::periods(3, 0.1).since(sum).abs() < 1e-30);
        assert!((sum.plus(1e-20).minus_periods(3, 0.1) - 1e-20).abs() < 1e-30);
        let end = Step { start: sum, h: 0.1 }.end();
        assert!(end.since(Elapsed::periods(4, 0.1)).abs() < 1e-30);
    }

    /// Below 1, doubles are half as far apart as above.
    #[test]
    fn seconds_are_the_nearest_double() {
        let now = Elapsed::ZERO.plus(1.0).plus(f64::EPSILON / 2.0);
        assert_eq!(now.seconds().to_bits(), 1.0_f64.to_bits());
    }

    #[test]
    fn naive_sum_would_lose_the_grid() {
        let mut t = 0.0;
        for _ in 0..10_000_000 {
            t += 1e-4;
        }
        let drift = t - 1000.0_f64;
        assert!(drift.abs() > SAME_INSTANT * 1e-4, "the test shows why the sum is kept in two doubles: {drift}");
    }
}
