//! Compares the verdicts of `fmu tune` with long runs of `PmsmDrive`: every start, every load, every note.
//!
//! The run takes 20 times the slowest time constant of mechanics, observer and speed loop after the reference and again after
//! the load, and is judged by its last two.
#![allow(missing_docs, non_snake_case)]

mod draw;

use draw::machine;
use drive::PmsmDrive;
use drive::estimator::Kind;
use drive::math::wrap;
use drive_tools::tune::limits::{self, Limit};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::pace::Begin;
use drive_tools::tune::remedy::What;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Tuned, Value};
use drive_tools::tune::trial::{self, Task, Trial};
use fmu_core::draw::Draw;
use fmu_core::{Block, Elapsed, Model, Step};
use std::f64::consts::{E, TAU};
use std::path::Path;

/// Seed of the machines.
const SEED: u64 = 1;

/// The three machines that were judged too early.
const TRACTION: &str = include_str!("machines/traction.toml");
const SERVO: &str = include_str!("machines/servo-400w.toml");
/// 0.13 N.m and 10 A at 24 V: R_s i is 0.34 of the EMF at rated speed. With R^ = 0.9 R it lost its load at 0.1 pu, untold.
const SMALL: &str = include_str!("machines/small-24v.toml");

fn read(text: &str) -> MotorFile {
    MotorFile::parse(text, Path::new("m.toml")).unwrap()
}

/// The first `n` machines that the rules do not refuse.
fn drawn(n: usize) -> Vec<MotorFile> {
    let mut draw = Draw(SEED);
    let mut all = Vec::new();
    while all.len() < n {
        let motor = read(&machine(&mut draw, &format!("drawn-{}", all.len() + 1)));
        if rules::tune(&motor).is_ok() {
            all.push(motor);
        }
    }
    all
}

/// A drive and its clock, in steps of ten samples.
struct Long {
    drive: Block<PmsmDrive>,
    now: Elapsed,
    h: f64,
}

impl Long {
    fn of(tuned: &Tuned, theta_e: f64) -> Self {
        let mut drive = Block::<PmsmDrive>::default();
        drive.model.pair = tuned.pair();
        drive.model.pair.plant.model.parameters.initial.theta_e = theta_e;
        drive.model.inputs.u_dc = drive.model.pair.plant.model.inputs.u_dc;
        let h = 10.0 * drive.model.pair.controller.model.parameters.T_s;
        drive.model.validate().unwrap();
        drive.initialize();
        Self { drive, now: Elapsed::ZERO, h }
    }

    /// Runs for `time` (s); whether the speed stays within 0.02 pu of `reference` (rad/s, `rated` is 1 pu) and the estimate within
    /// 30 deg of the rotor for the `last` part of it.
    fn run(&mut self, time: f64, last: f64, reference: f64, rated: f64, load: impl Fn(f64) -> f64) -> bool {
        let (mut t, mut held) = (0.0, true);
        while t < time {
            self.drive.model.inputs.speed_ref = reference;
            self.drive.model.inputs.tau_load = load(t);
            let step = Step { start: self.now, h: self.h };
            if self.drive.step(&step).is_err() {
                return false;
            }
            (self.now, t) = (step.end(), t + self.h);
            let out = &self.drive.out;
            let off = (out.plant.speed - reference).abs() / rated;
            if off > 100.0 {
                return false;
            }
            let ahead = wrap(out.plant.theta_e - out.controller.theta_est).abs();
            held &= t < time - last || (off <= 0.02 && ahead <= 30.0_f64.to_radians());
        }
        held
    }
}

/// From the angle `theta_e` (rad): whether it starts, and whether it holds the load.
fn long(motor: &MotorFile, tuned: &Tuned, task: &Task, theta_e: f64) -> (bool, bool) {
    let mut run = Long::of(tuned, theta_e);
    let par = run.drive.model.pair.controller.model.parameters.clone();
    let J = *motor.data.mechanics.J.get_ref();
    let (reference, w) = (task.level * tuned.speed, f64::from(par.motor.n_p) * task.level * tuned.speed);
    let observer = match par.estimator {
        Kind::Rasmussen => (2.0 / par.estimators.rasmussen.c_1).max(par.estimators.rasmussen.c_1 / (w * w)),
        _ => 1.0 / par.estimators.tracker.bandwidth,
    };
    let slowest = observer.max(2.0 / par.speed_loop.bandwidth).max(J * tuned.speed / tuned.torque);
    let Begin { rest, measures, ready } = Begin::of(tuned, &tuned.pair(), task.level);
    run.run(rest, 0.0, 0.0, tuned.speed, |_| 0.0);
    if !run.run(measures + ready + 20.0 * slowest, 2.0 * slowest, reference, tuned.speed, |_| 0.0) {
        return (false, false);
    }
    // The torque that the load does not need brings the speed back.
    let spare = (run.drive.out.controller.tau_max - task.torque).max(0.02 * task.torque);
    let back = 2.0 / E * task.torque / (par.speed_loop.bandwidth * spare);
    let slowest = slowest.max(back);
    let load = |t: f64| task.torque * if task.rise > 0.0 { (t / task.rise).min(1.0) } else { 1.0 };
    (true, run.run(task.rise + 20.0 * slowest, 2.0 * slowest, reference, tuned.speed, load))
}

