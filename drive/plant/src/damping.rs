//! Integration steps that are long compared with the time constant of a current in the zone of the kinks.
//!
//! In the zone +-`inverter.i_zero`, a leg with dead time acts as a resistance of u_dead / i_zero, 65 Ohm for 6.5 V and 0.1 A.
//! With an inductance of 0.1 mH the current settles in 1.5 us. An explicit method would need steps as short for as long as
//! the current is in the zone, which at light load is most of the time. The exponential method of Cox and Matthews (2002,
//! DOI 10.1006/jcph.2002.6995) solves this part exactly. With D the damping (1/s) of the flux linkage by the legs in the zone
//! and Z = h D:
//!
//! ```text
//! g(x) = d psi/dt (x) + D (x - psi)
//! a = psi + Q g(psi), b = psi + Q g(a), c = a + Q (2 g(b) - g(psi) - D (a - psi)), Q = h/2 phi_1(-Z/2)
//! psi + h (B_1 g(psi) + B_2 (g(a) + g(b)) + B_4 g(c))
//! B_1 = phi_1 - 3 phi_2 + 4 phi_3, B_2 = 2 phi_2 - 4 phi_3, B_4 = 4 phi_3 - phi_2 of -Z
//! phi_3(-z) = 1/6 - z/24 + z^2/120 - ..., phi_2 = 1/2 - z phi_3, phi_1 = 1 - z phi_2
//! ```
//!
//! Without damping this is the classical Runge-Kutta method.

use drive_base::frame::{AlphaBeta, Axis, Rotor};
use drive_base::math::exp;

/// Weights by which a Runge-Kutta step combines the derivatives of its stages.
pub(super) trait Stages {
    /// The flux linkage (Wb) at a stage with the d-axis on `axis`, at a distance of `away` (Wb) from the `start`.
    fn at(&self, start: AlphaBeta, away: AlphaBeta, axis: Axis<Rotor>) -> AlphaBeta;
    /// The derivative g (V) there, with the derivative `rate` (V) of the flux linkage and the electrical speed `w` (rad/s).
    fn beside(&self, rate: AlphaBeta, away: AlphaBeta, axis: Axis<Rotor>, w: f64) -> AlphaBeta;
    /// From the start to the middle of the step.
    fn half(&self, g: AlphaBeta) -> AlphaBeta;
    /// From the start to the fourth stage, with the difference `a` to the second and the derivatives of the first and third.
    fn last(&self, a: AlphaBeta, g_1: AlphaBeta, g_3: AlphaBeta) -> AlphaBeta;
    /// From the start to the end of the step.
    fn whole(&self, g: [AlphaBeta; 4]) -> AlphaBeta;
}

/// The classical Runge-Kutta method with a step of this length in s.
pub(super) struct Classical(pub(super) f64);

impl Stages for Classical {
    #[inline]
    fn at(&self, start: AlphaBeta, away: AlphaBeta, _axis: Axis<Rotor>) -> AlphaBeta {
        start + away
    }

    #[inline]
    fn beside(&self, rate: AlphaBeta, _away: AlphaBeta, _axis: Axis<Rotor>, _w: f64) -> AlphaBeta {
        rate
    }

    #[inline]
    fn half(&self, g: AlphaBeta) -> AlphaBeta {
        g * (0.5 * self.0)
    }

    #[inline]
    fn last(&self, _a: AlphaBeta, _g_1: AlphaBeta, g_3: AlphaBeta) -> AlphaBeta {
        g_3 * self.0
    }

    #[inline]
    fn whole(&self, [g_1, g_2, g_3, g_4]: [AlphaBeta; 4]) -> AlphaBeta {
        (g_1 + (g_2 + g_3) * 2.0 + g_4) * (self.0 * (1.0 / 6.0))
    }
}

/// A 2x2 matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Matrix([[f64; 2]; 2]);

impl Matrix {
    /// With these columns.
    pub(super) fn new(first: AlphaBeta, second: AlphaBeta) -> Self {
        Self([[first.alpha(), second.alpha()], [first.beta(), second.beta()]])
    }

