//! The coefficients of a flux map by weighted least squares.

use drive::frame::Dq;
use drive::plant::flux_map::{D, FluxMap, Q, contributions};
use nalgebra::{DMatrix, DVector};

/// A point of the table: current (A) and flux linkage (Wb).
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub(super) i: Dq,
    pub(super) psi: Dq,
}

/// Weight of the third differences, as a share of the mean weight of the table's points in a coefficient.
const SMOOTHNESS: f64 = 1e-5;

/// Weight of an equation for the incremental inductance where there are no points, as a share of the weight of a point.
const CONVEXITY: f64 = 1e-3;

/// Factors of a third difference.
const BINOMIAL: [f64; 4] = [-1.0, 3.0, -3.0, 1.0];

/// Maximum number of rounds that add such equations.
const ROUNDS: u32 = 40;

/// Coefficients by weighted least squares, with the normal equations.
struct Squares {
    normal: DMatrix<f64>,
    right: DVector<f64>,
}

impl Squares {
    const N: usize = D * Q;

    fn new() -> Self {
        Self { normal: DMatrix::zeros(Self::N, Self::N), right: DVector::zeros(Self::N) }
    }

    /// Adds the equation that these coefficients times these factors are `y`.
    fn add(&mut self, row: &[(usize, f64)], y: f64, weight: f64) {
        for &(a, x) in row {
            self.right[a] += weight * x * y;
            for &(b, z) in row {
                self.normal[(a, b)] += weight * x * z;
            }
        }
    }

    /// Mean weight of a coefficient.
    #[expect(clippy::cast_precision_loss, reason = "a hundred coefficients")]
    fn mean(&self) -> f64 {
        self.normal.trace() / Self::N as f64
    }

    fn solve(&self, map: &mut FluxMap) -> Option<()> {
        map.w.as_flattened_mut().copy_from_slice(self.normal.clone().cholesky()?.solve(&self.right).as_slice());
        Some(())
    }
}

/// The coefficients that minimize the error of the currents and, weakly, the third differences. Where the table has no points
/// and the extrapolation is physically impossible, further equations keep the incremental inductances of the table's edge.
pub(super) fn solve(map: &mut FluxMap, points: &[Point], psi_M: f64) -> Option<()> {
    let (mut squares, magnet) = (Squares::new(), Dq::new(psi_M, 0.0));
    for p in points {
        let all = contributions(map, p.psi - magnet);
        for (part, y) in [(Dq::d as fn(Dq) -> f64, p.i.d()), (Dq::q, p.i.q())] {
            let row: Vec<_> = all.iter().map(|c| (c.place, part(c.current))).collect();
            squares.add(&row, y, 1.0);
        }
    }
    let mean = squares.mean();
    // Third differences along both axes; along the q-axis across 0 too, where the energy is even.
    for m in 0..D {
        for n in 0..Q {
            let difference = |place: &dyn Fn(usize) -> usize| [0, 1, 2, 3].map(|k| (place(k), BINOMIAL[k]));
            if m + 3 < D {
                squares.add(&difference(&|k| (m + k) * Q + n), 0.0, SMOOTHNESS * mean);
            }
            if n + 2 < Q {
                squares.add(&difference(&|k| m * Q + (n + k).abs_diff(1)), 0.0, SMOOTHNESS * mean);
            }
        }
    }
    // The current does not determine the constant of the energy.
    squares.add(&[(0, 1.0)], 0.0, SMOOTHNESS * mean);
    squares.solve(map)?;
    let least = points.iter().map(|p| map.least_curvature(p.psi - magnet)).fold(f64::INFINITY, f64::min);
    for _ in 0..ROUNDS {
        let flawed: Vec<Dq> = map.knots().filter(|&x| map.least_curvature(x) < 0.1 * least).collect();
        if flawed.is_empty() || least <= 0.0 {
            break;
        }
        for x in flawed {
            let [a, b, c] = map.hessian(x);
            // The direction of minimum curvature.
            let angle = 0.5 * (2.0 * b).atan2(a - c) + std::f64::consts::FRAC_PI_2;
            let (sin, cos) = angle.sin_cos();
            let along = |[dd, dq, qq]: [f64; 3]| dd * cos * cos + 2.0 * dq * sin * cos + qq * sin * sin;
            let row: Vec<_> = contributions(map, x).iter().map(|c| (c.place, along(c.hessian))).collect();
            let size: f64 = row.iter().map(|(_, x)| x * x).sum();
            squares.add(&row, least, CONVEXITY * mean / size);
        }
        squares.solve(map)?;
    }
    Some(())
}