/// How many of `angles` start, and how many of these hold.
fn long_from(motor: &MotorFile, tuned: &Tuned, task: &Task, angles: u32) -> (u32, u32) {
    let from = |k: u32| long(motor, tuned, task, f64::from(k) * TAU / f64::from(angles));
    let half = angles / 2;
    let count = |angles: std::ops::Range<u32>| {
        angles.map(from).fold((0, 0), |(s, h), (started, held)| (s + u32::from(started), h + u32::from(held)))
    };
    let (one, other) = std::thread::scope(|scope| {
        let other = scope.spawn(|| count(half..angles));
        (count(0..half), other.join().unwrap())
    });
    (one.0 + other.0, one.1 + other.1)
}

/// The row of a machine: its data.
fn head(motor: &MotorFile, tuned: &Tuned) -> String {
    let (m, rating) = (&motor.data.machine, &motor.data.rating);
    let (n_p, psi_M) = (f64::from(*m.n_p.get_ref()), m.psi_M.get_ref());
    let (speed, torque) = (rating.speed.get_ref(), rating.torque.get_ref());
    let (w, i) = (n_p * speed, torque / (1.5 * n_p * psi_M));
    let par = &tuned.pair().controller.model.parameters;
    format!(
        "{:10} {:7.0} W {:5.0} V {:5.0} rpm {:4.0} Hz  R {:.3} pu  L_q/L_d {:.1}  {:5.3} s  {:4.1} us {:11}",
        motor.data.name,
        speed * torque,
        motor.data.dc_link.u_dc.get_ref(),
        speed * 60.0 / TAU,
        w / TAU,
        m.R_s.get_ref() * i / (w * psi_M),
        m.L_q.get_ref() / m.L_d.get_ref(),
        motor.data.mechanics.J.get_ref() * speed / torque,
        1e6 * par.T_s,
        par.estimator.name()
    )
}

/// Every verdict on a machine against long runs from `angles` angles; returns the number of cells that were compared and of
/// remedies.
fn compare(motor: &MotorFile, tuned: &Tuned, angles: u32) -> (u32, u32) {
    let trials = trial::all(tuned, angles);
    let (limits, _) = limits::of(motor, tuned, &trials);
    let (mut cells, mut remedies, mut row) = (0, 0, head(motor, tuned));
    for trial in &trials {
        let (started, held) = long_from(motor, tuned, &trial.task, angles);
        let cell = format!(" | {:.2}: {}/{} {started}/{held}", trial.task.level, trial.started, trial.held);
        row.push_str(&cell);
        let announced = |what| limits.iter().any(|l| l.what == what && l.level.total_cmp(&trial.task.level).is_eq());
        assert_eq!(trial.starts(), started == angles, "{row}");
        assert_eq!(trial.holds(), held == started, "{row}");
        assert_eq!(announced(What::Start), started < angles, "{row}");
        assert_eq!(announced(What::Load), held < started, "{row}");
        cells += 2;
    }
    println!("{row}");
    for limit in &limits {
        println!("    {limit}");
        let trial = trials.iter().find(|trial| trial.task.level.total_cmp(&limit.level).is_eq()).unwrap();
        remedies += helped(motor, tuned, limit, trial);
    }
    (cells, remedies)
}

