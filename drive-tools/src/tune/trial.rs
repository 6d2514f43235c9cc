//! Tries a tuned drive: from every start angle it starts, turns at a share of the rated speed, and takes a load as a step.
//!
//! Held: in the end the speed is within 0.02 pu of its reference, and the estimate within 30 deg of the rotor. The end is 20
//! times the slowest time constant ([`pace`](super::pace)) after the reference and again after the load; a run ends earlier if
//! it has clearly settled or diverges. Settled: over 4 time constants of the slower loop, the speed stays within 0.005 pu of
//! the reference and the angle error below 25 deg, and they move by less than 0.002 pu and 1 deg. A speed that still varies by
//! 0.02 pu at the end counts as lost.
//!
//! [`swings`] runs without a load through speeds between the levels, up and down again, because a swing that begins on the way up
//! may persist on the way down. [`at_temperature`] runs the drive with a colder or hotter machine than its values assume.

use super::pace::{Begin, Pace};
use super::setting::{Setting, Tuned, Value, real};
use crate::queue;
use drive::Pair;
use drive::math::wrap;
use std::f64::consts::TAU;
use std::fmt;

/// End of a run in units of the slowest time constant.
const HORIZON: f64 = 20.0;

/// Time over which a run must be settled, in units of the time constant of the slower loop.
const WINDOW: f64 = 4.0;

/// Parts of the window; a new part replaces the oldest.
const PARTS: usize = 4;

/// Tolerances of the end: speed in pu, angle in deg.
const HELD: (f64, f64) = (0.02, 30.0);

/// Tolerances of a run that has clearly settled.
const CALM: (f64, f64) = (0.005, 25.0);

/// Maximum movement in the window of a run that has clearly settled: speed in pu, angle in deg.
const STILL: (f64, f64) = (0.002, 1.0);

/// Distance from the reference in pu, in addition to its magnitude, from which no drive recovers.
const AWAY: f64 = 4.0;

/// A task of the drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Task {
    /// Speed in pu of the rated speed.
    pub level: f64,
    /// Load in N.m.
    pub torque: f64,
    /// Rise time of the load in s; 0: a step.
    pub rise: f64,
}

impl Tuned {
    /// The tasks of a trial: rated torque as a step at each level, and at the highest speed the torque of the rated power.
    pub fn tasks(&self) -> Vec<Task> {
        let task = |level, torque| Task { level, torque, rise: 0.0 };
        let top = self.top / self.speed;
        let highest = (top > 1.0).then(|| task(top, self.top_torque));
        self.levels.iter().map(|&level| task(level, self.torque)).chain(highest).collect()
    }
}

/// The result of a task from a number of start angles.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// The task.
    pub task: Task,
    /// Start angles.
    pub angles: u32,
    /// Number of those that started.
    pub started: u32,
    /// Number of these trials that held the load.
    pub held: u32,
    /// Minimum speed after the load step in pu.
    pub least: f64,
    /// Maximum angle error in deg after the load step where it was held.
    pub error: f64,
    /// Maximum torque in N.m that the controller allows at this speed.
    pub most: f64,
    /// Number of the runs that failed while `lock_lost` stayed below 1 and no limit was active at the end.
    pub silent: u32,
    /// Number of the runs that held the load, never lost the rotor, and had `lock_lost` at 1 or more.
    pub alarmed: u32,
}

impl Trial {
    /// Whether the drive started from every angle.
    pub fn starts(&self) -> bool {
        self.started == self.angles
    }

    /// Whether the estimate lost the rotor temporarily before a load that is finally held: beyond 90 deg, i_q acts in the
    /// opposite direction.
    pub fn slips(&self) -> bool {
        self.error > 90.0
    }

    /// Whether it held the load from every start.
    pub fn holds(&self) -> bool {
        self.held == self.started
    }
}

/// The result of a run: whether the drive started, whether it held the load, minimum speed in pu and maximum angle error in deg
/// after the load, and the maximum torque in N.m.
#[derive(Clone, Copy)]
struct Run {
    started: bool,
    held: bool,
    least: f64,
    error: f64,
    most: f64,
    /// Maximum `lock_lost`.
    lock: f64,
    /// Whether a limit of current, torque or voltage was active for most of the last time.
    limited: bool,
}

/// Speed and angle error in a part of the window.
#[derive(Clone, Copy)]
struct Part {
    /// Maximum distance of the speed from the reference in pu.
    off: f64,
    /// Maximum magnitude of the angle error in deg.
    ahead: f64,
    /// Minimum and maximum speed in pu.
    speed: (f64, f64),
    /// Minimum and maximum angle error in deg.
    angle: (f64, f64),
}

