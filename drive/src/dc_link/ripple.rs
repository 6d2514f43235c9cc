//! Ripple current of the DC-link capacitor, from the currents of the machine and the modulation:
//!
//! ```text
//! i_cap,rms = I_rms sqrt(2 m (sqrt 3 / (4 pi) + cos^2 phi (sqrt 3 / pi - 9 m / 16))),  m = 2 |u| / u_dc
//! ```
//!
//! I_rms is the phase current, phi the angle from the current to the voltage: cos phi = p_in / (1.5 |u| |i|). Valid for purely
//! sinusoidal currents and a source without ripple (Kolar); it agrees with switched sine waves to 1e-4. u in V, i in A, p_in
//! in W.

use drive_base::frame::{Stator, Vector};
use fmu_core::Scalar;
use std::f64::consts::PI;

const SQRT_3: f64 = 1.732_050_807_568_877_2;

/// Ripple current (A, rms) with the voltage `u` (V), the current `i` (A) and the power `p_in` (W) of the inverter on a link of
/// `u_dc` (V).
pub fn ripple<S: Scalar>(u: Vector<Stator, S>, i: Vector<Stator, S>, p_in: S, u_dc: S) -> S {
    let (voltage, current) = (u.dot(u), i.dot(i));
    if voltage.value() <= 0.0 || current.value() <= 0.0 || u_dc.value() <= 0.0 {
        return 0.0.into();
    }
    let m = root(voltage) * 2.0 / u_dc;
    let cos = p_in * (1.0 / 1.5);
    let square = cos * cos / (voltage * current);
    let share = square * (m * (-9.0 / 16.0) + S::from(SQRT_3 / PI)) + S::from(SQRT_3 / (4.0 * PI));
    let whole = current * m * share;
    if whole.value() <= 0.0 { 0.0.into() } else { root(whole) }
}

/// The square root of `x` > 0.
fn root<S: Scalar>(x: S) -> S {
    let root = x.value().sqrt();
    x.chain(root, 0.5 / root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::AlphaBeta;

    #[test]
    fn per_ampere_it_is_the_closed_form() {
        for (m, phi, expected) in [(0.3, 0.0_f64, 0.39512), (0.8, 0.5, 0.41557), (1.0, 1.0, 0.36684)] {
            let u = AlphaBeta::new(0.5 * m * 400.0 * phi.cos(), 0.5 * m * 400.0 * phi.sin());
            let found = ripple(u, AlphaBeta::new(1.0, 0.0), 1.5 * u.alpha(), 400.0);
            assert!((found - expected).abs() < 5e-6, "{found}, not {expected}");
        }
        assert!(ripple(AlphaBeta::ZERO, AlphaBeta::new(1.0, 0.0), 0.0, 400.0).abs() < 1e-12);
        assert!(ripple(AlphaBeta::new(1.0, 0.0), AlphaBeta::new(1.0, 0.0), 1.5, 0.0).abs() < 1e-12);
    }
}
