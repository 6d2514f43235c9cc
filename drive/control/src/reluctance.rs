//! The I-f start at currents above i_0 = psi_M / (L_q - L_d), where the reluctance torque outweighs that of the magnet.
//!
//! With the current on the d-axis, the stiffness of the rotor is 1.5 n_p i (psi_M - (L_q - L_d) i): above i_0 it is negative, and the
//! rotor leaves the current. With the rotor a small angle delta behind its frame, the torque grows by S delta,
//!
//! S = 1.5 n_p (A i_q + B i_d), A = (L_q - L_d) i_q, B = psi_M - (L_q - L_d) i_d,
//!
//! which is positive for 0 <= i_d <= i_0 and any i_q other than 0. The torque on the frame itself is 1.5 n_p B i_q: it vanishes on
//! the line i_d = i_0, where the magnitude of i_q is free.
//!
//! 1. Alignment with i_0 / 2, where S has its maximum on the d-axis.
//! 2. On the ramp, i_q and the acceleration rise together, and i_d is that of the torque: B = J dw/dt / (1.5 n_p n_p i_q), up to the line.
//! 3. At the end, the current goes to 0 in 10 ms, i_q first, so that the magnet's EMF shows the rotor, and the estimator takes over. A
//!    load then acts as a step.
//!
//! The EMF in the frame, e = d(psi)/dt + j w psi - c d(L i)/dt - j w L i, shows angle and slip of the rotor, to first order:
//! e_d = A d(delta)/dt + w B delta, e_q = w psi_M - B d(delta)/dt + w A delta. The slip is damped by D = 2 zeta w_0 J / n_p, w_0 =
//! sqrt(n_p S / J), with the smallest current that gives the torque: along the gradient n of the torque, 1.5 n_p (-A, B).
//!
//! What c d(L i)/dt leaves of the change of flux linkage, Delta d(i)/dt along n, feeds back through the gain K = D / (1.5 n_p (A^2 + B^2)).
//! With a filter of the time constant T_f, the damping acts with the lag T_f + K Delta, which must stay positive: with c = 1 and a
//! filter of 1 / (10 w_0), an inductance that saturates by 5 % makes it oscillate; with c = 0, the lag exceeds 1 / w_0 for L_q >> L_d.
//! So c = 0.75 and T_f = 0.35 K L_n, with the inductance L_n = (L_d A^2 + L_q B^2) / (A^2 + B^2) along n: inductances from 0.4 L on are
//! stable. The lag for L itself, 0.6 K L_n, is at most 0.6 / w_0 by zeta <= (A^2 + B^2) / (2 (A i_q + B i_d) L_n).
//!
//! Derived here. Angles in rad (electrical), e in V, i in A, flux linkages in Wb.

use drive_base::frame::{Axis, DqHat, Estimated};
use drive_base::math::{at_least, at_most};
use drive_base::motor::Motor;

/// Maximum damping ratio.
const ZETA: f64 = 1.0;
/// Maximum lag of the damping at the inductances of the controller, K L_n, in units of 1 / w_0.
const LAG: f64 = 1.0;
/// Share c of d(L i)/dt that the EMF leaves out.
pub(crate) const CHANGE_OF_CURRENT: f64 = 0.75;
/// Time constant of the filter of the EMF in units of K L_n.
const FILTER: f64 = 0.35;
/// Iterations for the angle, which is at most [`FARTHEST`].
const ITERATIONS: usize = 6;
/// Maximum angle in rad between frame and rotor.
const FARTHEST: f64 = 1.2;

/// A machine on the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    L_d: f64,
    /// L_q - L_d in H.
    saliency: f64,
    psi_M: f64,
    /// 1.5 n_p.
    per_flux: f64,
    n_p: f64,
    J: f64,
}

impl Line {
    /// For a start with the current `i` (A) above i_0; otherwise the magnet holds the rotor on the d-axis.
    pub(crate) fn of(motor: &Motor, J: f64, i: f64) -> Option<Self> {
        let (saliency, n_p) = (motor.L_q - motor.L_d, f64::from(motor.n_p));
        let line = Self { L_d: motor.L_d, saliency, psi_M: motor.psi_M, per_flux: 1.5 * n_p, n_p, J };
        (saliency * i > motor.psi_M).then_some(line)
    }

    /// i_0 in A.
    pub(crate) fn i_0(&self) -> f64 {
        self.psi_M / self.saliency
    }

    /// A and B in Wb at the current `i` (A).
    fn fluxes(&self, i: DqHat) -> (f64, f64) {
        (self.saliency * i.q(), self.psi_M - self.saliency * i.d())
    }

    /// w_0 in rad/s at the current `i` (A).
    fn swing(&self, i: DqHat) -> f64 {
        let (A, B) = self.fluxes(i);
        (self.n_p * self.per_flux * (A * i.q() + B * i.d()) / self.J).max(0.0).sqrt()
    }

