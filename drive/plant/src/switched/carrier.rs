//! The triangular carrier: duty cycles, and the instants at which a leg is commanded.
//!
//! ```text
//! d_x = 1/2 + (u_x + u_z) / u_dc, clamped to 0..1       upper switch on in [T/2 (1 - d), T/2 (1 + d)] of a period T
//! u_z = -(max + min)/2 (min-max), 0, u_dc/2 - max, -u_dc/2 - min, or the one of these two that moves the references less
//! ```
//!
//! A period begins at an extreme of the carrier with all lower switches on, and has its other extreme in the middle, with
//! all upper ones on. The duty cycles of the references are taken over at the first, or at both. The extremes are counted
//! from the start of the simulation on; the first comes after `inverter.carrier_delay`, with all lower switches on until then. u in V,
//! times in s.

use crate::inverter::Inverter;
use crate::pwm::{PwmUpdate, ZeroSequence};
use drive_base::frame::Phases;
use drive_base::overmodulation::ModulationMode;
use fmu_core::{Elapsed, Next, SampleGrid};
use serde::{Deserialize, Serialize};

/// Instants closer than this share of half a carrier period are the same instant.
const SAME: f64 = 1e-9;

/// State of the carrier.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Carrier {
    /// Number of extremes up to now: the last one was number `extremes - 1`.
    extremes: u64,
    /// Duty cycles of the legs.
    duties: [f64; 3],
}

/// Duty cycles of the legs for the references `u` (V) on a link of `u_dc` (V).
fn duties(Inverter { T_pwm, pwm, .. }: &Inverter, u: Phases, u_dc: f64) -> [f64; 3] {
    let Phases { a, b, c } = match pwm.modulation.mode {
        // Each leg is clamped: the nearest point of the hexagon, if the zero sequence is min-max.
        ModulationMode::Linear | ModulationMode::MinimumMagnitude => u,
        mode if u.span() > u_dc => Phases::from_stator(mode.limit(u, u_dc)),
        _ => u,
    };
    let (max, min) = (a.max(b).max(c), a.min(b).min(c));
    let (high, low) = (0.5 * u_dc - max, -0.5 * u_dc - min);
    let common = match pwm.zero_sequence {
        ZeroSequence::MinMax => -0.5 * (max + min),
        ZeroSequence::None => 0.0,
        ZeroSequence::DpwmHigh => high,
        ZeroSequence::DpwmLow => low,
        ZeroSequence::DpwmAlternating => {
            let mean = (a + b + c) * (1.0 / 3.0);
            if max - mean > mean - min { high } else { low }
        }
    };
    [a, b, c].map(|u| {
        let d = if u_dc > 0.0 { (0.5 + (u + common) / u_dc).clamp(0.0, 1.0) } else { 0.5 };
        if d * T_pwm < pwm.pulse_min {
            0.0
        } else if (1.0 - d) * T_pwm < pwm.pulse_min {
            1.0
        } else {
            d
        }
    })
}

impl Carrier {
    /// Time since the last extreme in s, at the time `now`. A carrier of another period takes `u` (V) over at once.
    pub(super) fn locate(&mut self, inverter: &Inverter, now: Elapsed, u: Phases, u_dc: f64) -> f64 {
        let grid = SampleGrid { period: 0.5 * inverter.T_pwm };
        let now = now.plus(-inverter.pwm.carrier_delay);
        let at = grid.period + now.minus_periods(self.extremes, grid.period);
        // At an extreme, the time is exact: the rounding of the communication steps has no effect.
        if at.abs() <= grid.width() {
            return 0.0;
        } else if (at - grid.period).abs() <= grid.width() {
            return grid.period;
        } else if (0.0..grid.period).contains(&at) {
            return at;
        }
        self.extremes = grid.first_after(now);
        self.duties = duties(inverter, u, u_dc);
        grid.period + now.minus_periods(self.extremes, grid.period)
    }

    /// Advances past the extremes up to the time `at` (s) since the last one; returns the time (s) since the new last one.
    pub(super) fn pass(&mut self, inverter: &Inverter, at: f64, u: Phases, u_dc: f64) -> f64 {
        let grid = SampleGrid { period: 0.5 * inverter.T_pwm };
        if at < grid.period - grid.width() {
            return at;
        }
        self.extremes += 1;
        if self.rises() || inverter.pwm.update == PwmUpdate::Double {
            self.duties = duties(inverter, u, u_dc);
        }
        0.0
    }

    /// Whether the present half of the period is the first one.
    fn rises(&self) -> bool {
        self.extremes % 2 == 1
    }

    /// The instant `time` (s) after the last extreme.
    pub(super) fn instant(&self, inverter: &Inverter, time: f64) -> Option<Elapsed> {
        let half = 0.5 * inverter.T_pwm;
        let next = Elapsed::periods(self.extremes, half).plus(inverter.pwm.carrier_delay);
        time.is_finite().then(|| next.plus(time - half))
    }

    /// The next extreme.
    pub(super) fn next(&self, inverter: &Inverter) -> Next {
        let (k, period, delay) = (self.extremes, 0.5 * inverter.T_pwm, inverter.pwm.carrier_delay);
        if delay == 0.0 { Next::Grid { k, period } } else { Next::At(Elapsed::periods(k, period).plus(delay)) }
    }

