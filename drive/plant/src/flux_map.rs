//! The machine as a map of its flux linkage: the current is the gradient of one energy.
//!
//! ```text
//! w(x, q)  = sum of w[m][n] B_m(x) B_n(q)          x = psi_d - psi_M, q = psi_q
//! i_d, i_q = dw/dx, dw/dq                          energy = 1.5 (w - w(0, 0))
//! ```
//!
//! B are the cubic B-splines on a uniform grid (de Boor, A Practical Guide to Splines, 1978), so the current has a continuous
//! derivative. A current with an energy is reciprocal, d i_d/d psi_q = d i_q/d psi_d: no cycle yields energy, for any
//! coefficients. w is even in q: coefficients for q >= 0 suffice. Beyond the grid, the splines continue with constant
//! curvature: the incremental inductances stay those of the edge.
//!
//! Limits: the map describes a machine where its Hessian, the inverse of the incremental inductances, is positive definite; this
//! is checked at all knots. It is valid for one temperature: with another psi_M, the map moves along the d-axis. The effect of
//! the rotor angle (slots, harmonics) is not part of it. `fmu tune` fits the coefficients to a table. Flux linkages in Wb, w in
//! J.

use drive_base::frame::{Dq, Rotor, Vector};
use drive_base::motor::Motor;
use fmu_core::unit::{JOULE, WEBER};
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Coefficients along the d-axis.
pub const D: usize = 12;

/// Coefficients along the q-axis, for q >= 0.
pub const Q: usize = 9;

/// Grid intervals along the d-axis, and along the q-axis from 0 on.
const INTERVALS: [usize; 2] = [D - 3, Q - 2];

/// Parameters; not used at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FluxMap {
    /// The map determines the current, instead of inductances and saturation.
    pub used: bool,
    /// Minimum d-axis flux linkage of the grid in Wb, relative to the magnet's, < 0.
    pub d_min: f64,
    /// Maximum in Wb, > 0.
    pub d_max: f64,
    /// Maximum q-axis flux linkage of the grid in Wb, > 0.
    pub q_max: f64,
    /// Coefficients in J; the q-axis varies fastest.
    pub w: [[f64; Q]; D],
}

impl Default for FluxMap {
    fn default() -> Self {
        Self { used: false, d_min: -0.3, d_max: 0.3, q_max: 0.3, w: [[0.0; Q]; D] }
    }
}

/// The four nonzero splines of an interval with their first and second derivatives, and the index of the first.
struct Splines<S> {
    first: usize,
    value: [S; 4],
    slope: [S; 4],
    curvature: [S; 4],
}

impl<S: Scalar> Splines<S> {
    /// At `s` grid intervals from the first knot of `intervals` of them.
    #[inline]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "a few intervals"
    )]
    fn at(s: S, intervals: usize) -> Self {
        let first = s.value().clamp(0.0, (intervals - 1) as f64) as usize;
        let t = s - S::from(first as f64);
        // Outside the grid, the second derivatives keep their values at the edge.
        let edge = t.value().clamp(0.0, 1.0);
        let beyond = t - S::from(edge);
        let t = if beyond.value() == 0.0 { t } else { S::from(edge) };
        let beyond = if beyond.value() == 0.0 { S::from(0.0) } else { beyond };
        let c = |x: f64| S::from(x);
        let r = c(1.0) - t;
        let mut value = [
            r * r * r * (1.0 / 6.0),
            ((t - c(2.0)) * t * t * 3.0 + c(4.0)) * (1.0 / 6.0),
            ((r - c(2.0)) * r * r * 3.0 + c(4.0)) * (1.0 / 6.0),
            t * t * t * (1.0 / 6.0),
        ];
        let mut slope = [r * r * -0.5, (t * 1.5 - c(2.0)) * t, (c(2.0) - r * 1.5) * r, t * t * 0.5];
        let curvature = [r, t * 3.0 - c(2.0), r * 3.0 - c(2.0), t];
        for k in 0..4 {
            value[k] += (slope[k] + curvature[k] * beyond * 0.5) * beyond;
            slope[k] += curvature[k] * beyond;
        }
        Self { first, value, slope, curvature }
    }
}