    #[inline]
    fn times(&self, v: AlphaBeta) -> AlphaBeta {
        let [[a, b], [c, d]] = self.0;
        AlphaBeta::new(a * v.alpha() + b * v.beta(), c * v.alpha() + d * v.beta())
    }

    /// The eigenvalues, real and not negative, the larger one first.
    fn eigenvalues(&self) -> [f64; 2] {
        let [[a, b], [c, d]] = self.0;
        let (half, determinant) = (0.5 * (a + d), a * d - b * c);
        let larger = half + (half * half - determinant).max(0.0).sqrt();
        [larger, if larger > 0.0 { (determinant / larger).max(0.0) } else { 0.0 }]
    }

    /// A function of this matrix, from its values at the `eigenvalues`.
    fn function(&self, [x, y]: [f64; 2], [f_x, f_y]: [f64; 2]) -> Self {
        let slope = if x - y > 1e-9 * x { (f_x - f_y) / (x - y) } else { 0.0 };
        let [[a, b], [c, d]] = self.0;
        Self([[f_y + slope * (a - y), slope * b], [slope * c, f_y + slope * (d - y)]])
    }
}

/// [`Stages`] with a damping that is solved exactly.
pub(super) struct Damped {
    /// Flux linkage of the magnet in Wb, and its vector at the start.
    psi_M: f64,
    magnet: AlphaBeta,
    damping: Matrix,
    half: Matrix,
    whole: [Matrix; 3],
}

impl Damped {
    /// Over a step of `h` (s) with the `damping` (1/s) of the flux linkage in excess of the magnet's, `psi_M` (Wb). The magnet
    /// is on `axis` at the start; the eigenvalues of the damping are real and not negative.
    pub(super) fn new(h: f64, damping: Matrix, psi_M: f64, axis: Axis<Rotor>) -> Self {
        let eigenvalues = damping.eigenvalues();
        let [x, y] = eigenvalues.map(|d| phi(d * h));
        let halves = eigenvalues.map(|d| 0.5 * h * phi(0.5 * d * h)[0]);
        let of = |f: fn([f64; 3]) -> f64| damping.function(eigenvalues, [h * f(x), h * f(y)]);
        Self {
            psi_M,
            magnet: axis.along(psi_M),
            damping,
            half: damping.function(eigenvalues, halves),
            whole: [
                of(|[a, b, c]| a - 3.0 * b + 4.0 * c),
                of(|[_, b, c]| 2.0 * b - 4.0 * c),
                of(|[_, b, c]| 4.0 * c - b),
            ],
        }
    }
}

impl Damped {
    /// For the next step, which begins with the magnet on `axis`.
    pub(super) fn from(self, axis: Axis<Rotor>) -> Self {
        Self { magnet: axis.along(self.psi_M), ..self }
    }
}

impl Stages for Damped {
    fn at(&self, start: AlphaBeta, away: AlphaBeta, axis: Axis<Rotor>) -> AlphaBeta {
        start + away + (axis.along(self.psi_M) - self.magnet)
    }

    fn beside(&self, rate: AlphaBeta, away: AlphaBeta, axis: Axis<Rotor>, w: f64) -> AlphaBeta {
        rate - axis.along(self.psi_M * w).turned() + self.damping.times(away)
    }

    fn half(&self, g: AlphaBeta) -> AlphaBeta {
        self.half.times(g)
    }

    fn last(&self, a: AlphaBeta, g_1: AlphaBeta, g_3: AlphaBeta) -> AlphaBeta {
        a + self.half.times(g_3 * 2.0 - g_1 - self.damping.times(a))
    }

    fn whole(&self, [g_1, g_2, g_3, g_4]: [AlphaBeta; 4]) -> AlphaBeta {
        let [first, middle, last] = &self.whole;
        first.times(g_1) + middle.times(g_2 + g_3) + last.times(g_4)
    }
}

