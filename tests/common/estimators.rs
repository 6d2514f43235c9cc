//! A start and a load step for every estimator, run natively and passed to FMPy: parameters, inputs and expected outputs.

use drive::control::start::StartMode;
use drive::estimator::{Class, Kind};
use drive::{Pair, math};
use drive_study::runner::{self, RATED_SPEED, RATED_TORQUE};
use fmu_core::{Block, Causality, Saved, Slot};
use serde_json::{Map, Value, json};

const T_S: f64 = 1e-4;
/// Samples from one recorded point to the next.
const EVERY: u32 = 50;

/// Values of an input over time: each applies from its time (s) on.
pub type Schedule = Vec<(f64, f64)>;

struct Experiment {
    name: String,
    pair: Pair,
    speed_ref: Schedule,
    load: Schedule,
    duration: f64,
    /// Time (s) from which the controller is enabled.
    on: f64,
}

/// Every parameter that differs from its start value.
fn parameters<M: Saved>(block: &Block<M>) -> Map<String, Value> {
    let (mut block, mut fresh) = (block.clone(), Block::<M>::default());
    let mut map = Map::new();
    for i in 0..M::TABLE.len() {
        let Some((name, meta, _)) = M::TABLE.locate(i) else { continue };
        if meta.causality != Causality::Parameter {
            continue;
        }
        let value = |block: &mut Block<M>| match M::TABLE.entry(block, i) {
            Some((_, Slot::Real(x))) => json!(*x),
            Some((_, Slot::Integer(x))) => json!(x.get()),
            Some((_, Slot::Boolean(x))) => json!(*x),
            Some((_, Slot::Enumeration(x))) => json!(x.get()),
            _ => Value::Null,
        };
        let set = value(&mut block);
        if set != value(&mut fresh) {
            map.insert(name, set);
        }
    }
    map
}

pub fn at(schedule: &Schedule, t: f64) -> f64 {
    schedule.iter().rev().find(|(from, _)| t >= from - 1e-9).map_or(0.0, |(_, value)| *value)
}

/// The reference motor with this estimator.
fn flux_observer(kind: Kind) -> Pair {
    let mut pair = Pair::default();
    pair.controller.model.parameters.estimator = kind;
    pair
}

fn load_step(kind: Kind) -> Experiment {
    // Injections run out of voltage above 0.2 pu; a flux observer is for a motor without saliency.
    let speed = if kind.class() == Class::Injection { 0.1 } else { 0.5 };
    let (pair, speed, load) = if kind.class() == Class::FluxObserver {
        let mut pair = flux_observer(kind);
        pair.plant.model.parameters.initial.speed = 100.0;
        pair.controller.model.parameters.speed_est = 100.0;
        (pair, 100.0, 1.0)
    } else {
        (runner::turning(runner::drive(kind), speed), speed * RATED_SPEED, 0.3 * RATED_TORQUE)
    };
    let name = format!("{}: load step", kind.name());
    Experiment { name, pair, speed_ref: vec![(0.0, speed)], load: vec![(0.2, load)], duration: 0.8, on: 0.0 }
}

fn start(kind: Kind) -> Experiment {
    let mut pair = if kind.class() == Class::FluxObserver { flux_observer(kind) } else { runner::drive(kind) };
    pair.plant.model.parameters.initial.theta_e = 2.0;
    let mut mode = pair.controller.model.parameters.start.mode;
    let speed = match kind.class() {
        Class::FluxObserver => 50.0,
        Class::Injection => 0.05 * RATED_SPEED,
        Class::Hybrid | Class::Sensored | Class::BackEmf => 0.5 * RATED_SPEED,
    };
    if kind.class().injects() {
        mode = StartMode::Injection;
    } else if !kind.holds_standstill() {
        mode = StartMode::CurrentFrequency;
    }
    pair.controller.model.parameters.start.mode = mode;
    if mode == StartMode::Injection {
        pair = runner::with_saturation(pair);
        pair.controller.model.parameters.s_2 = 40.0;
    }
    let name = format!("{}: start", kind.name());
    Experiment { name, pair, speed_ref: vec![(0.6, speed)], load: vec![], duration: 1.6, on: 0.0 }
}

/// A cell of the atlas that Rasmussen's observer loses without adaptation: R^ = 0.9 R, 2 N.m driving at 30 rpm.
fn adapting_at_rest() -> Experiment {
    let mut pair = flux_observer(Kind::Rasmussen);
    let par = &mut pair.controller.model.parameters;
    (par.estimators.adaptation.resistance, par.estimators.adaptation.k_a) = (true, 0.02);
    let speed_ref = vec![(0.0, 0.0), (0.2, std::f64::consts::PI)];
    let name = "Rasmussen: adapting, driven at 30 rpm".into();
    Experiment { name, pair, speed_ref, load: vec![(1.0, -2.0)], duration: 2.6, on: 0.0 }
}