impl Part {
    const NONE: Self = Self {
        off: 0.0,
        ahead: 0.0,
        speed: (f64::INFINITY, f64::NEG_INFINITY),
        angle: (f64::INFINITY, f64::NEG_INFINITY),
    };

    fn see(&mut self, reference: f64, speed: f64, angle: f64) {
        self.off = self.off.max((speed - reference).abs());
        self.ahead = self.ahead.max(angle.abs());
        self.speed = (self.speed.0.min(speed), self.speed.1.max(speed));
        self.angle = (self.angle.0.min(angle), self.angle.1.max(angle));
    }

    fn with(self, other: Self) -> Self {
        Self {
            off: self.off.max(other.off),
            ahead: self.ahead.max(other.ahead),
            speed: (self.speed.0.min(other.speed.0), self.speed.1.max(other.speed.1)),
            angle: (self.angle.0.min(other.angle.0), self.angle.1.max(other.angle.1)),
        }
    }

    fn held(&self) -> bool {
        self.off <= HELD.0 && self.ahead <= HELD.1 && self.speed.1 - self.speed.0 <= HELD.0
    }

    fn settled(&self) -> bool {
        let span = |(low, high): (f64, f64)| high - low;
        self.off <= CALM.0 && self.ahead <= CALM.1 && span(self.speed) <= STILL.0 && span(self.angle) <= STILL.1
    }
}

/// The drive of one run, and its clock.
struct Bench<'a> {
    tuned: &'a Tuned,
    pair: Pair,
    u_dc: f64,
    T_s: f64,
    /// Samples so far.
    k: u32,
    /// Maximum `lock_lost` so far.
    lock: f64,
    /// Share of the last samples in which a limit was active, smoothed.
    limited: f64,
}

/// Time constant in s of the share of samples at a limit.
const LATELY: f64 = 0.5;

impl Bench<'_> {
    fn now(&self) -> f64 {
        f64::from(self.k) * self.T_s
    }

    /// One sample at the speed reference `level` (pu) with the load `torque` (N.m): speed in pu and angle error in deg; `None` if a
    /// step fails.
    fn step(&mut self, level: f64, torque: f64) -> Option<(f64, f64)> {
        self.pair.set_inputs(level * self.tuned.speed, torque, self.u_dc);
        self.pair.step(self.T_s).ok()?;
        self.k += 1;
        let out = &self.pair.controller.out;
        self.lock = self.lock.max(out.lock_lost);
        let limited = f64::from(u8::from(out.current_limited || out.voltage_limited));
        self.limited += (limited - self.limited) * (self.T_s / LATELY).min(1.0);
        let ahead = wrap(self.pair.plant.out.theta_e - self.pair.controller.out.theta_est);
        Some((self.pair.plant.out.speed / self.tuned.speed, ahead.to_degrees()))
    }

    /// Starts up to `level` under `load` (N.m); returns whether the speed settles there.
    fn starts(&mut self, level: f64, load: f64) -> bool {
        let Begin { rest, ready, .. } = Begin::of(self.tuned, &self.pair, level);
        while self.now() < rest || self.pair.controller.model.measures_resistance() {
            if self.step(if self.now() < rest { 0.0 } else { level }, load).is_none() {
                return false;
            }
        }
        self.until_settled(level, ready, |_| load, |_, _| ())
    }

    /// Runs at `level` with `load` (N.m over the time in s since now), which is constant from `from` (s) on, until it settles
    /// or the time is over; returns whether it then runs at the reference. `see` gets speed and angle error.
    fn until_settled(
        &mut self,
        level: f64,
        from: f64,
        load: impl Fn(f64) -> f64,
        mut see: impl FnMut(f64, f64),
    ) -> bool {
        let pace = Pace::of(self.tuned, &self.pair, level, load(from));
        let (begin, part) = (self.now(), WINDOW * pace.loops() / f64::from(u8::try_from(PARTS).unwrap_or(1)));
        let (end, mut next) = (from + HORIZON * pace.slowest(), from + part);
        let (mut parts, mut seen) = ([Part::NONE; PARTS], 0);
        loop {
            let t = self.now() - begin;
            let Some((speed, angle)) = self.step(level, load(t)) else { return false };
            see(speed, angle);
            if t < from {
                continue;
            }
            parts[0].see(level, speed, angle);
            if parts[0].off > AWAY + level.abs() {
                return false;
            }
            if t < next {
                continue;
            }
            seen += 1;
            let whole = parts.iter().fold(Part::NONE, |whole, &part| whole.with(part));
            if seen >= PARTS && (whole.settled() || t >= end) {
                return whole.held();
            }
            parts.rotate_right(1);
            (parts[0], next) = (Part::NONE, next + part);
        }
    }
}

