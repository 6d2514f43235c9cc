//! A cell of the table: the error of the drive, its task, and the results of a run.

use drive::Pair;
use drive::control::start::StartState;
use drive::math::wrap;
use drive_tools::tune::pace::{Begin, Pace};
use drive_tools::tune::setting::{Tuned, Value};
use fmu_core::Warns;
use std::f64::consts::TAU;
use std::fmt;

/// R^/R with the machine at 20 degC.
const RESISTANCES: [f64; 5] = [0.8, 0.9, 1.0, 1.1, 1.2];
/// Temperatures in degC of winding and magnet, with the values that `fmu tune` gives for 20 degC.
const TEMPERATURES: [f64; 6] = [-30.0, 20.0, 60.0, 100.0, 130.0, 160.0];
/// Speeds in pu.
const LEVELS: [f64; 4] = [0.1, 0.3, 0.5, 1.0];
/// Loads in speed mode in rated torques.
const LOADS: [f64; 3] = [0.0, 0.7, -0.7];
/// Torque references in rated torques; the load takes as much at the speed of the cell and is proportional to the speed.
const TORQUES: [f64; 2] = [0.2, 0.7];
/// Temperature coefficients in 1/K of copper and NdFeB, if the machine's file has none.
const ALPHA: (f64, f64) = (3.93e-3, -1.1e-3);
/// Time in s at the end that is judged.
const LAST: f64 = 2.0;
/// Lengths in s of the parts that form the mean over 1 s and the swing at the end.
const PART: f64 = 0.1;

/// One run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cell {
    /// R^/R at 20 degC; none: R^ of `fmu tune`.
    pub(crate) R: Option<f64>,
    /// Temperature of the machine in degC.
    pub(crate) T: f64,
    /// Speed in pu.
    pub(crate) level: f64,
    /// Load in rated torques, in torque mode the reference.
    pub(crate) load: f64,
    /// Torque mode.
    pub(crate) torque_mode: bool,
}

/// All cells.
pub(crate) fn all() -> Vec<Cell> {
    let truths = TEMPERATURES.map(|T| (None, T)).into_iter().chain(RESISTANCES.map(|R| (Some(R), 20.0)));
    let asked = LEVELS.iter().flat_map(|&level| {
        let of = move |load, torque_mode| Cell { R: None, T: 20.0, level, load, torque_mode };
        LOADS.map(|load| of(load, false)).into_iter().chain(TORQUES.map(|load| of(load, true)))
    });
    let asked: Vec<Cell> = asked.collect();
    truths.flat_map(|(R, T)| asked.iter().map(move |cell| Cell { R, T, ..*cell }).collect::<Vec<_>>()).collect()
}

impl Cell {
    /// Whether the machine and the task are the same: the sensor's run is.
    pub(crate) fn has_the_truth_of(&self, other: &Self) -> bool {
        Self { R: None, ..*self } == Self { R: None, ..*other }
    }
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.R {
            Some(R) => write!(f, "R^ = {R} R")?,
            None => write!(f, "{:.0} degC", self.T)?,
        }
        write!(f, ", {} pu, {} {}", self.level, if self.torque_mode { "tau_ref" } else { "load" }, self.load)
    }
}

/// Results of the last seconds.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct End {
    /// Mean speed of the rotor and of the estimate in pu.
    pub(crate) speed: (f64, f64),
    /// Peak to peak of both in pu.
    pub(crate) swing: (f64, f64),
    /// Mean torque in rated torques.
    pub(crate) torque: f64,
    /// Maximum angle error in deg.
    pub(crate) error: f64,
}

/// Results with a sensor in the same task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Goal {
    end: End,
    /// Whether it can perform the task.
    held: bool,
}

/// How the rotor was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Loss {
    /// The estimate slipped by a turn.
    Slips,
    /// The mean speed of the estimate was off the rotor's.
    Apart,
    /// Both swing.
    Swings,
    /// A step failed.
    Failed,
}

