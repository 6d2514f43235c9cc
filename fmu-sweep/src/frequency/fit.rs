//! The sine in samples of whole periods.
//!
//! The window has whole periods on the grid of the samples, so that no constant part and no harmonic leaks into the sine:
//! `2/N sum y_k sin(a k)` and `2/N sum y_k cos(a k)`, with the angle `a` of a step and k = 0 .. N - 1. A signal that drifts, such as
//! the angle of a turning shaft, is not periodic: its slope `s` for each sample follows from the means of two successive windows, which
//! the periodic part does not change, and its share in the sums is
//!
//! ```text
//! sum k e^(j a k) = N / (e^(j a) - 1) = -N/2 - j N/2 cot(a/2)
//! ```
//!
//! The removal of the slope is derived here; the sine fit at a known frequency follows IEEE Std 1057.

use num_complex::Complex64;
use std::f64::consts::TAU;

/// Whole periods of a sine on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Periods {
    /// Number of periods.
    pub(super) periods: u32,
    /// Number of samples.
    pub(super) samples: u32,
}

impl Periods {
    /// Sine and cosine at sample `k`; their angle is exact for any number of samples.
    pub(super) fn wave(self, k: u32) -> (f64, f64) {
        let turns = u64::from(k) * u64::from(self.periods) % u64::from(self.samples);
        #[expect(clippy::cast_precision_loss, reason = "below 2^32")]
        let turns = turns as f64;
        (TAU * turns / f64::from(self.samples)).sin_cos()
    }
}

/// Sums over the samples of a signal in a window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SineFit {
    /// The first sample: a large constant part would cost digits of the sums.
    first: Option<f64>,
    sum: f64,
    with_sin: f64,
    with_cos: f64,
    largest: f64,
}

impl SineFit {
    /// Adds a sample at this `wave`.
    pub(super) fn add(&mut self, wave: (f64, f64), y: f64) {
        self.largest = self.largest.max(y.abs());
        let y = y - *self.first.get_or_insert(y);
        self.sum += y;
        self.with_sin += wave.0 * y;
        self.with_cos += wave.1 * y;
    }

    /// The largest magnitude of a sample.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    fn mean(&self, window: Periods) -> f64 {
        self.first.unwrap_or_default() + self.sum / f64::from(window.samples)
    }

    /// The sine after the window `before`: `b e^(j phi)` for `b sin(w t + phi)`.
    pub(super) fn phasor(&self, before: &Self, window: Periods) -> Complex64 {
        let n = f64::from(window.samples);
        let slope = (self.mean(window) - before.mean(window)) / n;
        let half = 0.5 * TAU * f64::from(window.periods) / n;
        let (k_sin, k_cos) = (-0.5 * n * half.cos() / half.sin(), -0.5 * n);
        let of = |sum: f64, with_k: f64| 2.0 / n * (sum - slope * with_k);
        Complex64::new(of(self.with_sin, k_sin), of(self.with_cos, k_cos))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_comes_back_from_a_constant_a_drift_and_harmonics() {
        let expected = Complex64::from_polar(2e-3, -1.1);
        for (periods, samples) in [(1, 40), (1, 10_000), (3, 127), (7, 20), (50, 4001)] {
            let window = Periods { periods, samples };
            let step = TAU * f64::from(periods) / f64::from(samples);
            let mut fits = [SineFit::default(); 2];
            for k in 0..2 * samples {
                let a = step * f64::from(k);
                let drift = 1e3 + 0.07 * f64::from(k);
                // The second harmonic: with 7 periods in 20 samples, its alias differs from the sine.
                let y = drift + 2e-3 * (a - 1.1).sin() + 0.4 * (2.0 * a + 0.3).cos();
                fits[usize::from(k >= samples)].add(window.wave(k), y);
            }
            let found = fits[1].phasor(&fits[0], window);
            assert!((found - expected).norm() < 1e-9, "{periods} in {samples}: {found}, not {expected}");
        }
    }
}
