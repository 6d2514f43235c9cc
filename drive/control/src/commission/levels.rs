//! Levels of speed and the sweeps between them, cut into [parts](super::circle): psi_M, J and friction.
//!
//! ```text
//! levels      0.15, 0.3, 0.45 w_r in the order 3 2 1 3 1 2 3 1 3
//! sweep       constant i_q = i_f +- i_a, so that 0.15 w_r take T_b = max(0.06 s, 30 / w_r);
//!             i_a at most 0.3 psi_M / L_q (beyond, an error of L_q turns the angle) and 0.6 I; i_f: friction
//! level       speed PI of bandwidth b = min(rho / 6, 30 1/s, 20 / T_a); settles for max(0.3 s, 3 / b, 12 / w)
//! measures    max(0.3 s, 4 turns, min(3.5 s, sqrt(300 T_a / w_r))), T_a = J w_r / (n_p K I / 2)
//! rho         sqrt(0.3 w_r / (0.06 T_b)) of the PLL, 2 pi 15 at least, 0.08 / T at most
//! flux        then max(0.2 s, 3 turns) with i_d = -0.06 I, or five times the ripple (`trial`); i_d = 0 elsewhere
//! ```
//!
//! A machine without load needs so little current that noise and the dead zone of the legs would dominate u. With i_d,
//! all legs carry current, and the error of their voltage loss points along d, where it turns the angle instead of changing the
//! radius; the radius is psi_M + (L_d - L_q) i_d, where the saturation changes L_d: by 5 % at 0.06 I, or psi_M by 0.3 %. An
//! error of 1 % of L_d changes psi_M by less than 0.1 %. The torque, however, is free of an error of the angle where i_d = 0. With
//! a [ripple](super::ripple), the radius without i_d is less exact than the current; the torque then is (psi_M + (L_d - L_q) i_d)
//! i_q.
//!
//! J / (n_p K) of the speed control and of i_a is updated after each sweep, and i_f from the last two levels. psi_M is the mean
//! radius at the highest level. Errors of the voltage change it by 1 / w: half of the difference between 0.15 and 0.45 w_r is
//! the error at 0.45 w_r and so part of the half-width, like the error of L_d. If time runs out after each level has been
//! measured once, the rest is omitted. At the end the control brakes to 0.1 w_r, and the gates go off. Derived here.

use super::bench::{Bench, Sample};
use super::circle::{Part, Points};
use super::identified::Identified;
use super::mechanics::Mechanics;
use super::results::Results;
use super::status::CommissionFault as Fault;
use super::trial::{Trial, Verdict};
use super::turning::Turning;
use drive_base::frame::{AlphaBeta, DqHat, SQRT_3};
use drive_base::math::within;
use drive_base::motor::Motor;
use serde::{Deserialize, Serialize};

/// Speed of a level over the rated one, times the levels in their order; and where the braking ends.
const LEVEL: f64 = 0.15;
const ORDER: [f64; 9] = [3.0, 2.0, 1.0, 3.0, 1.0, 2.0, 3.0, 1.0, 3.0];
const BRAKED: f64 = 0.1;
/// Currents over I, for a sweep and for the speed control.
const SWEEP: f64 = 0.6;
const CONTROL: f64 = 0.8;
/// Current along the d-axis over I.
const ALONG: f64 = -0.06;
/// Relative error of what the dead time adds to the samples.
const LATE: f64 = 0.3;
/// Shortest part in turns, longest in s.
const TURNS: f64 = 2.2;
const LONGEST: f64 = 1.2;
/// Maximum deviation of a part from a circle.
const DEVIATION: f64 = 0.05;
/// Relative half-width of an L_d that is refused.
const UNKNOWN: f64 = 0.1;
/// Minimum relative half-width of psi_M.
const LEAST: f64 = 0.001;
/// Speed deviation relative to the level: close enough to measure, and lost.
const NEAR: f64 = 0.03;
const FAR: f64 = 0.1;
/// Time in s in which the d-axis current changes by I.
const FADE: f64 = 0.05;
/// Measurement of psi_M: s and turns, after the time in s in which the current changes.
const FLUX: (f64, f64, f64) = (0.2, 3.0, 0.02);

/// Change of the friction's current that means a load, in units of I and of the current.
const LOAD: (f64, f64) = (0.02, 0.2);

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum Phase {
    #[default]
    Sweep,
    Settle,
    Measure,
    Flux,
}