    /// The damping D / n_p in N.m.s (electrical speed) around `i` (A), and its lag K L_n in s.
    fn damped(&self, i: DqHat) -> (f64, f64) {
        let (A, B) = self.fluxes(i);
        let (square, swing) = (A * A + B * B, self.swing(i));
        let L_n = (self.L_d * A * A + (self.L_d + self.saliency) * B * B) / square;
        // K L_n w_0 = 2 zeta (A i_q + B i_d) L_n / (A^2 + B^2).
        let per_zeta = 2.0 * (A * i.q() + B * i.d()) * L_n / square;
        let zeta = at_most(LAG / per_zeta, ZETA);
        (2.0 * zeta * swing * self.J / self.n_p, zeta * per_zeta / swing)
    }

    /// Bandwidth in rad/s of the filter of the EMF at the current `i` (A), at most `most`.
    pub(crate) fn filter(&self, i: DqHat, most: f64) -> f64 {
        at_most(1.0 / (FILTER * self.damped(i).1), most)
    }

    /// The current in A with the `share` of `i_q` (A) that accelerates the frame by that share of `acceleration` (rad/s2, electrical): i_d
    /// is between that of the alignment, less the share of it, and i_0.
    pub(crate) fn accelerating(&self, share: f64, i_q: f64, acceleration: f64) -> DqHat {
        let B = self.J * acceleration / (self.n_p * self.per_flux * i_q);
        let least = 0.5 * self.i_0() * (1.0 - share);
        DqHat::new(at_least(at_most((self.psi_M - B) / self.saliency, self.i_0()), least), share * i_q)
    }

    /// The magnitude of i_q in A on the line, with the current `i` (A).
    pub(crate) fn i_q(&self, i: f64) -> f64 {
        (i * i - self.i_0() * self.i_0()).max(0.0).sqrt()
    }

    /// The current (A) that damps the rotor around `i` (A) with the EMF `e` (V) in a frame at `w` (rad/s), at most `most` (A).
    pub(crate) fn damping(&self, i: DqHat, e: DqHat, w: f64, most: f64) -> DqHat {
        let (A, B) = self.fluxes(i);
        let square = A * A + B * B;
        let slip = (A * e.d() - B * (e.q() - w * self.psi_M)) / square;
        let torque = self.damped(i).0 * slip;
        let damping = DqHat::new(-A, B) * (torque / (self.per_flux * square));
        let magnitude = damping.magnitude();
        if magnitude > most { damping * (most / magnitude) } else { damping }
    }

    /// The angle (rad) of the rotor behind the frame, at `w` (rad/s) and with the EMF `e` (V) at the current `i` (A): the flux linkage
    /// e / (j w) is that of the rotor there, by least squares.
    pub(crate) fn behind(&self, i: DqHat, e: DqHat, w: f64) -> f64 {
        let flux = DqHat::new(e.q() / w, -e.d() / w);
        let mut angle = 0.0_f64;
        for _ in 0..ITERATIONS {
            let (A, B) = self.fluxes(turned(i, angle));
            // L_q i is the same in both frames. Beyond it, there is B on the rotor's d-axis.
            let shown = turned(DqHat::new(flux.d() - self.saliency * i.d(), flux.q()), angle);
            let (r_d, r_q) = (B - shown.d(), -shown.q());
            // The derivative of the model in the rotor's frame: (A, -B).
            angle -= (A * r_d - B * r_q) / (A * A + B * B);
            angle = angle.clamp(-FARTHEST, FARTHEST);
        }
        angle
    }

    /// The current (A) in the frame on the way from `i` (A) to 0 for a rotor `behind` (rad) the frame: i_q first, because i_d = i_0 gives no
    /// torque. `left` is the share of the way.
    pub(crate) fn leaving(i: DqHat, behind: f64, left: f64) -> DqHat {
        let own = turned(i, behind);
        // i_d is 0 for the second half: the current loop gets there.
        let i_d = if left > 0.5 { own.d() } else { 0.0 };
        turned(DqHat::new(i_d, own.q() * (2.0 * left - 1.0).max(0.0)), -behind)
    }
}

