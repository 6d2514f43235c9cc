//! Switching legs between two kinks, where every loss is a polynomial of the current.
//!
//! While each phase current stays on one side of the zone +-`inverter.i_zero`, dead time is a constant voltage, and so is
//! the share of each device in a period. The drop of the devices, the voltage e behind the resistance and the current i_s
//! at the terminals are then affine in the current i of the flux linkage:
//!
//! ```text
//! drop = a + D (i + G u) / (1 + R G)          e = (u - R i - drop) / (1 + R G)          i_s = i + G e
//! a    = sign u_0 + on u_1, D = r_0 + sign on r_1 of each leg          on = 2 d - 1
//! ```
//!
//! with half of the sum (0) and of the difference (1) of transistor and diode. The equations are those of [`flow`](super::flow)
//! with R, G and the signs held. A classical Runge-Kutta step that contains a kink closes the energy balance to its second
//! order only; one that ends there keeps the fourth.

use crate::losses::Losses;
use crate::losses::flow::Flow;
use drive_base::frame::{AlphaBeta, Phases};

/// The side of the zone on which the current of each leg is: 1 above, -1 below, 0 within.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sides([f64; 3]);

impl Sides {
    /// Of the currents `i` (A) with the zone +-`zone` (A).
    #[inline]
    pub fn of(i: AlphaBeta, zone: f64) -> Self {
        let side = |i: f64| f64::from(i8::from(i > zone) - i8::from(i < -zone));
        let Phases { a, b, c } = Phases::from_stator(i);
        Self([side(a), side(b), side(c)])
    }

    /// Whether no current is within the zone.
    #[inline]
    pub fn apart(&self) -> bool {
        let [a, b, c] = self.0;
        a * b * c != 0.0
    }

    /// For each leg.
    #[inline]
    pub fn legs(&self) -> Phases {
        let [a, b, c] = self.0;
        Phases { a, b, c }
    }

    /// Where in a step, as a share of it, the first current changes its side, if one does: the currents go from `start` (A)
    /// to `end` (A). The side changes to that in the second value there.
    #[expect(clippy::float_cmp, reason = "sides are exact")]
    #[inline]
    pub fn change(&self, start: AlphaBeta, end: AlphaBeta, zone: f64) -> Option<(f64, Self)> {
        let next = Self::of(end, zone);
        if next == *self {
            return None;
        }
        let parts = |i| {
            let Phases { a, b, c } = Phases::from_stator(i);
            [a, b, c]
        };
        let (start, end) = (parts(start), parts(end));
        let (mut first, mut sides) = (1.0, *self);
        for leg in 0..3 {
            let (from, to) = (self.0[leg], next.0[leg]);
            if from == to {
                continue;
            }
            // The side that it leaves, or the one that it enters from within.
            let edge = if from == 0.0 { to * zone } else { from * zone };
            let share = ((edge - start[leg]) / (end[leg] - start[leg])).clamp(0.0, 1.0);
            if share <= first {
                first = share;
                sides = *self;
                sides.0[leg] = if from == 0.0 { to } else { 0.0 };
            }
        }
        Some((first, sides))
    }
}

/// A vector that is affine in the current (A).
#[derive(Clone, Copy, Debug)]
pub struct Affine {
    /// Without current.
    pub at_0: AlphaBeta,
    /// Symmetric matrix per ampere: alpha alpha, alpha beta, beta beta.
    pub by: [f64; 3],
}

impl Affine {
    #[inline]
    fn at(&self, i: AlphaBeta) -> AlphaBeta {
        let Self { at_0, by: [x, y, z] } = self;
        *at_0 + AlphaBeta::new(x * i.alpha() + y * i.beta(), y * i.alpha() + z * i.beta())
    }
}

/// Inverter and machine while the currents keep their sides.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    /// Voltage of the legs with dead time in V.
    u: AlphaBeta,
    R: f64,
    G: f64,
    /// In V.
    e: Affine,
    drop: Affine,
    /// Switching loss in W per ampere.
    sw: AlphaBeta,
}

