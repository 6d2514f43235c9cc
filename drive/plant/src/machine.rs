//! The salient permanent-magnet machine in its rotor frame (Rasmussen (2) for L_d = L_q, Kim & Sul (1) in general).
//!
//! d psi_d/dt = u_d - R_s i_d + w psi_q, d psi_q/dt = u_q - R_s i_q - w psi_d, psi_d = L_d i_d + psi_M, psi_q = L_q
//! i_q, tau_e = 1.5 n_p (psi_d i_q - psi_q i_d); [`saturation`](crate::saturation) adds to the current. The flux
//! linkages are the state, so the equations remain valid when the inductances saturate.

use crate::saturation::Saturation;
use drive_base::frame::{AlphaBeta, Axis, Dq, Rotor, Stator, Vector};
use drive_base::math::reciprocal;
use drive_base::motor::Motor;
use fmu_core::Scalar;
use serde::{Deserialize, Serialize};

/// Flux linkage (Wb) for the current `i` (A) without saturation.
#[inline]
pub fn flux<S: Scalar>(motor: &Motor<S>, i: Vector<Rotor, S>) -> Vector<Rotor, S> {
    Vector::new(i.d() * motor.L_d + motor.psi_M, i.q() * motor.L_q)
}

/// Current (A) for the flux linkage `psi` (Wb).
#[inline]
pub fn current(motor: &Motor, saturation: &Saturation, psi: Dq) -> Dq {
    Machine::new(motor, saturation).current(psi)
}

/// Magnetic energy in J at the flux linkage `psi` (Wb), excluding that of the magnet: 0 without current.
#[inline]
pub fn magnetic_energy(motor: &Motor, saturation: &Saturation, psi: Dq) -> f64 {
    let (x, q) = (psi.d() - motor.psi_M, psi.q());
    0.75 * (x * x / motor.L_d + q * q / motor.L_q) + saturation.energy(motor, psi)
}

/// The reciprocals of the inductances in 1/H.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inverse {
    d: f64,
    q: f64,
}

impl Inverse {
    /// Of this machine.
    #[inline]
    pub fn of<S>(motor: &Motor<S>) -> Self {
        Self { d: reciprocal(motor.L_d), q: reciprocal(motor.L_q) }
    }
}

/// The machine with constants for many evaluations.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a, S = f64> {
    motor: &'a Motor<S>,
    /// `None` for a linear machine.
    saturation: Option<&'a Saturation>,
    psi_M: S,
    R_s: S,
    by_L_d: f64,
    by_L_q: f64,
    /// 1.5 n_p.
    torque: f64,
}

impl<'a, S: Scalar> Machine<'a, S> {
    /// From the parameters.
    #[inline]
    pub fn new(motor: &'a Motor<S>, saturation: &'a Saturation) -> Self {
        Self::with(motor, saturation, Inverse::of(motor))
    }

    /// With the reciprocals at hand.
    #[inline]
    pub fn with(motor: &'a Motor<S>, saturation: &'a Saturation, Inverse { d, q }: Inverse) -> Self {
        let Motor { n_p, R_s, psi_M, .. } = *motor;
        let saturation = (!saturation.is_none()).then_some(saturation);
        Self { motor, saturation, psi_M, R_s, by_L_d: d, by_L_q: q, torque: 1.5 * f64::from(n_p) }
    }

    /// Current (A) for the flux linkage `psi` (Wb).
    #[inline]
    pub fn current(&self, psi: Vector<Rotor, S>) -> Vector<Rotor, S> {
        let linear = Vector::new((psi.d() - self.psi_M) * self.by_L_d, psi.q() * self.by_L_q);
        self.saturation.map_or(linear, |saturation| linear + saturation.current(self.motor, psi))
    }

    /// Resistance (Ohm) of the stator.
    #[inline]
    pub fn resistance(&self) -> S {
        self.R_s
    }

    /// Derivative of the flux linkage (V) in stator axes at the voltage `u` (V) and the current `i` (A).
    #[inline]
    pub fn flux_derivative(&self, u: Vector<Stator, S>, i: Vector<Stator, S>) -> Vector<Stator, S> {
        u - i.scaled(self.R_s)
    }

    /// Copper loss in W at the current `i` (A).
    #[inline]
    pub fn copper_loss(&self, i: Vector<Stator, S>) -> S {
        i.dot(i) * (self.R_s * 1.5)
    }

    /// Electromagnetic torque in N.m at the flux linkage `psi` (Wb) and the current `i` (A).
    #[inline]
    pub fn torque<T: Scalar>(&self, psi: Vector<Rotor, T>, i: Vector<Rotor, T>) -> T {
        psi.cross(i) * self.torque
    }
}

impl Machine<'_> {
    /// Flux linkage (Wb) in stator axes with the magnet on `axis`. The part of the magnet is transformed separately, both
    /// ways, so that a machine without current has none after a transformation either.
    #[inline]
    pub fn to_stator(&self, axis: Axis<Rotor>, psi: Dq) -> AlphaBeta {
        axis.to_stator(psi - Dq::new(self.psi_M, 0.0)) + axis.along(self.psi_M)
    }

    /// The inverse of [`to_stator`](Self::to_stator).
    #[inline]
    pub fn from_stator(&self, axis: Axis<Rotor>, psi: AlphaBeta) -> Dq {
        axis.from_stator(psi - axis.along(self.psi_M)) + Dq::new(self.psi_M, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_of_magnet_and_reluctance() {
        let motor = Motor { L_q: 9e-3, ..Motor::default() };
        let i = Dq::new(-2.0, 4.0);
        let expected = 1.5 * 3.0 * (0.15 * 4.0 + (6e-3 - 9e-3) * -2.0 * 4.0);
        let (linear, psi) = (Saturation::default(), flux(&motor, i));
        assert!((Machine::new(&motor, &linear).torque(psi, i) - expected).abs() < 1e-14);
        assert!((current(&motor, &linear, psi).q() - 4.0).abs() < 1e-14);
    }

    #[test]
    fn steady_state_voltage() {
        // Kim & Sul (1) with constant currents: u_d = R i_d - w L_q i_q, u_q = R i_q + w (L_d i_d + psi_M).
        let motor = Motor { L_q: 9e-3, ..Motor::default() };
        let (i, w) = (Dq::new(-1.0, 3.0), 200.0);
        let u = Dq::new(-2.0 - w * 9e-3 * 3.0, 2.0 * 3.0 + w * (-6e-3 + 0.15));
        let (linear, axis, psi) = (Saturation::default(), Axis::<Rotor>::at(0.4), flux(&motor, i));
        // In stator axes, the flux linkage turns with the rotor.
        let machine = Machine::new(&motor, &linear);
        let rest = machine.flux_derivative(axis.to_stator(u), axis.to_stator(i)) - axis.to_stator(psi.turned() * w);
        assert!(rest.magnitude() < 1e-13, "{rest:?}");
    }
}
