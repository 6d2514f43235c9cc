//! The figures of the Kim & Sul review in closed loop: tolerance 10 % or 0.3 deg unless stated otherwise.
#![allow(missing_docs, non_snake_case)]

#[path = "common/rated.rs"]
mod rated;

use drive::Pair;
use drive::control::start::StartMode;
use drive::control::tables::ControllerParameters;
use drive::estimator::Kind;
use drive_study::runner::{drive as preset, *};
use rated::{load_step, slowed_down, steady};
use std::f64::consts::TAU;

const ON_THE_EMF: [Kind; 3] = [Kind::DirectEmf, Kind::EmfObserver, Kind::ExtendedEmf];
const MODELS: [Kind; 2] = [Kind::VoltageModel, Kind::CurrentModel];

fn near(what: &str, kind: Kind, measured: f64, expected: f64, tolerance: f64) {
    let name = kind.name();
    assert!((measured - expected).abs() <= tolerance, "{name}, {what}: {measured}, expected {expected} ± {tolerance}");
}

/// The preset with other parameters in the controller.
fn with(kind: Kind, change: impl Fn(&mut ControllerParameters)) -> Pair {
    let mut pair = preset(kind);
    change(&mut pair.controller.model.parameters);
    pair
}

#[test]
fn steady_error_at_rated_load() {
    for kind in ON_THE_EMF.into_iter().chain(MODELS).chain([Kind::VoltageFeedback, Kind::KalmanFilter]) {
        for steady in [slowed_down(preset(kind), 0.1), steady(preset(kind), 0.5, 1.0), steady(preset(kind), 1.0, 1.0)] {
            near("steady error", kind, steady.angle.mean(), 0.0, 0.1);
            assert!(steady.holds() && steady.angle.std() < 0.3, "{}: {steady:?}", kind.name());
        }
    }
}

#[test]
fn rated_load_is_held_down_to() {
    let held = |kind, ideal, compensated| {
        for (pair, speed) in [(preset(kind), ideal), (with_dead_time(preset(kind), true), compensated)] {
            let steady = slowed_down(pair, speed);
            assert!(steady.holds(), "{} at {speed} pu: {steady:?}", kind.name());
        }
    };
    held(Kind::DirectEmf, 0.10, 0.10);
    for kind in [Kind::EmfObserver, Kind::ExtendedEmf, Kind::VoltageModel, Kind::CurrentModel, Kind::KalmanFilter] {
        held(kind, 0.03, 0.05);
    }
    held(Kind::VoltageFeedback, 0.02, 0.05);
}

#[test]
fn a_wrong_l_q_turns_the_estimate() {
    for kind in ON_THE_EMF.into_iter().chain(MODELS).chain([Kind::VoltageFeedback, Kind::KalmanFilter]) {
        let error = |factor: f64| steady(with(kind, |p| p.motor.L_q *= factor), 0.5, 1.0).angle.mean();
        let expected = if MODELS.contains(&kind) { 5.5 } else { 5.8 };
        near("L_q + 20 %", kind, error(1.2), expected, 0.3);
        near("L_q - 20 %", kind, error(0.8), -5.9, 0.3);
    }
}

#[test]
fn a_wrong_r_turns_the_estimate_at_low_speed() {
    for kind in ON_THE_EMF.into_iter().chain([Kind::VoltageFeedback, Kind::KalmanFilter]) {
        let error = |factor: f64| slowed_down(with(kind, |p| p.motor.R_s *= factor), 0.1).angle.mean();
        near("R + 20 %", kind, error(1.2), 1.3, 0.3);
        near("R - 20 %", kind, error(0.8), -1.3, 0.3);
    }
}

#[test]
fn half_a_load_step_at_half_the_speed() {
    let expected = [
        (Kind::DirectEmf, 0.093, 3.9),
        (Kind::EmfObserver, 0.092, 3.8),
        (Kind::ExtendedEmf, 0.092, 3.8),
        (Kind::VoltageModel, 0.070, 1.5),
        (Kind::CurrentModel, 0.070, 1.5),
        (Kind::VoltageFeedback, 0.102, 6.6),
        // Not in the review: better than ExtendedEmf, because at this speed its bandwidth is three times the tracker's.
        (Kind::KalmanFilter, 0.073, 0.7),
    ];
    for (kind, dip, peak) in expected {
        let measured = load_step(preset(kind), 0.5, 0.5);
        near("dip", kind, measured.0, dip, 0.1 * dip);
        near("peak angle error", kind, measured.1, peak, (0.1 * peak).max(0.3));
    }
}

