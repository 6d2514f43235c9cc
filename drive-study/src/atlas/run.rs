//! One run: the course of speed and load, the criteria of a lost rotor, and whether `lock_lost` reports it.
//!
//! Every run has an approach, then a load, and it is judged at its end. Shares are of rated speed and torque:
//!
//! | | [`Approach::Rest`] | [`Approach::Turning`] |
//! |---|---|---|
//! | for | drives that start at rest by themselves (flux observers) | all others |
//! | first | rest | 0.2 of the rated speed, in the sign of the reference |
//! | `load` | speed as a step at 0.2 s, load as a step at 1 s | speed by a ramp 0.2..1 s, load by a ramp 1.5..1.8 s |
//! | `speed` | load as a step at 0.5 s, speed as a step at 1.5 s | load by a ramp 0.2..0.5 s, speed by a ramp 1..1.8 s |
//! | judged | 4..6 s (`heating`: 12..14 s, R rises 2..12 s) | the same |
//! | lost: speed off by more than | 1/600 + 5 % of the reference | 0.02 |
//! | lost: angle off by more than | 180 deg, which is never: at rest the d-axis current carries load at 36 deg | 30 deg |
//!
//! In `noise`, the current sensors have 10 mA of noise per 7.5 A of `limit.i`; `inverter` adds offsets of +20 and -20 mA per 7.5 A and a
//! dead time of 2 % of T_s, compensated. A drive with `compensation.calibrate` is off for the
//! first 0.05 s, and the course begins after that.

use super::cell::{Cell, Course};
use super::drive::{Approach, Drive};
use super::outside::Outside;
use crate::runner::{Bench, step};
use drive::Pair;
use drive::frame::Phases;
use drive::math::wrap;
use fmu_core::{Fault, Model};

/// Rise of the resistance in `heating`, as a share.
const HEATING: f64 = 0.4;
/// Standard deviation of the current noise as a share of `limit.i`: 10 mA on the reference motor.
const NOISE: f64 = 0.01 / 7.5;
/// Offsets of the current sensors a and b as shares of `limit.i`: 20 mA and -20 mA on the reference motor.
const OFFSET: f64 = 0.02 / 7.5;
/// Initial time (s) for which a drive with `compensation.calibrate` stays off.
const OFF: f64 = 0.05;
/// Dead time as a share of the sample period: 2 us at 10 kHz.
const DEAD_TIME: f64 = 0.02;

/// Temperatures of `cold` and `hot` relative to the machine's data (-30 and 130 degC relative to 20 degC), and the temperature
/// coefficients of copper and magnet.
const COLD: f64 = -50.0;
const HOT: f64 = 110.0;
const COPPER: f64 = 3.93e-3;
const MAGNET: f64 = -1.1e-3;

/// How the rotor was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Loss {
    /// The rotor slips against the estimated frame, by a turn or more in the last 2 s, or by the mean of the speeds.
    Slips,
    /// Rotor and estimate turn together at a speed that is not the reference.
    Creeps,
    /// Rotor and estimate turn together, on average at the reference speed, and swing.
    Swings,
    /// The speed is right, the angle is wrong.
    Angle,
    /// A step failed.
    Failed,
}

impl Loss {
    /// All classes.
    pub const ALL: &'static [Self] = &[Self::Slips, Self::Creeps, Self::Swings, Self::Angle, Self::Failed];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Slips => "slips",
            Self::Creeps => "creeps",
            Self::Swings => "swings",
            Self::Angle => "angle",
            Self::Failed => "failed",
        }
    }

    /// One sentence about it.
    pub fn title(self) -> &'static str {
        match self {
            Self::Slips => "the rotor slips against the estimate",
            Self::Creeps => "rotor and estimate turn together, not at the reference",
            Self::Swings => "the speed swings about the reference",
            Self::Angle => "the speed is right, the angle is wrong",
            Self::Failed => "a step failed",
        }
    }
}

/// The result of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Kind and time (s) of the loss: the first time out of tolerance within the evaluated span.
    pub lost: Option<(Loss, f64)>,
    /// Maximum `lock_lost` from the loss to 1 s later, or over the whole run if the cell is held.
    pub lock_lost: f64,
    /// Maximum `lock_lost` of a held cell while the drive has been within its tolerance for 1 s.
    pub while_held: f64,
    /// Maximum speed error in the evaluated time, as a share of the rated speed.
    pub speed_error: f64,
    /// Maximum angle error in the evaluated time, in deg.
    pub angle_error: f64,
}

