//! The average inverter: three phase voltages over a PWM period, limited to the hexagon of the DC link.

use crate::frame::{AlphaBeta, Phases};

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
    fn inside_nothing_changes_and_the_common_part_is_free() {
        let u = Phases { a: 500.0, b: 400.0, c: 300.0 };
        assert_eq!(limit_to_hexagon(u, 200.0), u.to_stator());
    }
}
