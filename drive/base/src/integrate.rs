//! The classical fourth-order Runge-Kutta method (Kutta 1901) for a small fixed-size state.

use nalgebra::SVector;

/// One step of `h` (s) of `dx/dt = f(x)`; the error of one step is of order h^5.
#[inline]
pub fn rk4<const N: usize>(
    x: SVector<f64, N>,
    h: f64,
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, N>,
) -> SVector<f64, N> {
    let k_1 = f(&x);
    let k_2 = f(&(x + k_1 * (0.5 * h)));
    let k_3 = f(&(x + k_2 * (0.5 * h)));
    let k_4 = f(&(x + k_3 * h));
    x + (k_1 + (k_2 + k_3) * 2.0 + k_4) * (h / 6.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    /// Largest error of the harmonic oscillator over one second with steps of 1/n.
    fn error(n: u32) -> f64 {
        let h = 1.0 / f64::from(n);
        let mut x = Vector2::new(1.0, 0.0);
        for _ in 0..n {
            x = rk4(x, h, |x| Vector2::new(-3.0 * x[1], 3.0 * x[0]));
        }
        (x[0] - 3.0_f64.cos()).abs().max((x[1] - 3.0_f64.sin()).abs())
    }

    #[test]
    fn order_is_four() {
        let ratio = error(50) / error(100);
        assert!((ratio - 16.0).abs() < 1.0, "halving the step divides the error by 16, not {ratio}");
    }
}
