//! Signs of the currents: between two kinks, legs and devices are affine in the current.
//!
//! While each phase current stays on one side of the zone +-`inverter.i_zero`, dead time is a constant voltage, and so is
//! the share of each device in a period:
//!
//! ```text
//! drop = a + D i          a = sign u_0 + on u_1, D = r_0 + sign on r_1 of each leg          on = 2 d - 1
//! ```
//!
//! with half of the sum (0) and of the difference (1) of transistor and diode: [`Switches`] with fixed signs. A classical
//! Runge-Kutta step that contains a kink closes the energy balance to second order only; one that ends at the kink, to the
//! fourth.

use crate::losses::conduction::{Affine, Conduction};
use crate::losses::flow::{Drops, Switches};
use drive_base::frame::{AlphaBeta, Phases};

/// The side of the zone for the current of each leg: 1 above, -1 below, 0 inside; first of the currents that determine the
/// dead-time voltage, then of those that determine the drop of the devices ([`Path::guides`](super::flow::Path::guides)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sides([[i8; 3]; 2]);

/// Allowed error of the voltage beyond an edge, as a share of the greatest drop.
const TOLERANCE: f64 = 0.008;

/// Maximum excess of a current over its edge, as a share of the zone.
const MOST: f64 = 0.05;

impl Sides {
    /// The sides of the currents `i` (A) with the zone +-`zone` (A).
    #[inline]
    pub fn of(i: [AlphaBeta; 2], zone: f64) -> Self {
        let side = |i: f64| i8::from(i > zone) - i8::from(i < -zone);
        Self(i.map(|i| {
            let Phases { a, b, c } = Phases::from_stator(i);
            [side(a), side(b), side(c)]
        }))
    }

    /// The sides of the legs: by the currents that determine the dead-time voltage, and by those that determine the drop of the devices.
    #[inline]
    pub(super) fn legs(self) -> [[i8; 3]; 2] {
        self.0
    }

    /// Whether no current is inside the zone.
    #[inline]
    pub fn apart(&self) -> bool {
        self.0.iter().flatten().all(|&side| side != 0)
    }

    /// Share of a step after which the first current crosses the edge of its side, if one leaves its side by more than its
    /// tolerance (A) while the currents go from `start` (A) to `end` (A). The point lies half the tolerance outside the edge.
    #[inline(never)]
    pub fn first_crossing(
        &self,
        start: [AlphaBeta; 2],
        end: [AlphaBeta; 2],
        zone: f64,
        tolerances: [f64; 2],
    ) -> Option<f64> {
        let leg = |side: i8, from: f64, to: f64, tolerance: f64| {
            // The lower and upper edges; a side outside the zone has only one.
            let (below, above) = (if side > 0 { zone } else { -zone }, if side < 0 { -zone } else { zone });
            let edge = if side <= 0 && to > above + tolerance {
                above + 0.5 * tolerance
            } else if side >= 0 && to < below - tolerance {
                below - 0.5 * tolerance
            } else {
                return 1.0;
            };
            ((edge - from) / (to - from)).clamp(0.0, 1.0)
        };
        let mut share = 1.0_f64;
        for (k, tolerance) in tolerances.into_iter().enumerate() {
            let ([a, b, c], start, end) = (self.0[k], Phases::from_stator(start[k]), Phases::from_stator(end[k]));
            let leg = |side, from, to| leg(side, from, to, tolerance);
            share = share.min(leg(a, start.a, end.a)).min(leg(b, start.b, end.b)).min(leg(c, start.c, end.c));
        }
        (share < 1.0).then_some(share)
    }
}

pub(super) fn phases(signs: [i8; 3]) -> Phases {
    let [a, b, c] = signs.map(f64::from);
    Phases { a, b, c }
}

/// Legs and devices while the currents keep their sides.
#[derive(Clone, Copy, Debug)]
pub struct OneSided {
    /// Voltage of the legs with dead time in V.
    u: AlphaBeta,
    /// Drop of the devices in V.
    drop: Option<Affine>,
    /// Switching loss in W per ampere.
    sw: AlphaBeta,
}

impl Switches {
    /// These legs and devices under the voltage `u` (V) while the currents keep their `sides`.
    #[inline]
    pub fn one_sided(&self, u: AlphaBeta, sides: &Sides) -> OneSided {
        let Self { legs, conduction, sw } = self;
        let [dead_time, devices] = sides.0.map(phases);
        let u = if legs.drop() { u - legs.loss_beyond(dead_time) } else { u };
        let drop = conduction.as_ref().map(|conduction| conduction.affine(u, devices));
        OneSided { u, drop, sw: devices.to_stator() * (1.5 * sw) }
    }

    /// Allowed excess (A) of the currents of [`Sides`] over their edges at the end of a step: where the voltage that depends on
    /// them is off by `TOLERANCE` of the whole.
    #[inline(never)]
    pub fn tolerances(&self) -> [f64; 2] {
        let zone = self.legs.i_zone();
        let (dead_time, threshold) = (self.legs.u_dead(), self.conduction.as_ref().map_or(0.0, Conduction::threshold));
        let whole = TOLERANCE * (dead_time + threshold);
        [dead_time, threshold].map(|u| zone * if u * MOST > whole { whole / u } else { MOST })
    }

