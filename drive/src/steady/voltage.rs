//! The controller's response to references that need more voltage than the link has.
//!
//! With field weakening, the trim y lowers the voltage of the references until the requested voltage is k_t u_max: the
//! drive settles there, or at the maximum trim. u_max = u_dc / sqrt 3, or the maximum fundamental of overmodulation.
//!
//! Without it, the current loop saturates. In Linear, the voltage then runs along the hexagon with the angle of its request, up to 1.049
//! u_dc / sqrt 3. What is cut off drives the integrators back: K_p (i_ref - i) = u_requested - u in each axis. So the error
//! has the direction of K_p^-1 u, and with the fundamental F(mu) of a request from which mu F is [cut
//! off](drive_base::overmodulation::ModulationMode::cut)
//!
//! ```text
//! i = i_ref - mu K_p^-1 u(i)          |u(i)| = F(mu), the smallest mu > 0
//! u(i) = u_ref - A (i_ref - i):       u = (1 + mu A K_p^-1)^-1 u_ref         A = du/di, exact for a linear machine, otherwise Newton's
//! ```
//!
//! A generator's current then exceeds `limit.i`. The current limit takes a voltage along L i from the request, so that the error gains a
//! part along i: the same equation with a lower i_ref, of the same direction, for which |i| is the limit.
//!
//! Since u_d falls with i_q, i_d rises, and with saliency the torque is far below the maximum at this voltage. That maximum is the
//! torque of a lower reference: [`At::by_reference`] searches for it, within the voltage of a sinusoid, and [`At::by_loop`] returns the state of
//! the drive. Derived here; u in V, i in A, K_p in V/A, A in Ohm.

use super::drive::Steady;
use super::operating::{At, Point, Region};
use super::search::root;
use drive_base::frame::Dq;
use drive_control::weakening::GREATEST_TRIM;

/// Relative error of the voltage at which the equation is solved.
const SMALL: f64 = 1e-10;

/// Share of the torque at which the voltage is compared with that at zero torque, to find the sign of its slope there.
const NEAR: f64 = 1e-6;

/// Steps to the minimum voltage, and the share of the interval that each leaves.
const SECTIONS: u32 = 34;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Relative tolerance of the maximum voltage.
const TOLERANCE: f64 = 1e-6;

/// Maximum number of rounds of Newton's method, and the step of its difference quotients as a share of U / K_p.
const MAX_ROUNDS: u32 = 20;
const NEARBY: f64 = 1e-4;

/// First mu of the search as a share of the reciprocal of M's magnitude, and the maximum number of doublings.
const FIRST: f64 = 1e-3;
const DOUBLINGS: u32 = 60;

impl Steady {
    /// Whether the voltage of the point is within the fundamental of `modulation.mode`.
    pub fn fits(&self, point: &Point) -> bool {
        point.u_share <= self.controller.modulation.mode.reach() * (1.0 + TOLERANCE)
    }
}

impl At<'_> {
    /// Whether the voltage of the point is within the fundamental of `modulation.mode`, as [`Steady::fits`] says.
    pub fn fits(&self, point: &Point) -> bool {
        self.drive.fits(point)
    }

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

    /// The point of a current loop with the torque reference `tau` (N.m), which the limits clip: as [`by_reference`](Self::by_reference), but
    /// the reference remains where the loop saturates.
    #[inline]
    pub fn by_loop(&self, tau: f64) -> Point {
        let point = if self.trims() { self.by_reference(tau) } else { self.of_reference(tau) };
        if self.fits(&point) { point } else { self.saturated(tau) }
    }

    /// The point of a loop that saturates with the references of the torque `tau` (N.m), under the maximum trim, if any.
    #[cold]
    fn saturated(&self, tau: f64) -> Point {
        let at_most = if self.trims() { self.trimmed(GREATEST_TRIM * self.highest()) } else { self.clone() };
        let (i_ref, weakens) = at_most.references(tau);
        let limit = self.drive.controller.limit.i;
        let excess = |point: &Point| point.i.magnitude() - limit;
        let mut point = self.driven_back(i_ref);
        if excess(&point) > 0.0 {
            let of = |share: f64| self.driven_back(i_ref * share);
            let none = of(0.0);
            point = if excess(&none) < 0.0 {
                let bracket = [(0.0, excess(&none)), (1.0, excess(&point))];
                of(root(bracket, SMALL * limit, |share| excess(&of(share))))
            } else {
                none
            };
        }
        Point { region: Region::Limit, limits: self.limits(), weakens, ..point }
    }

    /// The point of a loop with the references `i_ref` (A), whose integrators the voltage limit drives back, if it acts. The requested
    /// voltage includes what is cut off.
    fn driven_back(&self, i_ref: Dq) -> Point {
        let (mode, gains) = (self.drive.controller.modulation.mode, self.drive.settled().current_loop());
        let highest = |mu: f64| self.full(mode.cut(mu));
        let divided = |u: Dq| Dq::new(u.d() / gains[0], u.q() / gains[1]);
        let (mut i, mut at, mut cut) = (i_ref, self.by_current(i_ref), 0.0);
        let size = self.highest() / gains[0].max(gains[1]);
        let requested = |point: &Point| point.legs * (1.0 / self.held.share);
        for _ in 0..MAX_ROUNDS {
            let near = |away: Dq| (requested(&self.by_current(i + away)) - requested(&at)) * (1.0 / away.magnitude());
            let [d, q] = [Dq::new(NEARBY * size, 0.0), Dq::new(0.0, NEARBY * size)].map(near);
            let off = i_ref - i;
            let u_ref = requested(&at) + d * off.d() + q * off.q();
            let Some((mu, u)) = limited(u_ref, [d * (1.0 / gains[0]), q * (1.0 / gains[1])], &highest) else { break };
            let next = i_ref - divided(u) * mu;
            let step = (next - i).magnitude();
            (i, at, cut) = (next, self.by_current(next), mu);
            if step <= SMALL * size {
                break;
            }
        }
        Point { requested: at.requested * (1.0 + cut), u_share: at.u_share * (1.0 + cut), ..at }
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

/// The smallest mu > 0 at which u = (1 + mu M)^-1 u_ref has the magnitude `highest(mu)` (V), and this u (V); M has these columns (1/mu). `None` if
/// `u_ref` (V) is not larger.
fn limited(u_ref: Dq, [d, q]: [Dq; 2], highest: &impl Fn(f64) -> f64) -> Option<(f64, Dq)> {
    let (trace, determinant) = (d.d() + q.q(), d.cross(q));
    // The adjugate of M, applied to u_ref.
    let turned = Dq::new(q.q() * u_ref.d() - q.d() * u_ref.q(), d.d() * u_ref.q() - d.q() * u_ref.d());
    let u = |mu: f64| (u_ref + turned * mu) * (1.0 / (1.0 + mu * trace + mu * mu * determinant));
    let excess = |mu: f64| u(mu).magnitude() - highest(mu);
    let mut low = (0.0, excess(0.0));
    if low.1.is_nan() || low.1 <= 0.0 {
        return None;
    }
    let mut mu = FIRST / (trace.abs() + determinant.abs().sqrt());
    for _ in 0..DOUBLINGS {
        let high = (mu, excess(mu));
        if high.1 <= 0.0 {
            let mu = root([low, high], SMALL * highest(0.0), excess);
            return Some((mu, u(mu)));
        }
        (low, mu) = (high, 2.0 * mu);
    }
    None
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
