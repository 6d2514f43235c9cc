//! The salient permanent-magnet machine in its rotor frame (Rasmussen (2) for L_d = L_q, Kim & Sul (1) in general).
//!
//! d psi_d/dt = u_d - R_s i_d + w psi_q, d psi_q/dt = u_q - R_s i_q - w psi_d, psi_d = L_d i_d + psi_M, psi_q = L_q
//! i_q, tau_e = 1.5 n_p (psi_d i_q - psi_q i_d); [`saturation`](crate::saturation) adds to the current, or a
//! [`flux_map`](crate::flux_map) gives it. The flux linkages are the state, so the equations remain valid when the
//! inductances saturate.

use crate::flux_map::FluxMap;
use crate::saturation::Saturation;
use drive_base::frame::{Axis, Dq, Rotor, Stator, Vector};
use drive_base::math::reciprocal;
use drive_base::motor::Motor;
use fmu_core::Scalar;
use fmu_core::log::Warnings;
use serde::{Deserialize, Serialize};

/// Flux linkage (Wb) for the current `i` (A) without saturation.
#[inline]
pub fn flux<S: Scalar>(motor: &Motor<S>, i: Vector<Rotor, S>) -> Vector<Rotor, S> {
    Vector::new(i.d() * motor.L_d + motor.psi_M, i.q() * motor.L_q)
}

/// The relation between current and flux linkage.
#[derive(Clone, Copy, Debug)]
pub enum Magnetics<'a> {
    /// By the inductances.
    Linear,
    /// By the inductances and a polynomial.
    Polynomial(&'a Saturation),
    /// By a map.
    Map(&'a FluxMap),
}

impl Magnetics<'_> {
    /// Warns of a flux linkage `psi` (Wb) beyond the map, or one at which the polynomial describes no machine.
    #[cold]
    #[inline(never)]
    pub fn warn(self, motor: &Motor, psi: Dq, log: &mut Warnings<'_>) {
        let (d, q) = (psi.d(), psi.q());
        match self {
            Magnetics::Map(map) if !map.holds(psi - Dq::new(motor.psi_M, 0.0)) => log.warn("flux_map", || {
                format!(
                    "psi_d = {d} Wb, psi_q = {q} Wb is beyond the flux map, which continues with the inductances of its edge; limit the \
                     current, or fit a map to a table with larger currents"
                )
            }),
            Magnetics::Polynomial(saturation) if !is_stable(saturation.slope(motor, psi)) => log.warn("saturation", || {
                format!(
                    "psi_d = {d} Wb, psi_q = {q} Wb: here the saturation (s_2, s_3, s_dq) describes no machine, because more flux needs \
                     less current, and the results are wrong; use coefficients closer to 0, limit the current, or use a flux map"
                )
            }),
            _ => {}
        }
    }
}

/// Whether more flux linkage needs more current in every direction, with this [`slope`].
#[inline]
pub fn is_stable([d, cross, q]: [f64; 3]) -> bool {
    d > 0.0 && d * q > cross * cross
}

/// Current (A) for the flux linkage `psi` (Wb).
#[inline]
pub fn current(motor: &Motor, magnetics: Magnetics<'_>, psi: Dq) -> Dq {
    Machine::<_>::new(motor, magnetics).current(psi)
}

/// Magnetic energy in J at the flux linkage `psi` (Wb), without the magnet's: 0 at zero current.
#[inline]
pub fn magnetic_energy(motor: &Motor, magnetics: Magnetics<'_>, psi: Dq) -> f64 {
    let (x, q) = (psi.d() - motor.psi_M, psi.q());
    let linear = 0.75 * (x * x / motor.L_d + q * q / motor.L_q);
    match magnetics {
        Magnetics::Linear => linear,
        Magnetics::Polynomial(saturation) => linear + saturation.energy(motor, psi),
        Magnetics::Map(map) => map.energy(Dq::new(x, q)),
    }
}

/// d i_d / d psi_d, d i_d / d psi_q and d i_q / d psi_q (1/H) at the flux linkage `psi` (Wb).
#[inline]
pub fn slope(motor: &Motor, magnetics: Magnetics<'_>, psi: Dq) -> [f64; 3] {
    match magnetics {
        Magnetics::Linear => [1.0 / motor.L_d, 0.0, 1.0 / motor.L_q],
        Magnetics::Polynomial(saturation) => saturation.slope(motor, psi),
        Magnetics::Map(map) => map.hessian(psi - Dq::new(motor.psi_M, 0.0)),
    }
}

/// The smallest incremental inductance (H) of the machine over all directions at the flux linkage `psi` (Wb).
pub fn least_inductance(motor: &Motor, magnetics: Magnetics<'_>, psi: Dq) -> f64 {
    if let Magnetics::Linear = magnetics {
        return motor.L_d.min(motor.L_q);
    }
    let [d, cross, q] = slope(motor, magnetics, psi);
    // The larger eigenvalue.
    1.0 / (0.5 * (d + q) + (0.25 * (d - q) * (d - q) + cross * cross).sqrt())
}

/// The reciprocals of the inductances in 1/H.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Inverse {
    d: f64,
    q: f64,
}

impl Inverse {
    /// Computes them for a machine.
    #[inline]
    pub fn of<S>(motor: &Motor<S>) -> Self {
        Self { d: reciprocal(motor.L_d), q: reciprocal(motor.L_q) }
    }
}