impl Verdict {
    /// Whether `lock_lost` was right: 1 or more within 1 s of a loss, below 1 while the drive holds. A cell that is
    /// held in the end may have been lost before: in `heating`, R rises to an R^ that was greater.
    pub fn lock_lost_is_right(&self) -> bool {
        if self.lost.is_some() { self.lock_lost >= 1.0 } else { self.while_held < 1.0 }
    }
}

/// The runs of a drive.
#[derive(Clone)]
pub struct Atlas {
    /// The drive.
    pub drive: Drive,
    /// Cells and verdicts, in the order of the grid.
    pub runs: Vec<(Cell, Verdict)>,
}

impl Atlas {
    /// The lost cells, or the held ones.
    pub fn that_are(&self, lost: bool) -> impl Iterator<Item = &(Cell, Verdict)> {
        self.runs.iter().filter(move |(_, verdict)| verdict.lost.is_some() == lost)
    }
}

/// Speed reference and load at the time `t` (s), as shares.
fn course(approach: Approach, cell: &Cell, t: f64) -> (f64, f64) {
    let step = |from| step(t, from);
    let ramp = |from: f64, to: f64| ((t - from) / (to - from)).clamp(0.0, 1.0);
    let first = 0.2_f64.copysign(cell.speed);
    let slow_down = |share: f64| first + share * (cell.speed - first);
    match (approach, cell.scenario) {
        (Approach::Rest, Course::Speed) => (cell.speed * step(1.5), cell.load * step(0.5)),
        // On a shaft that something else turns.
        (Approach::Rest, Course::Torque) => (cell.speed * ramp(0.2, 1.0), cell.load * step(1.0)),
        (Approach::Rest, _) => (cell.speed * step(0.2), cell.load * step(1.0)),
        (Approach::Turning, Course::Speed) => (slow_down(ramp(1.0, 1.8)), cell.load * ramp(0.2, 0.5)),
        (Approach::Turning, _) => (slow_down(ramp(0.2, 1.0)), cell.load * ramp(1.5, 1.8)),
    }
}

/// The drive of a cell before its start.
fn prepared(drive: &Drive, cell: &Cell) -> Bench {
    let mut bench = drive.bench.clone();
    let pair = &mut bench.pair;
    let (plant, controller) = (&mut pair.plant.model, &mut pair.controller.model);
    let (truth, par) = (&mut plant.parameters, &mut controller.parameters);
    par.motor.R_s = cell.R * truth.motor.R_s;
    par.motor.psi_M = cell.psi * truth.motor.psi_M;
    truth.initial.theta_e = par.theta_est + cell.theta.to_radians();
    if drive.approach == Approach::Turning {
        let speed = 0.2_f64.copysign(cell.speed) * drive.bench.speed;
        (truth.initial.speed, par.speed_est) = (speed, speed);
    }
    // The presets of some drives have noise of their own.
    par.sensor.noise = 0.0;
    if matches!(cell.scenario, Course::Noise | Course::Inverter) {
        par.sensor.noise = NOISE * par.limit.i;
    }
    let degrees = match cell.scenario {
        Course::Cold => COLD,
        Course::Hot => HOT,
        _ => 0.0,
    };
    truth.motor.R_s *= 1.0 + COPPER * degrees;
    truth.motor.psi_M *= 1.0 + MAGNET * degrees;
    if cell.scenario == Course::Torque {
        (par.speed_loop.torque_mode, truth.mechanics.imposed) = (true, true);
        plant.inputs.speed_shaft = truth.initial.speed;
        plant.inputs.angle_shaft = truth.initial.theta_e / f64::from(truth.motor.n_p);
    }
    if cell.scenario == Course::Sign {
        par.sensor.gain = Phases { a: -1.0, b: -1.0, c: -1.0 };
    }
    if cell.scenario == Course::Inverter {
        (par.sensor.offset.a, par.sensor.offset.b) = (OFFSET * par.limit.i, -OFFSET * par.limit.i);
        truth.inverter.dead_time = DEAD_TIME * par.T_s;
        par.compensation.u_dead = truth.inverter.u_dead(plant.inputs.u_dc);
    }
    bench
}