    /// Whether the upper switch of the leg `x` is commanded on at the time `at` (s) since the last extreme, and the time (s) until
    /// the command changes within this half of the period.
    #[inline]
    pub(super) fn command(&self, x: usize, at: f64, half: f64) -> (bool, f64) {
        let share = if self.rises() { 1.0 - self.duties[x] } else { self.duties[x] };
        let left = share * half - at;
        if left > SAME * half { (!self.rises(), left) } else { (self.rises(), f64::INFINITY) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of each line-to-line voltage over a period equals the reference, for every zero sequence.
    #[test]
    fn every_zero_sequence_keeps_the_differences() {
        let mut inverter = Inverter::default();
        for zero in ZeroSequence::ALL {
            inverter.pwm.zero_sequence = *zero;
            for k in 0..24 {
                let angle = 15.0_f64.to_radians() * f64::from(k) + 0.02;
                let phase = |shift: f64| 140.0 * (angle - shift.to_radians()).cos();
                let u = Phases { a: phase(0.0), b: phase(120.0), c: phase(240.0) };
                let [a, b, c] = duties(&inverter, u, 300.0);
                assert!((300.0 * (a - b) - (u.a - u.b)).abs() < 1e-10, "{zero:?} {angle}");
                assert!((300.0 * (b - c) - (u.b - u.c)).abs() < 1e-10, "{zero:?} {angle}");
                let (rails, clamped) = ([0.0, 1.0], [a, b, c].map(|d| d.min(1.0 - d)));
                let at_rail = |rail: f64| [a, b, c].iter().any(|d| (d - rail).abs() < 1e-12);
                match zero {
                    ZeroSequence::DpwmHigh => assert!(at_rail(1.0)),
                    ZeroSequence::DpwmLow => assert!(at_rail(0.0)),
                    ZeroSequence::DpwmAlternating => {
                        // The leg of the largest magnitude rests.
                        let magnitudes = [u.a, u.b, u.c].map(f64::abs);
                        let x = (0..3).max_by(|&x, &y| magnitudes[x].total_cmp(&magnitudes[y])).unwrap();
                        assert!(clamped[x] < 1e-12 && rails.iter().any(|&rail| at_rail(rail)), "{angle}");
                    }
                    _ => assert!(clamped.iter().all(|&d| d > 1e-3)),
                }
            }
        }
    }

    #[test]
    fn short_pulses_and_gaps_vanish() {
        let mut inverter = Inverter::default();
        inverter.pwm.zero_sequence = ZeroSequence::None;
        inverter.pwm.pulse_min = 3e-6;
        let of = |d: f64| (d - 0.5) * 300.0;
        let found = duties(&inverter, Phases { a: of(0.029), b: of(0.031), c: of(0.975) }, 300.0);
        assert!(found.iter().zip([0.0, 0.031, 1.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn an_instant_is_located_in_its_half_of_the_period() {
        let (inverter, half, u) = (Inverter::default(), 5e-5, Phases { a: 0.0, b: 90.0, c: -90.0 });
        let mut carrier = Carrier::default();
        let mut at = |t: f64| carrier.locate(&inverter, Elapsed::ZERO.plus(t), u, 300.0);
        // Between two extremes, also in another half of the period.
        for (t, wanted) in [(0.5, 0.5), (1.2, 0.2), (1.9, 0.9), (7.3, 0.3), (0.3, 0.3)] {
            assert!((at(t * half) - wanted * half).abs() < 1e-15, "{t}: {} s, not {wanted}", at(t * half));
        }
        // At its ends exactly, despite rounding.
        assert!([1.0, 1.0 - 1e-15, 1.0 + 1e-15].iter().all(|t| at(t * half).to_bits() == half.to_bits()));
        assert!(at(0.0) == 0.0 && at(-1e-15 * half) == 0.0);
    }

    #[test]
    fn the_upper_switch_is_on_around_the_middle() {
        let (inverter, half) = (Inverter::default(), 5e-5);
        let mut carrier = Carrier::default();
        let u = Phases { a: 0.0, b: 90.0, c: -90.0 };
        let at = carrier.locate(&inverter, Elapsed::ZERO, u, 300.0);
        let at = carrier.pass(&inverter, at, u, 300.0);
        assert!(at == 0.0);
        let switches = |carrier: &Carrier| [0, 1, 2].map(|x| carrier.command(x, 0.0, half));
        for (x, d) in [0.5, 0.8, 0.2].into_iter().enumerate() {
            let (on, left) = switches(&carrier)[x];
            assert!(!on && (left - half * (1.0 - d)).abs() < 1e-15, "{x}: {left}");
        }
        // Single update: other references have no effect in the middle.
        let at = carrier.pass(&inverter, half, Phases::default(), 300.0);
        assert!(at == 0.0);
        for (x, d) in [0.5, 0.8, 0.2].into_iter().enumerate() {
            let (on, left) = switches(&carrier)[x];
            assert!(on && (left - half * d).abs() < 1e-15, "{x}: {left}");
        }
    }
}
