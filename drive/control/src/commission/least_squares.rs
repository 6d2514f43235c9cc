//! Linear least squares of a fixed number of unknowns by scaled normal equations and Cholesky's factors.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// Smallest pivot of the scaled normal equations: below, the unknowns are not separable.
const PIVOT: f64 = 1e-12;

/// The normal equations A^T A x = A^T y, row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Normal<const P: usize> {
    a: SMatrix<f64, P, P>,
    b: SVector<f64, P>,
    /// Sum of the squares of the right-hand sides.
    y_2: f64,
    rows: f64,
}

impl<const P: usize> Default for Normal<P> {
    fn default() -> Self {
        Self { a: SMatrix::zeros(), b: SVector::zeros(), y_2: 0.0, rows: 0.0 }
    }
}

/// The unknowns, and the half-widths of their 95 % intervals if the residual is white.
pub(super) struct Solution<const P: usize> {
    pub(super) x: [f64; P],
    pub(super) half_width: [f64; P],
    /// Standard errors of the unknowns, divided by the residual's.
    pub(super) spread: [f64; P],
    /// Variance of the residual.
    pub(super) variance: f64,
}

impl<const P: usize> Normal<P> {
    /// Adds the row `x` with the right-hand side `y`.
    pub(super) fn add(&mut self, x: &[f64; P], y: f64) {
        for j in 0..P {
            self.b[j] += x[j] * y;
            for k in 0..P {
                self.a[(j, k)] += x[j] * x[k];
            }
        }
        self.y_2 += y * y;
        self.rows += 1.0;
    }

    /// The unknowns with the share `damping` (Levenberg & Marquardt) added to the diagonal; `None`: not separable.
    /// A column of zeros gives a zero.
    pub(super) fn solve(&self, damping: f64) -> Option<Solution<P>> {
        let scale: [f64; P] = std::array::from_fn(|j| {
            let d = self.a[(j, j)];
            if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 }
        });
        // The lower factor, in place.
        let mut l = SMatrix::<f64, P, P>::zeros();
        for j in 0..P {
            for k in 0..=j {
                let unit = if j == k { if scale[j] > 0.0 { 1.0 + damping } else { 1.0 } } else { 0.0 };
                let a = if j == k { unit } else { self.a[(j, k)] * scale[j] * scale[k] };
                let rest = a - (0..k).map(|m| l[(j, m)] * l[(k, m)]).sum::<f64>();
                if j > k {
                    l[(j, k)] = rest / l[(k, k)];
                } else if rest > PIVOT {
                    l[(j, j)] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        let solve = |right: &dyn Fn(usize) -> f64| {
            let mut x = [0.0; P];
            for j in 0..P {
                x[j] = (right(j) - (0..j).map(|m| l[(j, m)] * x[m]).sum::<f64>()) / l[(j, j)];
            }
            for j in (0..P).rev() {
                x[j] = (x[j] - (j + 1..P).map(|m| l[(m, j)] * x[m]).sum::<f64>()) / l[(j, j)];
            }
            x
        };
        let scaled = solve(&|j| self.b[j] * scale[j]);
        let x: [f64; P] = std::array::from_fn(|j| scaled[j] * scale[j]);
        let unknowns = scale.iter().map(|&s| if s > 0.0 { 1.0 } else { 0.0 }).sum::<f64>();
        let left = (self.y_2 - (0..P).map(|j| x[j] * self.b[j]).sum::<f64>()).max(0.0);
        let variance = left / (self.rows - unknowns).max(1.0);
        let spread: [f64; P] = std::array::from_fn(|j| {
            let column = solve(&|k| if k == j { 1.0 } else { 0.0 });
            column[j].max(0.0).sqrt() * scale[j]
        });
        let half_width = spread.map(|spread| 2.0 * variance.sqrt() * spread);
        Some(Solution { x, half_width, spread, variance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_comes_back_and_an_unused_column_is_zero() {
        let mut normal = Normal::<4>::default();
        for k in 0..20 {
            let x = 0.1 * f64::from(k) - 1.0;
            normal.add(&[1.0, x, x * x, 0.0], 3.0 - 2.0 * x + 0.5 * x * x);
        }
        let Solution { x, half_width, .. } = normal.solve(0.0).unwrap();
        for (x, expected) in x.into_iter().zip([3.0, -2.0, 0.5, 0.0]) {
            assert!((x - expected).abs() < 1e-12, "{x}");
        }
        assert!(half_width.iter().all(|h| *h < 1e-6));
    }

    #[test]
    fn damping_divides_separate_unknowns() {
        let mut normal = Normal::<3>::default();
        normal.add(&[2.0, 0.0, 0.0], 6.0);
        normal.add(&[0.0, 5.0, 0.0], 5.0);
        for (damping, expected) in [(0.0, [3.0, 1.0, 0.0]), (0.5, [2.0, 1.0 / 1.5, 0.0])] {
            let x = normal.solve(damping).unwrap().x;
            assert!(x.iter().zip(expected).all(|(x, expected)| (x - expected).abs() < 1e-12), "{damping}: {x:?}");
        }
    }

    #[test]
    fn columns_that_are_not_separable_have_no_solution() {
        let mut normal = Normal::<2>::default();
        for k in 0..9 {
            normal.add(&[f64::from(k), 2.0 * f64::from(k)], 1.0);
        }
        assert!(normal.solve(0.0).is_none());
    }
}
