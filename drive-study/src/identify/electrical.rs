//! Linear fit of the voltage equations in integral form, in rotor axes, over windows of some samples:
//!
//! ```text
//! d: L_d [i_d] - L_q int(w i_q) + R int(i_d) + sum c_j int(s_jd)                = int(u_d)     [x]: end minus start
//! q: L_q [i_q] + L_d int(w i_d) + psi_M int(w) + R int(i_q) + sum c_j int(s_jq) = int(u_q)
//! ```
//!
//! The voltage is held in stator axes for a sample; its mean in rotor axes is `u e^(-j theta) sin(w T/2)/(w T/2)` at the middle.
//! `s_j` is what the three legs lose for `u_dead` = 1 V and the current `i_xj` at which the dead time's curve bends: the sum of
//! three approximates its tail. Noise of the current widens `[i]`, so that its square is taken off the normal matrix. The angle's
//! offset `theta_0` and delay `tau` are found around the linear fit.

use super::interval::{self, Sums};
use super::motion::Motion;
use super::record::BenchRecord;
use super::{Complex, legs};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Linear parameters: R, L_d, L_q, psi_M, c_1, c_2, c_3.
pub const LINEAR: usize = 7;

/// With theta_0 and tau.
const ALL: usize = 9;

/// Bends of the dead time's curve, as shares of the maximum current.
const BENDS: [f64; 3] = [0.003, 0.01, 0.03];

/// Iterations of the angle's offset and delay.
const ITERATIONS: usize = 12;

/// Windows of a block of the sandwich estimate.
const BLOCK: usize = 25;

/// Greatest share of a diagonal that is taken for noise.
const MOST_NOISE: f64 = 0.9;

/// One window: the regressors of both axes and what they explain, integrals over its time.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Time in s at its middle.
    pub t: f64,
    /// Regressors of the d-axis.
    pub d: [f64; LINEAR],
    /// Regressors of the q-axis.
    pub q: [f64; LINEAR],
    /// Integral of the voltage in V.s, rotor axes.
    pub u: Complex,
}

/// When the voltage of a row acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Samples of the controller between a row and the action of its voltage.
    pub delay: f64,
    /// The record keeps one of so many samples.
    pub every: u32,
}

/// A record prepared for fits.
pub struct Problem<'a> {
    record: &'a BenchRecord,
    motion: &'a Motion,
    timing: Timing,
    /// Loss of the legs for each bend and row, per volt of dead time, stator axes.
    losses: Vec<[Complex; 3]>,
    bends: [f64; 3],
    window: usize,
}

/// The fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// R in Ohm, L_d and L_q in H, psi_M in Wb, c_j in V.
    pub p: [f64; LINEAR],
    /// Angle of the sensor's zero in rad.
    pub theta_0: f64,
    /// Delay of the angle in s.
    pub tau: f64,
    /// Half-widths (95 %) of R, L_d, L_q, psi_M, u_dead and i_zero.
    pub half: [f64; 6],
    /// Condition number of the scaled normal matrix.
    pub condition: f64,
    /// What the fit leaves, as a voltage in V (rms of the vector), and what noise would leave.
    pub rest: f64,
    /// What the noise of the current would leave.
    pub noise: f64,
    bends: [f64; 3],
}

impl Fit {
    /// Dead-time voltage in V.
    pub fn u_dead(&self) -> f64 {
        self.p[4..].iter().sum()
    }

    /// Current in A below which the dead-time voltage falls linearly to zero: the curve has the same slope at zero.
    pub fn i_zero(&self) -> f64 {
        let slope: f64 = self.p[4..].iter().zip(self.bends).map(|(c, bend)| c / bend).sum();
        2.0 * self.u_dead() / slope
    }
}

impl<'a> Problem<'a> {
    /// Prepares a record; `i_max` is the maximum current in A.
    pub fn new(record: &'a BenchRecord, motion: &'a Motion, timing: Timing, i_max: f64) -> Self {
        let bends = BENDS.map(|share| share * i_max);
        let losses = record.i.iter().map(|&i| bends.map(|bend| legs::loss(i, bend))).collect();
        let window = 4.max(16 / timing.every.max(1) as usize);
        Self { record, motion, timing, losses, bends, window }
    }

