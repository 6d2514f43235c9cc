//! Inductances by the output-error method: simulates the record of an axis and minimizes the error of the current.
//!
//! ```text
//! dpsi/dt = u + u_0 - R i - loss(i)                 Heun, 12 steps a row at least
//! i       = A sum g_k z^e_k                         z = (psi - moved)/(L A); d: 1, 2, 3, 4; q: 1, 3, 5
//! moved   = c_1 int int i + c_2 t^2                 what a free rotor's magnet adds across itself; q alone
//! ```
//!
//! Unknowns: g, psi at the start, u_0, c_1 and c_2. Damped Gauss & Newton, one evaluation a sample, 25 at most; the
//! sensitivities follow the same steps. Exact where R T/L is not small, unlike a regression on the flux linkage.

use super::bench::Bench;
use super::excitation::{Excitation, Record};
use super::least_squares::Normal;
use serde::{Deserialize, Serialize};

/// Unknowns: four g, start, u_0, c_1, c_2.
const UNKNOWNS: usize = 8;
/// Error of a coefficient over the residual.
const LEFT: f64 = 3.0;
/// Evaluations at most.
const MOST: f64 = 25.0;

/// The axis excited by a loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Along {
    /// The magnet's: even powers.
    #[default]
    D,
    /// Across the magnet: odd powers, and a rotor that moves.
    Q,
}

/// The fit on its way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct OutputError {
    along: Along,
    /// Unknowns with the minimum cost so far, and those of the next evaluation.
    best: [f64; UNKNOWNS],
    trial: [f64; UNKNOWNS],
    normal: Normal<UNKNOWNS>,
    cost: f64,
    damping: f64,
    evaluations: f64,
    /// L A in Wb, and A.
    psi: f64,
    A: f64,
    L: f64,
}

/// Progress of the fit.
pub(super) enum Progress {
    /// It goes on.
    Continues,
    /// The loop has no magnetization.
    Failed,
    /// The magnetization.
    Found(Magnetization),
}

/// The magnetization of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Magnetization {
    along: Along,
    g: [f64; 4],
    /// Half-widths of the g.
    half: [f64; 4],
    psi: f64,
    /// Amplitude of the loop in A.
    pub(super) A: f64,
    /// Residual as a share of the amplitude, less the noise.
    pub(super) residual: f64,
}

/// Value and slope of sum g_k z^e_k, and the powers.
#[inline]
fn current(along: Along, g: &[f64], z: f64) -> (f64, f64, [f64; 4]) {
    let z_2 = z * z;
    let (powers, slopes) = match along {
        Along::D => ([z, z_2, z_2 * z, z_2 * z_2], [1.0, 2.0 * z, 3.0 * z_2, 4.0 * z_2 * z]),
        Along::Q => ([z, z_2 * z, z_2 * z_2 * z, 0.0], [1.0, 3.0 * z_2, 5.0 * z_2 * z_2, 0.0]),
    };
    let sum = |x: &[f64; 4]| g[0] * x[0] + g[1] * x[1] + g[2] * x[2] + g[3] * x[3];
    (sum(&powers), sum(&slopes), powers)
}

