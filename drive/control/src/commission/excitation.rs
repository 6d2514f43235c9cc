//! Excitation of an axis at standstill: a triangle of current with falling peaks, and the record of voltage and current.
//!
//! The current follows r of constant slope through (-0.707, 1, -1, 1, -0.9, 0.8, -0.7, 0.6, -0.5, 0.4, -0.3, 0) A. The first
//! half-wave has half of the area of the others, so the torque causes no mean speed of the rotor.
//!
//! ```text
//! u = L^/T (r[k+1] - r[k] + 0.3 (r[k-1] - i[k-1])) + R r_mean + loss(r_mean)      0 V across the axis
//! n = 2 A L^ / (T (0.72 U - (4/3) u_dead - 0.7 R A))                              samples of a half-wave, 4, 6 or 8 at least
//! ```
//!
//! The rotor that moves adds psi_M delta to the flux linkage, relatively psi_M w_0^2 (n T/pi)^2 / (0.4 I L): n and A are
//! reduced together until that is small.

use super::align::VOLTAGE;
use super::bench::{Bench, Sample};
use super::curve::Between;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated};
use drive_base::math::within;
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};

/// Rows of a record.
pub(super) const ROWS: usize = 512;

/// Peaks of the current as shares of the amplitude.
const PEAKS: [f64; 12] = [-0.707, 1.0, -1.0, 1.0, -0.9, 0.8, -0.7, 0.6, -0.5, 0.4, -0.3, 0.0];

/// Length of the way through the peaks, in amplitudes.
const WAY: f64 = 15.814;

/// At most `N` rows of `C` numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rows<const C: usize, const N: usize> {
    rows: SMatrix<f64, C, N>,
    #[serde(with = "crate::commission::fixed_size")]
    length: u64,
}

/// The record of an excitation.
pub(super) type Record = Rows<4, ROWS>;

impl<const C: usize, const N: usize> Default for Rows<C, N> {
    fn default() -> Self {
        Self { rows: SMatrix::zeros(), length: 0 }
    }
}

impl<const C: usize, const N: usize> Rows<C, N> {
    pub(super) fn len(&self) -> usize {
        usize::try_from(self.length).unwrap_or(N).min(N)
    }

    pub(super) fn row(&self, n: usize) -> [f64; C] {
        std::array::from_fn(|k| self.rows[(k, n)])
    }

    /// Adds a row; rows beyond `N` are discarded.
    pub(super) fn push(&mut self, row: [f64; C]) {
        let n = self.len();
        if n < N {
            self.set(n, row);
            self.length += 1;
        }
    }

    fn set(&mut self, n: usize, row: [f64; C]) {
        for (k, x) in row.into_iter().enumerate() {
            self.rows[(k, n)] = x;
        }
    }

    /// Combines two rows into one by `pair`.
    pub(super) fn halve(&mut self, pair: impl Fn([f64; C], [f64; C]) -> [f64; C]) {
        let half = self.len() / 2;
        for n in 0..half {
            self.set(n, pair(self.row(2 * n), self.row(2 * n + 1)));
        }
        self.length = u64::try_from(half).unwrap_or(0);
    }

    pub(super) fn clear(&mut self) {
        self.length = 0;
    }
}

/// Settings of an excitation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Plan {
    /// Amplitude in A, and samples of a half-wave.
    pub(super) A: f64,
    pub(super) n: f64,
    /// Inductance in H of the feed-forward.
    pub(super) L: f64,
    /// Samples of a row.
    pub(super) block: f64,
}

impl Plan {
    /// For the amplitude `A` (A) along an axis of inductance `L` (H); the moving rotor adds at most the share `motion`, and the
    /// square of time times rate of a turn by reluctance is at most `grown` where that exceeds the magnet's.
    pub(super) fn new(bench: &Bench, A: f64, L: f64, motion: f64, grown: f64) -> Self {
        let legs = (4.0 / 3.0) * bench.u_dead;
        let mut A = A.min(0.45 * bench.U / bench.R);
        let volts = (0.72 * bench.U - legs - 0.7 * bench.R * A).max(0.1 * bench.U);
        let over = |n: f64| 2.0 * A * L / (n * bench.T);
        let fewest = if over(8.0) > 1.7 * legs {
            8.0
        } else if over(6.0) > 1.7 * legs {
            6.0
        } else {
            4.0
        };
        let mut n = over(volts).ceil().max(fewest);
        if !bench.blocked {
            let turn = bench.w_0 * bench.T / std::f64::consts::PI;
            let mut most = (motion * bench.aligned() * L / bench.psi_0).sqrt() / turn;
            if bench.i_0 > 0.0 {
                let growth = bench.reluctance() * A * A * (0.5 * WAY * n * bench.T).powi(2);
                most = most.min(n * (grown / growth).sqrt().sqrt());
            }
            if n > most {
                let fewer = most.floor().max(4.0).min(n);
                (A, n) = (A * fewer / n, fewer);
            }
        }
        let whole = 0.5 * WAY * n + 2.0;
        Self { A, n, L, block: (whole / f64::from(500_u16)).ceil() }
    }
}