    /// Mean of the voltage over the step after row `k`, in rotor axes shifted by `theta_0` and `tau`.
    fn voltage(&self, k: usize, frame: impl Fn(usize, f64) -> f64) -> Complex {
        let (T, w) = (self.record.step, self.motion.w[k]);
        let u = &self.record.u;
        // The vector `u` that acts from `from` to `to` (parts of the step), seen from rotor axes.
        let seen = |row: usize, from: f64, to: f64| {
            let (middle, half) = (0.5 * (from + to) * T, 0.5 * (to - from) * T * w);
            let width = if half.abs() < 1e-4 { 1.0 } else { half.sin() / half };
            if self.record.rotor_voltage {
                // Given in rotor axes of the sensor: only the sensor's own error turns it.
                let turned = frame(k, 0.0) - self.motion.theta[k];
                return u[row] * Complex::cis(-self.record.theta[row] - turned) * (to - from);
            }
            u[row] * Complex::cis(-frame(k, middle)) * width * (to - from)
        };
        if self.timing.every > 1 {
            // The log has a vector of one sample; between two of them, the vector in rotor axes changes smoothly.
            let held = T / f64::from(self.timing.every);
            let shift = (self.timing.delay + 0.5) * held;
            let at = |row: usize| {
                if self.record.rotor_voltage {
                    let turned = frame(row, 0.0) - self.motion.theta[row];
                    return u[row] * Complex::cis(-self.record.theta[row] - turned);
                }
                let half = 0.5 * held * self.motion.w[row];
                let width = if half.abs() < 1e-4 { 1.0 } else { half.sin() / half };
                u[row] * Complex::cis(-frame(row, shift)) * width
            };
            // Mean over the step of the line through the vectors, which stand `shift` later than the rows.
            let late = shift / T;
            let back = late.floor() as usize;
            let part = late - late.floor();
            let row = |offset: isize| (k + 1).saturating_add_signed(offset - back as isize).min(u.len() - 1);
            let (a, b, c) = (at(row(-2)), at(row(-1)), at(row(0)));
            // Integral from -part to 1 - part of the line through (-1, a), (0, b), (1, c).
            let before = b * part + (a - b) * (0.5 * part * part);
            let rest = 1.0 - part;
            return before + b * rest + (c - b) * (0.5 * rest * rest);
        }
        let whole = self.timing.delay.floor();
        let part = self.timing.delay - whole;
        let row = k.saturating_sub(whole as usize);
        if part > 0.0 { seen(row.saturating_sub(1), 0.0, part) + seen(row, part, 1.0) } else { seen(row, 0.0, 1.0) }
    }

    /// The windows of a stretch.
    fn windows(&self, run: Range<usize>, theta_0: f64, tau: f64, out: &mut Vec<Window>) {
        let (T, motion) = (self.record.step, self.motion);
        let frame = |k: usize, later: f64| motion.theta[k] - theta_0 + motion.w[k] * (tau + later);
        let view = |k: usize| {
            let turn = Complex::cis(-frame(k, 0.0));
            (self.record.i[k] * turn, self.losses[k].map(|s| s * turn))
        };
        let lag = (self.timing.delay.ceil() as usize + 2).min(run.len());
        let mut start = run.start + lag;
        while start + self.window < run.end {
            let (first, mut before) = (view(start), view(start));
            let [mut i, mut w_i, mut u] = [Complex::new(0.0, 0.0); 3];
            let (mut s, mut angle) = ([Complex::new(0.0, 0.0); 3], 0.0);
            for k in start..start + self.window {
                let after = view(k + 1);
                let (w_0, w_1) = (motion.w[k], motion.w[k + 1]);
                i += (before.0 + after.0) * (0.5 * T);
                w_i += (before.0 * w_0 + after.0 * w_1) * (0.5 * T);
                angle += (w_0 + w_1) * (0.5 * T);
                for (s, (a, b)) in s.iter_mut().zip(before.1.iter().zip(after.1)) {
                    *s += (a + b) * (0.5 * T);
                }
                u += self.voltage(k, frame) * T;
                before = after;
            }
            let rise = before.0 - first.0;
            out.push(Window {
                t: 0.5 * (self.record.t[start] + self.record.t[start + self.window]),
                d: [i.re, rise.re, -w_i.im, 0.0, s[0].re, s[1].re, s[2].re],
                q: [i.im, w_i.re, rise.im, angle, s[0].im, s[1].im, s[2].im],
                u,
            });
            start += self.window;
        }
    }