/// What a run shows.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "answers")]
pub(crate) struct Outcome {
    /// Whether the drive behaves as with a sensor.
    pub(crate) held: bool,
    /// Kind and time (s) of the loss of the rotor.
    pub(crate) lost: Option<(Loss, f64)>,
    /// Whether an output reports that the drive is lost, or why it is off.
    pub(crate) said: bool,
    /// Whether `lock_lost` reached 1 later than 1 s after the start.
    pub(crate) alarm: bool,
    /// Whether the drive holds the cell with a sensor.
    pub(crate) on_sensor: bool,
    end: End,
    goal: End,
    /// Maximum `lock_lost`: near the loss, otherwise in the last seconds.
    lock_lost: f64,
}

impl Outcome {
    /// How it was lost.
    pub(crate) fn class(&self) -> Option<Loss> {
        self.lost.map(|(loss, _)| loss)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { held, lost, said, alarm, on_sensor, end, goal, lock_lost } = self;
        match lost {
            Some((loss, t)) => write!(f, "lost at {t:.2} s ({loss:?})")?,
            None if *held => write!(f, "held, alarm {alarm}")?,
            None => write!(f, "off")?,
        }
        write!(
            f,
            "{}, lock_lost {lock_lost:.2}; speed {:+.3} pu (+-{:.3}), estimate {:+.3} (+-{:.3}), torque {:+.3}, error {:.0} deg; sensor{} {:+.3} pu, {:+.3}",
            if *said { " and said" } else { "" },
            end.speed.0,
            0.5 * end.swing.0,
            end.speed.1,
            0.5 * end.swing.1,
            end.torque,
            end.error,
            if *on_sensor { "" } else { " does not hold:" },
            goal.speed.0,
            goal.torque
        )
    }
}

/// The drive of a cell; with a sensor if `sensor`.
fn prepared(tuned: &Tuned, cell: &Cell, sensor: bool) -> Pair {
    let on_sensor = || {
        tuned
            .with("estimator", Value::Item("Sensored".into()))
            .with("start.mode", Value::Item("Direct".into()))
            .with("emf.hold_reversal", Value::Boolean(false))
            .with("adaptation.resistance", Value::Boolean(false))
    };
    let mut pair = if sensor { on_sensor().pair() } else { tuned.pair() };
    let (plant, controller) = (&mut pair.plant.model.parameters, &mut pair.controller.model.parameters);
    let or = |given: f64, rule: f64| if given == 0.0 { rule } else { given };
    if let Some(R) = cell.R {
        controller.motor.R_s = R * plant.motor.R_s;
    }
    let thermal = &mut plant.thermal;
    (thermal.alpha_R, thermal.alpha_psi) = (or(thermal.alpha_R, ALPHA.0), or(thermal.alpha_psi, ALPHA.1));
    thermal.T_start = thermal.T_ref + cell.T - 20.0;
    if cell.torque_mode {
        controller.speed_loop.torque_mode = true;
        let (speed, mechanics) = (cell.level * tuned.speed, &mut plant.mechanics);
        let friction = mechanics.tau_coulomb + (mechanics.B + mechanics.k_w * speed) * speed;
        mechanics.B += (cell.load * tuned.torque - friction).max(0.0) / speed;
    }
    pair
}

/// Minimum and maximum value and sum over a part of the time.
#[derive(Clone, Copy)]
struct Part {
    low: [f64; 2],
    high: [f64; 2],
    sum: [f64; 3],
    error: f64,
    n: f64,
}