/// Mean radius of a level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Radii {
    sum: f64,
    squares: f64,
    parts: f64,
}

/// The levels on their way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Levels {
    phase: Phase,
    /// Place in the order.
    #[serde(with = "super::fixed_size")]
    at: u64,
    /// Samples of this phase.
    k: f64,
    /// J / (n_p K) in A.s2/rad.
    inertia: f64,
    /// Current of the friction at the last level in A, its slope in A.s/rad, and the speed of that level in rad/s.
    friction: [f64; 3],
    /// Current in A and speed in rad/s of the first level as first measured.
    first: [f64; 2],
    /// Integral of the speed control in A.
    integral: f64,
    /// Current of the sweep in A, and its first speed in rad/s.
    i_a: f64,
    from: f64,
    /// Current along the d-axis in A; for the flux linkage, and psi(i)/i - without the magnet - in H there.
    i_d: f64,
    i_flux: f64,
    L_d: f64,
    /// The ripple.
    trial: Trial,
    /// Sum of i_q in A over the level, and samples.
    sums: [f64; 2],
    points: Points,
    mechanics: Mechanics,
    radii: [Radii; 3],
}

/// Result of a sample of the levels.
pub(super) enum Level {
    /// The voltage of this sample in V.
    Voltage(AlphaBeta),
    /// The results are complete.
    Done,
}

/// Time in s for a step of 0.15 w_r.
fn T_b(bench: &Bench) -> f64 {
    (30.0 / bench.w_r()).max(0.06)
}

/// Duration in s of a part at the speed `w` (rad/s) in a stretch of `whole` (s): the shorter of 40 turns and 1.2 s, but at
/// least 2.5 turns and a tenth of the stretch.
fn part(w: f64, whole: f64) -> f64 {
    let turn = std::f64::consts::TAU / w;
    LONGEST.min(40.0 * turn).max(2.5 * turn).max(0.1 * whole)
}

/// Maximum current of a sweep in A.
fn most(bench: &Bench, turning: &Turning) -> f64 {
    (0.3 * turning.motor.psi_M / turning.motor.L_q).min(SWEEP * bench.I)
}

/// Bandwidth of the PLL in rad/s.
pub(super) fn rho(bench: &Bench) -> f64 {
    (0.3 * bench.w_r() / (0.06 * T_b(bench))).sqrt().max(94.0).min(0.08 / bench.T)
}

impl Levels {
    /// The start is over; friction requires `i_f` (A).
    pub(super) fn new(bench: &Bench, turning: &Turning, sample: &Sample, i_f: f64, results: &Results) -> Self {
        // A heavy rotor still swings: its friction is at most a tenth of I.
        let i_f = i_f.clamp(0.0, 0.1 * bench.I);
        let i_d = turning.current(sample).d();
        let inertia = bench.inertia();
        let i_flux = ALONG * bench.I;
        let L_d = results.chord_d(turning.motor.L_d, i_flux);
        let mut levels = Self { inertia, friction: [i_f, 0.0, 0.0], i_d, i_flux, L_d, ..Self::default() };
        levels.sweep(bench, turning);
        levels
    }

    /// The levels are over: the control brakes.
    fn brakes(&self) -> bool {
        usize::try_from(self.at).is_ok_and(|at| at >= ORDER.len())
    }

    /// Time in s for the next level and the braking; 0 before each level has been measured.
    fn needed(&self, bench: &Bench, turning: &Turning) -> f64 {
        if self.radii.iter().any(|r| r.parts < 1.0) {
            return 0.0;
        }
        let target = self.target(bench);
        let way = (target - turning.w).abs() + target - BRAKED * bench.w_r();
        let sweeps = way * self.inertia / most(bench, turning).min(self.inertia * LEVEL * bench.w_r() / T_b(bench));
        1.3 * sweeps + 3.0 * self.wait(bench, turning, target) + self.measured(bench, target) + FLUX.0
    }

    /// Time in s in which the speed control settles at `target` (rad/s).
    fn wait(&self, bench: &Bench, turning: &Turning, target: f64) -> f64 {
        (3.0 / self.bandwidth(bench, turning)).max(12.0 / target).max(0.3)
    }

    /// Time in s of the measurement at `target` (rad/s).
    fn measured(&self, bench: &Bench, target: f64) -> f64 {
        let T_a = 2.0 * self.inertia * bench.w_r() / bench.I;
        let turns = 4.0 * std::f64::consts::TAU / target;
        (300.0 * T_a / bench.w_r()).sqrt().min(3.5).max(turns).max(0.3)
    }

