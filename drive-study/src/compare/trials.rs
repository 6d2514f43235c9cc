//! The scenarios on the user's machine: each runs a tuned drive ([`fmu tune`](drive_tools::tune)) and measures it.
//!
//! Speeds are in pu of the rated speed, loads in pu of the rated torque. Times follow from the drive's time constants
//! ([`Pace`]): the results of a drone motor and of a traction machine are comparable. The scenarios run at half the rated speed
//! or, for a method that does not reach it, at its highest speed.

use super::measure::{Effort, Follow, Measure, Outcome};
use super::scenario::{Scenario, ScenarioRun};
use crate::runner::{self, Moment, Statistics, line};
use drive::Pair;
use drive::control::start::StartMode;
use drive::math::wrap;
use drive_tools::tune::pace::{Begin, Pace};
use drive_tools::tune::setting::Tuned;
use fmu_core::Fault;
use std::f64::consts::TAU;

/// End of a start or a load step in units of the slowest time constant.
const HORIZON: f64 = 20.0;

/// Time at each speed on the way down, in the same unit.
const STAY: f64 = 10.0;

const START: &str = "Start, load, reversal, top speed";
const LOWEST: &str = "Lowest speed at rated load, reached from above";
const COST: &str = "Cost";

const fn row(
    id: &'static str,
    group: &'static str,
    title: &'static str,
    run: fn(&Tuned, Effort) -> Result<Outcome, Fault>,
) -> Scenario {
    Scenario { id, group, title, run: ScenarioRun::Machine(run) }
}

/// All scenarios, in the order of the tables.
pub static TRIALS: &[Scenario] = &[
    row(
        "start",
        START,
        "from rest to half the rated speed, or the highest of the method, without a load, from 12 angles",
        start,
    ),
    row("load", START, "rated torque as a step at that speed", |s, _| load_step(s)),
    row("reversal", START, "from that speed to its negative, without a load", |s, _| reversal(s)),
    row("top", START, "the highest speed of the rating, with the torque of the rated power there", |s, _| top(s)),
    row("lowest", LOWEST, "with the tuned values", |s, e| lowest(s, e, |_| ())),
    row("r-high", LOWEST, "R^ 20 % higher", |s, e| lowest(s, e, |p| motor(p).R_s *= 1.2)),
    row("r-low", LOWEST, "R^ 20 % lower", |s, e| lowest(s, e, |p| motor(p).R_s *= 0.8)),
    row("l-q", LOWEST, "L_q^ 20 % higher", |s, e| lowest(s, e, |p| motor(p).L_q *= 1.2)),
    row("psi", LOWEST, "psi_M^ 10 % lower", |s, e| lowest(s, e, |p| motor(p).psi_M *= 0.9)),
    row("dead-time", LOWEST, "1 us more dead time than the controller compensates", |s, e| {
        lowest(s, e, |p| p.plant.model.parameters.inverter.dead_time += 1e-6)
    }),
    row("noise", LOWEST, "noise of 1 % of the maximum current in the sensors", |s, e| {
        lowest(s, e, |p| {
            let par = &mut p.controller.model.parameters;
            par.sensor.noise = 0.01 * par.limit.i;
        })
    }),
    row("offset", LOWEST, "an offset of 1 % of the maximum current in phase a", |s, e| {
        lowest(s, e, |p| {
            let par = &mut p.controller.model.parameters;
            par.sensor.offset.a = 0.01 * par.limit.i;
        })
    }),
    row(
        "signal",
        COST,
        "carrier current and its copper loss at rest, share of u_dc/sqrt(3) that the voltage takes there, and ripple of the \
         torque under the rated load at a fifth of the speed above",
        |s, _| cost(s),
    ),
];

fn motor(pair: &mut Pair) -> &mut drive::motor::Motor {
    &mut pair.controller.model.parameters.motor
}

