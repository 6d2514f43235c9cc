//! The output `start_state` with every estimator and every start: during a run, after a trip, and when the drive starts anew.

use StartState::{Aligning, Idle, Ramping, Running};
use drive::Pair;
use drive::control::start::{StartMode, StartState};
use drive::control::trip::Cause;
use drive::estimator::Kind;
use drive::motor::Motor;
use std::f64::consts::TAU;

const T_S: f64 = 1e-4;
/// Times of the I-f start in s.
const ALIGN: f64 = 0.03;
const RAMP: f64 = 0.06;
const SETTLE: f64 = 0.04;

/// A 2.2 kW machine with saturation.
fn drive(kind: Kind, mode: StartMode) -> Pair {
    let mut pair = Pair::default();
    let plant = &mut pair.plant.model.parameters;
    (plant.motor, plant.mechanics.J) = (Motor::IPMSM_2_2_KW, 0.015);
    (plant.saturation.s_2, plant.saturation.s_3) = (40.0, 40.0);
    let par = &mut pair.controller.model.parameters;
    par.s_2 = 40.0;
    (par.estimator, par.motor, par.J) = (kind, Motor::IPMSM_2_2_KW, 0.015);
    (par.current.bandwidth, par.speed_loop.bandwidth) = (TAU * 200.0, TAU * 5.0);
    (par.limit.i, par.limit.i_q, par.limit.tau) = (15.0, 15.0, 100.0);
    par.current.reference_feed_forward = kind == Kind::VoltageFeedback;
    let start = &mut par.start;
    (start.mode, start.i, start.t_align, start.settle) = (mode, 8.0, ALIGN, SETTLE);
    (start.speed, start.acceleration) = (30.0, 30.0 / RAMP);
    pair.set_inputs(30.0, 0.0, 540.0);
    pair
}

/// Steps for `seconds`; returns the states and the number of samples of each. At every sample, the torque limits are those of a start
/// (0) or of the loops, and the controller is enabled or rests, as the state says.
fn states(pair: &mut Pair, seconds: f64) -> Vec<(StartState, u32)> {
    let mut all: Vec<(StartState, u32)> = Vec::new();
    let mut t = 0.0;
    while t < seconds - 0.5 * T_S {
        pair.step(T_S).unwrap();
        t += T_S;
        let out = &pair.controller.out;
        let state = out.start_state;
        assert_eq!(state == Running, out.tau_max > 0.0, "{state:?}: {} N.m", out.tau_max);
        assert_eq!(state == Idle, !out.enabled, "{state:?}: enabled = {}", out.enabled);
        match all.last_mut() {
            Some((last, n)) if *last == state => *n += 1,
            _ => all.push((state, 1)),
        }
    }
    all
}

/// The states without their numbers.
fn names(states: &[(StartState, u32)]) -> Vec<StartState> {
    states.iter().map(|&(state, _)| state).collect()
}

#[test]
fn every_estimator_and_every_start_shows_its_state() {
    let samples = |seconds: f64| (seconds / T_S).round();
    for &kind in Kind::ALL {
        for mode in [StartMode::Direct, StartMode::CurrentFrequency, StartMode::Injection] {
            let mut pair = drive(kind, mode);
            if let Err(fault) = pair.start() {
                let refused = mode == StartMode::Injection && !kind.class().injects();
                assert!(refused, "{kind:?}, {mode:?}: {}", fault.message());
                continue;
            }
            assert_eq!(pair.controller.out.start_state, Idle, "{kind:?}, {mode:?} before the first command");
            let found = states(&mut pair, 0.5);
            match mode {
                StartMode::Direct => assert_eq!(names(&found), [Running], "{kind:?}"),
                StartMode::Injection => assert_eq!(names(&found), [Aligning, Running], "{kind:?}"),
                StartMode::CurrentFrequency => {
                    assert_eq!(names(&found), [Aligning, Ramping, Running], "{kind:?}");
                    for ((_, n), expected) in found.iter().zip([2.0 * ALIGN, RAMP + SETTLE]) {
                        assert!((f64::from(*n) - samples(expected)).abs() <= 3.0, "{kind:?}: {found:?}");
                    }
                }
            }
        }
    }
}

/// The I-f start waits for a reference; a trip, an active short circuit and `enable` lead to Idle, and the start begins anew.
#[test]
fn a_trip_and_a_new_start_show_in_the_state() {
    let mut pair = drive(Kind::ExtendedEmf, StartMode::CurrentFrequency);
    let trip = &mut pair.controller.model.parameters.trip;
    (trip.used, trip.i, trip.u_dc) = (true, 60.0, 600.0);
    pair.set_inputs(0.0, 0.0, 540.0);
    pair.start().unwrap();
    assert_eq!(names(&states(&mut pair, 5.0 * ALIGN)), [Aligning], "without a reference");
    pair.set_inputs(-30.0, 0.0, 540.0);
    assert_eq!(names(&states(&mut pair, 0.5 * RAMP)), [Ramping]);
    pair.set_inputs(-30.0, 0.0, 610.0);
    let tripped = states(&mut pair, 3.0 * T_S);
    assert_eq!((names(&tripped), pair.controller.out.tripped), (vec![Idle], Cause::OverVoltage));
    pair.set_inputs(-30.0, 0.0, 540.0);
    assert_eq!(names(&states(&mut pair, 2.0 * ALIGN)), [Idle], "the trip stays until enable falls");
    pair.controller.model.inputs.enable = false;
    assert_eq!(names(&states(&mut pair, 0.1)), [Idle]);
    pair.controller.model.inputs.enable = true;
    let again = names(&states(&mut pair, 2.0 * ALIGN + RAMP + SETTLE + 0.05));
    assert_eq!(again, [Aligning, Ramping, Running], "a new start");
    pair.controller.model.inputs.asc = true;
    assert_eq!(names(&states(&mut pair, 2.0 * T_S)), [Idle], "short-circuited");
    pair.controller.model.inputs.asc = false;
    assert_eq!(names(&states(&mut pair, 0.5 * ALIGN)), [Aligning]);
}

/// A drive that measures its resistance follows no reference before that.
#[test]
fn the_measurement_of_the_resistance_is_a_part_of_the_start() {
    let mut pair = drive(Kind::Rasmussen, StartMode::Direct);
    pair.controller.model.parameters.estimators.adaptation.resistance = true;
    pair.start().unwrap();
    let (mut samples, mut speed) = (0_u32, 0.0_f64);
    while pair.controller.model.measures_resistance() {
        pair.step(T_S).unwrap();
        (samples, speed) = (samples + 1, speed.max(pair.controller.out.speed_est.abs()));
        assert_eq!(pair.controller.out.start_state, Aligning, "sample {samples}");
    }
    assert!(samples > 100, "{samples} samples");
    assert_eq!(names(&states(&mut pair, 0.1)), [Running]);
}
