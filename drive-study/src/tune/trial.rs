//! Tries a tuned drive: from every start angle it starts, turns at a share of the rated speed, and takes rated torque as a
//! step.
//!
//! Held: at the end the speed is within 0.02 pu of its reference, and the estimate within 30 deg of the rotor.

use super::limits::{Limit, What};
use super::rules::Tuned;
use drive::Pair;
use drive::control::start::StartMode;
use drive::math::wrap;
use std::f64::consts::{PI, TAU};
use std::fmt;

/// The levels of speed in pu.
pub const LEVELS: [f64; 3] = [0.1, 0.5, 1.0];

/// What happened against what was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It starts from all angles and holds the load.
    Holds,
    /// It does not, as was told.
    Announced,
    /// It does not, and nothing was told.
    Lost,
    /// It does, and was told not to.
    FalseAlarm,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Holds => "holds",
            Self::Announced => "does not hold, as announced",
            Self::Lost => "does not hold, not announced",
            Self::FalseAlarm => "holds, though announced otherwise",
        })
    }
}

/// What a number of start angles gave at one level.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trial {
    /// Speed in pu.
    pub level: f64,
    /// Start angles.
    pub angles: u32,
    /// How many of them started.
    pub started: u32,
    /// How many of these held the load.
    pub held: u32,
    /// Least speed after the load step in pu.
    pub least: f64,
    /// Greatest angle error in deg after the load step where it was held.
    pub error: f64,
}

impl Trial {
    /// What happened against what `limits` told.
    pub fn verdict(&self, limits: &[Limit]) -> Verdict {
        let told = |what| limits.iter().any(|limit| limit.what == what && limit.level.total_cmp(&self.level).is_eq());
        let of = |what| match (self.does(what), told(what)) {
            (true, false) => Verdict::Holds,
            (false, true) => Verdict::Announced,
            (false, false) => Verdict::Lost,
            (true, true) => Verdict::FalseAlarm,
        };
        match of(What::Start) {
            Verdict::Holds => of(What::Load),
            start => start,
        }
    }

    /// Whether the drive does this from every angle.
    pub fn does(&self, what: What) -> bool {
        match what {
            What::Start => self.started == self.angles,
            What::Load => self.held == self.started,
        }
    }
}

/// One life of the drive from the electrical angle `theta` (rad), with a load that rises in `rise` (s): whether it started,
/// whether it held the load, least speed in pu and greatest angle error in deg after the step.
fn one(tuned: &Tuned, level: f64, rise: f64, theta: f64) -> (bool, bool, f64, f64) {
    let mut pair = tuned.pair();
    pair.plant.model.parameters.initial.theta_e = theta;
    let u_dc = pair.plant.model.inputs.u_dc;
    let (T_s, timing) = (pair.controller.model.parameters.T_s, Timing::of(tuned, &pair, level, rise));
    let reference = level * tuned.speed;
    let (mut started, mut held, mut least, mut error) = (true, true, f64::INFINITY, 0.0_f64);
    if pair.start().is_err() {
        return (false, false, 0.0, 180.0);
    }
    let mut k = 0_u32;
    loop {
        let t = f64::from(k) * T_s;
        if t >= timing.end {
            return (started, started && held, least, error);
        }
        let speed_ref = if t < timing.turn { 0.0 } else { reference };
        let share = if t < timing.load { 0.0 } else { ((t - timing.load) / rise.max(f64::MIN_POSITIVE)).min(1.0) };
        pair.set_inputs(speed_ref, share * tuned.torque, u_dc);
        if pair.step(T_s).is_err() {
            return (started && t > timing.load, false, least, 180.0);
        }
        k += 1;
        let off = (pair.plant.out.speed - reference).abs() / tuned.speed;
        let ahead = wrap(pair.plant.out.theta_e - pair.controller.out.theta_est).abs();
        let bad = off > 0.02 || ahead > PI / 6.0;
        if t < timing.load {
            started &= t < timing.load - timing.window || !bad;
        } else {
            held &= t < timing.end - timing.window || !bad;
            least = least.min(pair.plant.out.speed / tuned.speed);
            error = error.max(ahead.to_degrees());
        }
    }
}

/// Instants in s: of the speed reference, of the load, the end; and the window that is judged before the last two.
struct Timing {
    turn: f64,
    load: f64,
    end: f64,
    window: f64,
}

impl Timing {
    fn of(tuned: &Tuned, pair: &Pair, level: f64, rise: f64) -> Self {
        let par = &pair.controller.model.parameters;
        let J = pair.plant.model.parameters.mechanics.J;
        let settling = 12.0 / par.speed_loop.bandwidth;
        let up = 1.5 * level * J * tuned.speed / tuned.torque + 2.0 * settling;
        let start = &par.start;
        let (turn, begin) = if start.mode == StartMode::CurrentFrequency {
            (0.0, 2.0 * start.t_align + start.speed / start.acceleration + start.settle)
        } else {
            let rest = tuned.rest;
            (rest, rest)
        };
        let load = begin + up;
        Self { turn, load, end: load + rise + 2.0 * settling, window: 0.5 * settling }
    }
}

/// Tries a level (pu) from `angles` start angles, evenly spaced, with a load that rises in `rise` (s): 0 is a step.
pub fn at(tuned: &Tuned, level: f64, rise: f64, angles: u32) -> Trial {
    let mut trial = Trial { level, angles, least: f64::INFINITY, ..Trial::default() };
    for k in 0..angles {
        let (started, held, least, error) = one(tuned, level, rise, f64::from(k) * TAU / f64::from(angles));
        trial.started += u32::from(started);
        trial.held += u32::from(held);
        if started {
            trial.least = trial.least.min(least);
        }
        if held {
            trial.error = trial.error.max(error);
        }
    }
    trial
}
