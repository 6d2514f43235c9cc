//! Flying start: finds angle and speed of a rotor that turns, from the currents of short circuits and from the EMF at zero current.
//!
//! 1. Gates off, until no current flows. An EMF above u_dc / sqrt(3) drives a current through the diodes: the gates stay off as
//!    long as it does.
//! 2. A short circuit of one sample. The current at its end is, in the rotor's frame and without R_s,
//!
//!    i_q = -w psi_M T_s / L_q, i_d = -(w T_s)^2 psi_M / (2 L_d): it stands pi/2 + atan(|w| T_s L_q / (2 L_d)) behind the d-axis for w > 0.
//!
//! 3. Where it is at least 0.05 of the maximum current, or shows that the rotor turns by more than 0.03 rad in a sample, the diodes take
//!    it back, and a second short circuit follows when the rotor has turned by about 1 rad. The angle between the two currents gives the
//!    speed, the second current the angle.
//! 4. Where it is less, the gates stay on, and the voltage holds the current at zero: u = e - 0.3 L i / T_s, with the EMF
//!    e = u - R_s i - L di/dt of the last samples. From the EMF of n samples (k = 0 .. n - 1, S = sum of e, M = sum of (k - (n - 1)/2) e), its
//!    rotation in a sample follows by least squares, w T_s c(n w T_s / 2) = 12 Im(S* M) / (|S|^2 (n^2 - 1)), c(a) = 3 (1 - a cot a) / a^2; S is the
//!    EMF in the middle. n grows until the flux linkage |S| T_s is 1.2 psi_M, about 1.2 rad. L is the lower inductance: with it, the loop is
//!    stable at any angle of a salient rotor. Its error matters while the current changes, so the first samples do not count.
//! 5. The rotor rests if the mean EMF is below its minimum after 50 ms.
//!
//! The speed is compared with the EMF's magnitude, which depends on L and psi_M; the angles do not. Derived here; short-circuit pulses and
//! zero-current control are common practice. Angles in rad and speeds in rad/s, electrical; i in A, u in V.

use crate::estimator::Sample;
use drive_base::frame::AlphaBeta;
use drive_base::math::{atan2, sin_cos, wrap};
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// Current that counts as none, in units of the maximum current.
const NONE: f64 = 0.03;
/// Minimum current of a short circuit, in units of the maximum current, that a second one follows.
const SEEN: f64 = 0.05;
/// Turn in rad in a sample above which the current of a short circuit counts from this minimum on, in units of the maximum current.
const FAST: f64 = 0.03;
const CLEAR: f64 = 0.01;
/// Turn of the rotor in rad between two short circuits, and while the EMF is measured.
const TURN: f64 = 1.0;
const WATCHED: f64 = 1.2;
/// Maximum turn in rad at which the direction is unmistakable.
const MOST: f64 = 2.6;
/// Time in s after which a rotor without EMF rests.
const REST: f64 = 0.05;
/// Time in s with gates off after which a current means that the diodes conduct, and a refusal is tried again.
const WAIT: f64 = 0.1;
/// Samples until the current is at zero.
const SETTLE: f64 = 4.0;
/// Minimum number of samples of the EMF.
const SAMPLES: f64 = 16.0;
/// Gain of the current in units of L / T_s; with two samples of delay the loop oscillates at 0.62.
const GAIN: f64 = 0.3;
/// Share of a new EMF in the EMF that the voltage opposes.
const FRESH: f64 = 0.5;
/// Ratio of the speed and that of the EMF's magnitude, or its inverse, above which they contradict.
const CONTRADICTS: f64 = 2.5;

/// Constants of a flying start.
pub(crate) struct Setup<'a> {
    pub(crate) motor: &'a Motor,
    pub(crate) T_s: f64,
    /// Samples from a command to the interval in which it acts.
    pub(crate) delay: u8,
    /// Maximum current in A.
    pub(crate) i_max: f64,
    /// Minimum EMF in V of a rotor that turns.
    pub(crate) e_min: f64,
}

/// Why a rotor that turns is not caught, or not yet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Refusal {
    /// With gates off, this current (A) flows through the diodes.
    Diodes(f64),
    /// The rotor turns too fast for the sampling: about this angle (rad) in a sample.
    Sampling(f64),
    /// The speed (rad/s) contradicts that of the EMF's magnitude (rad/s).
    Contradiction(f64, f64),
    /// The estimator in use cannot work at this speed (rad/s).
    Estimator(f64),
    /// Started from rest: this EMF (V) is below the minimum.
    Slow(f64),
}

/// Request at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CatchStep {
    /// Gates off.
    Off,
    /// Gates on, with this voltage (V).
    Apply(AlphaBeta),
    /// The rotor is at `theta` and turns at `w`; `gates`: whether they are on.
    Turns { theta: f64, w: f64, gates: bool },
    /// The rotor rests, or nearly so.
    Rests,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
