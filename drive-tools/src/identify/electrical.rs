//! Linear fit of the voltage equations over the [`windows`](super::windows) of a record.
//!
//! Noise of the current increases `[i]`, so its square is subtracted from the normal matrix. The angle's offset `theta_0` and
//! delay `tau` are found around the linear fit. A second pass adds the terms of the saturation that reduce the residual, and
//! models the currents between samples as exponentials.

use super::interval::{self, Sums};
use super::record::Complex;
use super::windows::{BENT, CURVE, Form, Problem, SIZE, Window};
use nalgebra::{DMatrix, DVector};

/// With theta_0 and tau.
const ALL: usize = SIZE + 2;

/// Iterations of the angle's offset and delay.
const ITERATIONS: usize = 12;

/// Windows of a block of the sandwich estimate.
const BLOCK: usize = 25;

/// Maximum share of a diagonal that is taken for noise.
const MOST_NOISE: f64 = 0.9;

/// Terms of the saturation that are tried together: a_2, a_3, b_3, a_x.
const TERMS: [[bool; 4]; 5] =
    [[false; 4], [true, true, false, false], [false, false, true, false], [true, true, true, false], [true; 4]];

/// Maximum R T/L that the second pass takes into account.
const MOST_DECAY: f64 = 3.0;

/// Rounds of the second pass.
const ROUNDS: usize = 2;

/// The fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// R in Ohm, L_d and L_q in H at no current, psi_M in Wb, c_j in V, and the terms of the saturation.
    pub p: [f64; SIZE],
    /// Effects included in the equations.
    pub form: Form,
    /// Angle of the sensor's zero in rad.
    pub theta_0: f64,
    /// Delay of the angle in s.
    pub tau: f64,
    /// Half-widths (95 %) of R, L_d, L_q, psi_M, u_dead and i_zero.
    pub half: [f64; 6],
    /// Condition number of the scaled normal matrix.
    pub condition: f64,
    /// Residual of the fit as a voltage in V (rms of the vector), and the residual that noise alone would cause.
    pub rest: f64,
    /// The residual that the noise of the current alone would cause.
    pub noise: f64,
    bends: [f64; 3],
}

impl Fit {
    /// Dead-time voltage in V.
    pub fn u_dead(&self) -> f64 {
        self.p[CURVE].iter().sum()
    }

    /// Current in A below which the dead-time voltage falls linearly to zero: the curve has the same slope at zero.
    pub fn i_zero(&self) -> f64 {
        let slope: f64 = self.p[CURVE].iter().zip(self.bends).map(|(c, bend)| c / bend).sum();
        2.0 * self.u_dead() / slope
    }

    /// Whether no value of the stator is negative beyond its interval.
    pub fn is_possible(&self) -> bool {
        self.p.iter().zip(&self.half).take(4).all(|(x, half)| *x > -half)
    }

    /// Flux linkage in Wb of a current in A, rotor axes.
    pub fn flux(&self, i: Complex) -> Complex {
        let [_, L_d, L_q, psi_M, _, _, _, a_2, a_3, b_3, a_x] = self.p;
        let (d, q) = (i.re, i.im);
        let psi_d = psi_M + (L_d + (a_2 + a_3 * d) * d) * d + 0.5 * a_x * q * q;
        Complex::new(psi_d, (L_q + b_3 * q * q + a_x * d) * q)
    }

    /// Saturation as in the plant: s_2 in A/Wb2, s_3 in A/Wb3, s_dq in A/Wb2; `None` if the record shows no saturation.
    pub fn saturation(&self) -> Option<[f64; 3]> {
        let [_, L_d, L_q, _, _, _, _, a_2, a_3, _, a_x] = self.p;
        let s_2 = -a_2 / L_d.powi(3);
        let s_3 = 2.0 * s_2 * s_2 * L_d - a_3 / L_d.powi(4);
        self.form.bent.contains(&true).then_some([s_2, s_3, -a_x / (L_d * L_q * L_q)])
    }
}