#[test]
fn speed_bandwidths() {
    for kind in ON_THE_EMF.into_iter().chain([Kind::VoltageFeedback]) {
        near("speed bandwidth", kind, speed_bandwidth(&preset(kind), 0.5), 10.6, 1.06);
    }
    // The bandwidths in the review's list (26 and 60 Hz) apply to a faster speed loop.
    for kind in MODELS.into_iter().chain([Kind::KalmanFilter]) {
        let fast = with(kind, |p| p.speed_loop.bandwidth = TAU * 26.0);
        near("speed bandwidth", kind, speed_bandwidth(&fast, 0.5), 52.0, 5.2);
    }
    let observed = with(Kind::ExtendedEmf, |p| {
        p.speed_loop.bandwidth = TAU * 60.0;
        (p.estimators.tracker.kind, p.estimators.tracker.bandwidth) =
            (drive::estimator::tracker::TrackerKind::MechanicalObserver, TAU * 15.0);
    });
    near("with the mechanical observer", Kind::ExtendedEmf, speed_bandwidth(&observed, 0.5), 67.0, 6.7);
}

/// The bias of a Kalman filter due to noise grows with the square of the noise; in the rotor frame it stays small. The mean over
/// 0.5 s is itself uncertain by about std / sqrt(0.5 s w_0 / 2) = 0.015 deg.
#[test]
fn the_kalman_filter_makes_little_bias_of_noise() {
    let at = |noise: f64| slowed_down(with(Kind::KalmanFilter, |p| p.sensor.noise = noise), 0.1).angle.mean();
    let (once, twice) = (at(0.01), at(0.02));
    assert!(once.abs() < 0.03 && twice.abs() < 0.1, "{once} {twice} deg");
}

/// The magnitude of the EMF does not affect the angle: an error of 20 % in the magnet flux turns the angle by at most 0.15 deg.
#[test]
fn the_kalman_filter_looks_for_the_angle_along_the_magnet() {
    for factor in [0.8, 1.2] {
        let pair = with(Kind::KalmanFilter, |p| p.motor.psi_M *= factor);
        near("psi_M off by 20 %", Kind::KalmanFilter, steady(pair, 0.5, 1.0).angle.mean(), 0.0, 0.15);
    }
}

/// Without the frame-speed term 1-3 lose rated load below 0.21-0.25 of the rated speed.
#[test]
fn the_frame_term_is_needed() {
    for kind in ON_THE_EMF {
        let printed = with(kind, |p| p.estimators.emf.frame_term = false);
        let speeds: [f64; 12] = std::array::from_fn(|k| 0.01 * f64::from(30 - u32::try_from(k).unwrap()));
        let held = speeds.into_iter().take_while(|speed| slowed_down(printed.clone(), *speed).holds());
        let lowest = held.last().unwrap();
        let range = 0.9 * 0.21..=1.1 * 0.25;
        assert!(range.contains(&lowest), "{}: {lowest}, expected {range:?}", kind.name());
    }
    let printed = with(Kind::VoltageFeedback, |p| p.estimators.emf.frame_term = false);
    assert!(!slowed_down(printed, 0.1).holds(), "6 as printed fails at 0.1");
}

/// Without the integral L_q + 20 % loses 4 and 5 at half the rated speed.
#[test]
fn the_integral_is_needed() {
    for kind in MODELS {
        let printed = with(kind, |p| {
            p.motor.L_q *= 1.2;
            p.estimators.matsui.integral = false;
        });
        assert!(!steady(printed, 0.5, 1.0).holds(), "{}", kind.name());
    }
}

/// The figures have the sign of theta - theta^, and the sensored drive is their yardstick.
#[test]
fn sensored_yardstick() {
    for speed in [0.0, 0.5, 1.0] {
        let steady = steady(preset(Kind::Sensored), speed, 1.0);
        assert!(steady.holds() && steady.angle.peak < 1e-2, "{steady:?}");
    }
}

/// I-f start from 24 angles to half the speed, both ways, light and loaded, the dead time compensated: no failure.
#[test]
fn i_f_start_from_every_angle() {
    let emf = ON_THE_EMF.into_iter().chain(MODELS).chain([Kind::VoltageFeedback]);
    let starts = emf.flat_map(|kind| (0..24).map(move |k| (kind, k)));
    for (kind, k) in starts {
        let load = if k % 2 == 0 { 0.0 } else { 0.3 };
        let side = if k % 4 < 2 { 1.0 } else { -1.0 };
        let mut pair = with_dead_time(with(kind, |p| p.start.mode = StartMode::CurrentFrequency), true);
        pair.plant.model.parameters.initial.theta_e = (15.0 * f64::from(k)).to_radians();
        let mut peak = 0.0_f64;
        run(&mut pair, 2.0, |t, p| {
            p.controller.model.inputs.speed_ref = if t > 0.6 { side * 0.5 * RATED_SPEED } else { 0.0 };
            p.plant.model.inputs.tau_load = load * RATED_TORQUE * (p.plant.out.speed / 2.0).tanh();
            if t > 1.3 {
                peak = peak.max(rotor_ahead(p).abs());
            }
        });
        let speed = speed(&pair);
        assert!((speed - side * 0.5).abs() < 0.01, "{} from {} deg: {speed} pu", kind.name(), 15 * k);
        assert!(peak < 8.0, "{} from {} deg: {peak} deg off after the hand-over", kind.name(), 15 * k);
    }
}