/// An excitation on its way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Excitation {
    pub(super) plan: Plan,
    pub(super) axis: Axis<Estimated>,
    /// Samples since the start.
    k: f64,
    /// Sum of the voltages of this row in V, and their number.
    u: AlphaBeta,
    samples: f64,
    /// Current at the start in A.
    pub(super) i_start: AlphaBeta,
}

impl Excitation {
    pub(super) fn new(plan: Plan, phi: f64) -> Self {
        Self { plan, axis: Axis::at(phi), ..Self::default() }
    }

    /// Reference in A at the sample `k`.
    fn reference(&self, k: f64) -> f64 {
        let mut way = 2.0 * k.max(0.0) / self.plan.n;
        let mut from = 0.0;
        for to in PEAKS {
            let length = (to - from).abs();
            if way < length {
                return self.plan.A * (from + if to > from { way } else { -way });
            }
            way -= length;
            from = to;
        }
        0.0
    }

    /// Takes a sample; the command in V, or `None`: the excitation is over.
    pub(super) fn update(&mut self, bench: &Bench, sample: &Sample, record: &mut Record) -> Option<AlphaBeta> {
        let Plan { A: _, n, L, block } = self.plan;
        if self.k == 0.0 {
            record.clear();
            self.i_start = self.axis_of(sample.i);
        } else {
            self.u += sample.u;
            self.samples += 1.0;
            if self.samples >= block {
                let u = self.axis.from_stator(self.u * (1.0 / self.samples));
                let i = self.axis.from_stator(sample.i);
                record.push([u.d(), u.q(), i.d(), i.q()]);
                (self.u, self.samples) = (AlphaBeta::ZERO, 0.0);
            }
        }
        let k = self.k;
        self.k += 1.0;
        let acts = k + bench.delay;
        // The row that holds the last command is complete.
        if acts > 0.5 * WAY * n + 1.0 + 2.0 * bench.delay && self.samples == 0.0 {
            return None;
        }
        let (r, next, then) = (self.reference(k), self.reference(acts), self.reference(acts + 1.0));
        let i = self.axis.from_stator(sample.i).d();
        let mean = 0.5 * (next + then);
        let loss = bench.curve.loss_along(self.axis.along(1.0), self.axis.along(mean)).0;
        let u = L / bench.T * (then - next + 0.3 * (r - i)) + bench.R * mean + loss;
        Some(self.axis.along(within(u, VOLTAGE * bench.U)))
    }

    /// A stator vector in the axis frame, its parts as alpha and beta.
    fn axis_of(&self, v: AlphaBeta) -> AlphaBeta {
        let v = self.axis.from_stator(v);
        AlphaBeta::new(v.d(), v.q())
    }

    /// Duration of a row in s.
    pub(super) fn row_time(&self, bench: &Bench) -> f64 {
        self.plan.block * bench.T
    }

    /// The stator vector of parts `d` and `q` in the axis frame.
    pub(super) fn stator(&self, d: f64, q: f64) -> AlphaBeta {
        self.axis.to_stator(DqHat::new(d, q))
    }

    /// Calls `each` for each row with the flux linkage (Wb) along and across since the start and the currents (A); `L` in H.
    pub(super) fn flux(&self, bench: &Bench, record: &Record, L: f64, mut each: impl FnMut([f64; 4])) {
        let T = self.row_time(bench);
        let between = Between::new(bench.R * T / L);
        let (mut psi, mut last) = (AlphaBeta::ZERO, self.stator(self.i_start.alpha(), self.i_start.beta()));
        for n in 0..record.len() {
            let [u_d, u_q, i_d, i_q] = record.row(n);
            let i = self.stator(i_d, i_q);
            psi += (self.stator(u_d, u_q) - between.lost(bench.R, &bench.curve, last, i)) * T;
            let along = self.axis.from_stator(psi);
            each([along.d(), along.q(), i_d, i_q]);
            last = i;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The double integral of the first half-waves causes no mean speed of the rotor.
    #[test]
    fn the_triangle_passes_its_peaks_and_ends_at_zero() {
        let plan = Plan { A: 2.0, n: 10.0, L: 1.0, block: 1.0 };
        let excitation = Excitation::new(plan, 0.0);
        let way = PEAKS.iter().fold([0.0_f64, 0.0], |[sum, from], &to| [sum + (to - from).abs(), to])[0];
        assert!((way - WAY).abs() < 1e-12, "{way}");
        let r: Vec<f64> = (0..90).map(|k| excitation.reference(f64::from(k))).collect();
        let (least, most) = r.iter().fold((0.0_f64, 0.0_f64), |(a, b), &x| (a.min(x), b.max(x)));
        assert!((1.8..=2.0).contains(&most) && (-2.0..=-1.8).contains(&least));
        assert!(r[80..].iter().all(|x| x.abs() < 1e-12) && r.windows(2).all(|p| (p[1] - p[0]).abs() < 0.4 + 1e-12));
    }
}