    fn target(&self, bench: &Bench) -> f64 {
        let at = usize::try_from(self.at).unwrap_or(ORDER.len());
        bench.w_r() * ORDER.get(at).map_or(BRAKED, |n| LEVEL * n)
    }

    fn enter(&mut self, phase: Phase) {
        (self.phase, self.k) = (phase, 0.0);
    }

    /// Current of the friction in A at the speed `w` (rad/s).
    fn i_f(&self, w: f64) -> f64 {
        let [i, slope, at] = self.friction;
        i + slope * (w - at)
    }

    fn sweep(&mut self, bench: &Bench, turning: &Turning) {
        self.i_a = (self.inertia * LEVEL * bench.w_r() / T_b(bench)).min(most(bench, turning));
        self.from = turning.w;
        self.enter(Phase::Sweep);
        self.points.begin();
    }

    /// One sample, with `left` (s) of the time remaining.
    pub(super) fn update(
        &mut self,
        bench: &Bench,
        turning: &mut Turning,
        sample: &Sample,
        left: f64,
        results: &mut Results,
    ) -> Result<Level, Fault> {
        turning.observe(bench, sample);
        self.k += 1.0;
        let (T, w, target) = (bench.T, turning.w, self.target(bench));
        if w < 0.5 * BRAKED * bench.w_r() {
            return Err(Fault::Lost);
        }
        let t = self.k * T;
        let i_q = match self.phase {
            Phase::Sweep => {
                let up = (target - self.from).signum();
                let longest = part(w, (target - self.from).abs() * self.inertia / self.i_a);
                if (target - w) * up <= 0.0 {
                    self.swept(bench, turning, t);
                    if self.brakes() {
                        return Ok(Level::Done);
                    }
                    self.integral = self.i_f(w);
                    self.enter(Phase::Settle);
                } else if t > 2.0 * (target - self.from).abs() * self.inertia / self.i_a + 0.3 {
                    // Inertia or friction is greater than it seemed.
                    let stands = (w - self.from) * up < 0.01 * bench.w_r();
                    if self.brakes() {
                        return Ok(Level::Done);
                    }
                    if stands && self.i_a >= most(bench, turning) {
                        return Err(Fault::Lost);
                    }
                    self.i_a = (2.0 * self.i_a).min(most(bench, turning));
                    self.inertia *= if stands { 1.0 } else { 2.0 };
                    (self.from, self.k) = (w, 0.0);
                    self.points.begin();
                } else if t > 0.01 {
                    self.take(bench, turning, longest);
                }
                self.i_f(w) + up * self.i_a
            }
            Phase::Settle => {
                let wait = self.wait(bench, turning, target);
                let off = (w / target - 1.0).abs();
                if t > 3.0 * wait && off > FAR {
                    return Err(Fault::Lost);
                }
                if t > wait && off < NEAR {
                    self.sums = [0.0; 2];
                    self.trial.begin();
                    self.points.begin();
                    self.enter(Phase::Measure);
                }
                self.speed(bench, turning, target)
            }
            Phase::Measure => {
                let whole = self.measured(bench, target);
                self.take(bench, turning, whole / (whole / part(target, whole)).floor().max(1.0));
                self.trial.add(bench, turning, sample, false);
                let [sum, samples] = &mut self.sums;
                (*sum, *samples) = (*sum + turning.current(sample).q(), *samples + 1.0);
                if t >= whole {
                    let (i, [last, slope, w_last]) = (*sum / *samples, self.friction);
                    self.first = if self.first[1] == 0.0 { [i, target] } else { self.first };
                    let slope = if w_last > 0.0 { ((i - last) / (target - w_last)).max(0.0) } else { slope };
                    self.friction = [i, slope, target];
                    if (w / target - 1.0).abs() > FAR {
                        return Err(Fault::Lost);
                    }
                    self.part(bench, turning);
                    self.points.begin();
                    self.enter(Phase::Flux);
                }
                self.speed(bench, turning, target)
            }
            Phase::Flux => {
                let (time, turns, wait) = FLUX;
                let whole = time.max(turns * std::f64::consts::TAU / target);
                if t > wait {
                    self.trial.add(bench, turning, sample, true);
                    self.take(bench, turning, part(target, whole));
                }
                if t >= wait + whole {
                    self.part(bench, turning);
                    if self.repeats(bench, turning, results) {
                        self.enter(Phase::Settle);
                        let i = DqHat::new(self.i_d, self.i_f(w));
                        return Ok(Level::Voltage(turning.in_rotor_frame(bench, sample, i)));
                    }
                    self.follow(bench, turning);
                    self.at += 1;
                    if !self.brakes() && left < self.needed(bench, turning) {
                        self.at = ORDER.iter().fold(0, |n, _| n + 1);
                    }
                    if self.brakes() {
                        self.show(bench, turning.motor.L_d, turning.ripples, results)?;
                    }
                    self.sweep(bench, turning);
                }
                self.speed(bench, turning, target)
            }
        };
        let along = if self.phase == Phase::Flux { self.i_flux } else { 0.0 };
        self.i_d += within(along - self.i_d, bench.I * T / FADE);
        Ok(Level::Voltage(turning.in_rotor_frame(bench, sample, DqHat::new(self.i_d, i_q))))
    }

