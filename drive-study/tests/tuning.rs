//! Parameters tuned on a running drive: no bump at the next sample, the new gains after it, a bad combination refused.
#![allow(missing_docs, non_snake_case)]

use drive::control::envelope::{Envelope, WarmStart};
use drive::control::signals::ControllerOutputs;
use drive::control::start::StartMode;
use drive::estimator::Kind::{
    self, CurrentModel, DirectEmf, EmfObserver, ExtendedEmf, Hybrid, KalmanFilter, VoltageFeedback, VoltageModel,
};
use drive::{Pair, PmsmPlant, SensorlessController};
use drive_study::runner;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::Tuned;
use fmu_core::{Block, Elapsed, Fault, Model, Slot, Step, Variability};
use std::f64::consts::PI;
use std::path::Path;

const T_S: f64 = 1e-4;

/// The index of a variable in its model's table.
fn place<M: Model>(name: &str) -> usize {
    (0..M::TABLE.len())
        .find(|&i| M::TABLE.locate(i).is_some_and(|(found, ..)| found == name))
        .unwrap_or_else(|| panic!("{name}"))
}

/// Sets a tunable parameter of the running controller, like an importer.
fn tune(pair: &mut Pair, name: &str, change: impl Fn(f64) -> f64) -> Result<(), Fault> {
    let index = place::<SensorlessController>(name);
    let (meta, slot) = SensorlessController::TABLE.entry(&mut pair.controller, index).unwrap();
    assert_eq!(meta.variability, Variability::Tunable, "{name}");
    let Slot::Real(x) = slot else { panic!("{name} is not real") };
    let old = *x;
    *x = change(old);
    assert!(meta.range.contains(*x), "{name} = {x}");
    if let Err(fault) = pair.controller.model.validate() {
        let (_, slot) = SensorlessController::TABLE.entry(&mut pair.controller, index).unwrap();
        let Slot::Real(x) = slot else { panic!("{name}") };
        *x = old;
        return Err(fault);
    }
    pair.controller.model.derive();
    Ok(())
}

fn run(pair: &mut Pair, inputs: (f64, f64, f64), samples: u32) {
    for _ in 0..samples {
        pair.set_inputs(inputs.0, inputs.1, inputs.2);
        pair.step(T_S).unwrap();
    }
}

