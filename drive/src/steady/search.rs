//! Root finding by the Illinois method: the torque reference for a torque at the shaft.

use super::operating::{At, Point};

/// Maximum number of evaluations.
const MAX_EVALUATIONS: usize = 60;

/// Maximum number of evaluations for a reference without a bracket.
const MAX_CORRECTIONS: usize = 12;

/// Allowed residue of the torque at the shaft, relative and in N.m.
const SMALL: f64 = 1e-10;

impl At<'_> {
    /// The point with the torque `tau` (N.m) at the shaft; `None` beyond the [`ends`](Self::ends), or if `tau` is not finite.
    pub fn by_shaft(&self, tau: f64) -> Option<Point> {
        let allowed = SMALL * (1.0 + tau.abs());
        let off = |point: &Point| point.powers.tau_shaft - tau;
        // Iron and friction losses hardly depend on the torque, so two such steps are usually enough.
        let mut at = self.by_reference(tau);
        for _ in 0..3 {
            if off(&at).abs() <= allowed {
                return Some(at);
            }
            at = self.by_reference(at.tau_ref - off(&at));
        }
        let [low, high] = self.ends();
        for end in [low, high] {
            if off(&end).abs() <= allowed.max(1e-9 * tau.abs()) {
                return Some(end);
            }
        }
        if !(off(&low) < 0.0 && off(&high) > 0.0) {
            return None;
        }
        let bracket = [(low.tau_ref, off(&low)), (high.tau_ref, off(&high))];
        Some(self.by_reference(root(bracket, allowed, |tau_ref| off(&self.by_reference(tau_ref)))))
    }
}

impl At<'_> {
    /// The torque reference (N.m) for the torque `tau` (N.m) at the shaft; beyond the limits it is beyond them by the same excess.
    pub fn reference_for(&self, tau: f64) -> f64 {
        let mut reference = tau;
        for _ in 0..MAX_CORRECTIONS {
            let point = self.by_reference(reference);
            // The difference between reference and shaft, which hardly depends on the torque.
            let next = tau + (point.tau_ref - point.powers.tau_shaft);
            let settled = (next - reference).abs() <= SMALL * (1.0 + tau.abs());
            reference = next;
            if settled {
                break;
            }
        }
        reference
    }
}

/// A root of `f` to |f| <= `small`, between two arguments at which its values (second of each pair) have opposite signs: the
/// secant through both ends, with half the value at an end that stays (Illinois).
pub(super) fn root([mut a, mut b]: [(f64, f64); 2], small: f64, f: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..MAX_EVALUATIONS {
        let x = (a.0 * b.1 - b.0 * a.1) / (b.1 - a.1);
        let y = f(x);
        let resolved = (b.0 - a.0).abs() <= 4.0 * f64::EPSILON * x.abs();
        if y.abs() <= small || resolved || y.is_nan() {
            return x;
        }
        if (y > 0.0) == (b.1 > 0.0) {
            a.1 *= 0.5;
        } else {
            a = b;
        }
        b = (x, y);
    }
    b.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_root_is_found_from_both_sides() {
        let f = |x: f64| x * x * x - 2.0;
        for (a, b) in [(0.0, 9.0), (9.0, 0.0), (1.0, 1.3)] {
            let x = root([(a, f(a)), (b, f(b))], 1e-14, f);
            assert!((x - 2.0_f64.cbrt()).abs() < 1e-14, "{x}");
        }
    }
}