impl Problem<'_> {
    /// The windows in the axes of a fit.
    pub fn seen(&self, fit: &Fit) -> Vec<Window> {
        self.with(fit.form, 0.0).windows(fit.theta_0, fit.tau)
    }

    /// Square of the noise in `[i]` of one axis, which a window adds to the diagonals of both inductances.
    fn noise(&self) -> f64 {
        self.record.sigma * self.record.sigma
    }

    /// Direction of the magnet's flux in the sensor's axes: the start value of `theta_0`.
    fn direction(&self) -> Option<f64> {
        let mut theta_0 = 0.0;
        for _ in 0..4 {
            // A second flux on the q-axis, which enters the d-equation as -int(w).
            let mut sums = Sums::new(CURVE.end + 1);
            for Window { d, q, u, .. } in self.windows(theta_0, 0.0) {
                let row = |x: [f64; SIZE], last: f64| [x[0], x[1], x[2], x[3], x[4], x[5], x[6], last];
                sums.add(&row(d, -q[3]), u.re);
                sums.add(&row(q, 0.0), u.im);
            }
            let p = solved(&sums)?;
            let turn = p[CURVE.end].atan2(p[3]);
            theta_0 -= turn;
            if turn.abs() < 1e-3 {
                break;
            }
        }
        Some(theta_0)
    }

    /// The fit; `None` where the record determines nothing.
    pub fn fit(&self) -> Option<Fit> {
        self.fit_from(self.direction()?, 0.0)
    }

    /// The second pass.
    pub fn refined(&self, fit: Fit) -> Option<Fit> {
        let bent = self.worth(&fit)?;
        let mut fit = fit;
        for _ in 0..ROUNDS {
            let [R, L_d, L_q, ..] = fit.p;
            // The voltage is held only over a sample of the controller.
            let x = |L: f64| if self.timing.every == 1 && R > 0.0 && L > 0.0 { R * self.record.step / L } else { 0.0 };
            let form = Form { share: [L_d, L_q].map(|L| Form::share_of(x(L).min(MOST_DECAY))), bent };
            if form == fit.form {
                break;
            }
            fit = self.with(form, x(0.5 * (L_d + L_q)).min(MOST_DECAY)).fit_from(fit.theta_0, fit.tau)?;
        }
        Some(fit)
    }

    /// The terms of the saturation with which the values are known best: if a term describes the record, the results with
    /// different stretches of time left out agree; if an effect is missing, they differ.
    fn worth(&self, fit: &Fit) -> Option<[bool; 4]> {
        let whole = self.with(Form { bent: [true; 4], ..fit.form }, 0.0);
        let solved = whole.linear(fit.theta_0, fit.tau)?;
        let blocks = whole.blocks(&solved, fit.theta_0, fit.tau);
        let width = |bent: &[bool; 4]| {
            let without = |k: usize| BENT.contains(&k) && !bent[k - BENT.start];
            let mut sums = solved.sums.clone();
            sums.leave_out(without);
            let p = interval::solve(&sums.matrix, &sums.score)?;
            let moved = DVector::from_fn(ALL, |k, _| if k < SIZE { solved.p[k] - p[k] } else { 0.0 });
            let mut blocks = blocks.clone();
            for block in &mut blocks {
                block.score += &block.matrix * &moved;
                block.leave_out(without);
            }
            let half = interval::half_widths(&blocks, &whole.gradients(&p)[..4])?;
            Some((0..4).map(|k| (half[k] / p[k].max(f64::MIN_POSITIVE)).ln()).sum::<f64>())
        };
        let widths = TERMS.iter().filter_map(|bent| Some((*bent, width(bent)?)));
        widths.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(bent, _)| bent)
    }

    fn fit_from(&self, mut theta_0: f64, mut tau: f64) -> Option<Fit> {
        let mut damping = 1e-6;
        let mut best = self.linear(theta_0, tau)?;
        for _ in 0..ITERATIONS {
            let blocks = self.blocks(&best, theta_0, tau);
            let mut matrix = blocks.iter().fold(DMatrix::zeros(ALL, ALL), |sum, b| sum + &b.matrix);
            let score = blocks.iter().fold(DVector::zeros(ALL), |sum, b| sum + &b.score);
            for k in SIZE..ALL {
                matrix[(k, k)] *= 1.0 + damping;
            }
            let step = interval::solve(&matrix, &score)?;
            let next = (
                theta_0 + step[SIZE].clamp(-0.3, 0.3),
                tau + step[SIZE + 1].clamp(-2.0 * self.record.step, 2.0 * self.record.step),
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
        let windows = self.windows(theta_0, tau);
        let mut sums = Sums::new(SIZE);
        let mut power = 0.0;
        for Window { d, q, u, .. } in &windows {
            sums.add(d, u.re);
            sums.add(q, u.im);
            power += u.norm_sqr();
        }
        let mut noiseless = sums.matrix.clone();
        // An inductance whose current hardly changes is determined by noise only; all others are still reported.
        let count = windows.len().max(1) as f64;
        let noise = [1, 2].map(|k| self.noise().min(MOST_NOISE * sums.matrix[(k, k)] / count));
        for k in [1, 2] {
            noiseless[(k, k)] -= count * noise[k - 1];
        }
        sums.matrix = noiseless;
        let p = interval::solve(&sums.matrix, &sums.score)?;
        Some(Solved {
            squares: power - p.dot(&sums.score),
            condition: interval::condition(&sums.matrix),
            sums,
            p,
            windows,
            noise,
        })
    }

    /// Blocks of windows with the regressors of all parameters.
    fn blocks(&self, solved: &Solved, theta_0: f64, tau: f64) -> Vec<Sums> {
        let (by_angle, by_time) = (1e-3, 0.02 * self.record.step);
        let turned = self.windows(theta_0 + by_angle, tau);
        let late = self.windows(theta_0, tau + by_time);
        let rest = |w: &Window| w.u - Complex::new(dot(&w.d, &solved.p), dot(&w.q, &solved.p));
        let triples: Vec<_> = solved.windows.iter().zip(&turned).zip(&late).collect();
        let one = |chunk: &[((&Window, &Window), &Window)]| {
            let mut block = Sums::new(ALL);
            for ((now, turned), late) in chunk {
                let e = rest(now);
                let slopes = [(e - rest(turned)) / by_angle, (e - rest(late)) / by_time];
                let row = |x: &[f64; SIZE], slopes: [f64; 2]| {
                    let mut row = [0.0; ALL];
                    row[..SIZE].copy_from_slice(x);
                    row[SIZE..].copy_from_slice(&slopes);
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

    /// Gradients of R, L_d, L_q, psi_M, u_dead and i_zero.
    fn gradients(&self, p: &DVector<f64>) -> Vec<DVector<f64>> {
        let unit = |at: &[usize]| DVector::from_fn(ALL, |k, _| if at.contains(&k) { 1.0 } else { 0.0 });
        let mut gradients: Vec<_> = [&[0][..], &[1], &[2], &[3], &[4, 5, 6]].map(unit).to_vec();
        // i_zero = 2 sum c_j / sum(c_j / i_xj).
        let slope: f64 = CURVE.map(|k| p[k] / self.bends[k - CURVE.start]).sum();
        let u_dead: f64 = CURVE.map(|k| p[k]).sum();
        let curve = |k: usize| 2.0 / slope * (1.0 - u_dead / slope / self.bends[k - CURVE.start]);
        gradients.push(DVector::from_fn(ALL, |k, _| if CURVE.contains(&k) { curve(k) } else { 0.0 }));
        gradients
    }

    fn judged(&self, solved: &Solved, theta_0: f64, tau: f64) -> Option<Fit> {
        let blocks = self.blocks(solved, theta_0, tau);
        let half = interval::half_widths(&blocks, &self.gradients(&solved.p))?;
        let p: [f64; SIZE] = std::array::from_fn(|k| solved.p[k]);
        let windows = solved.windows.len() as f64;
        let time = self.length();
        let taken = p[1] * p[1] * solved.noise[0] + p[2] * p[2] * solved.noise[1];
        let noise = self.record.sigma * (p[1] * p[1] + p[2] * p[2]).sqrt() / time;
        Some(Fit {
            p,
            form: self.form,
            theta_0,
            tau,
            half: std::array::from_fn(|k| half[k]),
            condition: solved.condition,
            // The noise subtracted from the normal matrix remains as well.
            rest: ((solved.squares / windows + taken).max(0.0)).sqrt() / time,
            noise,
            bends: self.bends,
        })
    }
}

/// The linear fit at one offset and delay of the angle.
struct Solved {
    p: DVector<f64>,
    squares: f64,
    /// Normal matrix without the noise.
    sums: Sums,
    condition: f64,
    windows: Vec<Window>,
    /// Square of the noise subtracted from the diagonal entries of both inductances, per window.
    noise: [f64; 2],
}

fn solved(sums: &Sums) -> Option<DVector<f64>> {
    interval::solve(&sums.matrix, &sums.score)
}

fn dot(x: &[f64; SIZE], p: &DVector<f64>) -> f64 {
    x.iter().zip(p.iter()).map(|(x, p)| x * p).sum()
}
