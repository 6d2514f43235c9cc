//! Uncertainty of a least-squares result: the greater of a sandwich estimate over blocks of rows and a jackknife over stretches
//! of time. The first covers noise, the second model errors: without it, errors reached 8 half-widths.

use nalgebra::{DMatrix, DVector};

/// Stretches of time that the jackknife omits, one at a time.
const STRETCHES: usize = 8;

/// The jackknife's spread is a little too narrow with 8 stretches: the factor of Student's distribution.
const STUDENT: f64 = 1.18;

/// Sums over one block of rows: the normal matrix and the score, which add up to zero over all blocks.
#[derive(Clone, Debug)]
pub struct Sums {
    /// Normal matrix of the block.
    pub matrix: DMatrix<f64>,
    /// Gradient of the block's squares, times -1/2.
    pub score: DVector<f64>,
}

impl Sums {
    /// Sums without a row.
    pub fn new(size: usize) -> Self {
        Self { matrix: DMatrix::zeros(size, size), score: DVector::zeros(size) }
    }

    /// Leaves parameters out: they stay 0.
    pub fn leave_out(&mut self, out: impl Fn(usize) -> bool) {
        for k in (0..self.score.len()).filter(|&k| out(k)) {
            self.matrix.fill_row(k, 0.0);
            self.matrix.fill_column(k, 0.0);
            self.score[k] = 0.0;
        }
    }

    /// Adds a row of regressors with its residual.
    pub fn add(&mut self, row: &[f64], rest: f64) {
        for (a, x) in row.iter().enumerate() {
            self.score[a] += x * rest;
            for (b, y) in row.iter().enumerate() {
                self.matrix[(a, b)] += x * y;
            }
        }
    }
}

/// Half-widths (95 %) of linear combinations of the parameters, each given by its gradient; `None` where the normal matrix is
/// singular.
pub fn half_widths(blocks: &[Sums], gradients: &[DVector<f64>]) -> Option<Vec<f64>> {
    let size = blocks.first()?.score.len();
    let all = blocks.iter().fold(DMatrix::zeros(size, size), |sum, b| sum + &b.matrix);
    let inverse = scaled_inverse(&all)?;
    let scores = blocks.iter().fold(DMatrix::zeros(size, size), |sum, b| sum + &b.score * b.score.transpose());
    let sandwich = &inverse * scores * &inverse;
    let mut without = Vec::new();
    // Parameters that a single stretch determines.
    let mut lost = vec![false; size];
    for stretch in blocks.chunks(blocks.len().div_ceil(STRETCHES)) {
        let matrix = stretch.iter().fold(all.clone(), |sum, b| sum - &b.matrix);
        let score = stretch.iter().fold(DVector::zeros(size), |sum, b| sum - &b.score);
        lost.iter_mut().zip(matrix.diagonal().iter()).for_each(|(lost, x)| *lost |= *x <= 0.0);
        without.push(scaled_inverse(&matrix)? * score);
    }
    let count = without.len() as f64;
    let middle = without.iter().fold(DVector::zeros(size), |sum, x| sum + x) / count;
    let one = |g: &DVector<f64>| {
        if g.iter().zip(&lost).any(|(g, lost)| *g != 0.0 && *lost) {
            return f64::INFINITY;
        }
        let noise = (g.transpose() * &sandwich * g)[0].max(0.0).sqrt();
        let squares: f64 = without.iter().map(|x| g.dot(&(x - &middle)).powi(2)).sum();
        2.0 * noise.max(STUDENT * ((count - 1.0) / count * squares).sqrt())
    };
    Some(gradients.iter().map(one).collect())
}

/// Inverse of a normal matrix, scaled to a diagonal of ones meanwhile.
fn scaled_inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let (scaled, scale) = scaled(matrix);
    Some(&scale * scaled.try_inverse()? * &scale)
}

/// A normal matrix with a diagonal of ones, and the scale. A parameter without information in any row has only zeros in its row
/// and column, except a 1 on the diagonal: it stays 0.
fn scaled(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let scale = matrix.diagonal().map(|x| if x > 0.0 { 1.0 / x.sqrt() } else { 0.0 });
    let scale = DMatrix::from_diagonal(&scale);
    let mut scaled = &scale * matrix * &scale;
    for k in (0..scaled.nrows()).filter(|&k| scale[(k, k)] == 0.0) {
        scaled[(k, k)] = 1.0;
    }
    (scaled, scale)
}

/// Solves a normal matrix, scaled to a diagonal of ones meanwhile.
pub fn solve(matrix: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    Some(scaled_inverse(matrix)? * right)
}

/// Condition number of a normal matrix with a diagonal of ones.
pub fn condition(matrix: &DMatrix<f64>) -> f64 {
    let values = scaled(matrix).0.symmetric_eigenvalues();
    let least = values.min();
    if least > 0.0 { values.max() / least } else { f64::INFINITY }
}
