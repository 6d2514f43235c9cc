//! What the controller does where its references need more voltage than the link has.
//!
//! With field weakening, its trim y lowers the voltage of the references until the requested voltage is k_t u_dc / sqrt 3:
//! the drive settles there, or at the greatest trim. Without, the current loop saturates; the torque is lowered until the
//! voltage is u_dc / sqrt 3, the greatest that a sinusoid can have, and to 0 where the EMF alone is more. Both are equations of
//! one unknown.

use super::operating::{At, Point, Region};
use super::search::root;
use drive_control::weakening::GREATEST_TRIM;

/// Share of the voltage to which the equation is solved.
const SMALL: f64 = 1e-10;

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

    /// The point of the torque reference `tau` (N.m) within the voltage; `at_once` is that without regard to it.
    #[cold]
    pub(super) fn within_voltage(&self, tau: f64, at_once: Point) -> Point {
        let allowed = self.allowed();
        let excess = |point: &Point| point.requested - allowed;
        let small = SMALL * allowed;
        if self.trims() {
            let greatest = GREATEST_TRIM * self.highest();
            let trimmed = |trim: f64| self.trimmed(trim).of_reference(tau);
            let last = trimmed(greatest);
            if excess(&last) >= 0.0 {
                return last;
            }
            let bracket = [(0.0, excess(&at_once)), (greatest, excess(&last))];
            return trimmed(root(bracket, small, |trim| excess(&trimmed(trim))));
        }
        let none = self.of_reference(0.0);
        let tau_ref = if excess(&none) >= 0.0 {
            0.0
        } else {
            let bracket = [(at_once.tau_ref, excess(&at_once)), (0.0, excess(&none))];
            root(bracket, small, |tau| excess(&self.of_reference(tau)))
        };
        Point { region: Region::Limit, ..self.of_reference(tau_ref) }
    }
}