impl Region {
    /// With the voltage `u` (V) of the legs, resistance `R` (Ohm), conductance `G` (S), voltage `drop` (V) of the devices
    /// as a function of their current, and switching loss `sw` (W per ampere).
    #[inline]
    pub fn new(u: AlphaBeta, (R, G): (f64, f64), drop: Affine, sw: AlphaBeta) -> Self {
        let part = 1.0 / (R * G + 1.0);
        let by = drop.by.map(|r| r * part);
        let drop = Affine { at_0: drop.at(u * (part * G)), by };
        let e = Affine { at_0: (u - drop.at_0) * part, by: [-(R + by[0]) * part, -by[1] * part, -(R + by[2]) * part] };
        Self { u, R, G, e, drop, sw }
    }

    /// Voltage (V) behind the resistance with the current `i` (A) of the flux linkage.
    #[inline]
    pub fn emf(&self, i: AlphaBeta) -> AlphaBeta {
        self.e.at(i)
    }

    /// With the current `i` (A) of the flux linkage.
    #[inline]
    pub fn flow(&self, i: AlphaBeta) -> Flow<f64> {
        let (drop, e) = (self.drop.at(i), self.e.at(i));
        let i = i + e * self.G;
        let losses = Losses {
            cu: i.dot(i) * (self.R * 1.5),
            iron: e.dot(e) * (self.G * 1.5),
            cond: drop.dot(i) * 1.5,
            sw: self.sw.dot(i),
            friction: 0.0,
        };
        Flow { i, d_psi: e, p_in: self.u.dot(i) * 1.5 + losses.sw, losses }
    }
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "sides are exact")]
mod tests {
    use super::*;
    use crate::legs::Legs;
    use crate::losses::conduction::Devices;
    use crate::losses::flow::Lossy;
    use crate::tables::PlantParameters;

    #[test]
    fn beyond_the_zone_the_affine_flow_is_the_flow() {
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
        let legs = Legs::switching(&par.inverter, 325.0);
        let lossy = Lossy::new(&par, true, 325.0, legs.i_zone(), 1.2).unwrap();
        let u = AlphaBeta::new(70.0, -90.0);
        for k in 0..6_u32 {
            let angle = 0.2 + std::f64::consts::FRAC_PI_3 * f64::from(k);
            let i = AlphaBeta::new(5.0 * angle.cos(), 5.0 * angle.sin());
            let sides = Sides::of(i, legs.i_zone());
            assert!(sides.apart(), "{sides:?}");
            let got = lossy.region(lossy.circuit(2.0, 300.0), u, &legs, &sides).flow(i);
            let wanted = lossy.flow(2.0, u - legs.loss(i), i, 100.0);
            let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * (1.0 + b.abs());
            assert!((got.i - wanted.i).magnitude() < 1e-13 && (got.d_psi - wanted.d_psi).magnitude() < 1e-12, "{i:?}");
            assert!(near(got.p_in, wanted.p_in) && near(got.losses.cond, wanted.losses.cond), "{i:?}");
            assert!(near(got.losses.sw, wanted.losses.sw) && near(got.losses.iron, wanted.losses.iron), "{i:?}");
        }
    }

    #[test]
    fn the_first_current_at_an_edge_ends_a_step() {
        // a goes from 3 A to -1 A and meets 0.2 A at 0.7; b goes from 0 to 0.5 A, out of the zone at 0.4.
        let phases = |a: f64, b: f64| Phases { a, b, c: -a - b }.to_stator();
        let (start, end) = (phases(3.0, 0.0), phases(-1.0, 0.5));
        let sides = Sides::of(start, 0.2);
        let (share, next) = sides.change(start, end, 0.2).unwrap();
        assert!((share - 0.4).abs() < 1e-12 && !sides.apart(), "{share}");
        let Phases { a, b, c } = next.legs();
        assert_eq!([a, b, c], [1.0, 1.0, -1.0]);
        let (share, next) = next.change(start, end, 0.2).unwrap();
        assert!((share - 0.7).abs() < 1e-12 && next.legs().a == 0.0, "{share}, {next:?}");
        assert!(Sides::of(start, 0.2).change(start, phases(2.0, 0.1), 0.2).is_none());
    }
}
