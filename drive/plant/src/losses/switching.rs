//! Switching loss of the inverter: a current from the link in addition to the legs' current.
//!
//! ```text
//! p_sw = E_sw / T_pwm (u_dc / u_sw)^k_sw (|i_a| + |i_b| + |i_c|) / i_sw          i_dc += p_sw / u_dc
//! ```
//!
//! E_sw is turn-on, turn-off and recovery together. With a sinusoidal current of amplitude I, the mean is 3 (2/pi) E_sw /
//! T_pwm (u_dc / u_sw)^k_sw I / i_sw. It causes no voltage. Linear in the current and a power of the voltage: the usual
//! scaling of data-sheet values. With the gates off, and in an active short circuit, nothing switches.

use crate::losses::conduction::Devices;
use drive_base::frame::{Phases, Stator, Vector};
use drive_base::math::{abs, exp, ln};
use fmu_core::Scalar;

/// Loss (W) per ampere of [`magnitudes`], at the DC-link voltage `u_dc` (V) and the PWM period `T_pwm` (s).
pub fn per_ampere<S: Scalar>(devices: &Devices, T_pwm: f64, u_dc: S) -> S {
    let &Devices { E_sw, i_sw, u_sw, k_sw, .. } = devices;
    if E_sw == 0.0 {
        return 0.0.into();
    }
    let (full, x) = (E_sw / T_pwm / i_sw, u_dc.value().max(0.0) / u_sw);
    let power = if x > 0.0 { exp(k_sw * ln(x)) } else { 0.0 };
    let slope = if x > 0.0 { k_sw * power / x } else { k_sw * f64::from(u8::from(k_sw <= 1.0)) };
    u_dc.chain(full * power, full * slope / u_sw)
}

/// The sum of the phase currents' magnitudes (A).
pub fn magnitudes<S: Scalar>(i: Vector<Stator, S>) -> S {
    let Phases { a, b, c } = Phases::from_stator(i);
    abs(a) + abs(b) + abs(c)
}

/// Mean of [`magnitudes`] over a period with a sinusoidal current of amplitude 1 A: 3 (2/pi).
pub const MEAN_OF_MAGNITUDES: f64 = 3.0 * std::f64::consts::FRAC_2_PI;

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "exact numbers")]
mod tests {
    use super::*;
    use drive_base::frame::AlphaBeta;
    use fmu_core::Dual;

    #[test]
    fn the_derivative_is_that_of_the_power_law() {
        let devices = |k_sw| Devices { E_sw: 25e-3, i_sw: 300.0, u_sw: 400.0, k_sw, ..Devices::default() };
        let loss = |k_sw, u_dc| per_ampere(&devices(k_sw), 1e-4, Dual::new(u_dc, 1.0)).change;
        let full = 25e-3 / 1e-4 / 300.0;
        let (got, wanted) = (loss(1.3, 360.0), full * 1.3 * 0.9_f64.powf(0.3) / 400.0);
        assert!((got / wanted - 1.0).abs() < 1e-14, "{got}, not {wanted}");
        // Without a voltage: that of a straight line, 0 of a steeper curve.
        assert_eq!((loss(1.0, 0.0), loss(1.3, 0.0)), (full / 400.0, 0.0));
    }

    #[test]
    fn over_a_period_it_is_the_closed_form() {
        let devices = Devices { E_sw: 25e-3, i_sw: 300.0, u_sw: 400.0, k_sw: 1.3, ..Devices::default() };
        let count = 3600;
        let at = |k: u32| {
            let theta = (0.1 * f64::from(k) + 0.03).to_radians();
            magnitudes(AlphaBeta::new(150.0 * theta.cos(), 150.0 * theta.sin())) * per_ampere(&devices, 1e-4, 360.0)
        };
        let mean = (0..count).map(at).sum::<f64>() / f64::from(count);
        let closed = MEAN_OF_MAGNITUDES * 1e4 * 25e-3 * 0.5 * 0.9_f64.powf(1.3);
        assert!((mean / closed - 1.0).abs() < 1e-5, "{mean} W, not {closed} W");
        assert_eq!(per_ampere(&devices, 1e-4, 0.0), 0.0);
    }
}