impl Part {
    const NONE: Self =
        Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], sum: [0.0; 3], error: 0.0, n: 0.0 };

    fn see(&mut self, [speed, speed_est, torque]: [f64; 3], error: f64) {
        for (k, x) in [speed, speed_est].into_iter().enumerate() {
            (self.low[k], self.high[k]) = (self.low[k].min(x), self.high[k].max(x));
        }
        for (sum, x) in self.sum.iter_mut().zip([speed, speed_est, torque]) {
            *sum += x;
        }
        (self.error, self.n) = (self.error.max(error.abs()), self.n + 1.0);
    }

    fn of(parts: &[Self]) -> Self {
        parts.iter().fold(Self::NONE, |a, b| Self {
            low: [a.low[0].min(b.low[0]), a.low[1].min(b.low[1])],
            high: [a.high[0].max(b.high[0]), a.high[1].max(b.high[1])],
            sum: [a.sum[0] + b.sum[0], a.sum[1] + b.sum[1], a.sum[2] + b.sum[2]],
            error: a.error.max(b.error),
            n: a.n + b.n,
        })
    }
}

/// Number of parts in a time (s).
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "seconds")]
fn parts(time: f64) -> usize {
    (time / PART).round() as usize
}

/// Times in s: reference applied, monitoring begins, load applied, end.
fn times(tuned: &Tuned, pair: &Pair, cell: &Cell) -> [f64; 4] {
    let Begin { rest: turn, measures, ready } = Begin::of(tuned, pair, cell.level);
    let ready = turn + measures + ready;
    if cell.torque_mode {
        let J = pair.plant.model.parameters.mechanics.J;
        let accelerates = J * cell.level * tuned.speed / (cell.load * tuned.torque);
        let settles = (6.0 * accelerates).clamp(1.0, 20.0);
        return [turn, ready, ready, ready + settles + LAST];
    }
    let settles =
        |load: f64| (12.0 * Pace::of(tuned, pair, cell.level, load.abs() * tuned.torque).slowest()).clamp(1.0, 6.0);
    let load = ready + settles(0.0);
    [turn, ready, load, load + settles(cell.load) + LAST]
}

