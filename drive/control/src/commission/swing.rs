//! The swing of a free rotor when the direct current turns from 120 degrees to 0: start values of psi_M and of its frequency.
//!
//! ```text
//! p       = sum T (u - R i - loss), less its slope over the last 0.1 s
//! psi_0   = Re((p_end - L_c (i_end - i_start)) (1 - e^(j 120 deg))*) / 3
//! w_0     = 1.48 / t_50 ~ sqrt(n_p K 0.4 I / J)          t_50: half of the way
//! ```
//!
//! A blocked rotor's p is a linear function of the current at every instant, with any saliency; a free rotor turns after
//! the current has turned. The residual of a least-squares fit of p to current and time over the whole record separates the two.

use super::bench::{Bench, Sample};
use super::curve::Between;
use super::excitation::{ROWS, Record};
use super::least_squares::Normal;
use drive_base::frame::{AlphaBeta, SQRT_3};
use serde::{Deserialize, Serialize};

/// Residual over psi_r below which the current explains the flux linkage: between 0.013, the maximum of 100 blocked machines, and
/// 0.19, the minimum of 299 free ones.
const BLOCKED: f64 = 0.05;
/// Time in s at the end over which the slope is fitted.
const LAST: f64 = 0.1;

/// The flux linkage on its way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Swing {
    p: AlphaBeta,
    i_start: AlphaBeta,
    /// Samples, and the sample of the next record.
    k: f64,
    next: f64,
    between: Between,
    /// The last two marks: time in s and flux linkage.
    marks: [[f64; 3]; 2],
}

impl Swing {
    /// The current has just been turned.
    pub(super) fn start(bench: &Bench, sample: &Sample) -> Self {
        let between = Between::new(bench.R * bench.T / bench.L_c);
        let marks = [[0.0; 3]; 2];
        Self { i_start: sample.i, between, marks, next: 1.0, ..Self::default() }
    }

    /// Takes a sample, and records in steps of time that grow by 2.5 %.
    pub(super) fn update(&mut self, bench: &Bench, sample: &Sample, record: &mut Record) {
        let lost = self.between.lost(bench.R, &bench.curve, sample.i_last, sample.i);
        self.p += (sample.u - lost) * bench.T;
        self.k += 1.0;
        let t = self.k * bench.T;
        if t - self.marks[1][0] >= LAST {
            self.marks = [self.marks[1], [t, self.p.alpha(), self.p.beta()]];
        }
        if self.k >= self.next && record.len() < ROWS {
            record.push([self.p.alpha(), self.p.beta(), sample.i.alpha(), sample.i.beta()]);
            self.next = after(self.k);
        }
    }

    /// At rest again: psi_0, w_0 and whether the rotor is blocked; returns whether that flux linkage is one of a magnet.
    /// The magnet lies along the greater inductance if it is `inverse`.
    pub(super) fn finish(&self, bench: &mut Bench, sample: &Sample, record: &Record, inverse: bool) -> bool {
        let t = self.k * bench.T;
        let [from, alpha, beta] = self.marks[0];
        let slope = (self.p - AlphaBeta::new(alpha, beta)) * (1.0 / (t - from).max(bench.T));
        let way = AlphaBeta::new(1.5, -0.5 * SQRT_3);
        let share = |p: AlphaBeta, t: f64| (p - slope * t).dot(way) / 3.0;
        let moved = self.p - slope * t - (sample.i - self.i_start) * bench.L_c;
        bench.blocked = unexplained(bench.T, record) < BLOCKED * bench.psi_r;
        let i = (sample.i - self.i_start).dot(way) / 3.0;
        let beyond = if inverse { bench.tensor.saliency() * i } else { 0.0 };
        let psi = moved.dot(way) / 3.0 - beyond;
        let plausible = psi > bench.psi_least() && psi < 1.15 * bench.psi_r;
        let other = if bench.psi_1 > 0.0 { bench.psi_1 } else { 0.6 * bench.psi_r };
        bench.psi_0 = if plausible && (bench.psi_1 == 0.0 || psi < 2.5 * bench.psi_1) { psi } else { other };
        // The current has turned long before the rotor has: its own flux linkage counts from the start.
        let own = i * bench.L_c + beyond;
        let half = 0.5 * psi;
        let mut k = 1.0;
        let mut t_50 = t;
        for n in 0..record.len() {
            let [alpha, beta, ..] = record.row(n);
            if share(AlphaBeta::new(alpha, beta), k * bench.T) - own >= half {
                t_50 = k * bench.T;
                break;
            }
            k = after(k);
        }
        bench.w_0 = 1.48 / t_50;
        plausible
    }
}

/// The sample of the record after the one of sample `k`, in whole samples.
fn after(k: f64) -> f64 {
    (1.025 * k).ceil().max(k + 1.0)
}

/// Root mean square in Wb of the part of the flux linkage in the `record` that neither the current nor a drift explains.
fn unexplained(T: f64, record: &Record) -> f64 {
    let mut normal = [Normal::<4>::default(), Normal::default()];
    let mut k = 1.0;
    for n in 0..record.len() {
        let [alpha, beta, i_alpha, i_beta] = record.row(n);
        let row = [i_alpha, i_beta, 1.0, k * T];
        normal[0].add(&row, alpha);
        normal[1].add(&row, beta);
        k = after(k);
    }
    let [a, b] = normal.map(|n| n.solve(0.0).map_or(f64::INFINITY, |s| s.variance));
    (a + b).sqrt()
}
