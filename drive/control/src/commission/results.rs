//! Results with the half-widths of their intervals, and the conditions under which they are refused.

use super::axes::Axes;
use super::bench::Bench;
use super::identified::Identified;
use super::mechanics::Found;
use super::output_error::Magnetization;
use super::resistance::Line;
use drive_base::frame::SQRT_3;
use serde::{Deserialize, Serialize};

/// Maximum residual of a loop over its amplitude, along d and q.
const RESIDUAL: [f64; 2] = [0.02, 0.01];
/// Maximum relative half-width of R_s.
pub const LIMIT_R: f64 = 0.01;
/// Maximum relative half-width of the inductances.
pub const LIMIT_L: f64 = 0.05;
/// Maximum relative half-width of the dead time's values.
pub const LIMIT_DEAD: f64 = 0.5;
/// Maximum relative half-width of s_2 and s_3.
pub const LIMIT_SATURATION: f64 = 0.5;
/// Maximum relative half-width of psi_M.
const LIMIT_PSI: f64 = 0.02;
/// Maximum relative half-width of J.
const LIMIT_J: f64 = 0.05;
/// Maximum relative half-width of the friction's values.
const LIMIT_FRICTION: f64 = 0.15;

/// Results of the commissioning.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Stator resistance with one transistor in Ohm.
    pub R_s: Identified,
    /// L(0) in H of the d-axis and of the q-axis.
    pub L_d: Identified,
    /// L(0) in H of the q-axis.
    pub L_q: Identified,
    /// psi(i)/i - without the magnet - in H at `i_d` along the magnet.
    pub L_d_plus: Identified,
    /// psi(i)/i - without the magnet - in H at `i_d` against the magnet.
    pub L_d_minus: Identified,
    /// psi(i)/i in H at `i_q`.
    pub L_q_chord: Identified,
    /// Dead-time voltage of a leg in V, with the threshold of its devices.
    pub u_dead: Identified,
    /// Twice the current in A below which a leg loses less.
    pub i_zero: Identified,
    /// Second-order d-axis saturation coefficient in A/Wb2.
    pub s_2: Identified,
    /// Third-order d-axis saturation coefficient in A/Wb3.
    pub s_3: Identified,
    /// Both, however uncertain, and the half-width of s_2.
    pub(super) saturation: [f64; 3],
    /// Permanent-magnet flux linkage in Wb.
    pub psi_M: Identified,
    /// Moment of inertia in kg.m2.
    pub J: Identified,
    /// Viscous friction in N.m.s/rad, and Coulomb friction in N.m.
    pub B: Identified,
    /// Coulomb friction in N.m.
    pub tau_coulomb: Identified,
    /// Both together at 0.3 of the rated speed in N.m, known better than each of them.
    pub tau_friction: Identified,
    /// Currents in A of the chords.
    pub i_d: f64,
    /// Current in A of the q-axis chord.
    pub i_q: f64,
    /// Angle of the d-axis in rad at the end; for a blocked rotor modulo pi, unless `north`.
    pub axis: f64,
    /// The rotor did not turn.
    pub blocked: bool,
    /// The saturation shows the magnet's north pole at `axis`.
    pub north: bool,
}

impl Results {
    /// R_s and the inverter: the mean half-width of both fits, and half of their difference. If the dead time delays the pulses by
    /// t_d / 2, the samples exceed the mean current by its share R_s t_d / (2 L); between the pulses, the current is an exponential,
    /// and the samples are too small by the share (R_s T / L)^2 / 96. R_s contains both.
    pub(super) fn show_resistance(&mut self, bench: &Bench, lines: [&Line; 2]) {
        let [a, b] = lines;
        let of = |a: [f64; 2], b: [f64; 2], value: f64, limit: f64| {
            let half = 0.5 * (a[1] + b[1] + (a[0] - b[0]).abs());
            let u = if value > 0.0 { half / value } else { 1.0 };
            Identified::within(value, u, limit)
        };
        let (x, late) = (bench.R * bench.carrier / bench.L_c, bench.u_dead / (2.0 * SQRT_3 * bench.U));
        let wider = |[R, half]: [f64; 2]| [R, half + bench.R * x * (1.5 * late + x / 96.0)];
        self.R_s = of(wider(a.R), wider(b.R), bench.R, LIMIT_R);
        self.u_dead = of(a.u_dead, b.u_dead, bench.u_dead, LIMIT_DEAD);
        // The tails of dead time and threshold differ from 1/i: twice the half-width holds 95 % of the values.
        let double = |x: [f64; 2]| [2.0 * x[0], 4.0 * x[1]];
        self.i_zero = of(double(a.i_x), double(b.i_x), 2.0 * bench.i_x, LIMIT_DEAD);
    }