impl FluxMap {
    /// Grid intervals in Wb.
    #[inline]
    #[expect(clippy::cast_precision_loss, reason = "a few intervals")]
    fn interval(&self) -> [f64; 2] {
        [(self.d_max - self.d_min) / INTERVALS[0] as f64, self.q_max / INTERVALS[1] as f64]
    }

    /// The splines at `x` (Wb) for the d-axis and, at |q|, for the q-axis, and the sign of q.
    #[inline]
    fn splines<S: Scalar>(&self, x: Vector<Rotor, S>) -> ([Splines<S>; 2], f64) {
        let ([d, q], sign) = (self.interval(), if x.q().value() < 0.0 { -1.0 } else { 1.0 });
        let along_d = (x.d() - S::from(self.d_min)) * (1.0 / d);
        ([Splines::at(along_d, INTERVALS[0]), Splines::at(x.q() * (sign / q), INTERVALS[1])], sign)
    }

    /// The sum of the coefficients weighted with these values of the splines.
    #[inline]
    fn sum<S: Scalar>(&self, [d, q]: &[Splines<S>; 2], by_d: &[S; 4], by_q: &[S; 4]) -> S {
        let mut sum = S::from(0.0);
        for (m, by_d) in by_d.iter().enumerate() {
            let row = &self.w[d.first + m];
            // The coefficient on the left of q = 0 equals that on the right.
            let coefficient = |n: usize| row[(q.first + n).abs_diff(1)];
            let along_q = by_q[0] * coefficient(0)
                + by_q[1] * coefficient(1)
                + by_q[2] * coefficient(2)
                + by_q[3] * coefficient(3);
            sum += along_q * *by_d;
        }
        sum
    }

    /// The current (A) at the flux linkage `x` (Wb) in excess of the magnet's.
    #[inline]
    pub fn current<S: Scalar>(&self, x: Vector<Rotor, S>) -> Vector<Rotor, S> {
        let (splines, sign) = self.splines(x);
        let ([d, q], [h_d, h_q]) = (&splines, self.interval());
        let i_d = self.sum(&splines, &d.slope, &q.value) * (1.0 / h_d);
        Vector::new(i_d, self.sum(&splines, &d.value, &q.slope) * (sign / h_q))
    }

    /// The energy (J) at the flux linkage `x` (Wb) in excess of the magnet's: 1.5 times the integral of i d psi from there.
    pub fn energy(&self, x: Dq) -> f64 {
        let w = |x| {
            let (splines, _) = self.splines(x);
            self.sum(&splines, &splines[0].value, &splines[1].value)
        };
        1.5 * (w(x) - w(Dq::ZERO))
    }

    /// d i_d / d psi_d, d i_d / d psi_q and d i_q / d psi_q (1/H) at the flux linkage `x` (Wb) in excess of the magnet's: the
    /// inverse of the incremental inductances.
    pub fn hessian(&self, x: Dq) -> [f64; 3] {
        let (splines, sign) = self.splines(x);
        let ([d, q], [h_d, h_q]) = (&splines, self.interval());
        let dd = self.sum(&splines, &d.curvature, &q.value) / (h_d * h_d);
        let dq = self.sum(&splines, &d.slope, &q.slope) * sign / (h_d * h_q);
        [dd, dq, self.sum(&splines, &d.value, &q.curvature) / (h_q * h_q)]
    }

    /// Whether the flux linkage `x` (Wb) in excess of the magnet's is on the grid.
    #[inline]
    pub fn holds(&self, x: Dq) -> bool {
        (self.d_min..=self.d_max).contains(&x.d()) && x.q().abs() <= self.q_max
    }

    /// The knots of the grid in Wb, for q >= 0.
    #[expect(clippy::cast_precision_loss, reason = "a few intervals")]
    pub fn knots(&self) -> impl Iterator<Item = Dq> {
        let ([d, q], d_min) = (self.interval(), self.d_min);
        let along_d = (0..=INTERVALS[0]).map(move |m| d_min + d * m as f64);
        along_d.flat_map(move |x| (0..=INTERVALS[1]).map(move |n| Dq::new(x, q * n as f64)))
    }