    /// Bandwidth of the speed control in rad/s: noise of w causes little current.
    fn bandwidth(&self, bench: &Bench, turning: &Turning) -> f64 {
        (turning.rho / 6.0).min(30.0).min(10.0 * bench.I / (self.inertia * bench.w_r()))
    }

    /// Current of the speed control in A.
    fn speed(&mut self, bench: &Bench, turning: &Turning, target: f64) -> f64 {
        let b = self.bandwidth(bench, turning);
        let (e, most) = (target - turning.w, CONTROL * bench.I);
        let asked = self.inertia * b * e + self.integral;
        let i_q = within(asked, most);
        self.integral += self.inertia * b * b * 0.25 * bench.T * e + (i_q - asked);
        i_q
    }

    /// A sample of a part that lasts `longest` (s) at most.
    fn take(&mut self, bench: &Bench, turning: &Turning, longest: f64) {
        self.points.take(turning.delta, turning.i, turning.theta);
        if self.points.time(bench.T) >= longest {
            self.part(bench, turning);
            self.points.begin();
        }
    }

    /// A part ends.
    fn part(&mut self, bench: &Bench, turning: &Turning) {
        let Some(part) = self.points.end(bench.T) else { return };
        if part.deviation > DEVIATION || part.turns < TURNS {
            return;
        }
        let Part { acceleration, sigma, w, torque, radius, i_d, .. } = part;
        if self.phase != Phase::Flux {
            let each = 1.0 / bench.n_p;
            let Motor { psi_M, L_d, L_q, .. } = turning.motor;
            // The ripple's error of the radius is not one of the torque.
            let torque = if turning.ripples { torque * (psi_M + (L_d - L_q) * i_d) / radius } else { torque };
            self.mechanics.add(acceleration * each, sigma * each, w * each, 1.5 * bench.n_p * torque);
            return;
        }
        let level = ORDER[usize::try_from(self.at).unwrap_or(0).min(ORDER.len() - 1)];
        let n = if level < 1.5 {
            0
        } else if level < 2.5 {
            1
        } else {
            2
        };
        let (r, psi) = (&mut self.radii[n], radius + (turning.motor.L_q - self.L_d) * i_d);
        (r.sum, r.squares, r.parts) = (r.sum + psi, r.squares + psi * psi, r.parts + 1.0);
    }

    /// A sweep of `t` (s) ends: the inertia.
    fn swept(&mut self, bench: &Bench, turning: &Turning, t: f64) {
        self.part(bench, turning);
        let change = (turning.w - self.from).abs();
        let found = self.i_a * t / change.max(1e-9 * bench.w_r());
        self.inertia = found.clamp(0.3 * self.inertia, 2.0 * self.inertia);
    }

    /// Whether the level has to be repeated, with the ripple.
    fn repeats(&mut self, bench: &Bench, turning: &mut Turning, results: &Results) -> bool {
        let along = (self.L_d - turning.motor.L_q) * self.i_flux;
        let verdict = self.trial.judge(bench, turning, self.at == 0, along);
        if let Verdict::Again(i) = verdict {
            self.i_flux = self.i_flux.min(-i);
            self.L_d = results.chord_d(turning.motor.L_d, self.i_flux);
            // The level is its own predecessor: no slope.
            self.friction[2] = 0.0;
        }
        if verdict != Verdict::Over {
            (self.radii, self.mechanics) = <_>::default();
        }
        matches!(verdict, Verdict::Again(_))
    }

