//! Iron loss: a conductance G parallel to the flux linkage, explicit and without a further state.
//!
//! ```text
//! e      = d psi/dt + j w psi = (u - R i_m) / (1 + R G)     voltage behind the resistance, i_m is the current of psi
//! i_s    = i_m + G e                                         current at the terminals
//! p_iron = 1.5 G |e|^2                                       p_cu = 1.5 R |i_s|^2        tau_e = 1.5 n_p psi x i_m
//! G(w)   = G_e + G_h / sqrt(w^2 + w_0^2)
//! ```
//!
//! In steady state e = j w psi, so p_iron = 1.5 (G_e w^2 + G_h |w|) |psi|^2: eddy currents with the square of the speed,
//! hysteresis in proportion to it (Bertotti 1988 with the exponent 2 for hysteresis and without the excess term). w_0
//! bounds the conductance at standstill. At the shaft, p_iron reduces the torque: 1.5 n_p psi x i_s - tau_e = p_iron / w_m.
//! R G is about 1e-3, so the poles of the machine hardly move.
//!
//! With the gates off and the diodes blocking, i_s = 0, and the magnet drives i_m through G. The time constant L G is about
//! 10 us, so i_m follows the speed without delay: with g = G w, i_mq = -g psi_M / (1 + g^2 L_d L_q), i_md = g L_q i_mq; the
//! machine brakes with p_iron / w_m.
//!
//! The equations are derived here from the circuit; Modelica's `Electrical.Machines.Losses` has the same core loss with
//! another speed dependence. G in S, w in rad/s (electrical), psi in Wb.

use drive_base::frame::{Rotor, Vector};
use drive_base::motor::Motor;
use fmu_core::unit::{PER_HENRY, RAD_PER_S, SIEMENS};
use fmu_core::{Row, Scalar, Table, table};
use serde::{Deserialize, Serialize};

/// Parameters; all zero gives a machine without iron loss.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Iron {
    /// Eddy currents: conductance in S, >= 0.
    pub G_e: f64,
    /// Hysteresis: conductance times electrical speed in 1/H, >= 0.
    pub G_h: f64,
    /// Electrical speed in rad/s below which hysteresis fades, > 0.
    pub w_0: f64,
}

impl Default for Iron {
    fn default() -> Self {
        Self { G_e: 0.0, G_h: 0.0, w_0: 20.0 }
    }
}

impl Iron {
    /// Whether the iron loss is zero.
    #[inline]
    pub fn is_none(&self) -> bool {
        let &Self { G_e, G_h, w_0: _ } = self;
        G_e == 0.0 && G_h == 0.0
    }

    /// Conductance (S) at the electrical speed `w` (rad/s).
    pub fn conductance<S: Scalar>(&self, w: S) -> S {
        let (square, x) = (w.value() * w.value() + self.w_0 * self.w_0, w.value());
        let root = square.sqrt();
        w.chain(self.G_e + self.G_h / root, -self.G_h * x / (root * square))
    }

    /// Current (A) of the flux linkage without terminal current at the electrical speed `w` (rad/s), without
    /// saturation.
    pub fn idle_current<S: Scalar>(&self, motor: &Motor<S>, w: S) -> Vector<Rotor, S> {
        let g = self.conductance(w) * w;
        let q = -(g * motor.psi_M) / (g * g * (motor.L_d * motor.L_q) + S::from(1.0));
        Vector::new(g * motor.L_q * q, q)
    }
}

type P = Row<Iron>;

/// Variables of the iron loss; their owner supplies the prefix `iron.`.
pub const IRON: &Table<Iron> = table![
    P::parameter("G_e", &SIEMENS, "Iron loss by eddy currents: conductance parallel to the flux; 0: none", |p| &mut p
        .G_e,)
    .at_least(0.0),
    P::parameter("G_h", &PER_HENRY, "Iron loss by hysteresis: conductance times electrical speed; 0: none", |p| &mut p
        .G_h,)
    .at_least(0.0),
    P::parameter("w_0", &RAD_PER_S, "Electrical speed below which the hysteresis loss fades", |p| &mut p.w_0)
        .above(0.0),
];

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::Dq;
    use fmu_core::Dual;

    const IRON: Iron = Iron { G_e: 2.7e-4, G_h: 0.127, w_0: 20.0 };

    #[test]
    fn without_terminal_current_the_iron_carries_the_magnetic_current() {
        let motor = Motor::IPMSM_2_2_KW;
        for w in [-900.0, -30.0, 0.0, 7.0, 471.0] {
            let i: Dq = IRON.idle_current(&motor, w);
            let psi = Dq::new(motor.psi_M + motor.L_d * i.d(), motor.L_q * i.q());
            let i_s = i + psi.turned() * (IRON.conductance(w) * w);
            assert!(i_s.magnitude() < 1e-15, "{i_s:?} A at {w} rad/s");
        }
    }

    #[test]
    fn the_slope_of_the_conductance_is_its_derivative() {
        for w in [-300.0, -5.0, 0.0, 60.0] {
            let h = 1e-3;
            let near = (IRON.conductance(w + h) - IRON.conductance(w - h)) / (2.0 * h);
            assert!((IRON.conductance(Dual::new(w, 1.0)).change - near).abs() < 1e-11, "{w}");
        }
    }
}