    fn all_windows(&self, theta_0: f64, tau: f64) -> Vec<Window> {
        let mut windows = Vec::new();
        for run in &self.motion.runs {
            self.windows(run.clone(), theta_0, tau, &mut windows);
        }
        windows
    }

    /// The windows in the axes of a fit, and their length in s.
    pub fn seen(&self, fit: &Fit) -> (Vec<Window>, f64) {
        (self.all_windows(fit.theta_0, fit.tau), self.window as f64 * self.record.step)
    }

    /// Square of the noise in `[i]` of one axis, which a window adds to the diagonals of both inductances.
    fn noise(&self) -> f64 {
        self.record.sigma * self.record.sigma
    }

    /// Where the magnet's flux points, as seen from the sensor's axes: the start of `theta_0`.
    fn direction(&self) -> Option<f64> {
        let mut theta_0 = 0.0;
        for _ in 0..4 {
            // A second flux on the q-axis, which the d-equation sees as -int(w).
            let mut sums = Sums::new(LINEAR + 1);
            for Window { d, q, u, .. } in self.all_windows(theta_0, 0.0) {
                let row = |x: [f64; LINEAR], last: f64| [x[0], x[1], x[2], x[3], x[4], x[5], x[6], last];
                sums.add(&row(d, -q[3]), u.re);
                sums.add(&row(q, 0.0), u.im);
            }
            let p = solved(&sums)?;
            let turn = p[LINEAR].atan2(p[3]);
            theta_0 -= turn;
            if turn.abs() < 1e-3 {
                break;
            }
        }
        Some(theta_0)
    }

    /// The fit; `None` where the record determines nothing.
    pub fn fit(&self) -> Option<Fit> {
        let (mut theta_0, mut tau) = (self.direction()?, 0.0);
        let mut damping = 1e-6;
        let mut best = self.linear(theta_0, tau)?;
        for _ in 0..ITERATIONS {
            let blocks = self.blocks(&best, theta_0, tau);
            let mut matrix = blocks.iter().fold(DMatrix::zeros(ALL, ALL), |sum, b| sum + &b.matrix);
            let score = blocks.iter().fold(DVector::zeros(ALL), |sum, b| sum + &b.score);
            for k in LINEAR..ALL {
                matrix[(k, k)] *= 1.0 + damping;
            }
            let step = interval::solve(&matrix, &score)?;
            let next = (
                theta_0 + step[LINEAR].clamp(-0.3, 0.3),
                tau + step[LINEAR + 1].clamp(-2.0 * self.record.step, 2.0 * self.record.step),
            );
            let found = self.linear(next.0, next.1)?;
            if found.squares < best.squares {
                let small = (next.0 - theta_0).abs() < 1e-7 && (next.1 - tau).abs() < 1e-5 * self.record.step;
                (best, theta_0, tau, damping) = (found, next.0, next.1, damping * 0.1);
                if small {
                    break;
                }
            } else {
                damping *= 100.0;
            }
        }
        self.judged(&best, theta_0, tau)
    }

    fn linear(&self, theta_0: f64, tau: f64) -> Option<Solved> {
        let windows = self.all_windows(theta_0, tau);
        let mut sums = Sums::new(LINEAR);
        let mut power = 0.0;
        for Window { d, q, u, .. } in &windows {
            sums.add(d, u.re);
            sums.add(q, u.im);
            power += u.norm_sqr();
        }
        let mut noiseless = sums.matrix.clone();
        // An inductance whose current hardly changes is seen through noise alone; all others are still told.
        let count = windows.len().max(1) as f64;
        let noise = [1, 2].map(|k| self.noise().min(MOST_NOISE * sums.matrix[(k, k)] / count));
        for k in [1, 2] {
            noiseless[(k, k)] -= count * noise[k - 1];
        }
        let p = interval::solve(&noiseless, &sums.score)?;
        Some(Solved {
            squares: power - p.dot(&sums.score),
            condition: interval::condition(&noiseless),
            p,
            windows,
            noise,
        })
    }