    /// The smallest incremental inductance (H) over all directions and knots.
    pub fn least_inductance(&self) -> f64 {
        1.0 / self.knots().map(|x| eigenvalues(self.hessian(x))[1]).fold(0.0, f64::max)
    }

    /// The smallest eigenvalue (1/H) of the Hessian at the flux linkage `x` (Wb) in excess of the magnet's: the inverse of the
    /// maximum incremental inductance.
    pub fn least_curvature(&self, x: Dq) -> f64 {
        eigenvalues(self.hessian(x))[0]
    }

    /// The first knot (Wb beyond the magnet's flux linkage) at which more flux needs less current in some direction.
    pub fn flaw(&self) -> Option<Dq> {
        // The maximum of a NaN and 0 is 0.
        self.knots().find(|&x| self.least_curvature(x).max(0.0) == 0.0)
    }
}

/// The eigenvalues of a symmetric matrix, the smaller one first.
fn eigenvalues([a, b, c]: [f64; 3]) -> [f64; 2] {
    let (middle, radius) = (0.5 * (a + c), (0.25 * (a - c) * (a - c) + b * b).sqrt());
    [middle - radius, middle + radius]
}

/// Effect of 1 J of a coefficient at a point, for a fit.
#[derive(Clone, Copy, Debug)]
pub struct Contribution {
    /// Index of the coefficient; the q-axis varies fastest.
    pub place: usize,
    /// Current in A.
    pub current: Dq,
    /// Entries of the [`FluxMap::hessian`] in 1/H.
    pub hessian: [f64; 3],
}

/// The contributions of all coefficients with an effect at the flux linkage `x` (Wb) in excess of the magnet's.
pub fn contributions(map: &FluxMap, x: Dq) -> Vec<Contribution> {
    let (([d, q], sign), [h_d, h_q]) = (map.splines(x), map.interval());
    let mut all = Vec::with_capacity(16);
    for m in 0..4 {
        for n in 0..4 {
            all.push(Contribution {
                place: (d.first + m) * Q + (q.first + n).abs_diff(1),
                current: Dq::new(d.slope[m] * q.value[n] / h_d, d.value[m] * q.slope[n] * sign / h_q),
                hessian: [
                    d.curvature[m] * q.value[n] / (h_d * h_d),
                    d.slope[m] * q.slope[n] * sign / (h_d * h_q),
                    d.value[m] * q.curvature[n] / (h_q * h_q),
                ],
            });
        }
    }
    all
}

/// The map of a linear machine, on a grid with these limits along the d-axis (Wb beyond the magnet's flux linkage) and up to
/// `q_max` (Wb): splines represent quadratic functions exactly.
#[expect(clippy::cast_precision_loss, reason = "a few intervals")]
pub fn linear(motor: &Motor, [d_min, d_max]: [f64; 2], q_max: f64) -> FluxMap {
    let mut map = FluxMap { used: true, d_min, d_max, q_max, ..FluxMap::default() };
    let [h_d, h_q] = map.interval();
    for (m, row) in map.w.iter_mut().enumerate() {
        for (n, w) in row.iter_mut().enumerate() {
            let (x, q) = (d_min + (m as f64 - 1.0) * h_d, n as f64 * h_q);
            *w = 0.5 * ((x * x - h_d * h_d / 3.0) / motor.L_d + (q * q - h_q * h_q / 3.0) / motor.L_q);
        }
    }
    map
}

type P = Row<FluxMap>;

