//! The current limit at modulation: a command that would drive the current beyond `limit.i` is corrected before it acts.
//!
//! The references stay within `limit.i`. The current leaves them where the estimated angle is off by theta~: the current loop
//! then feeds forward an EMF that differs from the machine's by 2 sin(theta~ / 2) w psi_M, and
//! a PI loop that cancels the pole R / L answers a disturbance de at the frequency W in its frame with
//!
//! ```text
//! |di| = |de| W / (L sqrt(W^2 + w_c^2) sqrt(W^2 + (R / L)^2))
//! ```
//!
//! The voltage reveals the EMF of the machine even if the estimate is wrong. From the last interval, with psi = L i in the
//! estimated frame,
//!
//! ```text
//! e = u - R (i[k-1] + i[k]) / 2 - (psi[k] - psi[k-1]) / T_s
//! psi[k+1] = psi[k] + T_s (u - R (i[k] + i[k+1]) / 2 - e)        e turns by w T_s in each interval
//! ```
//!
//! w is w^, or |e| / psi_M where w^ is not within 0.7 and 1.3 of it: the EMF shows the speed of a rotor that the estimate has lost. Where
//! L i exceeds 1.5 psi_M, an error of L^ would hide the speed, so w is always w^. In steady state the
//! prediction is exact with any L^, R^ and psi_M^, because all vectors turn at w^, so a current at its limit is not corrected.
//!
//! The pending commands and the new one determine the current at the end of the interval in which the new one acts. Beyond the
//! limit, the voltage changes by L di / T_s, which brings the current back to the limit along its own direction, as far as the
//! hexagon allows; the integrators are corrected as at the hexagon. Otherwise nothing changes.
//!
//! Limits: L^ and R^ are estimates, and the EMF of the next interval is that of the last one, rotated: an error of 20 % in L^
//! leaves 20 % of the excess in a sample. A sample that injects is not corrected: its carrier is larger than the excess that the
//! limit would remove. With a communication step above T_s, several samples see the same currents, which show no EMF: only a
//! sample whose currents are new, after one whose currents were new, is corrected. Derived here. u and e in V, i in A, psi in Wb,
//! L in H, w in rad/s (electrical).

use crate::estimator::Sample;
use drive_base::frame::{AlphaBeta, Axis, DqHat, Estimated, Phases, Turn};
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Share of the limit below which a current that changes slowly cannot reach it before the new command acts, squared.
const NEAR: f64 = 0.25;
/// Change of the current in a sample, as a share of the limit, that counts as slow, squared.
const SLOW: f64 = 1.0 / 36.0;
/// Maximum turn of the EMF in a sample in rad.
const FASTEST: f64 = 1.0;
/// Bounds of the speed as shares of |e| / psi_M, and the flux linkage L i as a share of psi_M below which they apply.
const SPEED: (f64, f64) = (0.7, 1.3);
const MAGNETIC: f64 = 1.5;
/// Current that is corrected, as a share of the limit: a reference at the limit has ripple.
const BEYOND: f64 = 1.005;

/// Whether the current may reach the limit `i_max` (A) before the command of this sample acts.
#[inline]
pub fn may_exceed(sample: &Sample, i_max: f64) -> bool {
    let (change, square) = (sample.i - sample.i_last, i_max * i_max);
    sample.i.dot(sample.i) > NEAR * square || change.dot(change) > SLOW * square
}

/// Change of a voltage that a settled current may show, as a share of the voltage, squared.
const SETTLED: f64 = 1e-12;

/// Whether the measured currents are new at this sample and were at the last one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Fresh {
    i: Phases,
    u: AlphaBeta,
    new: bool,
}

impl Fresh {
    /// Takes the measured currents `i` (A) and the voltage `u` (V) of the interval before; returns whether they and those of the last
    /// sample were new. A current that stays under a voltage that stays is settled, not old.
    #[expect(clippy::inline_always, reason = "the compiler would call it")]
    #[inline(always)]
    pub(super) fn update(&mut self, i: Phases, u: AlphaBeta) -> bool {
        let change = u - self.u;
        let new = self.i != i || change.dot(change) <= SETTLED * u.dot(u);
        let last = self.new;
        *self = Self { i, u, new };
        last && new
    }
}