    /// Blocks of windows with the regressors of all parameters.
    fn blocks(&self, solved: &Solved, theta_0: f64, tau: f64) -> Vec<Sums> {
        let (by_angle, by_time) = (1e-3, 0.02 * self.record.step);
        let turned = self.all_windows(theta_0 + by_angle, tau);
        let late = self.all_windows(theta_0, tau + by_time);
        let rest = |w: &Window| w.u - Complex::new(dot(&w.d, &solved.p), dot(&w.q, &solved.p));
        let triples: Vec<_> = solved.windows.iter().zip(&turned).zip(&late).collect();
        let one = |chunk: &[((&Window, &Window), &Window)]| {
            let mut block = Sums::new(ALL);
            for ((now, turned), late) in chunk {
                let e = rest(now);
                let slopes = [(e - rest(turned)) / by_angle, (e - rest(late)) / by_time];
                let row = |x: &[f64; LINEAR], slopes: [f64; 2]| {
                    let mut row = [0.0; ALL];
                    row[..LINEAR].copy_from_slice(x);
                    row[LINEAR..].copy_from_slice(&slopes);
                    row
                };
                block.add(&row(&now.d, slopes.map(|s| s.re)), e.re);
                block.add(&row(&now.q, slopes.map(|s| s.im)), e.im);
            }
            for k in [1, 2] {
                let noise = chunk.len() as f64 * solved.noise[k - 1];
                block.matrix[(k, k)] -= noise;
                block.score[k] += noise * solved.p[k];
            }
            block
        };
        triples.chunks(BLOCK).map(one).collect()
    }

    fn judged(&self, solved: &Solved, theta_0: f64, tau: f64) -> Option<Fit> {
        let blocks = self.blocks(solved, theta_0, tau);
        let unit = |at: &[usize]| DVector::from_fn(ALL, |k, _| if at.contains(&k) { 1.0 } else { 0.0 });
        let mut gradients: Vec<_> = [&[0][..], &[1], &[2], &[3], &[4, 5, 6]].map(unit).to_vec();
        let p: [f64; LINEAR] = std::array::from_fn(|k| solved.p[k]);
        // i_zero = 2 sum c_j / sum(c_j / i_xj).
        let slope: f64 = p[4..].iter().zip(self.bends).map(|(c, bend)| c / bend).sum();
        let u_dead: f64 = p[4..].iter().sum();
        let curve = |k: usize| 2.0 / slope * (1.0 - u_dead / slope / self.bends[k - 4]);
        gradients.push(DVector::from_fn(ALL, |k, _| if (4..LINEAR).contains(&k) { curve(k) } else { 0.0 }));
        let half = interval::half_widths(&blocks, &gradients)?;
        let windows = solved.windows.len() as f64;
        let time = self.window as f64 * self.record.step;
        let noise = self.record.sigma * (p[1] * p[1] + p[2] * p[2]).sqrt() / time;
        Some(Fit {
            p,
            theta_0,
            tau,
            half: std::array::from_fn(|k| half[k]),
            condition: solved.condition,
            rest: (solved.squares.max(0.0) / windows).sqrt() / time,
            noise,
            bends: self.bends,
        })
    }
}

/// The linear fit at one offset and delay of the angle.
struct Solved {
    p: DVector<f64>,
    squares: f64,
    condition: f64,
    windows: Vec<Window>,
    /// Square of the noise that was taken off both inductances' diagonals, per window.
    noise: [f64; 2],
}

fn solved(sums: &Sums) -> Option<DVector<f64>> {
    interval::solve(&sums.matrix, &sums.score)
}

fn dot(x: &[f64; LINEAR], p: &DVector<f64>) -> f64 {
    x.iter().zip(p.iter()).map(|(x, p)| x * p).sum()
}