/// Half the rated speed, or the method's highest speed if that is lower.
fn level(tuned: &Tuned) -> f64 {
    tuned.levels.iter().fold(0.0, |a: f64, &b| a.max(b)).min(0.5)
}

/// A running drive.
struct Rig<'a> {
    tuned: &'a Tuned,
    pair: Pair,
    u_dc: f64,
    T_s: f64,
    /// Samples so far.
    k: u32,
}

impl<'a> Rig<'a> {
    fn new(tuned: &'a Tuned, change: impl FnOnce(&mut Pair)) -> Result<Self, Fault> {
        let mut pair = tuned.pair();
        change(&mut pair);
        pair.start()?;
        let (u_dc, T_s) = (pair.plant.model.inputs.u_dc, pair.controller.model.parameters.T_s);
        Ok(Self { tuned, pair, u_dc, T_s, k: 0 })
    }

    fn now(&self) -> f64 {
        f64::from(self.k) * self.T_s
    }

    /// One sample at a reference under a load, both in pu; false if the step fails.
    fn step(&mut self, reference: f64, load: f64, see: &mut impl FnMut(&Moment<'_>)) -> bool {
        self.pair.set_inputs(reference * self.tuned.speed, load * self.tuned.torque, self.u_dc);
        if self.pair.step(self.T_s).is_err() {
            return false;
        }
        self.k += 1;
        let theta_tilde = wrap(self.pair.plant.out.theta_e - self.pair.controller.out.theta_est);
        let speed = self.pair.plant.out.speed / self.tuned.speed;
        see(&Moment { t: self.now(), reference, speed, theta_tilde, pair: &self.pair });
        true
    }

    /// Runs for `seconds`; the courses get the time since now.
    fn run(
        &mut self,
        seconds: f64,
        reference: impl Fn(f64) -> f64,
        load: impl Fn(f64) -> f64,
        mut see: impl FnMut(&Moment<'_>),
    ) -> bool {
        let begin = self.now();
        while self.now() < begin + seconds {
            let t = self.now() - begin;
            if !self.step(reference(t), load(t), &mut see) {
                return false;
            }
        }
        true
    }

    /// The slowest time constant at `reference` under `load` (pu); below 0.1 pu, the value at 0.1 pu.
    fn slowest(&self, reference: f64, load: f64) -> f64 {
        Pace::of(self.tuned, &self.pair, reference.abs().max(0.1), load * self.tuned.torque).slowest()
    }

    /// Stays for `seconds` at a reference under a load; follows the last quarter of the time.
    fn stay(&mut self, seconds: f64, reference: f64, load: f64) -> Follow {
        let (mut follow, from) = (Follow::default(), self.now() + 0.75 * seconds);
        let ran = self.run(
            seconds,
            |_| reference,
            |_| load,
            |moment| {
                if moment.t > from {
                    follow.add(moment);
                }
            },
        );
        if ran { follow } else { Follow::default() }
    }

    /// Starts from rest to `reference` (pu), without a load: the end of the start.
    fn start(&mut self, reference: f64) -> Follow {
        let Begin { rest, ready, .. } = Begin::of(self.tuned, &self.pair, reference);
        while self.now() < rest || self.pair.controller.model.measures_resistance() {
            let now = if self.now() < rest { 0.0 } else { reference };
            if !self.step(now, 0.0, &mut |_| ()) {
                return Follow::default();
            }
        }
        // The start itself takes `ready`, and only what follows is its end.
        if !self.run(ready, |_| reference, |_| 0.0, |_| ()) {
            return Follow::default();
        }
        self.stay(HORIZON * self.slowest(reference, 0.0), reference, 0.0)
    }
}

/// The drive turning at the speed of the scenarios, if it gets there, and the time in s.
pub(super) fn running(tuned: &Tuned) -> Option<(Pair, f64)> {
    let mut rig = Rig::new(tuned, |_| ()).ok()?;
    let held = rig.start(level(tuned)).holds();
    let now = rig.now();
    held.then_some((rig.pair, now))
}

fn start(tuned: &Tuned, effort: Effort) -> Result<Outcome, Fault> {
    let count = if effort == Effort::Full { 12_u32 } else { 4 };
    let (mut failed, mut peak) = (0.0, 0.0_f64);
    for k in 0..count {
        let angle = (f64::from(k) + 0.25) * TAU / f64::from(count);
        let mut rig = Rig::new(tuned, |p| p.plant.model.parameters.initial.theta_e = angle)?;
        let end = rig.start(level(tuned));
        if end.holds() { peak = peak.max(end.angle.peak) } else { failed += 1.0 }
    }
    let measures = vec![
        Measure::new("speed", "pu", level(tuned)),
        Measure::new("failed starts", "of 12", failed),
        Measure::new("peak angle error", "deg", if failed < f64::from(count) { peak } else { f64::INFINITY }),
    ];
    Ok(Outcome::Measured(measures, None))
}

/// Starts to `from` (pu), then follows a course; every number is infinite if the drive did not reach `from`.
fn course(
    tuned: &Tuned,
    from: f64,
    course: impl FnOnce(&Rig<'_>) -> (f64, f64, Box<dyn Fn(f64) -> f64>, f64),
    with_dip: bool,
) -> Result<Outcome, Fault> {
    let mut rig = Rig::new(tuned, |_| ())?;
    let mut follow = Follow::default();
    let started = rig.start(from).holds();
    let mut ran = started;
    let begin = rig.now();
    let (mut changed, mut end) = (0.0, Follow::default());
    if ran {
        let (seconds, done, reference, load) = course(&rig);
        changed = done;
        ran = rig.run(
            seconds,
            reference,
            |_| load,
            |moment| {
                let at = Moment { t: moment.t - begin, ..*moment };
                follow.trace(&at);
                follow.add(&at);
                if at.t > 0.75 * seconds {
                    end.add(&at);
                }
            },
        );
    }
    let held = ran && end.holds();
    let mut measures = vec![follow.peak(), follow.settled(changed)];
    if with_dip {
        measures.push(Measure::new("dip", "pu", follow.dip));
    }
    if !held {
        for m in &mut measures {
            m.value = f64::INFINITY;
        }
    }
    Ok(Outcome::Measured(measures, started.then(|| follow.into_trace(held))))
}

fn load_step(tuned: &Tuned) -> Result<Outcome, Fault> {
    let speed = level(tuned);
    let stepped = |rig: &Rig<'_>| -> (f64, f64, Box<dyn Fn(f64) -> f64>, f64) {
        (HORIZON * rig.slowest(speed, 1.0), 0.0, Box::new(move |_| speed), 1.0)
    };
    course(tuned, speed, stepped, true)
}

/// By a ramp that takes a quarter of the rated torque.
fn reversal(tuned: &Tuned) -> Result<Outcome, Fault> {
    let speed = level(tuned);
    let back = |rig: &Rig<'_>| -> (f64, f64, Box<dyn Fn(f64) -> f64>, f64) {
        let time = 8.0 * Pace::of(tuned, &rig.pair, speed, 0.0).mechanics;
        let reference = move |t| line(t, 0.0, speed, time, -speed);
        (time + HORIZON * rig.slowest(speed, 0.0), time, Box::new(reference), 0.0)
    };
    course(tuned, speed, back, false)
}

fn top(tuned: &Tuned) -> Result<Outcome, Fault> {
    let (top, torque) = (tuned.top / tuned.speed, tuned.top_torque / tuned.torque);
    if level(tuned) < 0.5 {
        return Ok(Outcome::NotApplicable("a method for low speed"));
    }
    let mut rig = Rig::new(tuned, |_| ())?;
    let seconds = |rig: &Rig<'_>, load| HORIZON * rig.slowest(top, load);
    let mut end = rig.start(top);
    if end.holds() {
        end = rig.stay(seconds(&rig, torque), top, torque);
    }
    let reached = |x: f64| if end.holds() { x } else { f64::INFINITY };
    let measures = vec![
        Measure::new("speed", "pu", reached(top)),
        Measure::new("load", "pu", reached(torque)),
        Measure::new("peak angle error", "deg", reached(end.angle.peak)),
    ];
    Ok(Outcome::Measured(measures, None))
}

/// Applies the rated load, lowers the speed in steps, and stops when the load is lost.
fn lowest(tuned: &Tuned, effort: Effort, change: fn(&mut Pair)) -> Result<Outcome, Fault> {
    let speeds: &[f64] = if effort == Effort::Full {
        &[0.5, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.03, 0.02, 0.01, 0.0]
    } else {
        &[0.5, 0.2, 0.1, 0.05, 0.0]
    };
    let first = level(tuned);
    let mut rig = Rig::new(tuned, change)?;
    let (mut lowest, mut last) = (f64::INFINITY, first);
    if rig.start(first).holds() {
        let stands = tuned.estimator.holds_standstill();
        let way = speeds.iter().copied().filter(|&speed| speed < first && (speed > 0.0 || stands));
        for speed in std::iter::once(first).chain(way) {
            let (from, slow) = (last, rig.slowest(speed, 1.0));
            let time = 2.0 * slow;
            let ran = rig.run(time, |t| line(t, 0.0, from, time, speed), |_| 1.0, |_| ());
            if !ran || !rig.stay(STAY * slow, speed, 1.0).holds() {
                break;
            }
            (lowest, last) = (speed, speed);
        }
    }
    Ok(Outcome::Measured(vec![Measure::new("held down to", "pu", lowest)], None))
}

/// The drive at rest with its signal alone: the estimate begins at the rotor's angle, instead of an I-f start whose current would
/// be counted as the carrier's.
fn standing(pair: &mut Pair) {
    let par = &mut pair.controller.model.parameters;
    if par.start.mode == StartMode::CurrentFrequency {
        par.start.mode = StartMode::Direct;
        par.theta_est = pair.plant.model.parameters.initial.theta_e;
    }
}

fn cost(tuned: &Tuned) -> Result<Outcome, Fault> {
    let injects = tuned.estimator.class().injects();
    let (mut share, mut rms) = (0.0_f64, 0.0);
    if injects {
        let mut rig = Rig::new(tuned, standing)?;
        let limit = rig.u_dc / 3.0_f64.sqrt();
        rig.run(
            0.4,
            |_| 0.0,
            |_| 0.0,
            |moment| {
                if moment.t > 0.3 {
                    let u = moment.pair.controller.out.u.to_stator();
                    share = share.max(u.alpha().hypot(u.beta()) / limit);
                }
            },
        );
        let mut pair = tuned.pair();
        standing(&mut pair);
        rms = runner::injected_current(pair);
    }
    let mut ripple = Statistics::default();
    let mut rig = Rig::new(tuned, |_| ())?;
    let slow = 0.2 * level(tuned);
    let mut held = rig.start(level(tuned)).holds();
    if held {
        held = rig.stay(STAY * rig.slowest(slow, 1.0), slow, 1.0).holds();
        let mut see = |moment: &Moment<'_>| ripple.add(moment.pair.plant.out.tau_e / tuned.torque);
        held = held && rig.run(0.2, |_| slow, |_| 1.0, &mut see);
    }
    let R_s = rig.pair.plant.model.parameters.motor.R_s;
    // A lost drive swings with its limits.
    let (share, rms) = if share <= 1.0 { (share, rms) } else { (f64::INFINITY, f64::INFINITY) };
    let measures = vec![
        Measure::new("carrier current (rms)", "A", rms),
        Measure::new("copper loss", "W", 1.5 * R_s * rms * rms),
        Measure::new("voltage taken", "%", 100.0 * share),
        Measure::new("torque ripple (std)", "pu", if held { ripple.std() } else { f64::INFINITY }),
    ];
    Ok(Outcome::Measured(measures, None))
}
