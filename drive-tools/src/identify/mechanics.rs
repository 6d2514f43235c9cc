//! Fit of inertia and friction to the torque produced by the currents:
//!
//! ```text
//! J [w_m] + B int(w_m) + tau_coulomb int(tanh(w_m / (0.003 w_max))) = int(tau_e - tau_load)
//! tau_e = 1.5 n_p (psi_d i_q - psi_q i_d)
//! ```
//!
//! A known load also measures the scale of the record. With its integral as a fourth regressor,
//!
//! ```text
//! J [w_m] + B int(w_m) + tau_coulomb int(tanh(w_m / (0.003 w_max))) + c int(tau_load) = int(tau_e)
//! ```
//!
//! c is 1 if voltages (V), currents (A) and load (N.m) are right: tau_e is proportional to voltage and current, so RMS values of one
//! of them give c = 1/sqrt(2), and a load in mN.m gives c = 1/1000. Derived here; the other factors are in `verdict.rs`.

use super::electrical::Fit;
use super::interval::{self, Sums};
use super::motion::Motion;
use super::record::{BenchRecord, Complex, quantile};
use nalgebra::{DMatrix, DVector};

/// Length of a window in s.
const WINDOW: f64 = 0.05;

/// Windows of a block of the sandwich estimate.
const BLOCK: usize = 6;

/// J, B, tau_coulomb.
const SIZE: usize = 3;

/// The fit.
#[derive(Clone, Debug)]
pub struct MechanicalFit {
    /// J in kg.m2, B in N.m.s/rad, tau_coulomb in N.m.
    pub p: [f64; SIZE],
    /// Half-widths (95 %).
    pub half: [f64; SIZE],
}

/// Speed and torque in the record, in windows of 50 ms.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Maximum mechanical speed in rad/s.
    pub speed: f64,
    /// Maximum electromagnetic torque in N.m.
    pub torque: f64,
    /// Speeds that differ by a tenth of the maximum, each for at least 3 % of the time.
    pub levels: usize,
    /// The windows.
    pub rows: Vec<TorqueWindow>,
}

/// One window: the regressors of inertia and friction and the quantity to explain, integrated over its time.
#[derive(Clone, Copy, Debug)]
pub struct TorqueWindow {
    /// Time in s at its middle.
    pub t: f64,
    /// Its length in s.
    pub time: f64,
    /// Change of the speed, integral of the speed and of its sign.
    pub x: [f64; SIZE],
    /// Integral of the electromagnetic torque without the load, N.m.s.
    pub y: f64,
    /// Integral of the load, N.m.s.
    pub load: f64,
}

impl Shown {
    /// Windows of a record. An unknown load is taken as zero.
    pub fn of(record: &BenchRecord, motion: &Motion, fit: &Fit, n_p: f64) -> Self {
        let width = ((WINDOW / record.step).round() as usize).max(4);
        let speed =
            quantile(motion.runs.iter().flat_map(Clone::clone).map(|k| motion.w[k].abs()).collect(), 0.999) / n_p;
        let sign = |w: f64| (w / (0.003 * speed)).tanh();
        let torque = |k: usize| {
            let i = record.i[k] * Complex::cis(-(motion.theta[k] - fit.theta_0 + motion.w[k] * fit.tau));
            let psi = fit.flux(i);
            1.5 * n_p * (psi.re * i.im - psi.im * i.re)
        };
        let (mut rows, mut greatest, mut bins) = (Vec::new(), 0.0_f64, [0_usize; 101]);
        for run in &motion.runs {
            let mut start = run.start;
            while start + width < run.end {
                let (mut x, mut load, mut made) = ([0.0; SIZE], 0.0, 0.0);
                for k in start..=start + width {
                    let part = if k == start || k == start + width { 0.5 * record.step } else { record.step };
                    let w_m = motion.w[k] / n_p;
                    x[1] += part * w_m;
                    x[2] += part * sign(w_m);
                    made += part * torque(k);
                    load += part * record.load.as_ref().map_or(0.0, |load| load[k]);
                }
                x[0] = (motion.w[start + width] - motion.w[start]) / n_p;
                let time = width as f64 * record.step;
                greatest = greatest.max((made / time).abs());
                bins[((x[1] / time / speed).abs() * 100.0).clamp(0.0, 100.0) as usize] += 1;
                let t = 0.5 * (record.t[start] + record.t[start + width]);
                rows.push(TorqueWindow { t, time, x, y: made - load, load });
                start += width;
            }
        }
        let levels = levels(bins, rows.len());
        Self { speed, torque: greatest, levels, rows }
    }