impl OutputError {
    /// Starts from a regression of the current on the flux linkage; `L` (H) approximates the inductance of the axis.
    pub(super) fn start(bench: &Bench, excitation: &Excitation, record: &Record, along: Along, L: f64) -> Option<Self> {
        let A = excitation.plan.A;
        let psi = L * A;
        let (mut normal, mut t) = (Normal::<6>::default(), -1.0);
        let step = 2.0 / (0..record.len()).fold(0.0, |sum, _| sum + 1.0);
        excitation.flux(bench, record, L, |[flux, _, i, _]| {
            let [a, b, c, d] = current(along, &[0.0; 4], flux / psi).2;
            t += step;
            normal.add(&[a, b, c, d, 1.0, t], i / A);
        });
        let x = normal.solve(0.0)?.x;
        let trial = [x[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0];
        Some(Self { along, trial, damping: 1e-3, psi, A, L, cost: f64::MAX, ..Self::default() })
    }

    /// One evaluation.
    pub(super) fn update(&mut self, bench: &Bench, excitation: &Excitation, record: &Record) -> Progress {
        let (cost, normal) = self.evaluate(bench, excitation, record);
        self.evaluations += 1.0;
        let mut over = self.evaluations >= MOST;
        if cost.is_finite() && cost < self.cost {
            over |= self.cost - cost < 1e-7 * cost;
            (self.best, self.cost, self.normal) = (self.trial, cost, normal);
            self.damping = (0.1 * self.damping).max(1e-9);
        } else {
            self.damping *= 10.0;
            over |= self.damping > 1e6;
        }
        if over {
            return self.finish(bench, record).map_or(Progress::Failed, Progress::Found);
        }
        let Some(step) = self.normal.solve(self.damping) else {
            return Progress::Failed;
        };
        self.trial = std::array::from_fn(|k| self.best[k] + step.x[k]);
        Progress::Continues
    }

    fn finish(&self, bench: &Bench, record: &Record) -> Option<Magnetization> {
        let rows = (0..record.len()).fold(0.0, |sum, _| sum + 1.0);
        let noise = bench.sigma / self.A;
        let residual = (self.cost / rows - noise * noise).max(0.0).sqrt();
        let [a, b, c, d, ..] = self.best;
        let half = self.normal.solve(0.0).map_or([1.0; 4], |s| std::array::from_fn(|k| s.half_width[k]));
        let found = Magnetization { along: self.along, g: [a, b, c, d], half, psi: self.psi, A: self.A, residual };
        (self.cost < f64::MAX && a > 0.0).then_some(found)
    }

    /// Cost and normal equations of the trial.
    fn evaluate(&self, bench: &Bench, excitation: &Excitation, record: &Record) -> (f64, Normal<UNKNOWNS>) {
        let Self { along, trial: p, psi, A, L, .. } = self;
        let (T, moves) = (excitation.row_time(bench), *along == Along::Q && !bench.blocked);
        let stiff = T * (bench.R + bench.curve.steepest()) / (0.6 * L);
        let steps: u32 = [12, 18, 24, 32].into_iter().find(|&n| stiff < f64::from(n)).unwrap_or(48);
        let share = 1.0 / f64::from(steps);
        let h = T * share;
        let rows = (0..record.len()).fold(0.0, |sum, _| sum + 1.0);
        let unit = excitation.axis.along(1.0);
        let (mut normal, mut cost) = (Normal::default(), 0.0);
        let mut last = [excitation.i_start.alpha(), excitation.i_start.beta()];
        // Sum of the current, and what the magnet moves: the sum of that, and t^2.
        let (mut once, mut moved, mut k) = (0.0, [0.0; 2], 0.0);
        let mut state = Simulated { y: p[4], S: [0.0; UNKNOWNS] };
        state.S[4] = 1.0;
        for row in 0..record.len() {
            let [u, _, i, across] = record.row(row);
            k += 1.0;
            once += 0.5 * (i + last[0]) / A;
            let then = if moves { [moved[0] + 0.1 * once / rows, k * k / (rows * rows)] } else { [0.0; 2] };
            let slopes = |state: &Simulated, s: f64| {
                let D = [moved[0] + s * (then[0] - moved[0]), moved[1] + s * (then[1] - moved[1])];
                let (x, dx) = self.output(state, D);
                let across = last[1] + s * (across - last[1]);
                let (loss, resistance) = bench.curve.loss_along(unit, excitation.stator(x * A, across));
                let Z = (bench.R + resistance) * A / psi;
                let mut S: [f64; UNKNOWNS] = std::array::from_fn(|j| -Z * dx[j]);
                S[5] += 1.0 / T;
                Simulated { y: (u - bench.R * x * A - loss) / psi + p[5] / T, S }
            };
            let mut s = 0.0;
            for _ in 0..steps {
                let first = slopes(&state, s);
                s += share;
                let second = slopes(&state.plus(&first, h), s);
                state = state.plus(&first, 0.5 * h).plus(&second, 0.5 * h);
            }
            let (x, dx) = self.output(&state, then);
            let e = i / A - x;
            normal.add(&dx, e);
            cost += e * e;
            (last, moved) = ([i, across], then);
        }
        (cost, normal)
    }

    /// Current over A, and its slopes against the unknowns, where the magnet has moved by `D`.
    #[inline]
    fn output(&self, state: &Simulated, D: [f64; 2]) -> (f64, [f64; UNKNOWNS]) {
        let p = &self.trial;
        let z = state.y - p[6] * D[0] - p[7] * D[1];
        let (x, slope, powers) = current(self.along, &p[..4], z);
        let mut dx = state.S.map(|S| slope * S);
        for (dx, power) in dx.iter_mut().zip(powers) {
            *dx += power;
        }
        (dx[6], dx[7]) = (dx[6] - slope * D[0], dx[7] - slope * D[1]);
        (x, dx)
    }
}

/// Flux linkage over L A, and its slopes against the unknowns.
#[derive(Clone, Copy)]
struct Simulated {
    y: f64,
    S: [f64; UNKNOWNS],
}

impl Simulated {
    #[inline]
    fn plus(&self, slope: &Self, h: f64) -> Self {
        Self { y: self.y + h * slope.y, S: std::array::from_fn(|j| self.S[j] + h * slope.S[j]) }
    }
}

impl Magnetization {
    /// L(0) in H.
    pub(super) fn at_zero(&self) -> f64 {
        self.psi / (self.A * self.g[0])
    }

    /// psi(i)/i in H at the current `i` = +-A; `None`: the curve does not reach it.
    pub(super) fn chord(&self, sign: f64) -> Option<f64> {
        let mut z = sign;
        for _ in 0..30 {
            let (x, slope, _) = current(self.along, &self.g, z);
            if slope <= 0.0 {
                return None;
            }
            z -= (x - sign) / slope;
        }
        let reached = (current(self.along, &self.g, z).0 - sign).abs() < 1e-6;
        (reached && z * sign > 0.2 && z * sign < 3.0).then_some(self.psi * z * sign / self.A)
    }

    /// s_2 in A/Wb2 and s_3 in A/Wb3 of i = x/L + s_2 x^2 + s_3 x^3 along d, each with its half-width, by least squares over
    /// +-psi(A) with `L` (H) given, whose relative half-width is `u`. An error of L bends the line as s_3 does; the residual of
    /// the fit may have any form.
    pub(super) fn saturation(&self, L: f64, u: f64) -> [[f64; 2]; 2] {
        let ([a, b, c, d], half) = (self.g, self.half);
        // Over z in +-1: means of z^4 and z^6 are 1/5 and 1/7.
        let slope = a - self.psi / (self.A * L);
        let of = |x: [f64; 3]| LEFT * self.residual + x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let s_2 = [b + d * (5.0 / 7.0), of([half[1], half[3] * (5.0 / 7.0), 0.0])];
        let s_3 = [c + slope * (7.0 / 5.0), of([half[2], half[0] * (7.0 / 5.0), u * a * (7.0 / 5.0)])];
        let by = self.A / (self.psi * self.psi);
        [s_2.map(|s| s * by), s_3.map(|s| s * by / self.psi)]
    }
}