/// phi_1, phi_2, phi_3 of -`z`, z >= 0.
fn phi(z: f64) -> [f64; 3] {
    if z > 1.0 {
        let first = (1.0 - exp(-z)) / z;
        let second = (1.0 - first) / z;
        return [first, second, (0.5 - second) / z];
    }
    // 1/3! (1 - z/4 (1 - z/5 (...))): the first term left out is below 1e-17.
    let series = (4..=18_u32).rev().fold(1.0, |rest, n| 1.0 - z / f64::from(n) * rest);
    let third = series / 6.0;
    let second = 0.5 - z * third;
    [1.0 - z * second, second, third]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_phi_functions_are_their_definitions() {
        // phi_k(-z) = 1/k! - z phi_k+1(-z), phi_0 = e^-z; both branches and the point between them.
        for z in [0.0, 1e-9, 0.1, 0.999_999, 1.000_001, 5.0, 40.0, 1e6_f64] {
            let [first, second, third] = phi(z);
            assert!((1.0 - z * first - (-z).exp()).abs() < 2e-15 * (1.0 + z), "{z}");
            assert!((1.0 - z * second - first).abs() < 2e-15 * (1.0 + z), "{z}");
            assert!((0.5 - z * third - second).abs() < 2e-15 * (1.0 + z), "{z}");
        }
        assert!((phi(0.0)[2] - 1.0 / 6.0).abs() < 1e-17 && (phi(1e-4)[2] - 1.0 / 6.0 + 1e-4 / 24.0).abs() < 1e-10);
    }

    /// x after 1 s of x' = -D x + (cos t, sin t), in `n` steps, with the damping `known` to the method.
    fn end(matrix: Matrix, known: Option<Matrix>, n: u32) -> AlphaBeta {
        fn run(stages: &impl Stages, matrix: Matrix, h: f64, n: u32) -> AlphaBeta {
            let mut x = AlphaBeta::new(1.0, -0.5);
            for k in 0..n {
                let t = h * f64::from(k);
                let rate = |t: f64, x| AlphaBeta::new(t.cos(), t.sin()) - matrix.times(x);
                let g = |t, away| stages.beside(rate(t, x + away), away, Axis::default(), 0.0);
                let g_1 = g(t, AlphaBeta::ZERO);
                let a = stages.half(g_1);
                let g_2 = g(t + 0.5 * h, a);
                let b = stages.half(g_2);
                let g_3 = g(t + 0.5 * h, b);
                let c = stages.last(a, g_1, g_3);
                let g_4 = g(t + h, c);
                x += stages.whole([g_1, g_2, g_3, g_4]);
            }
            x
        }
        let h = 1.0 / f64::from(n);
        match known {
            Some(damping) => run(&Damped::new(h, damping, 0.0, Axis::default()), matrix, h, n),
            None => run(&Classical(h), matrix, h, n),
        }
    }

    #[test]
    fn the_order_is_four_and_strong_damping_needs_no_short_steps() {
        let weak = Matrix([[1.94, 0.5], [0.1, 2.94]]);
        let exact = end(weak, None, 4000);
        let error = |known, n| (end(weak, known, n) - exact).magnitude();
        for known in [None, Some(weak), Some(Matrix([[1.0, 0.0], [0.0, 1.0]]))] {
            let ratio = error(known, 10) / error(known, 20);
            assert!((12.0..22.0).contains(&ratio), "halving the step divides the error by {ratio}");
        }
        // Time constants of 0.1 and 50 us: with steps of 10 ms the quasi-steady solution.
        let strong = Matrix([[1e7, 1e6], [2e3, 2e4]]);
        let error = (end(strong, Some(strong), 100) - end(strong, Some(strong), 3000)).magnitude();
        assert!(error < 1e-9, "{error}");
        let [x, y] = strong.eigenvalues();
        let [[a, b], [c, d]] = strong.0;
        let (t, s) = (1.0_f64.cos(), 1.0_f64.sin());
        let steady = AlphaBeta::new((d * t - b * s) / (x * y), (a * s - c * t) / (x * y));
        assert!((end(strong, Some(strong), 100) - steady).magnitude() < 1e-8);
    }
}