    /// The currents (A) of [`Path::guides`](super::flow::Path::guides), each also instead of one without a kink.
    #[inline]
    pub fn guided(&self, [dead_time, devices]: [AlphaBeta; 2]) -> [AlphaBeta; 2] {
        match (self.legs.drop(), self.conduction.is_some() || self.sw > 0.0) {
            (true, true) => [dead_time, devices],
            (true, false) => [dead_time; 2],
            _ => [devices; 2],
        }
    }
}

impl Drops<f64> for OneSided {
    #[inline]
    fn legs(&self, _u: AlphaBeta, _steady: impl FnOnce() -> AlphaBeta) -> AlphaBeta {
        self.u
    }

    #[inline]
    fn devices(&self, _u: AlphaBeta, i: AlphaBeta) -> Option<AlphaBeta> {
        self.drop.map(|drop| drop.at(i))
    }

    #[inline]
    fn switching(&self, i: AlphaBeta) -> Option<f64> {
        Some(self.sw.dot(i))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::inverter::Gates;
    use crate::legs::Legs;
    use crate::losses::conduction::Devices;
    use crate::losses::flow::{Flow, Path};
    use crate::tables::PlantParameters;

    /// A plant with every loss.
    pub(crate) fn lossy() -> PlantParameters {
        let mut par = PlantParameters::default();
        (par.iron.G_e, par.iron.G_h, par.winding.k_ac) = (2e-4, 0.1, 1e-7);
        par.inverter.dead_time = 2e-6;
        par.inverter.devices = Devices {
            u_transistor: 0.9,
            r_transistor: 0.06,
            u_diode: 0.7,
            r_diode: 0.05,
            E_sw: 1e-3,
            ..Devices::default()
        };
        par
    }

    /// Compares both at the current `i` (A).
    pub(crate) fn assert_near(got: &Flow<f64>, wanted: &Flow<f64>, i: AlphaBeta) {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
        assert!((got.i - wanted.i).magnitude() < 1e-13 && (got.d_psi - wanted.d_psi).magnitude() < 1e-12, "{i:?}");
        assert!(near(got.p_in, wanted.p_in) && near(got.losses.cond, wanted.losses.cond), "{i:?}");
        assert!(near(got.losses.sw, wanted.losses.sw) && near(got.losses.iron, wanted.losses.iron), "{i:?}");
    }

    #[test]
    fn beyond_the_zone_the_signs_say_what_the_currents_say() {
        let par = lossy();
        let switches = Switches::new(&par.inverter, Gates::Switch, 325.0, Legs::switching(&par.inverter, 325.0));
        let (u, w) = (AlphaBeta::new(70.0, -90.0), 300.0);
        let dissipation = par.dissipation(2.0, w);
        for k in 0..6_u32 {
            let angle = 0.2 + std::f64::consts::FRAC_PI_3 * f64::from(k);
            let i = AlphaBeta::new(5.0 * angle.cos(), 5.0 * angle.sin());
            let sides = Sides::of([i; 2], par.inverter.i_zero);
            assert!(sides.apart(), "{sides:?}");
            let drops = switches.one_sided(u, &sides);
            let got = Path { u, dissipation, drops }.flow(AlphaBeta::ZERO, i, w);
            let wanted = Path { u, dissipation, drops: switches }.flow(AlphaBeta::ZERO, i, w);
            assert_near(&got, &wanted, i);
        }
    }

    #[test]
    fn the_first_current_at_an_edge_ends_a_step() {
        // a goes from 3 A to -1 A and meets 0.2 A at 0.7; b goes from 0 to 0.5 A, out of the zone at 0.4.
        let phases = |a: f64, b: f64| [Phases { a, b, c: -a - b }.to_stator(); 2];
        let (start, end) = (phases(3.0, 0.0), phases(-1.0, 0.5));
        let sides = Sides::of(start, 0.2);
        let (tolerances, half) = ([2e-3, 4e-3], 1e-3);
        let share = sides.first_crossing(start, end, 0.2, tolerances).unwrap();
        assert!((share - 0.4 - half / 0.5).abs() < 1e-12 && !sides.apart(), "{share}");
        // b has left the zone; a is next, at the upper edge.
        let next = Sides::of(phases(1.4, 0.2 + half), 0.2);
        assert_eq!(next.0, [[1, 1, -1]; 2]);
        let share = next.first_crossing(start, end, 0.2, tolerances).unwrap();
        assert!((share - 0.7 - half / 4.0).abs() < 1e-12, "{share}");
        assert!(sides.first_crossing(start, phases(2.0, 0.1), 0.2, tolerances).is_none());
        assert!(
            sides.first_crossing(start, phases(2.0, 0.2 + half), 0.2, tolerances).is_none(),
            "within the tolerance"
        );
    }
}