/// Variables of the map; their owner supplies the prefix `flux_map.`.
pub const FLUX_MAP: &Table<FluxMap> = table![
    P::boolean_parameter(
        "use",
        "A map of the flux linkage gives the current, instead of motor.L_d, motor.L_q and saturation",
        |p| &mut p.used,
    ),
    P::parameter("d_min", &WEBER, "Minimum d-axis flux linkage of the grid, relative to motor.psi_M", |p| &mut p.d_min),
    P::parameter("d_max", &WEBER, "Maximum d-axis flux linkage of the grid, relative to motor.psi_M", |p| {
        &mut p.d_max
    }),
    P::parameter("q_max", &WEBER, "Maximum q-axis flux linkage of the grid", |p| &mut p.q_max),
    P::array_parameter(
        "w",
        &JOULE,
        "B-spline coefficients of the energy whose gradient is the current: 12 along the d-axis times 9 along the \
                 q-axis from 0 on, with the q-axis varying fastest; fmu tune fits them",
        D * Q,
        |p| p.w.as_flattened_mut(),
    ),
];

#[cfg(test)]
#[expect(clippy::cast_precision_loss, reason = "a few intervals")]
mod tests {
    use super::*;
    use fmu_core::Dual;

    /// Coefficients of a machine that saturates in both axes.
    fn bent() -> FluxMap {
        let mut map = FluxMap { used: true, d_min: -0.2, d_max: 0.15, q_max: 0.25, ..FluxMap::default() };
        for m in 0..D {
            for n in 0..Q {
                let (x, q) = (-0.2 + 0.039 * (m as f64 - 1.0), 0.036 * n as f64);
                map.w[m][n] =
                    60.0 * x * x + 40.0 * q * q + 300.0 * x * x * x * x + 90.0 * x * q * q + 500.0 * q.powi(4);
            }
        }
        map
    }

    /// Points on the grid, on its knots and beyond it.
    fn points() -> impl Iterator<Item = Dq> {
        let of = |k: u32, span: f64| span * (f64::from(k) / 7.0 - 0.5);
        (0..8).flat_map(move |m| (0..8).map(move |n| Dq::new(of(m, 0.5), of(n, 0.8))))
    }

    #[test]
    fn the_current_is_the_gradient_of_the_energy() {
        let (map, h) = (bent(), 1e-5);
        assert!(points().any(|x| map.holds(x)) && points().any(|x| !map.holds(x)));
        for x in points() {
            let work = |v: Dq| (map.energy(x + v) - map.energy(x - v)) / (3.0 * h);
            let (d, q) = (Dq::new(h, 0.0), Dq::new(0.0, h));
            let i = map.current(x);
            assert!((work(d) - i.d()).abs() < 1e-6 && (work(q) - i.q()).abs() < 1e-6, "{x:?}: {i:?} A");
            let by = |v: Dq| (map.current(x + v) - map.current(x - v)) * (0.5 / h);
            let [dd, dq, qq] = map.hessian(x);
            let near = |a: f64, b: f64| (a - b).abs() < 1e-3 * (1.0 + b.abs());
            assert!(near(by(d).d(), dd) && near(by(q).q(), qq), "{x:?}");
            assert!(near(by(d).q(), dq) && near(by(q).d(), dq), "{x:?}: reciprocal");
            // As dual numbers.
            let along = map.current(Vector::new(Dual::new(x.d(), 1.0), Dual::new(x.q(), -2.0)));
            let wanted = by(d) - by(q) * 2.0;
            assert!(near(along.d().change, wanted.d()) && near(along.q().change, wanted.q()), "{x:?}");
            let mirrored = map.current(Dq::new(x.d(), -x.q()));
            assert!((mirrored.d() - i.d()).abs() < 1e-12 && (mirrored.q() + i.q()).abs() < 1e-12, "{x:?}");
        }
    }

    #[test]
    fn the_contributions_make_up_the_current() {
        let map = bent();
        for x in points() {
            let weights = map.w.as_flattened();
            let all = contributions(&map, x);
            let current = all.iter().fold(Dq::ZERO, |sum, part| sum + part.current * weights[part.place]);
            assert!((current - map.current(x)).magnitude() < 1e-11, "{x:?}");
            for (k, wanted) in map.hessian(x).into_iter().enumerate() {
                let found: f64 = all.iter().map(|part| part.hessian[k] * weights[part.place]).sum();
                assert!((found - wanted).abs() < 1e-10 * (1.0 + wanted.abs()), "{x:?}");
            }
        }
    }
}