/// A vector of the frame in a frame `angle` (rad) behind.
fn turned(x: DqHat, angle: f64) -> DqHat {
    let turned = Axis::<Estimated>::at(angle).to_stator(x);
    DqHat::new(turned.alpha(), turned.beta())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTOR: Motor = Motor { n_p: 2, R_s: 0.42, L_d: 10e-3, L_q: 48e-3, psi_M: 0.25 };

    fn line() -> Line {
        Line::of(&MOTOR, 0.05, 37.0).unwrap()
    }

    /// Flux linkage (Wb) in the frame of a rotor `angle` (rad) behind, with the current `i` (A) of the frame.
    fn linkage(i: DqHat, angle: f64) -> DqHat {
        let own = turned(i, angle);
        turned(DqHat::new(MOTOR.psi_M + MOTOR.L_d * own.d(), MOTOR.L_q * own.q()), -angle)
    }

    /// EMF (V) of the frame at `w` (rad/s), with a rotor `angle` (rad) behind that slips by `slip` (rad/s).
    fn emf(i: DqHat, w: f64, angle: f64, slip: f64) -> DqHat {
        let h = 1e-6;
        let change = (linkage(i, angle + h) - linkage(i, angle - h)) * (0.5 * slip / h);
        let own = DqHat::new(MOTOR.L_d * i.d(), MOTOR.L_q * i.q());
        change + (linkage(i, angle) - own).turned() * w
    }

    #[test]
    fn only_a_current_above_i_0_takes_the_line() {
        assert!((line().i_0() - 6.578_947).abs() < 1e-6);
        assert!(Line::of(&MOTOR, 0.05, 6.5).is_none());
        let round = Motor { L_q: MOTOR.L_d, ..MOTOR };
        let inverse = Motor { L_d: MOTOR.L_q, L_q: MOTOR.L_d, ..MOTOR };
        assert!(Line::of(&round, 0.05, 1e9).is_none() && Line::of(&inverse, 0.05, 1e9).is_none());
    }

    /// w_0 from the slope of the torque, on the d-axis and on the line.
    #[test]
    fn the_swing_follows_from_the_torque() {
        let torque = |i: DqHat, angle: f64| {
            let own = turned(i, angle);
            MOTOR.torque(own.d(), own.q())
        };
        for i in [DqHat::new(3.29, 0.0), DqHat::new(4.0, 12.0), DqHat::new(6.58, 36.0), DqHat::new(6.58, -36.0)] {
            let slope = (torque(i, 1e-6) - torque(i, -1e-6)) / 2e-6;
            let expected = (2.0 * slope / 0.05).sqrt();
            assert!((line().swing(i) / expected - 1.0).abs() < 1e-6, "{i:?}: {}, not {expected}", line().swing(i));
        }
        assert!(line().swing(DqHat::new(20.0, 0.0)) < 1e-12, "above i_0, the d-axis does not hold the rotor");
    }

    /// Damping gives the torque 2 zeta w_0 J / n_p times the slip, for an angle that the EMF shows as well.
    #[test]
    fn the_damping_is_a_torque_against_the_slip() {
        for (i, w) in [(DqHat::new(3.29, 0.0), 0.0), (DqHat::new(6.58, 36.0), 47.0), (DqHat::new(6.58, -36.0), -47.0)] {
            for angle in [0.0, 0.02, -0.02] {
                let slip = 2.0;
                let added = line().damping(i, emf(i, w, angle, slip), w, 1e9);
                let h = 1e-6 / added.magnitude();
                let torque = |x: DqHat| MOTOR.torque(x.d(), x.q());
                let given = (torque(i + added * h) - torque(i)) / h;
                let expected = line().damped(i).0 * slip;
                assert!((given / expected - 1.0).abs() < 0.05, "{i:?}, {angle} rad: {given} N.m, not {expected} N.m");
            }
            let limited = line().damping(i, emf(i, w, 0.0, 50.0), w, 1.5);
            assert!((limited.magnitude() - 1.5).abs() < 1e-12);
        }
    }

    /// The flux linkage shows the rotor also on the line, where the EMF of the estimators vanishes.
    #[test]
    fn the_emf_shows_the_rotor_behind_the_frame() {
        for (w, side) in [(47.0, 1.0), (-47.0, -1.0)] {
            for angle in [-0.4, -0.05, 0.0, 0.1, 0.5] {
                let i = DqHat::new(6.58, 36.0 * side);
                let found = line().behind(i, emf(i, w, angle * side, 0.0), w);
                assert!((found - angle * side).abs() < 1e-6, "{found} rad, not {} rad", angle * side);
            }
        }
    }

    /// On the way to 0, a rotor on the line gets no torque, and the way begins at the current.
    #[test]
    fn there_is_no_torque_on_the_way_to_the_hand_over() {
        for (behind, side) in [(0.0, 1.0), (0.2, 1.0), (-0.1, -1.0)] {
            let i = turned(DqHat::new(line().i_0(), 36.0 * side), -behind);
            assert!((Line::leaving(i, behind, 1.0) - i).magnitude() < 1e-9);
            for left in [0.9, 0.7, 0.51, 0.4, 0.0] {
                let own = turned(Line::leaving(i, behind, left), behind);
                assert!(MOTOR.torque(own.d(), own.q()).abs() < 1e-9, "{left}: {own:?}");
                assert!(left > 0.5 || own.magnitude() < 1e-12);
            }
        }
    }

    /// The torque of the frame's acceleration, where i_d is between its bounds.
    #[test]
    fn the_current_on_the_ramp_accelerates_the_frame() {
        let i = line().accelerating(1.0, 36.0, 600.0);
        assert!((MOTOR.torque(i.d(), i.q()) - 0.05 * 300.0).abs() < 1e-9, "{i:?}");
        let rest = line().accelerating(1.0, -36.0, 0.0);
        assert!((rest.d() - line().i_0()).abs() < 1e-12 && MOTOR.torque(rest.d(), rest.q()).abs() < 1e-9);
        assert!((line().accelerating(0.0, 36.0, 600.0) - DqHat::new(0.5 * line().i_0(), 0.0)).magnitude() < 1e-12);
    }
}
