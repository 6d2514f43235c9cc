//! The average inverter: three phase voltages over a PWM period, limited to the hexagon of the DC link, and the error of
//! the dead time between the two switches of a leg.
//!
//! While both switches are off the current chooses the diode: over a PWM period the leg's voltage is off by
//! -u_dead sign(i) with u_dead = dead_time u_dc / T_pwm. Below i_zero the current crosses zero within the dead time (the
//! ripple, the capacitances of the switches) and the error falls linearly: -u_dead i / i_zero.
//!
//! The hexagon follows from three legs between the rails, here; the dead time is the field's usual mean-value model, in neither
//! paper. u in V, i in A, times in s.

use crate::frame::{AlphaBeta, Phases};
use fmu_core::unit::{AMPERE, SECOND};
use fmu_core::{Row, Table};
use serde::{Deserialize, Serialize};

/// Parameters; no dead time is the ideal average inverter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inverter {
    /// Dead time in s, >= 0.
    pub dead_time: f64,
    /// PWM period in s, > 0.
    pub T_pwm: f64,
    /// Current in A below which the error falls linearly, > 0.
    pub i_zero: f64,
}

impl Default for Inverter {
    fn default() -> Self {
        Self { dead_time: 0.0, T_pwm: 1e-4, i_zero: 0.1 }
    }
}

impl Inverter {
    /// Voltage lost per leg in V at the DC-link voltage `u_dc` (V).
    #[inline]
    pub fn u_dead(&self, u_dc: f64) -> f64 {
        self.dead_time / self.T_pwm * u_dc
    }
}

/// The voltage (V) that legs lose which lose up to `u_dead` (V) with the currents `i` (A).
#[inline]
pub fn dead_time_loss(u_dead: f64, i_zero: f64, i: Phases) -> AlphaBeta {
    let leg = |i: f64| u_dead * (i / i_zero).clamp(-1.0, 1.0);
    Phases { a: leg(i.a), b: leg(i.b), c: leg(i.c) }.to_stator()
}

type P = Row<Inverter>;

/// The inverter's variables; their owner gives the prefix `inverter.`.
pub const INVERTER: &Table<Inverter> = &Table::new(
    const {
        &[
            P::parameter("dead_time", &SECOND, "Dead time between the two switches of a leg; 0: ideal inverter", |p| {
                &mut p.dead_time
            })
            .at_least(0.0),
            P::parameter("T_pwm", &SECOND, "PWM period", |p| &mut p.T_pwm).above(0.0),
            P::parameter("i_zero", &AMPERE, "Current below which the dead-time voltage falls linearly to zero", |p| {
                &mut p.i_zero
            })
            .above(0.0),
        ]
    },
);

/// The stator voltage (V) that an inverter on `u_dc` (V, >= 0) applies for the references `u` (V).
///
/// Only differences of the references matter; the inverter chooses the zero sequence. It reproduces each vector inside
/// the hexagon (no line-to-line voltage above `u_dc`) and scales the others back radially to its edge.
#[inline]
pub fn limit_to_hexagon(u: Phases, u_dc: f64) -> AlphaBeta {
    let span = u.span();
    let v = u.to_stator();
    if span > u_dc { v * (u_dc.max(0.0) / span) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_a_hexagon() {
        // Corners reach 2/3 u_dc, the middle of an edge u_dc / sqrt(3).
        for i in 0..360 {
            let theta = f64::from(i).to_radians();
            let wanted = AlphaBeta::new(1000.0 * theta.cos(), 1000.0 * theta.sin());
            let got = limit_to_hexagon(Phases::from_stator(wanted), 300.0);
            let from_corner = f64::from(i % 60).to_radians();
            let edge = 200.0 * 0.75_f64.sqrt() / (std::f64::consts::FRAC_PI_6 - from_corner).cos();
            assert!((got.magnitude() - edge).abs() < 1e-9, "{i} deg: {} V, not {edge} V", got.magnitude());
            assert!(got.cross(wanted).abs() < 1e-6, "the direction stays");
        }
    }

    #[test]
    fn a_leg_loses_the_dead_time() {
        let inverter = Inverter { dead_time: 2e-6, ..Inverter::default() };
        let u_dead = inverter.u_dead(540.0);
        assert!((u_dead - 10.8).abs() < 1e-12);
        // Currents (+, -, -): legs lose (u, -u, -u), a vector of 4/3 u along phase a.
        let loss = dead_time_loss(u_dead, 0.1, Phases { a: 2.0, b: -1.0, c: -1.0 });
        assert!((loss.alpha() - 4.0 / 3.0 * u_dead).abs() < 1e-12 && loss.beta().abs() < 1e-12);
        let loss = dead_time_loss(u_dead, 0.1, Phases { a: 0.02, b: -0.01, c: -0.01 });
        assert!((loss.alpha() - 0.2 * u_dead).abs() < 1e-12, "inside the zone it is a resistance");
    }

    #[test]
    fn inside_nothing_changes_and_the_common_part_is_free() {
        let u = Phases { a: 500.0, b: 400.0, c: 300.0 };
        assert_eq!(limit_to_hexagon(u, 200.0), u.to_stator());
    }
}
