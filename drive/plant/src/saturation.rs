//! Magnetic saturation and cross-saturation: the current as a polynomial of the flux linkage.
//!
//! With x = psi_d - psi_M: i_d = x / L_d + s_2 x^2 + s_3 x^3 + s_dq psi_q^2 / 2, i_q = psi_q / L_q + s_dq x psi_q.
//! Both are derivatives of one energy, so no cycle yields energy: d i_d / d psi_q = d i_q / d psi_d = s_dq psi_q.
//!
//! s_2 > 0 distinguishes the magnet's poles: the inductance is smaller for a positive d-axis current (x > 0) than for a
//! negative one. Limits: the polynomial is usable roughly as long as d i_d / d psi_d = 1 / L_d + 2 s_2 x + 3 s_3 x^2 is
//! positive.
//!
//! Neither paper includes saturation; this polynomial was chosen because it has an energy. Flux linkages in Wb, s_2
//! and s_dq in A/Wb2, s_3 in A/Wb3.

use drive_base::frame::{Dq, Rotor, Vector};
use drive_base::motor::{A_PER_WB2, A_PER_WB3, Motor};
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters; all zero gives the linear machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Saturation {
    /// Second-order d-axis coefficient in A/Wb2.
    pub s_2: f64,
    /// Third-order d-axis coefficient in A/Wb3.
    pub s_3: f64,
    /// Cross-saturation coefficient in A/Wb2.
    pub s_dq: f64,
}

impl Saturation {
    /// Whether the machine is linear.
    #[inline]
    pub fn is_none(&self) -> bool {
        let &Self { s_2, s_3, s_dq } = self;
        s_2 == 0.0 && s_3 == 0.0 && s_dq == 0.0
    }

    /// The current (A) in excess of the linear machine's, at the flux linkage `psi` (Wb) in excess of the magnet's.
    #[inline]
    pub fn current<S: Scalar>(&self, psi: Vector<Rotor, S>) -> Vector<Rotor, S> {
        let (x, q) = (psi.d(), psi.q());
        Vector::new((x * self.s_3 + S::from(self.s_2)) * x * x + q * (0.5 * self.s_dq) * q, x * self.s_dq * q)
    }

    /// d i / d psi (1/H) of the machine at the flux linkage `psi` (Wb), which is symmetric: d with d, d with q, q with q.
    #[inline]
    pub fn slope(&self, motor: &Motor, psi: Dq) -> [f64; 3] {
        let (x, q) = (psi.d() - motor.psi_M, psi.q());
        let by_d = 1.0 / motor.L_d + (2.0 * self.s_2 + 3.0 * self.s_3 * x) * x;
        [by_d, self.s_dq * q, 1.0 / motor.L_q + self.s_dq * x]
    }

    /// The energy (J) in excess of the linear machine's at the flux linkage `psi` (Wb): 1.5 times the integral of i d psi.
    #[inline]
    pub fn energy(&self, motor: &Motor, psi: Dq) -> f64 {
        let (x, q) = (psi.d() - motor.psi_M, psi.q());
        1.5 * ((self.s_2 / 3.0 + 0.25 * self.s_3 * x) * x * x * x + 0.5 * self.s_dq * x * q * q)
    }
}

type P = Row<Saturation>;

/// Variables of the saturation; their owner supplies the prefix `saturation.`.
pub const SATURATION: &Table<Saturation> = table![
    P::parameter("s_2", &A_PER_WB2, "Second-order d-axis saturation coefficient; 0: none", |p| &mut p.s_2),
    P::parameter("s_3", &A_PER_WB3, "Third-order d-axis saturation coefficient; 0: none", |p| &mut p.s_3).at_least(0.0),
    P::parameter("s_dq", &A_PER_WB2, "Cross-saturation coefficient between d and q axis; 0: none", |p| { &mut p.s_dq }),
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{self, Magnetics};

    #[test]
    fn is_reciprocal_and_tells_north_from_south() {
        let (motor, s) = (Motor::default(), Saturation { s_2: 40.0, s_3: 40.0, s_dq: 7.0 });
        let (psi, h) = (Dq::new(0.21, -0.08), 1e-6);
        let current = |psi: Dq| s.current(psi - Dq::new(motor.psi_M, 0.0));
        let linear = |v: Dq| Dq::new(v.d() / motor.L_d, v.q() / motor.L_q);
        let by = |v: Dq| (current(psi + v) - current(psi - v) + linear(v) * 2.0) * (0.5 / h);
        let (by_d, by_q) = (by(Dq::new(h, 0.0)), by(Dq::new(0.0, h)));
        assert!((by_d.q() - by_q.d()).abs() < 1e-9, "{by_d:?} {by_q:?}");
        let work = |v: Dq| (s.energy(&motor, psi + v) - s.energy(&motor, psi - v)) * (0.5 / h) / 1.5;
        let i = current(psi);
        assert!((work(Dq::new(h, 0.0)) - i.d()).abs() < 1e-9 && (work(Dq::new(0.0, h)) - i.q()).abs() < 1e-9);
        let of = |angle: f64| {
            let direction = Dq::new(angle.cos(), angle.sin());
            1.0 / by(direction * h).dot(direction)
        };
        let lowest = (0..3600).map(|k| of(f64::from(k).to_radians() / 10.0)).fold(f64::INFINITY, f64::min);
        assert!(
            (machine::least_inductance(&motor, Magnetics::Polynomial(&s), psi) / lowest - 1.0).abs() < 1e-5,
            "{lowest} H"
        );
        let along = |x: f64| current(Dq::new(motor.psi_M + x, 0.0)).d();
        assert!(along(0.1) > 0.0 && along(0.1) > -along(-0.1));
    }
}