    /// psi(i)/i - without the magnet - in H at the d-axis current `i` (A), of i = x/L + s_2 x^2 + s_3 x^3 with `L` (H).
    pub(super) fn chord_d(&self, L: f64, i: f64) -> f64 {
        let (s_2, s_3, mut x) = (self.saturation[0], self.saturation[1], L * i);
        for _ in 0..4 {
            let slope = 1.0 / L + (2.0 * s_2 + 3.0 * s_3 * x) * x;
            x -= (x / L + (s_2 + s_3 * x) * x * x - i) / slope.max(0.5 / L);
        }
        x / i
    }

    /// Flux linkage, refused where L_d is: the currents of iron loss turn the angle.
    pub(super) fn show_flux(&mut self, psi_M: Identified) {
        self.psi_M = Identified::within(psi_M.value, psi_M.u, self.with_l_d(LIMIT_PSI));
    }

    /// The limit, which has no effect if L_d is refused.
    fn with_l_d(&self, limit: f64) -> f64 {
        if self.L_d.u < 1.0 { limit } else { 0.0 }
    }

    /// Inertia and friction; the latter is refused if L_d is, because the iron loss brakes like friction.
    pub(super) fn show_mechanics(&mut self, found: Found) {
        let of = |x: Identified, limit: f64| Identified::within(x.value, x.u, limit);
        self.J = of(found.J, LIMIT_J);
        let friction = self.with_l_d(LIMIT_FRICTION);
        self.B = of(found.B, friction);
        self.tau_coulomb = of(found.tau_coulomb, friction);
        self.tau_friction = of(found.tau_friction, friction);
    }

    /// Inductances, refused where the loops do not agree or do not fit; without the axis, neither chords nor saturation.
    pub(super) fn show_inductances(&mut self, axes: &Axes, large: [Option<Magnetization>; 2]) {
        let Axes { L_d, L_q, known, spread, .. } = *axes;
        let of = |loop_: Option<Magnetization>, limit: f64, L: f64| {
            let large = loop_.filter(|m| m.residual <= limit)?;
            let u = (L / large.at_zero() - 1.0).abs() + 0.01 + spread;
            (u <= LIMIT_L).then_some((large, u))
        };
        let chord = |m: &Magnetization, sign: f64, u: f64| {
            m.chord(sign).filter(|_| known).map_or(Identified::default(), |value| Identified { value, u })
        };
        let r = self;
        r.north = known && !r.blocked;
        if let Some((d, u)) = of(large[0], RESIDUAL[0], L_d) {
            (r.L_d, r.i_d) = (Identified { value: L_d, u }, d.A);
            (r.L_d_plus, r.L_d_minus) = (chord(&d, 1.0, u), chord(&d, -1.0, u));
            if known {
                let [s_2, s_3] = d.saturation(L_d, u);
                // An interval with 0 in it shows no saturation.
                let shown = |[s, half]: [f64; 2]| Identified::within(s, half / s.abs(), LIMIT_SATURATION);
                (r.s_2, r.s_3, r.saturation) = (shown(s_2), shown(s_3), [s_2[0], s_3[0], s_2[1]]);
            }
            let difference = r.L_d_minus.value - r.L_d_plus.value;
            if known && r.blocked && difference.abs() > 0.005 * L_d {
                r.north = true;
                if difference < 0.0 {
                    std::mem::swap(&mut r.L_d_plus, &mut r.L_d_minus);
                    r.axis = drive_base::math::wrap(r.axis + std::f64::consts::PI);
                    (r.s_2.value, r.saturation[0]) = (-r.s_2.value, -r.saturation[0]);
                }
            }
        }
        if let Some((q, u)) = of(large[1], RESIDUAL[1], L_q) {
            (r.L_q, r.i_q) = (Identified { value: L_q, u }, q.A);
            r.L_q_chord = chord(&q, 1.0, u);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(value: f64, u: f64) -> Identified {
        Identified { value, u }
    }

    #[test]
    fn a_chord_has_the_saturation() {
        let r = Results { saturation: [40.0, 300.0, 1.0], ..Results::default() };
        for i in [-3.0, -0.9, 0.9, 3.0] {
            let x = i * r.chord_d(36e-3, i);
            assert!((x / 36e-3 + 40.0 * x * x + 300.0 * x * x * x - i).abs() < 1e-6, "{i} A: {x} Wb");
        }
        assert!((Results::default().chord_d(36e-3, -0.9) - 36e-3).abs() < 1e-12);
    }

    /// Iron loss, which appears in the loops of the d-axis, brakes like friction.
    #[test]
    fn without_l_d_no_flux_and_no_friction() {
        let found = Found {
            J: known(1e-3, 0.01),
            B: known(1e-3, 0.1),
            tau_coulomb: known(0.1, 0.1),
            tau_friction: known(0.1, 0.05),
        };
        for u in [0.01, 1.0] {
            let mut r = Results { L_d: known(1e-3, u), ..Results::default() };
            r.show_flux(known(0.1, 0.001));
            r.show_mechanics(found);
            assert!(r.J.u < 1.0);
            for x in [r.psi_M, r.B, r.tau_coulomb, r.tau_friction] {
                assert_eq!(x.u < 1.0, u < 1.0, "{r:?}");
            }
        }
    }
}