/// One run from the electrical angle `theta` (rad).
fn one(tuned: &Tuned, task: &Task, theta: f64) -> Run {
    let mut run = Run {
        started: false,
        held: false,
        least: f64::INFINITY,
        error: 0.0,
        most: f64::INFINITY,
        lock: 0.0,
        limited: false,
    };
    let mut pair = tuned.pair();
    pair.plant.model.parameters.initial.theta_e = theta;
    if pair.start().is_err() {
        return run;
    }
    let (u_dc, T_s) = (pair.plant.model.inputs.u_dc, pair.controller.model.parameters.T_s);
    let mut bench = Bench { tuned, pair, u_dc, T_s, k: 0, lock: 0.0, limited: 0.0 };
    run.started = bench.starts(task.level, 0.0);
    if !run.started {
        return Run { lock: bench.lock, limited: bench.limited > 0.5, ..run };
    }
    let most = bench.pair.controller.out.tau_max;
    let load = |t: f64| if t < task.rise { task.torque * t / task.rise } else { task.torque };
    let (mut least, mut error) = (f64::INFINITY, 0.0_f64);
    run.held = bench.until_settled(task.level, task.rise, load, |speed, angle| {
        least = least.min(speed);
        error = error.max(angle.abs());
    });
    Run { least, error, most, lock: bench.lock, limited: bench.limited > 0.5, ..run }
}

/// From how many of `angles` start angles the drive runs up under the rated torque, which acts from the first sample on: a free rotor
/// turns back until a current holds it. To half the rated speed, or to the highest of the method: the speed in pu.
pub fn loaded(tuned: &Tuned, angles: u32) -> (f64, u32) {
    let level = tuned.levels.iter().fold(0.0, |a: f64, &b| a.max(b)).min(0.5);
    let starts: Vec<f64> = (0..angles).map(|k| f64::from(k) * TAU / f64::from(angles)).collect();
    let ran = |theta: &f64| {
        let mut pair = tuned.pair();
        pair.plant.model.parameters.initial.theta_e = *theta;
        if pair.start().is_err() {
            return false;
        }
        let (u_dc, T_s) = (pair.plant.model.inputs.u_dc, pair.controller.model.parameters.T_s);
        Bench { tuned, pair, u_dc, T_s, k: 0, lock: 0.0, limited: 0.0 }.starts(level, tuned.torque)
    };
    (level, queue::map(&starts, ran).into_iter().map(u32::from).sum())
}

/// Number of speeds between 0 and the rated one at which a drive without a load is tried for swings.
const STAIRS: u32 = 10;

/// Minimum swing: speed in pu, current as a share of the maximum, power as a share of the rated one, all from peak to peak.
const SWING: [f64; 3] = [0.01, 0.25, 0.25];

/// A drive without a load that swings at a constant reference.
#[derive(Clone, Debug, PartialEq)]
pub struct Swing {
    /// Speed in pu.
    pub level: f64,
    /// Whether the drive came from below.
    pub rising: bool,
    /// Peak to peak: speed in pu.
    pub speed: f64,
    /// Peak to peak: i_q in A.
    pub current: f64,
    /// Peak to peak: input power in W.
    pub power: f64,
}

impl fmt::Display for Swing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let side = if self.rising { "below" } else { "above" };
        write!(
            f,
            "without a load, the drive swings at {:.1} pu, reached from {side}: speed +-{:.3} pu, i_q +-{:.3} A, input power +-{:.3} W",
            self.level,
            0.5 * self.speed,
            0.5 * self.current,
            0.5 * self.power
        )
    }
}

impl Bench<'_> {
    /// Moves the speed reference from `from` to `to` (pu) in the time (s), without a load; the spans of speed, i_q and input power.
    fn pass(&mut self, from: f64, to: f64, time: f64) -> Option<[f64; 3]> {
        let begin = self.now();
        let mut span = [(f64::INFINITY, f64::NEG_INFINITY); 3];
        while self.now() < begin + time {
            let share = (self.now() - begin) / time;
            let (speed, _) = self.step(from + (to - from) * share, 0.0)?;
            let seen = [speed, self.pair.controller.out.i.q, self.pair.plant.out.powers.p_in];
            for ((low, high), x) in span.iter_mut().zip(seen) {
                (*low, *high) = (low.min(x), high.max(x));
            }
        }
        Some(span.map(|(low, high)| high - low))
    }
}