/// The interval between two samples, in the estimated frame.
#[derive(Clone, Copy, Debug)]
pub struct Predictor<'a> {
    /// Estimates of the machine.
    pub motor: &'a Motor,
    /// Sample period in s.
    pub T_s: f64,
    /// The frame at the sample.
    pub axis: Axis<Estimated>,
    /// Electrical speed in rad/s.
    pub w: f64,
}

impl Predictor<'_> {
    /// The change (V) of the newest of the `commands` (V, in the order of their effect from `sample` on) that keeps the current
    /// at its end within `i_max` (A); `None` if it is within this limit anyway.
    #[cold]
    #[inline(never)]
    pub fn correction(&self, sample: &Sample, commands: &[AlphaBeta], i_max: f64) -> Option<AlphaBeta> {
        let &Self { motor, T_s, axis, w } = self;
        let flux = |i: DqHat| DqHat::new(motor.L_d * i.d(), motor.L_q * i.q());
        let last = axis.ahead(Turn::new(-w * T_s));
        let of_last = last.to_stator(flux(last.from_stator(sample.i_last)));
        let mut psi = axis.to_stator(flux(axis.from_stator(sample.i)));
        let resistive = (sample.i_last + sample.i) * (0.5 * motor.R_s);
        let e = axis.from_stator(sample.u - resistive - (psi - of_last) * (1.0 / T_s));
        // The frame of the prediction turns with the EMF.
        let shown = e.magnitude() / motor.psi_M;
        let magnetic = motor.L_d.max(motor.L_q) * i_max < MAGNETIC * motor.psi_M;
        let fits = (SPEED.0 * shown..=SPEED.1 * shown).contains(&w.abs());
        let speed = if fits || !magnetic { w.abs() } else { shown };
        let (turn, i_max) = (Turn::new((speed * T_s).min(FASTEST).copysign(w)), BEYOND * i_max);
        let (mut axis, mut i, half) = (axis, axis.from_stator(sample.i), 0.5 * motor.R_s * T_s);
        for &u in commands {
            let before = axis.to_stator(i);
            axis = axis.ahead(turn);
            let driven = axis.from_stator(psi + u * T_s - before * half) - e * T_s;
            i = DqHat::new(driven.d() / (motor.L_d + half), driven.q() / (motor.L_q + half));
            psi = axis.to_stator(flux(i));
        }
        let magnitude = i.magnitude();
        if magnitude.is_nan() || magnitude <= i_max {
            return None;
        }
        let excess = i * (i_max / magnitude - 1.0);
        let change = DqHat::new((motor.L_d + half) * excess.d(), (motor.L_q + half) * excess.q());
        Some(axis.to_stator(change * (1.0 / T_s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::Rotor;

    const T_S: f64 = 1e-4;
    const I_MAX: f64 = 7.5;
    /// Electrical speed in rad/s.
    const W: f64 = 800.0;

    /// A machine without resistance: its flux linkage is the integral of the voltage.
    fn machine() -> Motor {
        Motor { R_s: 1e-12, ..Motor::default() }
    }

    /// Magnet flux linkage (Wb) at sample `k`.
    fn magnet(k: f64) -> AlphaBeta {
        Axis::<Rotor>::at(0.3 + k * W * T_S).along(machine().psi_M)
    }

    /// Magnitude (A) of the current at the end of the interval of the newest of `commands` (V) after the `sample`, and its
    /// prediction with an estimate that is `off` (rad) at `w` (rad/s).
    fn reached(sample: &Sample, commands: &[AlphaBeta], off: f64, w: f64) -> (f64, f64) {
        let motor = machine();
        let end = |commands: &[AlphaBeta]| {
            let first = (sample.i * motor.L_d + magnet(0.0), 0.0);
            let (driven, k) = commands.iter().fold(first, |(psi, k), &u| (psi + u * T_S, k + 1.0));
            ((driven - magnet(k)) * (1.0 / motor.L_d)).magnitude()
        };
        let predictor = Predictor { motor: &motor, T_s: T_S, axis: Axis::at(0.3 + off), w };
        let mut corrected = commands.to_vec();
        if let Some(change) = predictor.correction(sample, commands, I_MAX) {
            *corrected.last_mut().unwrap() += change;
        }
        (end(commands), end(&corrected))
    }

    /// A sample with 6 A, after the voltage that has raised the current from 5 A.
    fn sample() -> Sample {
        let (i, i_last) = (AlphaBeta::new(6.0, 0.0), AlphaBeta::new(4.9, -1.0));
        let u = ((i - i_last) * machine().L_d + magnet(0.0) - magnet(-1.0)) * (1.0 / T_S);
        Sample { i, i_last, u, ..Sample::default() }
    }

    /// At any estimated angle and with every delay, a command that would exceed the limit is corrected to end at it, and any
    /// other command stays unchanged.
    #[test]
    fn the_current_ends_at_the_limit() {
        for off in [0.0, 1.0, -2.0, 3.1] {
            for delay in 0..3_usize {
                let waiting = [AlphaBeta::new(40.0, 110.0); 2];
                // The command that takes the current to `i`.
                let to = |i: AlphaBeta| {
                    let first = sample().i * machine().L_d + magnet(0.0);
                    let driven = waiting[..delay].iter().fold(first, |psi, &u| psi + u * T_S);
                    let end = i * machine().L_d + magnet(f64::from(u8::try_from(delay).unwrap()) + 1.0);
                    [&waiting[..delay], &[(end - driven) * (1.0 / T_S)]].concat()
                };
                let (without, kept) = reached(&sample(), &to(AlphaBeta::new(7.0, 6.0)), off, W);
                assert!(
                    without > 1.02 * I_MAX && (kept - BEYOND * I_MAX).abs() < 1e-6,
                    "{off} rad, {delay}: {without}, {kept} A"
                );
                let (without, kept) = reached(&sample(), &to(AlphaBeta::new(7.0, 1.0)), off, W);
                assert!(without < I_MAX && (kept - without).abs() < 1e-12, "{off} rad, {delay}: {without}, {kept} A");
            }
        }
    }

    /// An estimate at standstill while the rotor turns: the EMF shows the speed within 30 %.
    #[test]
    fn a_lost_estimate_does_not_hide_the_speed() {
        let commands = [AlphaBeta::new(40.0, 110.0), AlphaBeta::new(200.0, 100.0)];
        let (without, kept) = reached(&sample(), &commands, 2.0, 1.0);
        assert!(without > 9.0 && kept < 1.05 * I_MAX, "{without}, {kept} A");
    }

    /// Currents updated every second or third sample under a rotating voltage reveal no EMF; currents that change with the
    /// voltage do.
    #[test]
    fn currents_that_stay_are_old() {
        for (every, turn, expected) in [(1, 0.1, true), (2, 0.1, false), (3, 0.1, false), (100, 0.0, true)] {
            let mut fresh = Fresh::default();
            for k in 0..12_i32 {
                let i = Phases::from_stator(AlphaBeta::new(f64::from(1 + k / every), 0.0));
                let shown = fresh.update(i, Axis::<Rotor>::at(turn * f64::from(k)).along(10.0));
                assert!(k < 2 || shown == expected, "every {every} samples, at {k}");
            }
        }
    }

    /// The command is checked from half of the limit on, and where the current changes by a sixth in a sample.
    #[test]
    fn a_small_current_is_left_alone() {
        let at = |i: f64, i_last: f64| Sample {
            i: AlphaBeta::new(i, 0.0),
            i_last: AlphaBeta::new(i_last, 0.0),
            ..Sample::default()
        };
        assert!(!may_exceed(&at(3.7, 3.7), I_MAX) && may_exceed(&at(3.8, 3.8), I_MAX));
        assert!(!may_exceed(&at(1.2, 0.0), I_MAX) && may_exceed(&at(1.3, 0.0), I_MAX));
    }
}