    /// The observer's flux linkage follows the value found at the levels.
    fn follow(&self, bench: &Bench, turning: &mut Turning) {
        let best = self.radii.iter().rev().find(|r| r.parts > 0.0);
        if let Some(r) = best {
            turning.motor.psi_M = (r.sum / r.parts).clamp(bench.psi_least(), 1.15 * bench.psi_r);
        }
    }

    /// The results; `L_d` in H without current.
    fn show(&self, bench: &Bench, L_d: f64, ripples: bool, results: &mut Results) -> Result<(), Fault> {
        let [low, _, high] = self.radii;
        if low.parts < 1.0 || high.parts < 1.0 {
            return Err(Fault::Flux);
        }
        let psi = high.sum / high.parts;
        if !(psi > bench.psi_least() && psi < 1.15 * bench.psi_r) {
            return Err(Fault::Flux);
        }
        let error = 0.5 * (low.sum / low.parts / psi - 1.0);
        let variance = (high.squares / high.parts - psi * psi).max(0.0) / (psi * psi);
        let saturated = results.saturation[2] * L_d * self.i_flux * L_d;
        let inductance = (results.L_d.u.min(UNKNOWN) + saturated.abs()) * L_d * self.i_flux / psi;
        let ripple = self.trial.rest / psi;
        let u =
            (error * error + ripple * ripple + inductance * inductance + 4.0 * variance / high.parts + LEAST * LEAST)
                .sqrt();
        // At w_f the samples differ from the mean current by this at most, in A.
        let late = if ripples { LATE * bench.u_dead / (2.0 * SQRT_3 * bench.U) } else { 0.0 };
        let sampled = 0.3 * bench.w_r() * psi * bench.carrier / L_d * (late + bench.R * bench.carrier / (96.0 * L_d));
        let K = 1.5 * bench.n_p * psi;
        let w_f = 0.3 * bench.w_r() / bench.n_p;
        let J = self.inertia * bench.n_p * K;
        results.show_flux(Identified { value: psi, u });
        let found = self.mechanics.solve(J, K * bench.I, w_f).ok_or(Fault::Mechanics)?;
        // The friction of the first level is that of the others, or a load has come.
        let [i, w] = self.first;
        let expected = (found.B.value * w / bench.n_p + found.tau_coulomb.value) / K;
        if (i - expected).abs() > LOAD.0 * bench.I + LOAD.1 * expected.abs() {
            return Err(Fault::Mechanics);
        }
        results.show_mechanics(found.with(u, K * sampled, w_f));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_part_has_enough_turns_and_is_short_enough() {
        for (turns_a_second, whole, expected) in
            [(1.0, 4.0, 2.5), (10.0, 3.0, 1.2), (200.0, 0.3, 0.2), (200.0, 4.0, 0.4)]
        {
            let found = part(TAU * turns_a_second, whole);
            assert!((found - expected).abs() < 1e-12, "{turns_a_second} 1/s: {found} s, not {expected} s");
        }
    }

    /// A third error of the voltage, psi (1 + x / w), is within the half-width.
    #[test]
    fn an_error_of_the_voltage_is_in_the_half_width() {
        let bench = Bench { n_p: 2.0, U: 100.0, psi_r: 0.2, I: 10.0, ..Bench::default() };
        let mut levels = Levels { inertia: 1.0, L_d: 1e-3, ..Levels::default() };
        for (n, error) in [(0, 0.03), (1, 0.015), (2, 0.01)] {
            let psi = 0.15 * (1.0 + error);
            levels.radii[n] = Radii { sum: 4.0 * psi, squares: 4.0 * psi * psi, parts: 4.0 };
        }
        let mut results = Results { L_d: Identified { value: 1e-3, u: 0.01 }, ..Results::default() };
        assert_eq!(levels.show(&bench, 1e-3, false, &mut results), Err(Fault::Mechanics), "there are no parts");
        let error = results.psi_M.value / 0.15 - 1.0;
        assert!((error - 0.01).abs() < 1e-9 && results.psi_M.u > 0.0099 && results.psi_M.u < 0.0105, "{results:?}");
        levels.radii[2].sum *= 0.1;
        assert_eq!(
            levels.show(&bench, 1e-3, false, &mut results),
            Err(Fault::Flux),
            "0.015 Wb is not within 0.25 and 1.15 psi_r"
        );
    }
}
