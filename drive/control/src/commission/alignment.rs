//! The current that aligns the rotor of a machine with saliency.
//!
//! ```text
//! torque of a current i at beta from the magnet       1.5 n_p i sin(beta) (psi_M - (L_q - L_d) i cos(beta))
//! the rotor rests                                      at beta = 0 up to i_1 = psi_M / (L_q - L_d),
//!                                                      beyond at cos(beta) = i_1 / i, on either side
//! ```
//!
//! A current far above i_1 therefore comes to rest on the q-axis, as the magnet of a machine with L_d > L_q rests on its greater
//! inductance. A smaller current separates the two: if the axis of smaller inductance turns to the current, the magnet lies along
//! it. The angle also shows i_1, and so psi_M; an alignment by 0.6 i_1 is stiff. An angle that does not change means a blocked
//! rotor, which the [swing](super::swing) recognizes, a rotor stopped by friction, or L_d > L_q; for the latter the swing must
//! also show a magnet, psi - L i > 0, because beyond i_1 the flux linkage is L_q i alone.

use drive_base::math::{sin_cos, wrap};
use serde::{Deserialize, Serialize};

/// Maximum angle in rad at which the smaller inductance lies along the current, and minimum angle at which it lies across it.
const ALONG: f64 = 0.26;
const ACROSS: f64 = 1.31;
/// Change of the angle in rad that indicates that the rotor follows.
const FOLLOWS: f64 = 0.05;
/// Smallest current over I, and the next one over the present one where the angle does not show i_1.
const FEWEST: f64 = 0.03;
const NEXT: f64 = 0.25;
/// Share of i_1.
const STIFF: f64 = 0.6;

/// Result of the angles at rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Alignment {
    /// Current in A of an alignment where 0.4 I is too much, and about the flux linkage of the magnet in Wb; 0: it is not.
    pub(super) i_0: f64,
    pub(super) psi_1: f64,
    /// Angle in rad from the current to the axis of the smaller inductance, at the last measurement.
    off: f64,
    looks: f64,
    /// No further look is needed.
    pub(super) over: bool,
    /// The magnet seems to lie along the greater inductance.
    pub(super) inverse: bool,
    /// The rotor rests between the two: it is blocked, or the case is undecided.
    pub(super) stuck: bool,
}

/// What a look asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Looked {
    /// An alignment with less current.
    Lower,
    /// The current is right.
    Over,
}

impl Alignment {
    /// The rotor rests with its smaller inductance `angle` (rad) from the current `i` (A), of `I` (A); the greater one is greater
    /// by `salient` (H).
    pub(super) fn look(&mut self, [i, I]: [f64; 2], salient: f64, angle: f64) -> Looked {
        let before = self.off;
        // Half of a turn is the same axis.
        self.off = 0.5 * wrap(2.0 * angle).abs();
        self.looks += 1.0;
        if self.off <= ALONG {
            if self.i_0 > 0.0 {
                self.psi_1 = self.psi_1.max(salient * i);
                self.i_0 = i.min(STIFF * self.psi_1 / salient);
            }
            self.over = true;
            return Looked::Over;
        }
        let follows = self.looks < 1.5 || (self.off - before).abs() > FOLLOWS;
        if follows && i > FEWEST * I {
            let cos = sin_cos(self.off).1;
            self.psi_1 = salient * i * cos;
            self.i_0 = i * if self.off > ACROSS { NEXT } else { STIFF * cos };
            return Looked::Lower;
        }
        (self.i_0, self.psi_1) = (0.0, 0.0);
        (self.over, self.inverse) = (true, self.off > ACROSS);
        self.stuck = !self.inverse && self.off > std::f64::consts::FRAC_PI_4;
        Looked::Over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks at a rotor that rests `off(i)` (rad) from the current i (A), until no look follows.
    fn looked(off: impl Fn(f64) -> f64) -> (Alignment, f64) {
        let (mut i, mut alignment) = (20.0, Alignment::default());
        for side in [1.0, -1.0].into_iter().cycle().take(20) {
            // An axis has two directions.
            let angle = side * off(i) + if side > 0.0 { std::f64::consts::PI } else { 0.0 };
            let over = alignment.look([i, 50.0], 20e-3, angle) == Looked::Over;
            i = if alignment.i_0 > 0.0 { alignment.i_0 } else { 20.0 };
            if over {
                return (alignment, i);
            }
        }
        panic!("no end: {alignment:?}");
    }

    /// cos(beta) = i_1 / i beyond i_1: the alignment reaches 0.6 i_1, and psi_M is known.
    #[test]
    fn a_magnet_beside_the_current_gets_less_current() {
        for i_1 in [15.0_f64, 8.0, 3.0] {
            let (found, i) = looked(|i| (i_1 / i).min(1.0).acos());
            assert!(found.over && !found.inverse && !found.stuck, "{found:?}");
            assert!(i <= i_1 && i > 0.25 * i_1, "{i} A of {i_1} A");
            assert!((found.psi_1 / (20e-3 * i_1) - 1.0).abs() < 0.1, "{} Wb of {i_1} A", found.psi_1);
        }
        let (found, i) = looked(|_| 0.1);
        assert!(found.over && found.i_0 == 0.0 && found.psi_1 == 0.0, "0.4 I is small enough: {found:?}, {i} A");
    }

    /// An angle that stays: L_d > L_q, or a rotor that does not follow.
    #[test]
    fn an_angle_that_stays_is_no_magnet_beside_the_current() {
        for (off, inverse, stuck) in [(1.55, true, false), (1.0, false, true), (0.5, false, false)] {
            let (found, i) = looked(|_| off);
            assert_eq!((found.inverse, found.stuck, i.to_bits()), (inverse, stuck, 20.0_f64.to_bits()), "{off} rad");
        }
    }
}