/// The swings of a drive that starts at 0.1 pu and runs without a load to 1 pu and back, by ramps and in steps of 0.1 pu. If the
/// drive is lost on the way, the swings so far.
pub fn swings(tuned: &Tuned) -> Vec<Swing> {
    let (mut all, mut pair) = (Vec::new(), tuned.pair());
    if pair.start().is_err() {
        return all;
    }
    let first = tuned.levels.iter().fold(0.0, |a: f64, &b| a.max(b)) / f64::from(STAIRS);
    let par = &pair.controller.model.parameters;
    let (u_dc, T_s) = (pair.plant.model.inputs.u_dc, par.T_s);
    let least = [SWING[0], SWING[1] * par.limit.i, SWING[2] * tuned.torque * tuned.speed];
    let mut bench = Bench { tuned, pair, u_dc, T_s, k: 0, lock: 0.0, limited: 0.0 };
    if !bench.starts(first, 0.0) {
        return all;
    }
    let mut last = first;
    for (k, rising) in (1..=STAIRS).map(|k| (k, true)).chain((1..STAIRS).rev().map(|k| (k, false))) {
        let level = f64::from(k) * first;
        let time = 8.0 * Pace::of(tuned, &bench.pair, level, 0.0).loops();
        let mut pass = |from| bench.pass(from, level, time);
        let (Some(_), Some(_), Some(before), Some(after)) = (pass(last), pass(level), pass(level), pass(level)) else {
            return all;
        };
        let stays = |k: usize| before[k] > least[k] && after[k] > least[k].max(0.7 * before[k]);
        if (0..3).any(stays) {
            let [speed, current, power] = after;
            all.push(Swing { level, rising, speed, current, power });
        }
        last = level;
    }
    all
}

/// Temperatures in degC of winding and magnet at which a drive with the values of 20 degC is tried.
pub const TEMPERATURES: [f64; 2] = [-30.0, 130.0];

/// Temperature coefficients in 1/K of copper and NdFeB, for a machine whose file specifies none.
const ALPHA: [(&str, f64); 2] = [("winding.alpha", 3.93e-3), ("magnet.alpha", -1.1e-3)];

/// The drive with its machine at `celsius` degC from the beginning, with at most the torque of the rated current at that
/// temperature.
pub fn at_temperature(tuned: &Tuned, celsius: f64) -> Tuned {
    let mut other = tuned.clone();
    for (name, alpha) in ALPHA {
        if !other.plant.iter().any(|setting| setting.name == name) {
            other.plant.push(real(name, alpha, "copper and NdFeB"));
        }
    }
    let alpha = other.plant.iter().find_map(|setting| match setting {
        Setting { name: "magnet.alpha", value: Value::Real(x), .. } => Some(*x),
        _ => None,
    });
    let share = (1.0 + alpha.unwrap_or_default() * (celsius - 20.0)).min(1.0);
    (other.torque, other.top_torque) = (share * tuned.torque, share * tuned.top_torque);
    other.plant.push(real("thermal.T_start", 273.15 + celsius, "of the trial"));
    other
}

/// Tries all tasks from `angles` start angles.
pub fn all(tuned: &Tuned, angles: u32) -> Vec<Trial> {
    tuned.tasks().iter().map(|task| at(tuned, task, angles)).collect()
}

/// Tries a task from `angles` start angles, evenly spaced, on all processors.
pub fn at(tuned: &Tuned, task: &Task, angles: u32) -> Trial {
    let starts: Vec<f64> = (0..angles).map(|k| f64::from(k) * TAU / f64::from(angles)).collect();
    let runs = queue::map(&starts, |theta| one(tuned, task, *theta));
    let mut trial = Trial {
        task: *task,
        angles,
        started: 0,
        held: 0,
        least: f64::INFINITY,
        error: 0.0,
        most: f64::INFINITY,
        silent: 0,
        alarmed: 0,
    };
    for Run { started, held, least, error, most, lock, limited } in runs {
        trial.started += u32::from(started);
        trial.held += u32::from(held);
        trial.silent += u32::from(!held && lock < 1.0 && !limited);
        trial.alarmed += u32::from(held && lock >= 1.0 && error <= 90.0);
        trial.least = trial.least.min(least);
        trial.most = trial.most.min(most);
        if held {
            trial.error = trial.error.max(error);
        }
    }
    trial
}