/// Runs a cell.
///
/// # Errors
/// The parameters do not fit together.
pub fn run(drive: &Drive, cell: &Cell) -> Result<Verdict, Fault> {
    let mut bench = prepared(drive, cell);
    let pair = &mut bench.pair;
    let off = if pair.controller.model.parameters.compensation.calibrate { OFF } else { 0.0 };
    if off > 0.0 {
        let coasting = &mut pair.plant.model;
        coasting.parameters.initial.theta_e -=
            f64::from(coasting.parameters.motor.n_p) * coasting.parameters.initial.speed * off;
        (coasting.inputs.enable, pair.controller.model.inputs.enable) = (false, false);
    }
    let heats = cell.scenario == Course::Heating;
    let cold = pair.plant.model.parameters.motor.R_s;
    let end = if heats { 14.0 } else { 6.0 };
    let (tolerance, angle) = match drive.approach {
        Approach::Rest => (1.0 / 600.0 + 0.05 * cell.speed.abs(), 180.0),
        Approach::Turning => (0.02, 30.0),
    };
    let (mut lost_at, mut before, mut after, mut last) = (None, 0.0_f64, 0.0_f64, 0.0);
    let (mut while_held, mut last_off) = (0.0_f64, 0.0);
    let (mut speed_error, mut angle_error, mut theta_tilde) = (0.0_f64, 0.0_f64, 0.0);
    let (mut mean, mut judged) = (0.0, 0.0);
    let (mut outside, mut angle_shaft) = (Outside::default(), 0.0);
    let (rated, torque, torques) = (drive.bench.speed, drive.bench.torque, cell.scenario == Course::Torque);
    let T_s = pair.controller.model.parameters.T_s;
    let start = pair.plant.model.parameters.initial.theta_e;
    let n_p = f64::from(pair.plant.model.parameters.motor.n_p);
    let mut hot = 0_u32;
    let course = |t: f64, p: &mut Pair| {
        let on = t >= off - 1e-9;
        (p.controller.model.inputs.enable, p.plant.model.inputs.enable) = (on, on);
        // In steps of one percent.
        let share = if heats { ((t - 2.0) / 10.0).clamp(0.0, 1.0) * 40.0 } else { 0.0 };
        if share >= f64::from(hot + 1) {
            hot += 1;
            p.plant.model.parameters.motor.R_s = cold * (1.0 + HEATING * f64::from(hot) / 40.0);
            p.plant.model.derive();
        }
        let (speed, load) = course(drive.approach, cell, t - off);
        if torques {
            let inputs = &mut p.plant.model.inputs;
            (inputs.speed_shaft, inputs.angle_shaft) = (speed * rated, start / n_p + angle_shaft);
            angle_shaft += speed * rated * T_s;
            p.controller.model.inputs.tau_ref = load * torque;
        }
        (speed, load)
    };
    let finished = bench.run(end, course, |moment| {
        let (t, error, out) = (moment.t, moment.theta_tilde, &moment.pair.controller.out);
        last = t;
        let off = moment.deviation();
        let is_off = off.abs() > tolerance || error.abs().to_degrees() > angle;
        if is_off {
            last_off = t;
        } else if t > last_off + 1.0 {
            while_held = while_held.max(out.lock_lost);
        }
        if t > end - 2.0 - 1e-9 {
            speed_error = speed_error.max(off.abs());
            angle_error = angle_error.max(error.abs().to_degrees());
            let speeds = (moment.speed, out.speed_est / rated);
            let limited = out.current_limited || out.voltage_limited;
            outside.see(t - end + 2.0, speeds, (error, wrap(error - theta_tilde)), out.lock_lost, limited);
            (mean, judged) = (mean + off, judged + 1.0);
            if is_off {
                lost_at = lost_at.or(Some(t));
            }
        }
        theta_tilde = error;
        match lost_at {
            None => before = before.max(out.lock_lost),
            Some(at) if t <= at + 1.0 => after = after.max(out.lock_lost),
            Some(_) => {}
        }
    })?;
    lost_at = lost_at.or((!finished).then_some(last));
    let from_outside = outside.slips() || outside.swings();
    if finished && !from_outside && outside.limited() && mean.abs() / judged > tolerance {
        // A limit keeps it off the reference.
        lost_at = None;
        while_held = outside.lock_lost();
    }
    if from_outside && lost_at.is_none() {
        (lost_at, after) = (Some(end - 2.0), outside.lock_lost());
    }
    let class = if !finished {
        Loss::Failed
    } else if outside.slips() {
        Loss::Slips
    } else if (mean / judged).abs() > tolerance {
        Loss::Creeps
    } else if speed_error > tolerance || outside.swings() {
        Loss::Swings
    } else {
        Loss::Angle
    };
    Ok(Verdict {
        lost: lost_at.map(|at| (class, at)),
        lock_lost: if lost_at.is_some() { after } else { before },
        while_held: if lost_at.is_some() { 0.0 } else { while_held },
        speed_error,
        angle_error,
    })
}
