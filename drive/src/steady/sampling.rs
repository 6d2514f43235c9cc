//! Effect of a voltage that is constant over a sample period, while the rotor turns by x = w T_s.
//!
//! The controller measures the currents at its samples, between which the flux linkage in stator axes moves on a straight
//! line instead of a circle. Without resistance, the mean of the flux linkage in rotor axes is
//!
//! ```text
//! psi = s^2 psi_sample,  u = s w psi_sample,  s = sin(x/2) / (x/2)
//! ```
//!
//! so the voltage and the mean are lower than at the samples by x^2/24 and x^2/12: 0.4 and 0.8 % for x = 0.31, 10 000 rpm
//! with three pole pairs and 0.1 ms. The mean current is lower along the flux linkage, and so is the torque. The current of the
//! iron follows the voltage: at a sample, at the end of the period, it is s G j w psi_sample e^(-jx/2).
//!
//! Between the samples, the flux linkage differs from its mean by r psi, with r = x^2/8 (1 - (2t/T_s)^2) minus its mean; the
//! mean of r^2 is (4/45) (x^2/8)^2. The corresponding current adds copper loss: 2 % in an idle machine without saliency that
//! turns by 0.35 rad in a period. Derived here.

use drive_base::math::sin_cos_small;

/// Maximum x at which the drive works; above, the factors stay constant.
const MAX_TURN: f64 = 2.0;

/// The factors for a rotation by x per sample period.
#[derive(Clone, Copy, Debug)]
pub(super) struct HeldVoltage {
    /// s.
    pub(super) share: f64,
    /// s e^(-jx/2).
    pub(super) late: [f64; 2],
    /// Mean of r^2.
    pub(super) ripple: f64,
}

impl HeldVoltage {
    /// No sampling.
    pub(super) const NOT: Self = Self { share: 1.0, late: [1.0, 0.0], ripple: 0.0 };

    /// For x in rad.
    #[inline]
    pub(super) fn new(x: f64) -> Self {
        let half = 0.5 * x.clamp(-MAX_TURN, MAX_TURN);
        let (sin, cos) = sin_cos_small(half);
        let share = if half == 0.0 { 1.0 } else { sin / half };
        let bow = 0.5 * half * half;
        Self { share, late: [share * cos, -share * sin], ripple: 4.0 / 45.0 * bow * bow }
    }
}

#[cfg(test)]
mod tests {
    /// The mean of a chord of the circle in the rotating frame.
    #[test]
    fn the_mean_of_a_chord() {
        for x in [1e-3_f64, 0.31, -0.8, 1.9] {
            let count = 2000;
            let at = |k: u32| {
                let t = (f64::from(k) + 0.5) / f64::from(count) - 0.5;
                let ((sin, cos), (chord_sin, chord_cos)) = ((x * t).sin_cos(), (0.5 * x).sin_cos());
                chord_cos * cos + 2.0 * t * chord_sin * sin
            };
            let mean = (0..count).map(at).sum::<f64>() / f64::from(count);
            let super::HeldVoltage { share: s, ripple, .. } = super::HeldVoltage::new(x);
            assert!((s * s - mean).abs() < 1e-6 * x * x, "{x}: {s}");
            let square = (0..count).map(|k| (at(k) - mean) * (at(k) - mean)).sum::<f64>() / f64::from(count);
            assert!((ripple / square - 1.0).abs() < 1e-5 + 0.3 * x * x, "{x}: {ripple}, not {square}");
        }
    }
}
