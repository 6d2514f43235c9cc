//! The salient permanent-magnet machine in its rotor frame (Rasmussen (2) for L_d = L_q, Kim & Sul (1) in general).
//!
//! d psi_d/dt = u_d - R_s i_d + w psi_q, d psi_q/dt = u_q - R_s i_q - w psi_d, psi_d = L_d i_d + psi_M, psi_q = L_q
//! i_q, tau_e = 1.5 n_p (psi_d i_q - psi_q i_d); [`saturation`](crate::plant::saturation) adds to the current. The flux
//! linkages are the state, so the equations remain valid when the inductances saturate.

use crate::frame::{Dq, Vector};
use crate::motor::Motor;
use crate::plant::saturation::Saturation;

/// Flux linkage (Wb) for the current `i` (A) without saturation.
#[inline]
pub fn flux(motor: &Motor, i: Dq) -> Dq {
    Dq::new(motor.L_d * i.d() + motor.psi_M, motor.L_q * i.q())
}

/// Current (A) for the flux linkage `psi` (Wb).
#[inline]
pub fn current(motor: &Motor, saturation: &Saturation, psi: Dq) -> Dq {
    let linear = Dq::new((psi.d() - motor.psi_M) * (1.0 / motor.L_d), psi.q() * (1.0 / motor.L_q));
    if saturation.is_none() { linear } else { linear + saturation.current(motor, psi) }
}

/// Derivative of the flux linkage (V) at the voltage `u` (V), the current `i` (A) and the electrical speed `w` (rad/s).
#[inline]
pub fn flux_derivative(motor: &Motor, psi: Dq, u: Dq, i: Dq, w: f64) -> Dq {
    u - i * motor.R_s - psi.turned() * w
}

/// Magnetic energy in J at the flux linkage `psi` (Wb), excluding that of the magnet: 0 without current.
#[inline]
pub fn magnetic_energy(motor: &Motor, saturation: &Saturation, psi: Dq) -> f64 {
    let (x, q) = (psi.d() - motor.psi_M, psi.q());
    0.75 * (x * x / motor.L_d + q * q / motor.L_q) + saturation.energy(motor, psi)
}

/// Electromagnetic torque in N.m from flux linkage (Wb) and current (A), the same in every frame.
#[inline]
pub fn torque<F>(motor: &Motor, psi: Vector<F>, i: Vector<F>) -> f64 {
    1.5 * f64::from(motor.n_p) * psi.cross(i)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_of_magnet_and_reluctance() {
        let motor = Motor { L_q: 9e-3, ..Motor::default() };
        let i = Dq::new(-2.0, 4.0);
        let expected = 1.5 * 3.0 * (0.15 * 4.0 + (6e-3 - 9e-3) * -2.0 * 4.0);
        assert!((torque(&motor, flux(&motor, i), i) - expected).abs() < 1e-14);
        assert!((current(&motor, &Saturation::default(), flux(&motor, i)).q() - 4.0).abs() < 1e-14);
    }

    #[test]
    fn steady_state_voltage() {
        // Kim & Sul (1) with constant currents: u_d = R i_d - w L_q i_q, u_q = R i_q + w (L_d i_d + psi_M).
        let motor = Motor { L_q: 9e-3, ..Motor::default() };
        let (i, w) = (Dq::new(-1.0, 3.0), 200.0);
        let u = Dq::new(-2.0 - w * 9e-3 * 3.0, 2.0 * 3.0 + w * (-6e-3 + 0.15));
        let rest = flux_derivative(&motor, flux(&motor, i), u, i, w);
        assert!(rest.magnitude() < 1e-13, "{rest:?}");
    }
}
