//! Zone of the dead time of a turning machine, from the ripple of its currents.
//!
//! A leg switches on at the current `i - r` and off at `i + r`, if i is its current at a sample, where the ripple is zero. The
//! curve l(i) of the standstill, whose voltages are small and whose ripple is negligible, holds at each of the two instants:
//!
//! ```text
//! loss  = (l(i - r) + l(i + r)) / 2                  between -r and r a leg loses nothing
//! r     = u_dc T / (2 L) (sum of max(d_y - d, 0) / 3 + (d - mean) (1 - d))
//! l(i)  = l(W / 2) i / (W / 2) below W / 2           W = 2 u_dead T / (3 L): a current that ends within the dead time
//! late  = T / (2 L) |loss| d of each leg             the sample less the mean current
//! ```
//!
//! d are the duty cycles with the min-max zero sequence over a carrier period of T. A pulse of a leg with a loss comes half a dead
//! time late, so that the samples no longer lie in the middle between two pulses: without load, up to a tenth of the current. A
//! mean-value model has no ripple; [`trial`](super::trial) distinguishes the two. Derived here.

use super::bench::Bench;
use super::curve::Curve;
use drive_base::frame::{AlphaBeta, Phases};

/// Ripple at the voltage of a period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ripple {
    /// Currents r in A, and the duty cycles, of each leg.
    r: [f64; 3],
    d: [f64; 3],
    /// Half of W in A.
    half: f64,
    /// T / (2 L) in s/H.
    late: f64,
}

impl Ripple {
    /// At the voltage `u` (V) on the link voltage `u_dc` (V) with the mean inductance `L` (H).
    pub(super) fn new(bench: &Bench, u: AlphaBeta, u_dc: f64, L: f64) -> Self {
        let phases = Phases::from_stator(u);
        let Phases { a, b, c } = phases;
        let middle = 0.5 * (a.max(b).max(c) + a.min(b).min(c));
        let full = phases.span().max(u_dc);
        let d = [a, b, c].map(|u| (u - middle) / full + 0.5);
        let mean = (d[0] + d[1] + d[2]) * (1.0 / 3.0);
        let late = 0.5 * bench.carrier / L;
        let r = d.map(|x| {
            let earlier = d.iter().fold(0.0, |sum, y| sum + (y - x).max(0.0));
            u_dc * late * (earlier * (1.0 / 3.0) + (x - mean) * (1.0 - x))
        });
        Self { r, d, half: bench.u_dead * bench.carrier / (3.0 * L), late }
    }

    /// Loss in V of a leg without ripple at the current `i` (A), and its slope in Ohm.
    fn edge(&self, curve: &Curve, i: f64) -> (f64, f64) {
        if i.abs() >= self.half {
            return curve.leg(i);
        }
        let slope = curve.leg(self.half).0 / self.half;
        (slope * i, slope)
    }

    /// Loss in V of each leg with its ripple, and its slope in Ohm.
    fn legs(&self, curve: &Curve, i: AlphaBeta) -> [(f64, f64); 3] {
        let Phases { a, b, c } = Phases::from_stator(i);
        let leg = |i: f64, r: f64| {
            let (on, off) = (self.edge(curve, i - r), self.edge(curve, i + r));
            (0.5 * (on.0 + off.0), 0.5 * (on.1 + off.1))
        };
        let [r_a, r_b, r_c] = self.r;
        [leg(a, r_a), leg(b, r_b), leg(c, r_c)]
    }

    /// Voltage in V lost in the legs at the currents `i` (A), and the mean slope of the legs in Ohm.
    pub(super) fn loss_and_slope(&self, curve: &Curve, i: AlphaBeta) -> (AlphaBeta, f64) {
        let [a, b, c] = self.legs(curve, i);
        (Phases { a: a.0, b: b.0, c: c.0 }.to_stator(), (a.1 + b.1 + c.1) * (1.0 / 3.0))
    }

