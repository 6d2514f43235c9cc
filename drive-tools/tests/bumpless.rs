//! Torque where the rotor is known: gates off and on, a sensor that fails and comes back, and trips, while the rotor turns.
#![allow(missing_docs, non_snake_case)]

use drive::Pair;
use drive::control::start::StartState;
use drive::control::tables::ControllerParameters;
use drive::control::trip::Cause;
use drive::estimator::Kind;
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::{Suited, Tuned};
use std::path::Path;

fn tuned(name: &str, kind: Kind) -> Box<Tuned> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors").join(format!("{name}.toml"));
    let Ok(Suited::Tuned(tuned)) = rules::suited(&MotorFile::read(&path).unwrap(), kind) else {
        panic!("{name}: {kind:?} does not suit")
    };
    tuned
}

/// A run of a pair on an imposed shaft.
struct Run {
    pair: Pair,
    k: u32,
    speed: f64,
}

impl Run {
    fn new(tuned: &Tuned, speed: f64, set: impl FnOnce(&mut ControllerParameters)) -> Self {
        let mut pair = tuned.pair();
        let par = &mut pair.controller.model.parameters;
        (par.start.catch, par.speed_loop.torque_mode) = (true, true);
        set(par);
        pair.plant.model.parameters.mechanics.imposed = true;
        pair.plant.model.inputs.speed_shaft = speed;
        pair.start().unwrap();
        Self { pair, k: 0, speed }
    }

    /// Runs for `seconds`; the least and the greatest torque (N.m) in it.
    fn go(&mut self, seconds: f64) -> [f64; 2] {
        let T_s = self.pair.controller.model.parameters.T_s;
        let mut seen = [f64::MAX, f64::MIN];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some thousands")]
        for _ in 0..(seconds / T_s).round() as u32 {
            self.pair.plant.model.inputs.angle_shaft = self.speed * T_s * f64::from(self.k);
            self.pair.step(T_s).unwrap();
            self.k += 1;
            let tau = self.pair.plant.out.tau_e;
            seen = [seen[0].min(tau), seen[1].max(tau)];
        }
        seen
    }

    fn inputs(&mut self) -> &mut drive::control::signals::ControllerInputs {
        &mut self.pair.controller.model.inputs
    }
}

/// Largest change of the torque in a millisecond, as a share of the rated torque.
const STEP: f64 = 0.05;

/// The sensor fails under load, and comes back: the fallback begins with its angle, the sensor with the voltage of the fallback.
#[test]
fn a_sensor_that_fails_and_comes_back_is_not_felt() {
    for name in ["reference", "hub-36v", "servo-6.6kw"] {
        let sensored = tuned(name, Kind::Sensored);
        let torque = sensored.torque;
        for fallback in [Kind::Rasmussen, Kind::FluxObserver, Kind::ExtendedEmf, Kind::SlidingMode] {
            let values = tuned(name, fallback).pair().controller.model.parameters;
            for pu in [0.2, 0.5, -0.8] {
                let mut run = Run::new(&sensored, pu * sensored.speed, |par| {
                    (par.fallback, par.resume) = (fallback, true);
                    (par.zero_speed, par.estimators) = (values.zero_speed.clone(), values.estimators.clone());
                    // Options that a sensor does not have.
                    let own = &mut par.estimators;
                    (own.emf.hold_reversal, own.adaptation.tracking, own.adaptation.resistance) = (false, 0.0, false);
                });
                let about = format!("{name}, {fallback:?}, {pu} pu");
                run.inputs().tau_ref = 0.4 * torque;
                run.go(0.5);
                run.inputs().sensor_valid = false;
                let lost = run.go(0.5);
                assert!(run.pair.controller.out.sensor_lost, "{about}");
                run.inputs().sensor_valid = true;
                let back = run.go(0.2);
                assert!(!run.pair.controller.out.sensor_lost, "{about}: the sensor takes over again");
                println!("{about}: {:.4?} lost, {:.4?} back", lost.map(|x| x / torque), back.map(|x| x / torque));
                for x in [lost, back].concat() {
                    assert!((x / torque - 0.4).abs() < STEP, "{about}: {} of the rated torque", x / torque);
                }
            }
        }
    }
}

/// With `start.catch`, gates off and on, by `enable` and by trips, with a sensor: the torque is 0, rises to its reference in 0.1 s, and is
/// the same as before.
#[test]
fn gates_off_and_on_make_no_step_of_torque() {
    for name in ["reference", "hub-36v", "traction-60kw", "ipmsm-2.2kw"] {
        let sensored = tuned(name, Kind::Sensored);
        let torque = sensored.torque;
        for pu in [0.1, 0.5, -0.8] {
            for (event, share) in [("enable", 0.0), ("enable", 0.4), ("under-voltage", 0.4), ("over-voltage", 0.4)] {
                let mut run = Run::new(&sensored, pu * sensored.speed, |par| {
                    (par.trip.used, par.trip.i) = (true, 2.0 * par.limit.i);
                    (par.trip.u_dc_min, par.trip.u_dc_restart) = (0.7 * link(&sensored), 0.8 * link(&sensored));
                    par.trip.u_dc = 1.3 * link(&sensored);
                });
                let about = format!("{name}, {pu} pu, {event}, {share}");
                let u_dc = run.inputs().u_dc;
                run.inputs().tau_ref = share * torque;
                run.go(0.5);
                let before = run.pair.plant.out.tau_e / torque;
                match event {
                    "enable" => run.inputs().enable = false,
                    "under-voltage" => run.inputs().u_dc = 0.65 * u_dc,
                    _ => run.inputs().u_dc = 1.35 * u_dc,
                }
                run.go(0.2);
                assert!(run.pair.plant.out.tau_e.abs() < 0.03 * torque, "{about}: the gates are off");
                assert_eq!(run.pair.controller.out.tripped == Cause::None, event == "enable", "{about}");
                run.inputs().u_dc = u_dc;
                if event == "over-voltage" {
                    // Only a new enable ends this trip.
                    run.inputs().enable = false;
                    run.go(0.01);
                }
                run.inputs().enable = true;
                let (mut last, mut step) = (run.pair.plant.out.tau_e, 0.0_f64);
                for _ in 0..300 {
                    run.go(1e-3);
                    let tau = run.pair.plant.out.tau_e;
                    (last, step) = (tau, step.max((tau - last).abs() / torque));
                }
                println!(
                    "{about}: at most {step:.4} of the rated torque in a ms, {before:.4} before, {:.4} after",
                    last / torque
                );
                assert!(run.pair.controller.out.start_state == StartState::Running, "{about}");
                assert!(step < STEP, "{about}: {step} of the rated torque in a millisecond");
                assert!((last / torque - before).abs() < 2e-3, "{about}: {before} before, {} after", last / torque);
            }
        }
    }
}

/// The voltage (V) of the link.
fn link(tuned: &Tuned) -> f64 {
    tuned.pair().plant.model.inputs.u_dc
}