/// The machine with constants for many evaluations.
#[derive(Clone, Copy, Debug)]
pub struct Machine<'a, S = f64, const LINEAR: bool = false> {
    /// Unused if `LINEAR`.
    magnetics: Magnetics<'a>,
    psi_M: S,
    R_s: S,
    by_L_q: f64,
    /// 1/L_d - 1/L_q in 1/H.
    saliency: f64,
    n_p: f64,
}

impl<'a, S: Scalar, const LINEAR: bool> Machine<'a, S, LINEAR> {
    /// From the parameters.
    #[inline]
    pub fn new(motor: &Motor<S>, magnetics: Magnetics<'a>) -> Self {
        Self::with(motor, magnetics, Inverse::of(motor))
    }

    /// With known reciprocals of the inductances.
    #[inline]
    pub fn with(motor: &Motor<S>, magnetics: Magnetics<'a>, Inverse { d, q }: Inverse) -> Self {
        let Motor { n_p, R_s, L_d: _, L_q: _, psi_M } = *motor;
        Self { magnetics, psi_M, R_s, by_L_q: q, saliency: d - q, n_p: f64::from(n_p) }
    }

    /// Current (A) for the flux linkage `psi` (Wb).
    #[inline]
    pub fn current(&self, psi: Vector<Rotor, S>) -> Vector<Rotor, S> {
        let e = Vector::new(1.0.into(), 0.0.into());
        let x = psi - e.scaled(self.psi_M);
        match self.magnetics {
            Magnetics::Linear => self.linear_current(x, e),
            Magnetics::Polynomial(saturation) => self.linear_current(x, e) + saturation.current(x),
            Magnetics::Map(map) => map.current(x),
        }
    }

    /// [`current`](Self::current) in stator axes, for the flux linkage `psi` (Wb) in stator axes with the magnet on `axis`.
    #[inline]
    pub fn stator_current(&self, axis: Axis<Rotor, S>, psi: Vector<Stator, S>) -> Vector<Stator, S> {
        let x = psi - axis.along(self.psi_M);
        let linear = || self.linear_current(x, axis.along(1.0.into()));
        if LINEAR {
            return linear();
        }
        match self.magnetics {
            Magnetics::Linear => linear(),
            Magnetics::Polynomial(saturation) => linear() + axis.to_stator(saturation.current(axis.from_stator(x))),
            Magnetics::Map(map) => axis.to_stator(map.current(axis.from_stator(x))),
        }
    }

    /// Current (A) of the machine without saturation, for the flux linkage `x` (Wb) beyond that of the magnet with the d-axis
    /// in the direction `e`: x / L_q + (1 / L_d - 1 / L_q) (x . e) e, in any axes.
    #[inline]
    fn linear_current<F>(&self, x: Vector<F, S>, e: Vector<F, S>) -> Vector<F, S> {
        x * self.by_L_q + e.scaled(x.dot(e) * self.saliency)
    }

    /// Resistance (Ohm) of the stator.
    #[inline]
    pub fn resistance(&self) -> S {
        self.R_s
    }

    /// Electrical speed in rad/s at the mechanical `speed` (rad/s).
    #[inline]
    pub fn electrical<T: Scalar>(&self, speed: T) -> T {
        speed * self.n_p
    }

    /// Electromagnetic torque in N.m at the flux linkage `psi` (Wb) and the current `i` (A) in the same axes.
    #[inline]
    pub fn torque<F, T: Scalar>(&self, psi: Vector<F, T>, i: Vector<F, T>) -> T {
        psi.cross(i) * (1.5 * self.n_p)
    }
}

impl<S: Scalar, const LINEAR: bool> Machine<'_, S, LINEAR> {
    /// Flux linkage (Wb) in stator axes with the magnet on `axis`. The magnet's part is transformed separately in both
    /// directions, so that zero current stays zero.
    #[inline]
    pub fn to_stator(&self, axis: Axis<Rotor, S>, psi: Vector<Rotor, S>) -> Vector<Stator, S> {
        axis.to_stator(psi - Vector::new(self.psi_M, 0.0.into())) + axis.along(self.psi_M)
    }

    /// The inverse of [`to_stator`](Self::to_stator).
    #[inline]
    pub fn from_stator(&self, axis: Axis<Rotor, S>, psi: Vector<Stator, S>) -> Vector<Rotor, S> {
        axis.from_stator(psi - axis.along(self.psi_M)) + Vector::new(self.psi_M, 0.0.into())
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
        let psi = flux(&motor, i);
        assert!((Machine::<_>::new(&motor, Magnetics::Linear).torque(psi, i) - expected).abs() < 1e-14);
        assert!((current(&motor, Magnetics::Linear, psi).q() - 4.0).abs() < 1e-14);
    }

    /// Saturation adds to the current, in rotor and in stator axes.
    #[test]
    fn saturation_adds_to_the_current() {
        let motor = Motor { L_q: 9e-3, ..Motor::default() };
        let saturation = Saturation { s_2: 40.0, s_3: 300.0, s_dq: 7.0 };
        let magnetics = Magnetics::Polynomial(&saturation);
        let (x, q) = (0.05, -0.03);
        let psi = Dq::new(motor.psi_M + x, q);
        let expected =
            Dq::new(x / motor.L_d + 40.0 * x * x + 300.0 * x * x * x + 3.5 * q * q, q / motor.L_q + 7.0 * x * q);
        assert!((current(&motor, magnetics, psi) - expected).magnitude() < 1e-12);
        let axis = Axis::<Rotor>::at(0.8);
        let machine = Machine::<_>::new(&motor, magnetics);
        let i = machine.stator_current(axis, machine.to_stator(axis, psi));
        assert!((axis.from_stator(i) - expected).magnitude() < 1e-12, "{i:?}");
    }
}
