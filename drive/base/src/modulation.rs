//! The average output of three inverter legs over a PWM period for a voltage command: the hexagon of the DC link and
//! the dead-time voltage. The plant models its inverter with these functions; the controller uses them to account for the
//! limits and the dead time.
//!
//! The hexagon is derived here from three legs between the rails. Dead time: a leg loses u_dead sign(i), or u_dead i /
//! i_zero below i_zero: the usual mean-value model, which neither paper contains. u in V, i in A.

use crate::frame::{Phases, Stator, Vector};
use fmu_core::{Scalar, enumeration};
use serde::{Deserialize, Serialize};

enumeration! {
    /// Instants at which the carrier takes over the voltage references; values never change.
    #[derive(Serialize, Deserialize)]
    pub enum PwmUpdate("PwmUpdate", "When new voltage references take effect") {
        1 Single "At the beginning of each carrier period";
        2 Double "At the beginning and in the middle of each carrier period";
    }
}

impl PwmUpdate {
    /// Number of updates in a carrier period.
    #[inline]
    pub fn each_period(self) -> f64 {
        match self {
            Self::Single => 1.0,
            Self::Double => 2.0,
        }
    }
}

/// Stator voltage (V) that an inverter on `u_dc` (V, >= 0) applies for the references `u` (V).
///
/// Only differences of the references matter; the inverter chooses the zero sequence. It reproduces every vector inside
/// the hexagon (no line-to-line voltage above `u_dc`) and scales any other vector back radially to the edge.
#[inline]
pub fn limit_to_hexagon<S: Scalar>(u: Phases<S>, u_dc: S) -> Vector<Stator, S> {
    limit_span(u.to_stator(), u.span(), u_dc)
}

/// The voltage `u` (V), whose largest line-to-line voltage is `span` (V), scaled back to the hexagon of `u_dc` (V).
#[inline]
pub fn limit_span<S: Scalar>(u: Vector<Stator, S>, span: S, u_dc: S) -> Vector<Stator, S> {
    if span.value() > u_dc.value() { u.scaled(positive(u_dc) / span) } else { u }
}

/// `x`, or 0 if it is negative.
#[inline]
pub(crate) fn positive<S: Scalar>(x: S) -> S {
    x.chain(x.value().max(0.0), f64::from(u8::from(x.value() >= 0.0)))
}

/// Stator voltage (V) lost to dead time at the phase currents `i` (A): up to `u_dead` (V) per leg, linear within
/// +-`i_zero` (A).
#[inline]
pub fn dead_time_loss<S: Scalar>(u_dead: S, i_zero: S, i: Phases<S>) -> Vector<Stator, S> {
    let leg = |i: S| u_dead * clamp_unit(i / i_zero);
    Phases { a: leg(i.a), b: leg(i.b), c: leg(i.c) }.to_stator()
}

/// `x`, limited to +-1.
#[inline]
pub fn clamp_unit<S: Scalar>(x: S) -> S {
    x.chain(x.value().clamp(-1.0, 1.0), f64::from(u8::from(x.value().abs() <= 1.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::AlphaBeta;

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
        let u_dead = 10.8;
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