enum Stage {
    #[default]
    Wait,
    First,
    Between,
    Second,
    /// The second current flows back through the diodes, and the rotor is at this angle with this speed.
    Back(f64, f64),
    Watch,
}

/// State of a flying start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Catch {
    stage: Stage,
    /// Samples in this stage; in the first one, without current.
    n: f64,
    /// Samples since the command of the first short circuit, or with gates off.
    since: f64,
    /// Current in A at the end of the first short circuit.
    first: AlphaBeta,
    /// EMF in V, low-passed, the sums S (V) and of k e (V), and their number of samples.
    e: AlphaBeta,
    sum: AlphaBeta,
    moment: AlphaBeta,
    count: f64,
    /// Why the rotor is not caught.
    pub(crate) refusal: Option<Refusal>,
}

/// Angle of a stator vector in rad.
fn angle(v: AlphaBeta) -> f64 {
    atan2(v.beta(), v.alpha())
}

impl Catch {
    /// One sample; `sample.u` acted with gates on.
    pub(crate) fn update(&mut self, set: &Setup<'_>, sample: &Sample) -> CatchStep {
        let i = sample.i.magnitude();
        let (none, delay) = (i < NONE * set.i_max, f64::from(set.delay));
        self.since += 1.0;
        self.n += 1.0;
        match self.stage {
            Stage::Wait => {
                if !none {
                    self.n = 0.0;
                }
                if !none && self.since * set.T_s >= WAIT {
                    self.refusal = Some(Refusal::Diodes(i));
                }
                // The commands of before are over, and so is the time after a refusal.
                let refused = matches!(self.refusal, Some(refusal) if !matches!(refusal, Refusal::Diodes(_)));
                if self.n <= delay + 1.0 || refused && self.n * set.T_s < WAIT {
                    return CatchStep::Off;
                }
                self.enter(Stage::First);
                self.since = 0.0;
                CatchStep::Apply(AlphaBeta::ZERO)
            }
            Stage::First if self.n > delay => {
                self.first = sample.i;
                let turn = turn_of(set.motor, i);
                if i < SEEN * set.i_max && (turn < FAST || i < CLEAR * set.i_max) {
                    (self.e, self.sum, self.moment, self.count) = Default::default();
                    self.enter(Stage::Watch);
                    return CatchStep::Apply(AlphaBeta::ZERO);
                }
                if turn * (delay + 3.0) > MOST {
                    return self.refuse(Refusal::Sampling(turn));
                }
                self.enter(Stage::Between);
                CatchStep::Off
            }
            Stage::Between => {
                let turned = turn_of(set.motor, self.first.magnitude()) * self.since;
                if turned > MOST {
                    // The current took too long to vanish.
                    self.enter(Stage::Wait);
                } else if none && self.since >= delay + 3.0 && turned >= TURN {
                    self.enter(Stage::Second);
                    return CatchStep::Apply(AlphaBeta::ZERO);
                }
                CatchStep::Off
            }
            Stage::Second if self.n > delay => {
                // The samples between the two commands.
                let between = self.since - self.n;
                let turn = wrap(angle(sample.i) - angle(self.first)) / between;
                let (w, expected) = (turn / set.T_s, turn_of(set.motor, i) / set.T_s);
                if contradicts(w, expected) {
                    return self.refuse(Refusal::Contradiction(w, expected));
                }
                let Motor { L_d, L_q, .. } = *set.motor;
                let behind = FRAC_PI_2 + atan2(0.5 * turn.abs() * L_q, L_d);
                self.enter(Stage::Back(angle(sample.i) + behind.copysign(w), w));
                CatchStep::Off
            }
            Stage::First | Stage::Second => CatchStep::Off,
            Stage::Back(theta, w) => {
                let theta = theta + w * set.T_s;
                self.stage = Stage::Back(theta, w);
                if none { CatchStep::Turns { theta: wrap(theta), w, gates: false } } else { CatchStep::Off }
            }
            Stage::Watch => self.watch(set, sample),
        }
    }

    /// Why a rotor that turns at `w` (rad/s) with gates off is not taken over: tried again later.
    pub(crate) fn refuse(&mut self, refusal: Refusal) -> CatchStep {
        self.refusal = Some(refusal);
        self.enter(Stage::Wait);
        self.since = 0.0;
        CatchStep::Off
    }

    fn enter(&mut self, stage: Stage) {
        (self.stage, self.n) = (stage, 0.0);
    }

