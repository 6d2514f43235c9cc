//! J, B and tau_coulomb: one least squares over the parts of the run, with rejection.
//!
//! ```text
//! J w' + B w + tau_coulomb = tau          weight 1 / (0.01 |tau| + 1e-4 K I + J sigma), K = 1.5 n_p psi_M
//! ```
//!
//! The rotor turns in one direction. Parts beyond 3.5 standard deviations are left out, at most a fifth of all. The
//! residual's variance counts as 1 at least, and half-widths are 4 standard errors: what remains, such as cogging and
//! the loss of the legs at small currents, is not white. w and w' are mechanical here, in rad/s and rad/s2; tau in N.m.

use super::excitation::Rows;
use super::identified::Identified;
use super::least_squares::Normal;
use serde::{Deserialize, Serialize};

/// Parts that are kept.
const PARTS: usize = 192;
/// Minimum number of parts, and maximum share of those left out.
const FEWEST: f64 = 8.0;
const LEFT_OUT: f64 = 0.2;
/// Standard deviations beyond which a part is left out.
const BEYOND: f64 = 3.5;
/// Rounds of rejection.
const ROUNDS: usize = 8;
/// Minimum relative half-width of all values.
const LEAST: f64 = 0.003;

/// The parts: w' in rad/s2, its standard error, w in rad/s, tau in N.m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Mechanics {
    rows: Rows<4, PARTS>,
}

/// Values with relative half-widths, however wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) J: Identified,
    pub(super) B: Identified,
    pub(super) tau_coulomb: Identified,
    /// B w + tau_coulomb at the speed of interest.
    pub(super) tau_friction: Identified,
}

impl Found {
    /// Widens the intervals by the relative error `u` of the torque and an error of `tau` (N.m) at the speed `w_f` (rad/s).
    pub(super) fn with(self, u: f64, tau: f64, w_f: f64) -> Self {
        let of = |x: Identified, tau: f64| {
            let share = tau / x.value.max(f64::MIN_POSITIVE);
            Identified { u: (x.u * x.u + u * u + share * share).sqrt().min(1.0), ..x }
        };
        Self {
            J: of(self.J, 0.0),
            B: of(self.B, tau / w_f),
            tau_coulomb: of(self.tau_coulomb, tau),
            tau_friction: of(self.tau_friction, tau),
        }
    }
}

impl Mechanics {
    /// Stores a part; if the store is full, the part is discarded.
    pub(super) fn add(&mut self, acceleration: f64, sigma: f64, w: f64, tau: f64) {
        self.rows.push([acceleration, sigma, w, tau]);
    }

    /// The values, with the friction at `w_f` (rad/s); `J` (kg.m2) is about the inertia, `K_I` (N.m) the torque of I.
    pub(super) fn solve(&self, J: f64, K_I: f64, w_f: f64) -> Option<Found> {
        let (mut x, mut limit) = ([J, 0.0, 0.0], f64::INFINITY);
        let mut last = None;
        for _ in 0..ROUNDS {
            let J = x[0].abs();
            let weight = |[_, sigma, _, tau]: [f64; 4]| 1.0 / (0.01 * tau.abs() + 1e-4 * K_I + J * sigma);
            let left = |x: &[f64; 3], [a, _, w, tau]: [f64; 4]| tau - x[0] * a - x[1] * (w - w_f) - x[2];
            // The unknown friction at w_f, and at 0.
            let (mut at, mut rest) = (Normal::<3>::default(), Normal::<3>::default());
            let (mut kept, mut all) = (0.0, 0.0);
            for row in (0..self.rows.len()).map(|n| self.rows.row(n)) {
                let g = weight(row);
                all += 1.0;
                if (left(&x, row) * g).abs() <= limit {
                    kept += 1.0;
                    let [a, _, w, tau] = row;
                    at.add(&[g * a, g * (w - w_f), g], g * tau);
                    rest.add(&[g * a, g * w, g], g * tau);
                }
            }
            if kept < FEWEST || kept < (1.0 - LEFT_OUT) * all {
                return None;
            }
            let (at, rest) = (at.solve(0.0)?, rest.solve(0.0)?);
            x = at.x;
            let variance = at.variance.max(1.0);
            limit = BEYOND * variance.sqrt();
            let value = |value: f64, spread: f64| {
                let u = 4.0 * variance.sqrt() * spread / value;
                let u = (u * u + LEAST * LEAST).sqrt();
                Identified { value, u: if value > 0.0 { u.min(1.0) } else { 1.0 } }
            };
            last = Some(Found {
                J: value(x[0], at.spread[0]),
                B: value(x[1], at.spread[1]),
                tau_friction: value(x[2], at.spread[2]),
                tau_coulomb: value(rest.x[2], rest.spread[2]),
            });
        }
        last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUE: [f64; 3] = [2e-3, 5e-4, 0.08];

    /// Levels at three speeds and sweeps between them, `change` added to the torque of the part `n`.
    fn parts(change: impl Fn(u32) -> f64) -> Option<Found> {
        let [J, B, tau_coulomb] = TRUE;
        let mut mechanics = Mechanics::default();
        for n in 0..40_u32 {
            let w = [20.0, 40.0, 60.0][(n % 3) as usize];
            let a = [0.0, 0.0, 150.0, 0.0, -150.0][(n % 5) as usize];
            mechanics.add(a, 0.1, w, J * a + B * w + tau_coulomb + change(n));
        }
        // Without torque and without an error of the acceleration, the weight is finite.
        mechanics.add(-(B * 30.0 + tau_coulomb) / J, 0.0, 30.0, 0.0);
        mechanics.solve(1.3 * J, 20.0, 40.0)
    }

    #[test]
    fn exact_parts_give_exact_values_and_one_outlier_is_left_out() {
        for outlier in [0.0, 3.0] {
            let Found { J, B, tau_coulomb, tau_friction } = parts(|n| if n == 17 { outlier } else { 0.0 }).unwrap();
            let friction = TRUE[1] * 40.0 + TRUE[2];
            for (x, expected) in [(J, TRUE[0]), (B, TRUE[1]), (tau_coulomb, TRUE[2]), (tau_friction, friction)] {
                assert!((x.value / expected - 1.0).abs() < 1e-9 && x.u < 1.0, "{x:?}, not {expected}");
            }
            assert!(tau_friction.u < tau_coulomb.u && tau_friction.u < B.u, "the sum is known better");
        }
    }

    /// A load in the second half: no value, or one so uncertain that it is refused.
    #[test]
    fn a_load_on_the_way_is_seen() {
        let found = parts(|n| if n < 20 { 0.0 } else { 0.5 });
        assert!(found.is_none_or(|found| found.tau_friction.u > 0.15), "{found:?}");
    }

    #[test]
    fn too_few_parts_or_one_speed_give_no_value() {
        let mut mechanics = Mechanics::default();
        for _ in 0..7 {
            mechanics.add(1.0, 0.1, 2.0, 3.0);
        }
        assert_eq!(mechanics.solve(1.0, 1.0, 1.0), None);
        for _ in 0..7 {
            mechanics.add(1.0, 0.1, 2.0, 3.0);
        }
        assert_eq!(mechanics.solve(1.0, 1.0, 1.0), None);
    }
}
