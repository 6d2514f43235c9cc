//! A drive with gains that suit its estimator.

use drive::Pair;
use drive::estimator::Kind;
use drive::estimator::kalman::KalmanParameters;
use drive::motor::Motor;
use std::f64::consts::TAU;

pub(crate) const T_S: f64 = 1e-4;
/// Rated mechanical speed in rad/s.
pub(crate) const RATED: f64 = TAU * 25.0;

/// The 2.2 kW machine without friction, all options at their start values, with gains that suit the estimator.
pub(crate) fn drive(kind: Kind) -> Pair {
    let mut pair = Pair::default();
    let plant = &mut pair.plant.model.parameters;
    plant.motor = Motor::IPMSM_2_2_KW;
    (plant.mechanics.J, plant.mechanics.B, plant.mechanics.tau_coulomb) = (0.015, 0.0, 0.0);
    let par = &mut pair.controller.model.parameters;
    (par.estimator, par.motor, par.J) = (kind, Motor::IPMSM_2_2_KW, 0.015);
    par.current.bandwidth = TAU * 200.0;
    (par.speed_loop.bandwidth, par.speed_loop.b) = (TAU * 5.0, 1.0);
    (par.limit.i, par.limit.i_q, par.limit.tau) = (15.0, 15.0, 100.0);
    (par.start.i, par.start.speed) = (8.0, 0.2 * RATED);
    par.estimators.kalman = KalmanParameters::new(0.545, TAU * 20.0, 0.15 * RATED, 0.01, T_S);
    match kind {
        Kind::VoltageFeedback => {
            (par.current.reference_feed_forward, par.current.integral) = (true, 0.2);
            (par.estimators.tracker.bandwidth, par.estimators.emf.bandwidth) = (TAU * 15.0, TAU * 300.0);
        }
        Kind::FluxObserver => par.estimators.tracker.bandwidth = TAU * 60.0,
        Kind::GradientObserver | Kind::Hybrid | Kind::SquareWaveInjection | Kind::NearPwmInjection => {
            par.estimators.tracker.bandwidth = TAU * 40.0;
        }
        _ => {}
    }
    pair.set_inputs(0.0, 0.0, 540.0);
    pair
}

/// Turning at `speed` (rad/s), with the estimator at the same speed.
pub(crate) fn turning(mut pair: Pair, speed: f64) -> Pair {
    pair.plant.model.parameters.initial.speed = speed;
    pair.controller.model.parameters.speed_est = speed;
    pair.controller.model.inputs.speed_ref = speed;
    pair
}