    /// Current in A by which a sample of the currents `i` (A) exceeds their mean.
    pub(super) fn late(&self, curve: &Curve, i: AlphaBeta) -> AlphaBeta {
        let ([a, b, c], [d_a, d_b, d_c]) = (self.legs(curve, i), self.d);
        Phases { a: a.0.abs() * d_a, b: b.0.abs() * d_b, c: c.0.abs() * d_c }.to_stator() * self.late
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commission::curve::POINTS;

    /// Legs that lose 3 V.
    fn bench() -> Bench {
        let mut curve = Curve::new(7.5);
        (0..POINTS).for_each(|n| curve.set(n, 3.0));
        Bench { T: 5e-5, carrier: 1e-4, u_dead: 3.0, curve, ..Bench::default() }
    }

    /// The currents of ideal legs in small steps, with the voltage `u` as EMF, from the middle of a zero vector on: what each has
    /// fallen by when its leg switches on.
    fn fallen(u: Phases, u_dc: f64, T: f64, L: f64) -> [f64; 3] {
        let e = [u.a, u.b, u.c];
        let most = e.iter().fold(f64::MIN, |a, &b| a.max(b)) + e.iter().fold(f64::MAX, |a, &b| a.min(b));
        let on = e.map(|u| 0.5 * T * (0.5 - (u - 0.5 * most) / u_dc));
        let (mut i, mut fallen, h) = ([0.0; 3], [0.0; 3], T * 1e-5);
        for k in 0..100_000 {
            let t = (f64::from(k) + 0.5) * h;
            let v = on.map(|on| if t > on { u_dc } else { 0.0 });
            let mean = (v[0] + v[1] + v[2]) / 3.0;
            for x in 0..3 {
                if t < on[x] {
                    i[x] += (v[x] - mean - e[x]) * h / L;
                    fallen[x] = -i[x];
                }
            }
        }
        fallen
    }

    #[test]
    fn the_ripple_is_that_of_ideal_legs() {
        let (u_dc, L, bench) = (325.0, 6e-3, bench());
        for (angle, size) in [(0.0_f64, 60.0), (0.4, 60.0), (1.9, 150.0), (4.0, 20.0)] {
            let u = AlphaBeta::new(size * angle.cos(), size * angle.sin());
            let ripple = Ripple::new(&bench, u, u_dc, L);
            let expected = fallen(Phases::from_stator(u), u_dc, bench.carrier, L);
            for (r, expected) in ripple.r.iter().zip(expected) {
                assert!((r - expected).abs() < 1e-4, "{:?}, not {expected:?}", ripple.r);
            }
        }
    }

    /// In the ripple a leg loses nothing, and beyond it everything; only then its pulses are late, by half a dead time.
    #[test]
    fn inside_the_ripple_nothing_is_lost() {
        let (bench, u) = (bench(), AlphaBeta::new(60.0, 0.0));
        let ripple = Ripple::new(&bench, u, 325.0, 6e-3);
        let [r, ..] = ripple.r;
        assert!((0.15..0.2).contains(&r), "{r} A");
        let inside = AlphaBeta::new(0.5 * r, 0.0);
        assert!(ripple.loss_and_slope(&bench.curve, inside).0.magnitude() < 1e-12);
        assert!(ripple.late(&bench.curve, inside).magnitude() < 1e-12);
        let beyond = AlphaBeta::new(4.0, 0.0);
        let (loss, slope) = ripple.loss_and_slope(&bench.curve, beyond);
        assert!((loss - AlphaBeta::new(4.0, 0.0)).magnitude() < 1e-12 && slope == 0.0, "{loss:?}");
        // The current falls by u / L until a pulse that comes t_d / 2 late: t_d = T u_dead / u_dc.
        let late = ripple.late(&bench.curve, beyond);
        let expected = u * (0.5 * bench.carrier * 3.0 / 325.0 / 6e-3);
        assert!((late - expected).magnitude() < 1e-9, "{late:?}, not {expected:?}");
    }

    /// Without ripple, a current that ends within the dead time loses its share of the loss at W / 2 = u_dead T / (3 L).
    #[test]
    fn small_currents_end_within_the_dead_time() {
        let (bench, L) = (bench(), 6e-4);
        let i = 0.5 * 3.0 * 1e-4 / (3.0 * L);
        let ripple = Ripple::new(&bench, AlphaBeta::ZERO, 325.0, L);
        let expected = 0.5 * bench.curve.leg(2.0 * i).0;
        assert!(bench.curve.leg(i).0 > 1.2 * expected, "{} V without the dead time's end", bench.curve.leg(i).0);
        let (loss, _) = ripple.loss_and_slope(&bench.curve, AlphaBeta::new(i, 0.0));
        assert!((loss - AlphaBeta::new(expected, 0.0)).magnitude() < 1e-12, "{loss:?}, not {expected} V");
    }
}