    /// The current is held at zero, and the EMF shows the rotor.
    fn watch(&mut self, set: &Setup<'_>, sample: &Sample) -> CatchStep {
        let Setup { motor, T_s, .. } = *set;
        if self.n <= f64::from(set.delay) {
            return CatchStep::Apply(AlphaBeta::ZERO);
        }
        let per_sample = motor.L_d.min(motor.L_q) / T_s;
        let e = sample.u - (sample.i + sample.i_last) * (0.5 * motor.R_s) - (sample.i - sample.i_last) * per_sample;
        let settled = self.n > f64::from(set.delay) + SETTLE;
        self.e = if self.n <= f64::from(set.delay) + 1.0 { e } else { self.e + (e - self.e) * FRESH };
        let command = CatchStep::Apply(self.e - sample.i * (GAIN * per_sample));
        if !settled {
            return command;
        }
        self.sum += e;
        self.moment += e * self.count;
        self.count += 1.0;
        let (n, magnitude) = (self.count, self.sum.magnitude());
        let (turn, mean) = (magnitude * T_s / motor.psi_M, magnitude / n);
        if turn >= WATCHED && n >= SAMPLES {
            let moment = self.moment - self.sum * (0.5 * (n - 1.0));
            let seen = 12.0 * self.sum.cross(moment) / (magnitude * magnitude * (n * n - 1.0));
            let w = seen / least_squares(0.5 * n * seen.abs()) / T_s;
            let expected = mean / motor.psi_M;
            if !contradicts(w, expected) {
                let theta = angle(self.sum) + 0.5 * w * n * T_s - FRAC_PI_2.copysign(w);
                return CatchStep::Turns { theta: wrap(theta), w, gates: true };
            }
            return self.refuse(Refusal::Contradiction(w, expected));
        }
        // A sum that does not grow: the rotor does not turn evenly.
        let over = REST + 2.0 * motor.psi_M / set.e_min;
        if n * T_s >= REST && mean < set.e_min || n * T_s >= over {
            if mean > 0.5 * set.e_min {
                self.refusal = Some(Refusal::Slow(mean));
            }
            return CatchStep::Rests;
        }
        command
    }
}

/// Angle in rad in a sample that a short circuit with this current (A) shows.
fn turn_of(motor: &Motor, i: f64) -> f64 {
    i * motor.L_q / motor.psi_M
}

/// c(a) for an a that this factor has not been taken off yet.
fn least_squares(seen: f64) -> f64 {
    let c = |a: f64| {
        let (sin, cos) = sin_cos(a);
        if a > 1e-3 { 3.0 * (1.0 - a * cos / sin) / (a * a) } else { 1.0 }
    };
    let a = seen.min(1.4);
    c(a / c(a / c(a)))
}

/// Whether the speed `w` (rad/s) contradicts the magnitude `expected` (rad/s).
fn contradicts(w: f64, expected: f64) -> bool {
    w.abs() > CONTRADICTS * expected || w.abs() * CONTRADICTS < expected
}

#[cfg(test)]
mod tests {
    use super::*;
    use drive_base::frame::{Axis, Estimated};

    /// The EMF of a turning rotor without currents: the least squares give its speed and angle.
    #[test]
    fn the_emf_shows_the_rotor() {
        let motor = Motor { n_p: 3, R_s: 2.0, L_d: 6e-3, L_q: 6e-3, psi_M: 0.15 };
        let set = Setup { motor: &motor, T_s: 1e-4, delay: 1, i_max: 10.0, e_min: 1.0 };
        for w in [-180.0, -20.0, 20.0, 180.0] {
            let mut catch = Catch { stage: Stage::Watch, ..Catch::default() };
            let mut theta = 0.7;
            let found = loop {
                // The mean over the interval.
                let middle = theta + 0.5 * w * 1e-4;
                theta += w * 1e-4;
                let sample = Sample { u: Axis::<Estimated>::at(middle).along(w * 0.15).turned(), ..Sample::default() };
                match catch.update(&set, &sample) {
                    CatchStep::Turns { theta, w, gates } => break (theta, w, gates),
                    step => assert!(matches!(step, CatchStep::Apply(_)), "{step:?}"),
                }
            };
            assert!(
                wrap(found.0 - theta).abs() < 1e-4 && (found.1 / w - 1.0).abs() < 1e-4 && found.2,
                "{found:?}, {theta} rad, {w} rad/s"
            );
        }
    }

    /// Without EMF the rotor rests after 50 ms; with less than the minimum, the reason is kept.
    #[test]
    fn a_rotor_without_emf_rests() {
        let motor = Motor { n_p: 3, R_s: 2.0, L_d: 6e-3, L_q: 6e-3, psi_M: 0.15 };
        let set = Setup { motor: &motor, T_s: 1e-4, delay: 1, i_max: 10.0, e_min: 1.0 };
        for (e, slow) in [(0.0, false), (0.6, true)] {
            let mut catch = Catch { stage: Stage::Watch, ..Catch::default() };
            let sample = Sample { u: AlphaBeta::new(e, 0.0), ..Sample::default() };
            let mut n = 0;
            while catch.update(&set, &sample) != CatchStep::Rests {
                n += 1;
            }
            assert!((500..=510).contains(&n) && catch.refusal.is_some() == slow, "{n} samples, {:?}", catch.refusal);
        }
    }
}
