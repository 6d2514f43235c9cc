//! Offsets of the current sensors and their noise, with the gates off: mean and standard deviation of each phase.

use drive_base::frame::Phases;
use serde::{Deserialize, Serialize};

/// Minimum time in s and minimum number of samples.
const SHORTEST: (f64, f64) = (0.1, 1000.0);

/// Sums over the samples with the gates off.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Offsets {
    samples: f64,
    /// The first sample in A: sums of differences from it lose no digits.
    first: Phases,
    sum: Phases,
    squares: f64,
}

impl Offsets {
    /// Takes a sample `i` (A); at the end, the offsets in A and the standard deviation of a component of the current in A.
    pub(super) fn update(&mut self, i: Phases, T_s: f64) -> Option<(Phases, f64)> {
        if self.samples == 0.0 {
            self.first = i;
        }
        let Phases { a, b, c } = i;
        let d = [a - self.first.a, b - self.first.b, c - self.first.c];
        (self.sum.a, self.sum.b, self.sum.c) = (self.sum.a + d[0], self.sum.b + d[1], self.sum.c + d[2]);
        self.squares += d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        self.samples += 1.0;
        let (time, fewest) = SHORTEST;
        if self.samples < fewest || self.samples * T_s < time {
            return None;
        }
        let each = 1.0 / self.samples;
        let mean = [self.sum.a * each, self.sum.b * each, self.sum.c * each];
        let variance = self.squares * each - mean.iter().map(|m| m * m).sum::<f64>();
        let offset = Phases { a: self.first.a + mean[0], b: self.first.b + mean[1], c: self.first.c + mean[2] };
        // A third of the sum is the variance of a phase; a component of the vector has 2/3 of that.
        Some((offset, (variance.max(0.0) * (2.0 / 9.0)).sqrt()))
    }
}
