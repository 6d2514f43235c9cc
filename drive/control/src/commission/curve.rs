//! Voltage that a leg of the inverter loses, as a table over the current.
//!
//! Sixteen points in each octave from `i_0` to 256 `i_0` (A), read by linear interpolation; below, the leg is a resistance,
//! above, the loss is constant. Half of a current is sixteen points below it; [`resistance`](super::resistance) uses this.

use drive_base::frame::{AlphaBeta, Phases};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Points in an octave.
pub(super) const OCTAVE: usize = 16;

/// Points of the table: eight octaves.
pub(super) const POINTS: usize = 8 * OCTAVE + 1;

/// l(i) of a leg.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Curve {
    /// Current of the first point in A.
    i_0: f64,
    /// Voltage at the points in V.
    l: SVector<f64, POINTS>,
}

impl Default for Curve {
    fn default() -> Self {
        Self { i_0: 1.0, l: SVector::zeros() }
    }
}

impl Curve {
    /// No loss, for currents about `i` (A).
    pub(super) fn new(i: f64) -> Self {
        Self { i_0: i / 256.0, ..Self::default() }
    }

    /// Current in A of the point `n`.
    #[inline]
    pub(super) fn current(&self, n: usize) -> f64 {
        // Sixteen steps are the first four digits after the point.
        let n = u64::try_from(n).unwrap_or(0);
        self.i_0 * f64::from_bits((n + (1023 << 4)) << 48)
    }

    /// Sets the loss at the point `n` to `l` (V).
    pub(super) fn set(&mut self, n: usize, l: f64) {
        self.l[n] = l;
    }

    /// Loss at the point `n` in V.
    pub(super) fn at(&self, n: usize) -> f64 {
        self.l[n]
    }

    /// Loss in V of a leg at the current `i` (A), and its slope in Ohm.
    #[inline]
    pub(super) fn leg(&self, i: f64) -> (f64, f64) {
        let y = i.abs() / self.i_0;
        if y < 1.0 {
            let slope = self.l[0] / self.i_0;
            return (slope * i, slope);
        }
        if y >= 256.0 {
            let l = self.l[POINTS - 1];
            return (if i < 0.0 { -l } else { l }, 0.0);
        }
        // The exponent is the octave, the first four digits after the point are the step in it.
        let n = usize::try_from((y.to_bits() >> 48) - (1023 << 4)).unwrap_or(0).min(POINTS - 2);
        let (from, to) = (self.current(n), self.current(n + 1));
        let slope = (self.l[n + 1] - self.l[n]) / (to - from);
        let l = self.l[n] + slope * (i.abs() - from);
        (if i < 0.0 { -l } else { l }, slope)
    }

    /// Voltage in V lost in the legs at the currents `i` (A).
    #[inline]
    pub(super) fn loss(&self, i: AlphaBeta) -> AlphaBeta {
        self.loss_and_slope(i).0
    }

    /// The same, and the mean slope of the legs in Ohm.
    #[inline]
    pub(super) fn loss_and_slope(&self, i: AlphaBeta) -> (AlphaBeta, f64) {
        let Phases { a, b, c } = Phases::from_stator(i);
        let (a, b, c) = (self.leg(a), self.leg(b), self.leg(c));
        (Phases { a: a.0, b: b.0, c: c.0 }.to_stator(), (a.1 + b.1 + c.1) * (1.0 / 3.0))
    }

    /// Loss in V along the unit vector `along` at the currents `i` (A), and its slope in Ohm against the current along it.
    #[inline]
    pub(super) fn loss_along(&self, along: AlphaBeta, i: AlphaBeta) -> (f64, f64) {
        let (share, i) = (Phases::from_stator(along), Phases::from_stator(i));
        let (a, b, c) = (self.leg(i.a), self.leg(i.b), self.leg(i.c));
        (
            (2.0 / 3.0) * (share.a * a.0 + share.b * b.0 + share.c * c.0),
            (2.0 / 3.0) * (share.a * share.a * a.1 + share.b * share.b * b.1 + share.c * share.c * c.1),
        )
    }

    /// Maximum slope in Ohm.
    pub(super) fn steepest(&self) -> f64 {
        self.l[0] / self.i_0
    }
}

/// The current within a period, from `from` to `to`: exponential with R T / L = `x`. Mean current, and weights of eight
/// midpoints between the two.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Between {
    mean: f64,
    at: [f64; 8],
}

impl Between {
    pub(super) fn new(x: f64) -> Self {
        use drive_base::math::exp;
        let mid: [f64; 8] = [0.0625, 0.1875, 0.3125, 0.4375, 0.5625, 0.6875, 0.8125, 0.9375];
        if x < 0.02 {
            return Self { mean: 0.5 + x / 12.0, at: mid };
        }
        let whole = 1.0 - exp(-x);
        Self { mean: 1.0 / whole - 1.0 / x, at: mid.map(|s| (1.0 - exp(-x * s)) / whole) }
    }

    /// Mean voltage drop in V of the resistance `R` (Ohm) and the legs between the currents `from` and `to` (A).
    pub(super) fn lost(&self, R: f64, curve: &Curve, from: AlphaBeta, to: AlphaBeta) -> AlphaBeta {
        let step = to - from;
        let legs = self.at.iter().fold(AlphaBeta::ZERO, |sum, &s| sum + curve.loss(from + step * s));
        (from + step * self.mean) * R + legs * 0.125
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_gives_its_points_and_lines_between_them() {
        let mut curve = Curve::new(10.0);
        for n in 0..POINTS {
            curve.set(n, curve.current(n).sqrt());
        }
        for n in 0..POINTS - 1 {
            let (i, next) = (curve.current(n), curve.current(n + 1));
            assert!((curve.leg(i).0 - i.sqrt()).abs() < 1e-12 && (curve.leg(-i).0 + i.sqrt()).abs() < 1e-12);
            let half = 0.5 * (i + next);
            assert!((curve.leg(half).0 - 0.5 * (i.sqrt() + next.sqrt())).abs() < 1e-12, "point {n}");
        }
        assert!((curve.leg(40.0).0 - 10.0_f64.sqrt()).abs() < 1e-12 && curve.leg(0.0).0.abs() < 1e-15);
    }

    /// Over an exponential from 0 to 1, the mean equals the integral.
    #[test]
    fn the_mean_current_is_that_of_the_exponential() {
        for x in [0.019_f64, 0.021, 0.5, 1.3] {
            let exact = 1.0 / (1.0 - (-x).exp()) - 1.0 / x;
            assert!((Between::new(x).mean - exact).abs() < 1e-7, "{x}");
        }
    }
}