/// A case that needs `compensation.observe` and `compensation.calibrate`: 15 rpm under 2 N.m with a dead time, noise and
/// offsets, while the resistance is tracked.
fn with_a_real_inverter() -> Experiment {
    let mut experiment = adapting_at_rest();
    let Pair { plant, controller, .. } = &mut experiment.pair;
    let (truth, par) = (&mut plant.model.parameters, &mut controller.model.parameters);
    truth.inverter.dead_time = 2e-6;
    par.compensation.u_dead = truth.inverter.u_dead(plant.model.inputs.u_dc);
    (par.compensation.observe, par.compensation.calibrate) = (true, true);
    (par.sensor.noise, par.sensor.offset.a, par.sensor.offset.b) = (0.01, 0.02, -0.02);
    par.estimators.adaptation.tracking = 0.15;
    let speed_ref = vec![(0.0, 0.0), (0.25, 0.5 * std::f64::consts::PI)];
    Experiment { name: "Rasmussen: dead time, offsets, 15 rpm".into(), speed_ref, on: 0.05, ..experiment }
}

/// A cell of the flux observer's map: R^ = 0.8 R, psi^ = 0.95 psi, both adapting, half the load driving at 0.02 pu.
fn adapting() -> Experiment {
    let mut pair = runner::turning(runner::drive(Kind::FluxObserver), 0.2);
    let par = &mut pair.controller.model.parameters;
    (par.motor.R_s, par.motor.psi_M) = (0.8 * par.motor.R_s, 0.95 * par.motor.psi_M);
    (par.estimators.adaptation.resistance, par.estimators.flux_observer.magnet) = (true, 5.0);
    let step = |k: u32| (0.2 + 0.1 * f64::from(k), RATED_SPEED * (0.2 - 0.0225 * f64::from(k)));
    let speed_ref = std::iter::once((0.0, 0.2 * RATED_SPEED)).chain((0..=8).map(step)).collect();
    let load = (0..=6).map(|k| (1.5 + 0.05 * f64::from(k), -RATED_TORQUE * f64::from(k) / 12.0)).collect();
    Experiment { name: "FluxObserver: adapting at 0.02 pu".into(), pair, speed_ref, load, duration: 2.6, on: 0.0 }
}

/// The reversal from 0.5 to -0.5 pu in 0.5 s that needs `emf.hold_reversal`, under friction of 0.3 pu.
fn reversal(kind: Kind) -> Experiment {
    let mut pair = runner::turning(runner::drive(kind), 0.5);
    pair.plant.model.parameters.mechanics.tau_coulomb = 0.3 * RATED_TORQUE;
    let par = &mut pair.controller.model.parameters;
    par.estimators.emf.hold_reversal = kind != Kind::FluxObserver;
    let step = |k: u32| (0.3 + 0.01 * f64::from(k), RATED_SPEED * (0.5 - 0.02 * f64::from(k)));
    let speed_ref = std::iter::once((0.0, 0.5 * RATED_SPEED)).chain((0..=50).map(step)).collect();
    Experiment { name: format!("{}: reversal", kind.name()), pair, speed_ref, load: vec![], duration: 1.6, on: 0.0 }
}

impl Experiment {
    /// Runs it natively: the experiment as JSON with speed and estimated angle of every recorded point.
    fn run(mut self) -> Value {
        let pair = &mut self.pair;
        let u_dc = pair.plant.model.inputs.u_dc;
        let (plant, controller) = (parameters(&pair.plant), parameters(&pair.controller));
        let (mut speed, mut theta_est) = (Vec::new(), Vec::new());
        super::run(pair, T_S, self.duration, |t, p| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count of samples")]
            let k = (t / T_S).round() as u32;
            if k.is_multiple_of(EVERY) {
                speed.push(p.plant.out.speed);
                theta_est.push(p.controller.out.theta_est);
            }
            p.controller.model.inputs.enable = t >= self.on - 1e-9;
            p.set_inputs(at(&self.speed_ref, t), at(&self.load, t), u_dc);
        });
        let reference = at(&self.speed_ref, self.duration);
        let error = math::wrap(pair.controller.out.theta_est - pair.plant.out.theta_e).to_degrees();
        assert!((pair.plant.out.speed - reference).abs() < 8.0, "{}: {} rad/s", self.name, pair.plant.out.speed);
        assert!(error.abs() < 20.0, "{}: {error} deg off", self.name);
        json!({
            "name": self.name, "plant": plant, "controller": controller, "u_dc": u_dc, "speed_ref": self.speed_ref,
            "load": self.load, "on": self.on, "steps": (speed.len() - 1) * EVERY as usize, "every": EVERY, "speed": speed,
            "theta_est": theta_est,
        })
    }
}

/// All experiments.
pub fn experiments() -> Value {
    let all = Kind::ALL.iter().flat_map(|&kind| vec![load_step(kind), start(kind)]);
    let reversals = [Kind::ExtendedEmf, Kind::FluxObserver].map(reversal);
    let later = vec![adapting_at_rest(), with_a_real_inverter(), adapting()].into_iter().chain(reversals);
    Value::Array(all.chain(later).map(Experiment::run).collect())
}