/// The run of a drive: its end, the loss, the maximum of `lock_lost` at a loss and in the last seconds, whether a limit is active
/// there or a warning names a torque without motion, and whether `lock_lost` reached 1 later than 1 s after the start.
fn follow(tuned: &Tuned, cell: &Cell, sensor: bool) -> (End, Option<(Loss, f64)>, f64, bool, bool) {
    let mut pair = prepared(tuned, cell, sensor);
    let mut end = End::default();
    if let Err(e) = pair.start() {
        panic!("{}, {cell}: {e}", tuned.name);
    }
    let [turn, ready, load, stop] = times(tuned, &pair, cell);
    let (u_dc, T_s) = (pair.plant.model.inputs.u_dc, pair.controller.model.parameters.T_s);
    let (second, last) = (parts(1.0), parts(LAST));
    let mut history = vec![Part::NONE];
    let mut lost: Option<(Loss, f64)> = None;
    // The unwrapped angle error since monitoring began, with its maximum and minimum.
    let (mut before, mut slip, mut span) = (0.0, 0.0, (0.0_f64, 0.0_f64));
    // lock_lost in each part.
    let mut locks = vec![0.0_f64];
    let (mut limited, mut evaluated, mut alarm, mut warned) = (0.0, 0.0, false, false);
    let (mut k, mut t) = (0_u32, 0.0);
    while t < stop {
        let asked = if t >= turn { 1.0 } else { 0.0 };
        let torque = if cell.torque_mode { 0.0 } else { cell.load * tuned.torque * ((t - load) / 0.3).clamp(0.0, 1.0) };
        pair.controller.model.inputs.tau_ref = asked * cell.load * tuned.torque;
        pair.set_inputs(asked * cell.level * tuned.speed, torque, u_dc);
        if pair.step(T_s).is_err() {
            return (end, Some((Loss::Failed, t)), 10.0, false, true);
        }
        k += 1;
        t = f64::from(k) * T_s;
        let (plant, controller) = (&pair.plant.out, &pair.controller.out);
        let error = wrap(plant.theta_e - controller.theta_est);
        let (speed, speed_est) = (plant.speed / tuned.speed, controller.speed_est / tuned.speed);
        let part = history.last_mut().expect("a part");
        part.see([speed, speed_est, plant.tau_e / tuned.torque], error.to_degrees());
        let lock = locks.last_mut().expect("a part");
        *lock = lock.max(controller.lock_lost);
        alarm |= t > ready + 1.0 && controller.lock_lost >= 1.0;
        // Before, theta_est is that of the start or 0.
        if t > ready && controller.start_state == StartState::Running {
            slip += wrap(error - before);
            span = (span.0.min(slip), span.1.max(slip));
            if span.1 - span.0 >= TAU {
                lost = lost.or(Some((Loss::Slips, t)));
                span = (slip, slip);
            }
        }
        before = error;
        if t > stop - LAST {
            limited += f64::from(u8::from(controller.current_limited || controller.voltage_limited));
            evaluated += 1.0;
        }
        if cell.torque_mode && k % 1000 == 0 {
            let mut hear = |(_, key, _): fmu_core::log::Said<'_>| warned |= key == "stands";
            pair.controller.model.warn(&mut fmu_core::log::Warnings::to(&mut hear));
        }
        if t >= PART * f64::from(u32::try_from(history.len()).expect("few")) - 0.5 * T_s {
            let mean = Part::of(&history[history.len().saturating_sub(second)..]);
            let apart = (mean.sum[0] - mean.sum[1]).abs() / mean.n;
            if t > ready + 1.0 && apart > 0.05 {
                lost = lost.or(Some((Loss::Apart, t)));
            }
            history.push(Part::NONE);
            locks.push(0.0);
        }
    }
    let of_end = Part::of(&history[history.len().saturating_sub(last + 1)..]);
    end.speed = (of_end.sum[0] / of_end.n, of_end.sum[1] / of_end.n);
    end.swing = (of_end.high[0] - of_end.low[0], of_end.high[1] - of_end.low[1]);
    (end.torque, end.error) = (of_end.sum[2] / of_end.n, of_end.error);
    if end.swing.0 > 0.1 && end.swing.1 > 0.1 {
        lost = lost.or(Some((Loss::Swings, stop - LAST)));
    }
    let at = lost.map_or(stop - LAST, |(_, at)| at);
    let until = if lost.is_some() { at + 1.0 } else { stop };
    let from = if matches!(lost, Some((Loss::Apart, _))) { at - 1.0 } else { at };
    let seen = locks[parts(from).min(locks.len() - 1)..].iter().take(parts(until - from) + 1);
    let lock_lost = seen.fold(0.0_f64, |most, lock| most.max(*lock));
    (end, lost, lock_lost, warned || limited > 0.5 * evaluated, alarm)
}

/// Whether the drive has fulfilled the task at the `end`; in torque mode, whether it has reached the `goal` of the sensor.
fn stands(cell: &Cell, end: &End, goal: &End) -> bool {
    let calm = end.swing.0 <= 0.1 && end.swing.1 <= 0.1 && end.error <= 60.0;
    if cell.torque_mode {
        calm && (end.torque - goal.torque).abs() <= (0.1 * cell.load).max(0.02)
    } else {
        calm && (end.speed.0 - cell.level).abs() <= 0.02
    }
}

/// The run of a cell with a sensor.
pub(crate) fn on_sensor(tuned: &Tuned, cell: &Cell) -> Goal {
    let (end, ..) = follow(tuned, cell, true);
    Goal { end, held: stands(cell, &end, &end) }
}

/// The run of a cell.
pub(crate) fn run(tuned: &Tuned, cell: &Cell, goal: Goal) -> Outcome {
    let (end, lost, lock_lost, limited, alarm) = follow(tuned, cell, false);
    let held = lost.is_none() && stands(cell, &end, &goal.end);
    let said = lock_lost >= 1.0 || (lost.is_none() && limited);
    Outcome { held, lost, said, alarm, on_sensor: goal.held, end, goal: goal.end, lock_lost }
}
