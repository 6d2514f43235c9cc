//! Magnetic saturation and cross-saturation: the current as a polynomial of the flux linkage.
//!
//! With x = psi_d - psi_M: i_d = x / L_d + c_2 x^2 + c_3 x^3 + c_x psi_q^2 / 2, i_q = psi_q / L_q + c_x x psi_q.
//! Both are derivatives of one energy, so no cycle yields energy: d i_d / d psi_q = d i_q / d psi_d = c_x psi_q.
//!
//! c_2 > 0 tells the two ends of the magnet apart: current along it (x > 0) meets a smaller inductance than against it.
//! Limits: a polynomial, good to about the flux at which d i_d / d psi_d = 1 / L_d + 2 c_2 x + 3 c_3 x^2 stays positive.
//!
//! Neither paper saturates: a polynomial chosen here that has an energy. Flux linkages in Wb, c_2 and c_x in A/Wb2, c_3 in A/Wb3.

use crate::frame::Dq;
use crate::motor::Motor;
use fmu_core::unit::{Exponents, Quantity, Unit};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// Second-order coefficient in A/Wb2.
pub(crate) const A_PER_WB2: Quantity = Quantity::new("SaturationOfSecondOrder", Unit::si("A/Wb2", per_weber(2)));
/// Third-order coefficient in A/Wb3.
const A_PER_WB3: Quantity = Quantity::new("SaturationOfThirdOrder", Unit::si("A/Wb3", per_weber(3)));

/// Exponents of an ampere per weber to the power of `n`: 1 Wb = 1 kg.m2.s-2.A-1.
const fn per_weber(n: i8) -> Exponents {
    Exponents::mechanical(-n, -2 * n, 2 * n, 1 + n)
}

/// Parameters; all zero is the linear machine.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Saturation {
    /// Of second order along the magnet in A/Wb2.
    pub c_2: f64,
    /// Of third order along the magnet in A/Wb3.
    pub c_3: f64,
    /// Between the axes in A/Wb2.
    pub c_x: f64,
}

impl Saturation {
    /// The current (A) beyond the linear machine's at the flux linkage `psi` (Wb).
    #[inline]
    pub fn current(&self, motor: &Motor, psi: Dq) -> Dq {
        let (x, q) = (psi.d() - motor.psi_M, psi.q());
        Dq::new((self.c_2 + self.c_3 * x) * x * x + 0.5 * self.c_x * q * q, self.c_x * x * q)
    }

    /// The least incremental inductance (H) of the machine at the flux linkage `psi` (Wb) over all directions:
    /// 1 over the greatest eigenvalue of d i / d psi, which is symmetric.
    pub fn least_inductance(&self, motor: &Motor, psi: Dq) -> f64 {
        let (x, q) = (psi.d() - motor.psi_M, psi.q());
        let by_d = 1.0 / motor.L_d + (2.0 * self.c_2 + 3.0 * self.c_3 * x) * x;
        let (by_q, cross) = (1.0 / motor.L_q + self.c_x * x, self.c_x * q);
        1.0 / (0.5 * (by_d + by_q) + (0.5 * (by_d - by_q)).hypot(cross))
    }

    /// The energy (J) beyond the linear machine's at the flux linkage `psi` (Wb): 1.5 of the integral of i d psi.
    #[inline]
    pub fn energy(&self, motor: &Motor, psi: Dq) -> f64 {
        let (x, q) = (psi.d() - motor.psi_M, psi.q());
        1.5 * ((self.c_2 / 3.0 + 0.25 * self.c_3 * x) * x * x * x + 0.5 * self.c_x * x * q * q)
    }
}

type P = Row<Saturation>;

/// The saturation's variables; their owner gives the prefix `saturation.`.
pub const SATURATION: &Table<Saturation> = &Table::new(
    const {
        &[
            P::parameter("c_2", &A_PER_WB2, "Saturation of second order along the magnet; 0: none", |p| &mut p.c_2),
            P::parameter("c_3", &A_PER_WB3, "Saturation of third order along the magnet; 0: none", |p| &mut p.c_3)
                .at_least(0.0),
            P::parameter("c_x", &A_PER_WB2, "Cross-saturation between the axes; 0: none", |p| &mut p.c_x),
        ]
    },
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_reciprocal_and_tells_north_from_south() {
        let (motor, s) = (Motor::default(), Saturation { c_2: 40.0, c_3: 40.0, c_x: 7.0 });
        let (psi, h) = (Dq::new(0.21, -0.08), 1e-6);
        let linear = |v: Dq| Dq::new(v.d() / motor.L_d, v.q() / motor.L_q);
        let by = |v: Dq| (s.current(&motor, psi + v) - s.current(&motor, psi - v) + linear(v) * 2.0) * (0.5 / h);
        let (by_d, by_q) = (by(Dq::new(h, 0.0)), by(Dq::new(0.0, h)));
        assert!((by_d.q() - by_q.d()).abs() < 1e-9, "{by_d:?} {by_q:?}");
        let work = |v: Dq| (s.energy(&motor, psi + v) - s.energy(&motor, psi - v)) * (0.5 / h) / 1.5;
        let i = s.current(&motor, psi);
        assert!((work(Dq::new(h, 0.0)) - i.d()).abs() < 1e-9 && (work(Dq::new(0.0, h)) - i.q()).abs() < 1e-9);
        let of = |angle: f64| {
            let direction = Dq::new(angle.cos(), angle.sin());
            1.0 / by(direction * h).dot(direction)
        };
        let least = (0..3600).map(|k| of(f64::from(k).to_radians() / 10.0)).fold(f64::INFINITY, f64::min);
        assert!((s.least_inductance(&motor, psi) / least - 1.0).abs() < 1e-5, "{least} H");
        let along = |x: f64| s.current(&motor, Dq::new(motor.psi_M + x, 0.0)).d();
        assert!(along(0.1) > 0.0 && along(0.1) > -along(-0.1));
    }
}