/// Each remedy in a long run, and a rise of three times that length; returns their number.
fn helped(motor: &MotorFile, tuned: &Tuned, limit: &Limit, trial: &Trial) -> u32 {
    let mut remedies = 0;
    assert!(!limit.cures.is_empty(), "{limit}");
    for cure in &limit.cures {
        let (cured, task) = cure.applied(motor, tuned, &trial.task).unwrap();
        for task in [task, Task { rise: 3.0 * task.rise, ..task }] {
            let (started, held) = long_from(motor, &cured, &task, trial.angles);
            let good = if limit.what == What::Start { started == trial.angles } else { held == started };
            assert!(good, "{}: {cure}: {started} start, {held} hold", motor.data.name);
        }
        remedies += 1;
    }
    remedies
}

/// The traction machine and the servo hold all loads that they were predicted to lose.
#[test]
fn a_verdict_waits_for_the_slowest_time_constant() {
    for text in [TRACTION, SERVO] {
        let motor = read(text);
        let tuned = rules::tune(&motor).unwrap();
        let trials = trial::all(&tuned, 8);
        assert!(trials.iter().all(|trial| trial.started == 8 && trial.held == 8), "{trials:?}");
        assert!(limits::of(&motor, &tuned, &trials).0.is_empty());
        compare(&motor, &tuned, 4);
    }
}

/// A motor of 150 W at 22,700 rpm; a step of rated torque at 0.1 pu changes its speed by twice that value.
const LIGHT: &str = include_str!("machines/light-24v.toml");

#[test]
fn a_small_machine_holds_what_it_lost() {
    let motor = read(SMALL);
    let tuned = rules::fixed(&motor).unwrap();
    assert!(trial::all(&tuned, 8).iter().all(|trial| trial.started == 8 && trial.held == 8));
    compare(&motor, &tuned, 4);
    // Known by 10 % only, R loses the load.
    let R_s = *motor.data.machine.R_s.get_ref();
    let known_badly = tuned.with("motor.R_s", Value::Real(0.9 * R_s)).with("rasmussen.c_1", Value::Real(200.0));
    assert_eq!(trial::at(&known_badly, &tuned.tasks()[0], 4).held, 0);
}

/// A scooter's hub motor whose diodes drop 0.7 V. Without their compensation it swings without a load on the way down from 0.9 pu,
/// bistable: +-10 A at 0.5 pu, where the trial from standstill reported 24 of 24. With it, or with a slow speed loop, it is
/// quiet.
#[test]
fn a_swing_between_the_levels_is_found_from_both_sides() {
    let motor = read(include_str!("machines/scooter-36v.toml"));
    let tuned = rules::tune(&motor).unwrap();
    assert!(trial::swings(&tuned).is_empty());
    let fixed = rules::fixed(&motor).unwrap().with("compensation.u_dead", Value::Real(0.0));
    let swings = trial::swings(&fixed);
    let half: Vec<_> = swings.iter().filter(|swing| (swing.level - 0.5).abs() < 1e-9).collect();
    assert!(half.len() == 1 && !half[0].rising && half[0].current > 15.0 && swings.len() >= 4, "{swings:?}");
    assert!(half[0].to_string().contains("swings at 0.5 pu, reached from above"), "{}", half[0]);
    assert!(trial::swings(&fixed.with("speed_loop.bandwidth", Value::Real(40.0))).is_empty());
}

/// Every failure is announced, and every remedy helps. With the adaptation, this machine holds its load.
#[test]
fn a_light_machine_is_told_what_helps() {
    let motor = read(LIGHT);
    assert!(trial::all(&rules::tune(&motor).unwrap(), 4).iter().all(|trial| trial.starts() && trial.holds()));
    let (_, remedies) = compare(&motor, &rules::fixed(&motor).unwrap(), 4);
    assert!(remedies >= 2, "{remedies}");
}

#[test]
fn what_is_told_of_some_machines_is_what_long_runs_show() {
    let compared: u32 = drawn(8).iter().map(|motor| compare(motor, &rules::tune(motor).unwrap(), 4).0).sum();
    assert!(compared >= 48, "{compared} cells");
}

/// `cargo test --release -p drive-tools --test verdicts -- --ignored --nocapture`
#[test]
#[ignore = "minutes"]
fn what_is_told_of_forty_machines_is_what_long_runs_show() {
    let machines = [TRACTION, SERVO, SMALL].map(read).into_iter().chain(drawn(40));
    let (mut cells, mut remedies) = (0, 0);
    for motor in machines {
        let (more, helped) = compare(&motor, &rules::tune(&motor).unwrap(), 24);
        (cells, remedies) = (cells + more, remedies + helped);
    }
    println!("{cells} verdicts compared, {remedies} remedies tried");
    assert!(cells >= 240, "{cells} cells");
}
