//! Converts torque to currents: maximum torque per ampere, or i_d = 0.
//!
//! tau = 1.5 n_p (psi_M + (L_d - L_q) i_d) i_q. With dL = L_q - L_d, the smallest current for a torque satisfies i_d =
//! -dL i_q^2 / (psi_M / 2 + sqrt(psi_M^2 / 4 + (dL i_q)^2)) (Morimoto et al. 1990), so tau = 1.5 n_p i_q (psi_M / 2 +
//! sqrt(psi_M^2 / 4 + (dL i_q)^2)). This function is odd in i_q and convex for i_q > 0; Newton's method solves it from
//! above. Without saliency, i_d = 0.

use crate::limits::Limits;
use drive_base::frame::DqHat;
use drive_base::motor::Motor;

/// Currents (A) of minimum magnitude for the torque `tau` (N.m).
#[inline]
pub fn max_torque_per_ampere(motor: &Motor, tau: f64) -> DqHat {
    let (k, half, dL) = (1.5 * f64::from(motor.n_p), 0.5 * motor.psi_M, motor.L_q - motor.L_d);
    // Magnet or reluctance alone would need more current: the smaller value exceeds the solution by at most a third.
    let mut i_q = (tau / (2.0 * k * half)).abs().min((tau / (k * dL)).abs().sqrt()).copysign(tau);
    for _ in 0..STEPS {
        let root = (half * half + dL * dL * i_q * i_q).sqrt();
        let slope = half + root + dL * dL * i_q * i_q / root;
        i_q -= (i_q * (half + root) - tau / k) / slope;
    }
    along(motor, i_q)
}

/// Newton steps to full precision.
const STEPS: u32 = 4;

/// Currents (A) on that curve for the given i_q (A).
fn along(motor: &Motor, i_q: f64) -> DqHat {
    let (half, dL) = (0.5 * motor.psi_M, motor.L_q - motor.L_d);
    let root = (half * half + dL * dL * i_q * i_q).sqrt();
    DqHat::new(-dL * i_q * i_q / (half + root), i_q)
}

/// Maximum torque in N.m within the limits, on the curve (`mtpa`) or with i_d = 0.
pub fn max_torque(motor: &Motor, limit: &Limits, mtpa: bool) -> f64 {
    let i_q = limit.i_q.min(limit.i);
    let i = if mtpa {
        // |i| = limit.i on the curve: i_d = (psi_M - sqrt(psi_M^2 + 8 (dL i)^2)) / (4 dL), without the division.
        let dL = motor.L_q - motor.L_d;
        let root = (motor.psi_M * motor.psi_M + 8.0 * dL * dL * limit.i * limit.i).sqrt();
        let i_d = -2.0 * dL * limit.i * limit.i / (motor.psi_M + root);
        along(motor, i_q.min((limit.i * limit.i - i_d * i_d).max(0.0).sqrt()))
    } else {
        DqHat::new(0.0, i_q)
    };
    motor.torque(i.d(), i.q()).min(limit.tau)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn salient() -> Motor {
        Motor::IPMSM_2_2_KW
    }

    #[test]
    fn gives_the_torque_with_the_least_current() {
        for motor in [salient(), Motor { psi_M: 0.02, ..salient() }, Motor { L_q: 20e-3, ..salient() }] {
            for tau in [-30.0, -14.0, 0.0, 0.5, 14.0, 30.0] {
                let i = max_torque_per_ampere(&motor, tau);
                assert!((motor.torque(i.d(), i.q()) - tau).abs() < 1e-10, "{tau} N.m: {i:?}");
                for turn in [-1e-3_f64, 1e-3] {
                    let (sin, cos) = turn.sin_cos();
                    let other = motor.torque(i.d() * cos - i.q() * sin, i.d() * sin + i.q() * cos);
                    assert!(other.abs() <= tau.abs() + 1e-12, "{tau} N.m: more torque beside {i:?}");
                }
            }
        }
    }

    #[test]
    fn rated_point_of_the_2_2_kw_machine() {
        let i = max_torque_per_ampere(&salient(), 14.0);
        assert!((i.d() + 0.84).abs() < 0.005 && (i.q() - 5.585).abs() < 0.01, "{i:?}");
    }

    #[test]
    fn the_maximum_torque_is_at_a_limit() {
        let limit = Limits { i_q: 100.0, i: 10.0, tau: 1000.0 };
        let tau = max_torque(&salient(), &limit, true);
        assert!((max_torque_per_ampere(&salient(), tau).magnitude() - 10.0).abs() < 1e-9);
        assert!((max_torque(&salient(), &Limits { tau: 5.0, ..limit.clone() }, true) - 5.0).abs() < 1e-12);
        let i_q = Limits { i_q: 4.0, ..limit };
        assert!((max_torque(&salient(), &i_q, false) - salient().torque(0.0, 4.0)).abs() < 1e-12);
    }
}