/// The maximum differences between the commands and estimates of a sample, in V, A and rad.
fn apart(a: &ControllerOutputs, b: &ControllerOutputs) -> f64 {
    let all = |o: &ControllerOutputs| [o.u.a, o.u.b, o.u.c, o.i_ref.d, o.i_ref.q, o.theta_est, o.speed_est];
    all(a).iter().zip(all(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A drive in the middle of a transient, with nonzero errors, and its inputs.
fn in_a_transient(kind: Kind) -> (Pair, (f64, f64, f64)) {
    if kind == Kind::Rasmussen {
        let mut pair = Pair::default();
        pair.start().unwrap();
        run(&mut pair, (50.0, 0.0, 325.0), 5000);
        run(&mut pair, (60.0, 1.0, 325.0), 37);
        return (pair, (60.0, 1.0, 325.0));
    }
    let mut pair = runner::turning(runner::drive(kind), 0.2);
    pair.start().unwrap();
    run(&mut pair, (0.2 * runner::RATED_SPEED, 0.0, 540.0), 5000);
    let inputs = (0.22 * runner::RATED_SPEED, 2.0, 540.0);
    run(&mut pair, inputs, 37);
    (pair, inputs)
}

/// Tunes one parameter of a drive in a transient: the sample at which it takes effect gives the same command as the untuned
/// drive, later ones do not.
fn without_a_bump(kind: Kind, name: &str, change: impl Fn(f64) -> f64, set: impl Fn(&mut Pair)) {
    let (mut pair, inputs) = {
        let (mut pair, inputs) = in_a_transient(kind);
        set(&mut pair);
        pair.controller.model.derive();
        run(&mut pair, inputs, 2);
        (pair, inputs)
    };
    let mut untuned = pair.clone();
    tune(&mut pair, name, change).unwrap();
    run(&mut pair, inputs, 1);
    run(&mut untuned, inputs, 1);
    let at_once = apart(&pair.controller.out, &untuned.controller.out);
    assert!(at_once < 1e-9, "{name}, {}: a bump of {at_once}", kind.name());
    // The weight of the set point shows when that moves.
    let inputs = (0.98 * inputs.0, inputs.1, inputs.2);
    run(&mut pair, inputs, 200);
    run(&mut untuned, inputs, 200);
    let later = apart(&pair.controller.out, &untuned.controller.out);
    assert!(later > 1e-5, "{name}, {}: no effect, {later}", kind.name());
}

/// The file of the reference motor has the same ratings as the constants of the studies.
#[test]
fn the_reference_motor_has_one_rating() {
    let motor = MotorFile::read("../motors/reference.toml".as_ref()).unwrap();
    let rating = &motor.data.rating;
    assert!((rating.speed.get_ref() / runner::REFERENCE_SPEED - 1.0).abs() < 1e-8);
    assert!((rating.torque.get_ref() / runner::REFERENCE_TORQUE - 1.0).abs() < 1e-8);
}

#[test]
fn loops_and_estimators_change_without_a_bump() {
    let nothing = |_: &mut Pair| {};
    for name in ["speed_loop.bandwidth", "speed_loop.t_is", "speed_loop.b", "mechanics.J", "current.bandwidth"] {
        without_a_bump(Kind::Rasmussen, name, |x| 0.6 * x, nothing);
        without_a_bump(Kind::ExtendedEmf, name, |x| 0.6 * x, nothing);
    }
    for name in ["rasmussen.c_1", "rasmussen.c_2", "rasmussen.w_n", "rasmussen.zeta", "motor.R_s"] {
        without_a_bump(Kind::Rasmussen, name, |x| 0.9 * x, nothing);
    }
    without_a_bump(Kind::Rasmussen, "current.integral", |_| 0.3, nothing);
    let active = |pair: &mut Pair| pair.controller.model.parameters.current.active_resistance = true;
    let forward = |pair: &mut Pair| pair.controller.model.parameters.current.reference_feed_forward = true;
    for name in ["motor.R_s", "current.bandwidth"] {
        without_a_bump(Kind::Rasmussen, name, |x| 0.8 * x, active);
        without_a_bump(Kind::Rasmussen, name, |x| 0.8 * x, forward);
    }
    for kind in [DirectEmf, EmfObserver, ExtendedEmf, VoltageFeedback, Kind::SquareWaveInjection] {
        without_a_bump(kind, "tracker.bandwidth", |x| 0.6 * x, nothing);
    }
    for kind in [DirectEmf, EmfObserver, ExtendedEmf, VoltageFeedback, Hybrid] {
        without_a_bump(kind, "emf.bandwidth", |x| 1.4 * x, nothing);
    }
    for kind in [VoltageModel, CurrentModel] {
        without_a_bump(kind, "matsui.bandwidth", |x| 0.6 * x, nothing);
        without_a_bump(kind, "matsui.filter", |x| 0.6 * x, nothing);
    }
    for name in ["kalman.voltage_d", "kalman.voltage_q", "kalman.acceleration", "kalman.current"] {
        without_a_bump(KalmanFilter, name, |x| 4.0 * x, nothing);
    }
    without_a_bump(Hybrid, "hybrid.bandwidth", |x| 0.6 * x, nothing);
    for kind in [DirectEmf, KalmanFilter, VoltageFeedback, Hybrid, CurrentModel] {
        without_a_bump(kind, "motor.R_s", |x| 0.9 * x, nothing);
    }
}

#[test]
fn a_ramp_begins_at_the_reference() {
    let (mut pair, inputs) = in_a_transient(Kind::Rasmussen);
    let mut untuned = pair.clone();
    tune(&mut pair, "speed_loop.ramp", |_| 50.0).unwrap();
    run(&mut pair, inputs, 1);
    run(&mut untuned, inputs, 1);
    assert_eq!(pair.controller.out, untuned.controller.out, "no correction is needed at the reference");
    // 0.1 s of 50 rad/s2 from 60 rad/s on.
    run(&mut pair, (80.0, 1.0, 325.0), 1000);
    assert!((pair.plant.out.speed - 65.0).abs() < 3.0, "{}", pair.plant.out.speed);
}

#[test]
fn limits_and_the_low_speed_law_act_at_the_next_sample() {
    let (mut pair, inputs) = in_a_transient(Kind::Rasmussen);
    assert!(pair.controller.out.i_ref.q > 0.7, "{:?}", pair.controller.out.i_ref);
    tune(&mut pair, "limit.i_q", |_| 0.5).unwrap();
    run(&mut pair, inputs, 1);
    assert!((pair.controller.out.i_ref.q - 0.5).abs() < 1e-12);
    tune(&mut pair, "limit.tau", |_| 0.0675).unwrap();
    run(&mut pair, inputs, 1);
    assert!((pair.controller.out.i_ref.q - 0.1).abs() < 1e-12);
    let i_d = pair.controller.out.i_ref.d;
    tune(&mut pair, "zero_speed.i_0", |x| 0.5 * x).unwrap();
    run(&mut pair, inputs, 1);
    assert!((pair.controller.out.i_ref.d / i_d - 0.5).abs() < 0.02);
    tune(&mut pair, "zero_speed.w_0", |x| 100.0 * x).unwrap();
    run(&mut pair, inputs, 1);
    assert!(pair.controller.out.i_ref.d > 2.2, "{:?}", pair.controller.out.i_ref);
    tune(&mut pair, "limit.i", |_| 2.51).unwrap();
    run(&mut pair, inputs, 1);
    assert!(pair.controller.out.i_ref.q.abs() <= 2.51);
}

/// Speeds of a step from 20 to 40 rad/s after `set` and then one second.
fn step_response(set: impl FnOnce(&mut Pair)) -> Vec<f64> {
    let mut pair = Pair::default();
    pair.start().unwrap();
    run(&mut pair, (20.0, 0.0, 325.0), 3000);
    set(&mut pair);
    run(&mut pair, (20.0, 0.0, 325.0), 7000);
    (0..2000)
        .map(|_| {
            run(&mut pair, (40.0, 0.0, 325.0), 1);
            pair.plant.out.speed
        })
        .collect()
}

#[test]
fn a_tuned_drive_is_one_that_started_so() {
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let before = step_response(|_| {});
    for (name, to) in [("speed_loop.bandwidth", 40.0), ("rasmussen.w_n", 160.0), ("current.bandwidth", 300.0)] {
        let tuned = step_response(|pair| tune(pair, name, |_| to).unwrap());
        let restarted = step_response(|pair| {
            *pair = Pair::default();
            let par = &mut pair.controller.model.parameters;
            match name {
                "speed_loop.bandwidth" => par.speed_loop.bandwidth = to,
                "rasmussen.w_n" => par.estimators.rasmussen.w_n = to,
                _ => par.current.bandwidth = to,
            }
            pair.start().unwrap();
            run(pair, (20.0, 0.0, 325.0), 3000);
        });
        let (as_started, as_before) = (apart(&tuned, &restarted), apart(&tuned, &before));
        assert!(as_started < 0.02, "{name}: {as_started} rad/s from a drive that started with it");
        assert!(as_before > 10.0 * as_started && as_before > 0.1, "{name}: {as_before} rad/s from the untuned one");
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let (mut pair, inputs) = in_a_transient(Kind::ExtendedEmf);
    let mut untouched = pair.clone();
    let fault = tune(&mut pair, "tracker.bandwidth", |_| 400.0).unwrap_err();
    assert!(fault.message().contains("tracker.bandwidth = 400 rad/s"), "{fault}");
    let fault = tune(&mut pair, "current.bandwidth", |_| 4e3).unwrap_err();
    assert!(fault.message().contains("current.bandwidth = 4000 rad/s"), "{fault}");
    run(&mut pair, inputs, 100);
    run(&mut untouched, inputs, 100);
    assert_eq!(pair.controller.out, untouched.controller.out);
}

#[test]
fn several_sets_before_a_sample_are_one() {
    let (mut pair, inputs) = in_a_transient(Kind::Rasmussen);
    let mut untuned = pair.clone();
    for factor in [3.0, 0.1, 2.0] {
        tune(&mut pair, "speed_loop.bandwidth", |x| factor * x).unwrap();
        tune(&mut pair, "rasmussen.zeta", |x| x / factor).unwrap();
    }
    run(&mut pair, inputs, 1);
    run(&mut untuned, inputs, 1);
    assert!(apart(&pair.controller.out, &untuned.controller.out) < 1e-9);
}

#[test]
fn before_the_first_sample_a_tuned_value_is_a_start_value() {
    let mut late = Pair::default();
    late.start().unwrap();
    tune(&mut late, "current.bandwidth", |x| 0.5 * x).unwrap();
    tune(&mut late, "rasmussen.c_1", |x| 0.5 * x).unwrap();
    let mut early = Pair::default();
    let par = &mut early.controller.model.parameters;
    par.current.bandwidth *= 0.5;
    par.estimators.rasmussen.c_1 *= 0.5;
    early.start().unwrap();
    run(&mut late, (50.0, 0.0, 325.0), 1000);
    run(&mut early, (50.0, 0.0, 325.0), 1000);
    assert_eq!(late.controller.out, early.controller.out);
}

#[test]
fn the_plant_warms_up() {
    // A locked rotor at 10 V along its magnet: the current goes from 10 V / R_s to 10 V / 1.25 R_s.
    let mut plant = Block::<PmsmPlant>::default();
    plant.model.parameters.mechanics.imposed = true;
    plant.model.inputs.u.a = 15.0;
    plant.initialize();
    let mut now = Elapsed::ZERO;
    for r_s in [2.0, 2.5] {
        let (meta, slot) = PmsmPlant::TABLE.entry(&mut plant, place::<PmsmPlant>("motor.R_s")).unwrap();
        assert_eq!(meta.variability, Variability::Tunable);
        let Slot::Real(x) = slot else { panic!() };
        *x = r_s;
        plant.model.derive();
        for _ in 0..1000 {
            let step = Step { start: now, h: T_S };
            plant.step(&step).unwrap();
            now = step.end();
        }
        assert!((plant.out.i_d - 10.0 / r_s).abs() < 1e-6, "{}", plant.out.i_d);
        assert!((plant.out.powers.p_loss - 1.5 * 100.0 / r_s).abs() < 1e-4);
    }
}

/// The values of the reference machine's file with some lines replaced.
fn tuned_with(changes: &[(&str, &str)]) -> drive_tools::error::Result<Tuned> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors/reference.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    let changed = changes.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    rules::tune(&MotorFile::parse(&changed, &path)?)
}

#[test]
fn field_weakening_is_tuned_where_the_rating_needs_it() {
    let used = |tuned: &Tuned| tuned.controller.iter().any(|s| s.name == "weakening.use");
    let own = tuned_with(&[]).unwrap();
    assert!(!used(&own), "3000 rpm and 2.5 N.m fit 0.95 u_dc / sqrt(3)");
    // 4500 rpm: 3.0945 N.m at 7.5 A; the diodes conduct from 3982 rpm (417 rad/s) on.
    let fast = tuned_with(&[("speed = 314.159265", "speed = 471.238898")]).unwrap();
    assert!(used(&fast) && fast.notes.iter().any(|note| note.contains("above 417 rad/s")), "{:?}", fast.notes);
    let more = [("speed = 314.159265", "speed = 471.238898"), ("torque = 2.5 ", "torque = 3.2 ")];
    let refused = tuned_with(&more).unwrap_err().to_string();
    assert!(refused.contains("rating.speed") && refused.contains("at most 3.09 N.m of the 3.2 N.m"), "{refused}");
}

#[test]
fn three_machines_need_it_at_their_rated_point() {
    // The 2.2 kW machine takes 0.9504 u_dc / sqrt(3) at 1500 rpm and 14 N.m with maximum torque per ampere.
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors");
    for (name, needed) in [
        ("reference", false),
        ("servo-6.6kw", false),
        ("ipmsm-2.2kw", true),
        ("pmsyrm-5.5kw", true),
        ("traction-63kw", true),
    ] {
        let tuned = drive_tools::tune::tune(&folder.join(format!("{name}.toml"))).unwrap();
        assert_eq!(tuned.controller.iter().any(|s| s.name == "weakening.use"), needed, "{name}");
        tuned.pair().start().unwrap();
    }
}

/// The tuned traction drive at 2.5 times its base speed: a ramp from standstill, two thirds of the envelope as load, then more
/// than the envelope, which slows it down.
#[test]
fn the_traction_drive_reaches_two_and_a_half_times_its_base_speed() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors/traction-63kw.toml");
    let tuned = drive_tools::tune::tune(&path).unwrap();
    for kind in [Kind::Sensored, ExtendedEmf, EmfObserver] {
        let mut pair = tuned.pair();
        let par = &mut pair.controller.model.parameters;
        par.estimator = kind;
        if kind == Kind::Sensored {
            par.start.mode = StartMode::Direct;
            par.estimators.emf.hold_reversal = false;
        }
        assert!(par.weakening.used);
        let u_dc = pair.plant.model.inputs.u_dc;
        let (motor, U) = (&pair.plant.model.parameters.motor, 0.95 * u_dc / 3.0_f64.sqrt());
        let (envelope, n_p) = (Envelope::new(motor, par.limit.i), f64::from(motor.n_p));
        let most = |speed: f64| {
            let mut warm = WarmStart::default();
            (0..8).map(|_| envelope.limit(n_p * speed, 1.0, U, &mut warm).tau).last().unwrap()
        };
        let top = 2.5 * envelope.base_speed(U) / n_p;
        assert!((top * 30.0 / PI / 2.5 - 3075.23).abs() < 0.01);
        pair.start().unwrap();
        let (mut worst, mut current, mut highest) = (0.0_f64, 0.0_f64, 0.0_f64);
        // Speed reference, load and samples of each part.
        let mut part = |pair: &mut Pair, from: f64, to: f64, load: f64, samples: u32| {
            for k in 1..=samples {
                let speed_ref = from + (to - from) * f64::from(k) / f64::from(samples);
                pair.set_inputs(speed_ref, load, u_dc);
                pair.step(T_S).unwrap();
                let out = &pair.plant.out;
                current = current.max(out.i_d.hypot(out.i_q));
                highest = highest.max(out.speed);
                if out.speed > 0.3 * top {
                    worst = worst.max(runner::rotor_ahead(pair).abs());
                }
            }
        };
        part(&mut pair, 0.0, 0.0, 0.0, 6000);
        part(&mut pair, 0.0, top, 0.0, 30_000);
        part(&mut pair, top, top, 0.0, 5000);
        part(&mut pair, top, top, 0.66 * most(top), 10_000);
        let reached = pair.plant.out.speed;
        let weakens = pair.controller.out.weakens;
        part(&mut pair, top, top, 1.1 * most(top), 30_000);
        let share = pair.plant.out.tau_e / most(pair.plant.out.speed);
        println!(
            "{}: {reached} of {top} rad/s, at most {highest}; {worst} deg, {current} A; {share} of the envelope at {} rad/s",
            kind.name(),
            pair.plant.out.speed
        );
        assert!(weakens && (reached / top - 1.0).abs() < 0.002, "{reached} of {top} rad/s");
        assert!(
            highest < 1.01 * top && worst < 15.0 && current < 1.02 * 240.0,
            "{highest} rad/s, {worst} deg, {current} A"
        );
        assert!(pair.plant.out.speed < 0.98 * top && (share - 1.0).abs() < 0.01, "{share} at {}", pair.plant.out.speed);
    }
}
