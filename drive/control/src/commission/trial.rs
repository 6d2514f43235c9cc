//! Whether the inverter has a [ripple](super::ripple), and the error of psi_M that remains with it.
//!
//! The first level is measured once more with the ripple and a greater i_d, for which all legs carry more current than the
//! ripple. The flux linkage there does not depend on the zone of the dead time, unlike that without i_d, where the current of the
//! friction is inside the zone: with a dead time of 1 % its error is some percent. The one nearer to it is right.

use super::bench::{Bench, Sample};
use super::turning::Turning;
use serde::{Deserialize, Serialize};

/// Share of the flux linkage that a ripple must change to matter.
const SEEN: f64 = 0.003;
/// Current along d over the ripple, and its maximum over I.
const CLEAR: f64 = 5.0;
const STRONG: f64 = 0.3;
/// R T / L up to which the ripple is a triangle, and the error of the flux linkage over the ripple's part beyond.
const SLOW: f64 = 0.5;
const UNKNOWN: f64 = 2.0;
/// Share of the error without i_d that remains with it.
const LEFT: f64 = 0.3;

/// Sums of a phase: the flux linkage along q and the turn, and the ripple's part of that flux linkage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Seen {
    flux: f64,
    turn: f64,
    rippled: f64,
}

/// The trial, and the sums of the present level without and with i_d.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Trial {
    seen: [Seen; 2],
    tried: bool,
    /// Flux linkage in Wb without ripple and without i_d.
    plain: f64,
    /// Error of the flux linkage in Wb by the zone of the dead time.
    pub(super) rest: f64,
}

/// What a level has shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// The sequence goes on.
    Over,
    /// There is no ripple: what was measured with it does not count.
    Plain,
    /// The level has to be repeated, with at least this current (A) against the magnet.
    Again(f64),
}

impl Trial {
    /// A level begins.
    pub(super) fn begin(&mut self) {
        self.seen = [Seen::default(); 2];
    }

    /// A sample without or with a current along d.
    pub(super) fn add(&mut self, bench: &Bench, turning: &Turning, sample: &Sample, along: bool) {
        let seen = &mut self.seen[usize::from(along)];
        seen.flux += turning.along_q(bench);
        seen.turn += turning.w * bench.T;
        seen.rippled += turning.rippled(bench, sample) * bench.T;
    }

    /// A level ends, the `first` one or a later one; `along` (Wb) is the flux linkage of the current along d.
    pub(super) fn judge(&mut self, bench: &Bench, turning: &mut Turning, first: bool, along: f64) -> Verdict {
        let [[without, part], [with, rest]] = self.seen.map(|s| [s.flux / s.turn, s.rippled / s.turn]);
        let psi = with - along;
        let off = (without - psi).abs();
        let trial = first && self.tried;
        if trial {
            turning.ripples = off <= (self.plain - psi).abs();
        }
        self.rest = if turning.ripples { LEFT * off } else { 0.0 } + rest.abs();
        // Where the ripple decays within a period, its part only widens the interval.
        if 2.0 * bench.R * bench.carrier > SLOW * (turning.motor.L_d + turning.motor.L_q) {
            self.rest = UNKNOWN * rest.abs();
            return Verdict::Over;
        }
        if trial && !turning.ripples {
            return Verdict::Plain;
        }
        if trial || !first {
            return Verdict::Over;
        }
        self.tried = true;
        if part.abs().max(3.0 * rest.abs()) < SEEN * psi {
            return Verdict::Over;
        }
        (self.plain, turning.ripples) = (without, true);
        turning.motor.psi_M = psi.clamp(bench.psi_least(), 1.15 * bench.psi_r);
        // Somewhat more than the ripple at the voltage w psi.
        let r = 0.5 * bench.carrier * turning.w * psi / (turning.motor.L_d + turning.motor.L_q);
        Verdict::Again((CLEAR * r).min(STRONG * bench.I))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(without: f64, with: f64, part: f64) -> [Seen; 2] {
        [Seen { flux: without, turn: 1.0, rippled: part }, Seen { flux: with, turn: 1.0, rippled: 0.0 }]
    }

    /// The flux linkage without i_d decides, with the ripple or without it.
    #[test]
    fn the_nearer_flux_linkage_is_right() {
        let bench = Bench { T: 5e-5, carrier: 1e-4, I: 10.0, psi_r: 0.2, ..Bench::default() };
        for (plain, rippled, ripples) in [(0.144, 0.1501, true), (0.1513, 0.155, false)] {
            let (mut trial, mut turning) = (Trial::default(), Turning::default());
            (turning.w, turning.motor.L_d, turning.motor.L_q) = (400.0, 6e-3, 6e-3);
            trial.seen = level(plain, 0.149, 0.006);
            let verdict = trial.judge(&bench, &mut turning, true, 0.0);
            assert!(matches!(verdict, Verdict::Again(i) if (i - 1.24).abs() < 0.01) && turning.ripples, "{verdict:?}");
            trial.seen = level(rippled, 0.149, 0.006);
            let verdict = trial.judge(&bench, &mut turning, true, -0.001);
            assert_eq!((verdict == Verdict::Over, turning.ripples), (ripples, ripples));
            let rest = if ripples { LEFT * 0.0001 } else { 0.0 };
            assert!((trial.rest - rest).abs() < 1e-9, "{}", trial.rest);
        }
    }

    #[test]
    fn a_ripple_without_effect_is_not_tried() {
        let (mut trial, mut turning) = (Trial::default(), Turning::default());
        trial.seen = level(0.14, 0.15, 0.0004);
        assert_eq!(trial.judge(&Bench::default(), &mut turning, true, 0.0), Verdict::Over);
        assert!(!turning.ripples);
    }
}
