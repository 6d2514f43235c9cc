//! The controller's response to references that need more voltage than the link has.
//!
//! With field weakening, the trim y lowers the voltage of the references until the requested voltage is k_t u_max: the
//! drive settles there, or at the maximum trim. Without it, the current loop saturates; the torque is lowered until the voltage
//! is u_max = u_dc / sqrt 3, or the maximum fundamental of overmodulation, and to 0 if no torque of its sign needs less. Both are equations in one
//! unknown.

use super::operating::{At, Point, Region};
use super::search::root;
use drive_control::weakening::GREATEST_TRIM;

/// Relative error of the voltage at which the equation is solved.
const SMALL: f64 = 1e-10;

/// Share of the torque at which the voltage is compared with that at zero torque, to find the sign of its slope there.
const NEAR: f64 = 1e-6;

/// Steps to the minimum voltage, and the share of the interval that each leaves.
const SECTIONS: u32 = 34;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

impl At<'_> {
    /// Voltage in V that the current loop may request in steady state.
    #[inline]
    pub(super) fn allowed(&self) -> f64 {
        let weakening = &self.drive.controller.weakening;
        let share = if self.trims() { weakening.k_t } else { 1.0 };
        share * self.highest()
    }

    fn trims(&self) -> bool {
        let weakening = &self.drive.controller.weakening;
        weakening.used && weakening.bandwidth > 0.0
    }

    /// The point of the torque reference `tau` (N.m) within the voltage of the link; `at_once` ignores it.
    #[cold]
    pub(super) fn within_voltage(&self, tau: f64, at_once: Point) -> Point {
        let allowed = self.allowed();
        let excess = |point: &Point| point.requested - allowed;
        let small = SMALL * allowed;
        if self.trims() {
            let most = GREATEST_TRIM * self.highest();
            let trimmed = |trim: f64| self.trimmed(trim).of_reference(tau);
            let last = trimmed(most);
            if excess(&last) >= 0.0 {
                return last;
            }
            let bracket = [(0.0, excess(&at_once)), (most, excess(&last))];
            return trimmed(root(bracket, small, |trim| excess(&trimmed(trim))));
        }
        let of = |tau: f64| excess(&self.of_reference(tau));
        let tau_ref = inside(at_once.tau_ref, of)
            .map_or(0.0, |inside| root([(at_once.tau_ref, excess(&at_once)), inside], small, of));
        Point { region: Region::Limit, ..self.of_reference(tau_ref) }
    }
}

/// A torque between 0 and `tau` (N.m) whose `excess` (V) is negative, and this excess; `None` if there is none. The R i of a generator
/// opposes the EMF, so the excess may first fall; it has one minimum, which a golden-section search approaches.
fn inside(tau: f64, excess: impl Fn(f64) -> f64) -> Option<(f64, f64)> {
    let of = |tau: f64| (tau, excess(tau));
    let [at_0, near_0] = [0.0, NEAR * tau].map(of);
    if at_0.1 < 0.0 || near_0.1 >= at_0.1 {
        return Some(at_0).filter(|at| at.1 < 0.0);
    }
    let (mut low, mut high) = (0.0, tau);
    let [mut a, mut b] = [1.0 - GOLDEN, GOLDEN].map(|share| of(share * tau));
    for _ in 0..SECTIONS {
        if let Some(found) = [a, b].into_iter().find(|at| at.1 < 0.0) {
            return Some(found);
        }
        if a.1 < b.1 {
            (high, b) = (b.0, a);
            a = of(high - GOLDEN * (high - low));
        } else {
            (low, a) = (a.0, b);
            b = of(low + GOLDEN * (high - low));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parabola that falls from 1 V to `least` (V) at the share `at` of the torque, for torques of both signs.
    #[test]
    fn a_torque_with_less_voltage_is_found() {
        for tau in [-3.0, 5.0] {
            for at in [0.01, 0.4, 0.99] {
                for least in [-0.5, -1e-6, 1e-6, 0.3] {
                    let excess = |x: f64| least + (1.0 - least) * (x / (tau * at) - 1.0) * (x / (tau * at) - 1.0);
                    let found = inside(tau, excess);
                    assert_eq!(found.is_some(), least < 0.0, "{tau} {at} {least}: {found:?}");
                    assert!(found.is_none_or(|(x, y)| y < 0.0 && y.to_bits() == excess(x).to_bits() && x / tau <= 1.0));
                }
            }
        }
        assert_eq!(inside(2.0, |x| x + 1.0), None);
        assert_eq!(inside(2.0, |x| x - 1.0), Some((0.0, -1.0)));
    }
}