    /// The fit.
    pub fn fit(&self) -> Option<MechanicalFit> {
        let rows: Vec<_> = self.rows.iter().map(|row| (row.x, row.y)).collect();
        least_squares(&rows).map(|(p, half)| MechanicalFit { p, half })
    }

    /// The ratio c of the torque of the currents to that of the load, and its half-width (95 %); `None` without a load.
    pub fn per_load(&self) -> Option<(f64, f64)> {
        let with_load =
            |TorqueWindow { x: [dw, w, sign], y, load, .. }: &TorqueWindow| ([*dw, *w, *sign, *load], y + load);
        if self.rows.iter().all(|row| row.load == 0.0) {
            return None;
        }
        let rows: Vec<_> = self.rows.iter().map(with_load).collect();
        least_squares(&rows).map(|(p, half)| (p[SIZE], half[SIZE]))
    }
}

/// Least squares assuming an error of 1 % of the torque in each row of regressors and torque, with less weight beyond 2.5 standard
/// deviations: parameters and half-widths (95 %).
fn least_squares<const N: usize>(rows: &[([f64; N], f64)]) -> Option<([f64; N], [f64; N])> {
    let typical = quantile(rows.iter().map(|(_, y)| y.abs()).collect(), 0.9);
    let size = |y: f64| 0.01 * y.abs() + 0.005 * typical;
    let mut weights: Vec<f64> = rows.iter().map(|(_, y)| 1.0 / size(*y)).collect();
    let base = weights.clone();
    let dot = |x: &[f64; N], p: &DVector<f64>| x.iter().zip(p.iter()).map(|(x, p)| x * p).sum::<f64>();
    let mut p = DVector::zeros(N);
    for _ in 0..3 {
        let mut sums = Sums::new(N);
        for ((x, y), weight) in rows.iter().zip(&weights) {
            sums.add(&x.map(|x| x * weight), y * weight);
        }
        p = interval::solve(&sums.matrix, &sums.score)?;
        let rests: Vec<f64> = rows.iter().zip(&base).map(|((x, y), b)| b * (y - dot(x, &p))).collect();
        let sigma = 1.4826 * quantile(rests.iter().map(|r| r.abs()).collect(), 0.5);
        for ((weight, base), rest) in weights.iter_mut().zip(&base).zip(&rests) {
            // Huber: the square root of the weight of a square.
            let keep = if rest.abs() > 2.5 * sigma { 2.5 * sigma / rest.abs() } else { 1.0 };
            *weight = base * keep.sqrt();
        }
    }
    let rows: Vec<_> = rows.iter().zip(&weights).collect();
    let block = |chunk: &[(&([f64; N], f64), &f64)]| {
        let mut block = Sums::new(N);
        for ((x, y), weight) in chunk {
            block.add(&x.map(|x| x * *weight), *weight * (y - dot(x, &p)));
        }
        block
    };
    let blocks: Vec<Sums> = rows.chunks(BLOCK).map(block).collect();
    let units = DMatrix::<f64>::identity(N, N);
    let gradients: Vec<DVector<f64>> = units.column_iter().map(nalgebra::Matrix::into_owned).collect();
    let half = interval::half_widths(&blocks, &gradients)?;
    Some((std::array::from_fn(|k| p[k]), std::array::from_fn(|k| half[k])))
}

/// Levels in a histogram of the speed with 100 bins: the fullest tenth of the range, then the next one outside its
/// surroundings, as long as it contains 3 % of the windows.
fn levels(mut bins: [usize; 101], windows: usize) -> usize {
    let mut levels = 0;
    loop {
        let sum = |from: usize| bins[from..from + 10].iter().sum::<usize>();
        let Some(fullest) = (0..=91).max_by_key(|&from| sum(from)) else { return levels };
        if sum(fullest) == 0 || (sum(fullest) as f64) < 0.03 * windows as f64 {
            return levels;
        }
        levels += 1;
        bins[fullest.saturating_sub(5)..(fullest + 15).min(101)].fill(0);
    }
}
