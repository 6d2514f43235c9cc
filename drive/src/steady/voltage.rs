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

/// Steps to the minimum voltage; each reduces the interval to two thirds.
const THIRDS: u32 = 40;

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
        let fits = |tau: f64| Some((tau, of(tau))).filter(|(_, excess)| *excess < 0.0);
        let inside = fits(0.0).or_else(|| fits(self.lowest_voltage(at_once.tau_ref)));
        let tau_ref = inside.map_or(0.0, |inside| root([(at_once.tau_ref, excess(&at_once)), inside], small, of));
        Point { region: Region::Limit, ..self.of_reference(tau_ref) }
    }

    /// The torque reference between 0 and `tau` (N.m) with the minimum voltage: the R i of a generator opposes the EMF.
    fn lowest_voltage(&self, tau: f64) -> f64 {
        let requested = |tau: f64| self.of_reference(tau).requested;
        let (mut low, mut high) = (0.0, tau);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            if requested(low + third) < requested(high - third) {
                high -= third;
            } else {
                low += third;
            }
        }
        0.5 * (low + high)
    }
}
