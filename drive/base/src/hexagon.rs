//! The voltage hexagon of the DC link, for commands in stator axes.

use crate::frame::{AlphaBeta, Phases};
use crate::modulation::limit_span;

/// The voltage `u` (V) limited to the hexagon of `u_dc` (V), and whether it was outside.
#[inline]
pub fn within_hexagon(u: AlphaBeta, u_dc: f64) -> (AlphaBeta, bool) {
    let span = Phases::from_stator(u).span();
    (limit_span(u, span, u_dc), span > u_dc)
}
