use super::*;
use drive_base::frame::{Dq, Rotor};
use drive_plant::machine::flux;

const T_S: f64 = 1e-4;
/// Reach of the reference drive.
const REACH: Reach = Reach { integral: 5.0, acceleration: 2000.0, lag: 0.0 };
/// Its torque in N.m.
const TAU_MAX: f64 = 4.0;

/// `lock_lost` for an estimate `theta_tilde` (rad) off a loaded rotor turning at `w` (rad/s), estimated as `w_hat`.
fn beside(theta_tilde: f64, w: f64, w_hat: f64) -> f64 {
    let (motor, i) = (Motor { L_q: 9e-3, ..Motor::default() }, Dq::new(-1.0, 4.0));
    let gains = LockGains::new(&LockParameters { u: 1e-9, ..LockParameters::default() }, &motor, T_S, REACH);
    let at = |theta: f64, v: Dq| -> AlphaBeta { Axis::<Rotor>::at(theta).to_stator(v) };
    let (mut lock, mut level) = (Lock::default(), 0.0);
    for k in 0..10_000 {
        let (t, last) = (T_S * f64::from(k), T_S * f64::from(k - 1));
        let (i_now, i_last) = (at(w * t, i), at(w * last, i));
        let u = (at(w * t, flux(&motor, i)) - at(w * last, flux(&motor, i))) * (1.0 / T_S)
            + (i_now + i_last) * (0.5 * motor.R_s);
        let sample = Sample { i: i_now, i_last, u, ..Sample::default() };
        level =
            lock.update(&gains, &motor, motor.R_s, &sample, Axis::at(w_hat * t - theta_tilde), (w_hat, None, TAU_MAX));
    }
    level
}

#[test]
fn an_angle_error_is_measured_by_the_emf() {
    assert!(beside(0.0, 300.0, 300.0) < 1e-9);
    // Without saliency it would be exactly 1; here (L_q - L_d) i adds to the back EMF.
    for (degrees, expected) in [(-30.0_f64, 1.0), (30.0, 1.0), (180.0, 1.0 / 15.0_f64.to_radians().sin())] {
        let level = beside(degrees.to_radians(), -300.0, -300.0);
        assert!((level / expected - 1.0).abs() < 0.1, "{degrees} deg: {level}");
    }
}

#[test]
fn a_wrong_speed_is_seen() {
    let level = beside(0.0, 0.0, 300.0);
    assert!(level > 1.5, "a rotor at rest, the estimate running: {level}");
    let level = beside(0.0, 300.0, 1.0);
    assert!(level > 5.0, "a rotor that runs, the estimate at rest: {level}");
}

/// A machine at rest with the current (3, 4) A in the estimated frame and the resistance `R` (Ohm).
fn at_rest(R: f64, gains: &LockGains) -> f64 {
    let (motor, i) = (Motor::default(), AlphaBeta::new(3.0, 4.0));
    let sample = Sample { i, i_last: i, u: i * R, ..Sample::default() };
    let mut lock = Lock::default();
    let mut update = || lock.update(gains, &motor, motor.R_s, &sample, Axis::at(0.0), (0.0, None, TAU_MAX));
    (0..10_000).map(|_| update()).last().unwrap()
}

/// 30 % of R^ explain themselves; of 60 %, the other 30 % remain: 0.3 * 2 Ohm * 5 A = 3 V.
#[test]
fn a_wrong_resistance_explains_its_voltage() {
    let gains = LockGains::new(&LockParameters::default(), &Motor::default(), T_S, REACH);
    // The root of the rounding of 9 V2.
    assert!(at_rest(2.6, &gains) < 1e-7 && at_rest(1.4, &gains) < 1e-7);
    assert!((at_rest(3.2, &gains) - 0.6).abs() < 1e-3 && (at_rest(0.8, &gains) - 0.6).abs() < 1e-3);
}

/// S after `seconds` with the frame turning at `w` and the reference `w_ref` (rad/s).
fn followed(watch: &mut Following, w: f64, w_ref: f64, seconds: f64, confirmed: bool) -> f64 {
    let gains = LockGains::new(&LockParameters::default(), &Motor::default(), T_S, REACH);
    let (start, mut t) = (watch.d.beta().atan2(watch.d.alpha()), 0.0);
    while t < seconds {
        t += T_S;
        let d = Axis::<Estimated>::at(start + w * t).to_stator(DqHat::new(1.0, 0.0));
        watch.update(&gains, d, (w, Some(w_ref)), TAU_MAX, confirmed);
    }
    watch.S
}

/// An error of 10 rad/s is reported after S_0 / 10 = 0.8 s; a moving reference is allowed the time that half of the torque
/// needs; the EMF resets S.
#[test]
fn a_speed_that_is_not_reached_is_seen() {
    // Less the lag 1 / SMOOTH = 23 ms.
    let S = followed(&mut Following::default(), 10.0, 0.0, 0.4, false);
    assert!((S - (0.4 - 1.0 / SMOOTH) * 10.0 / 8.0).abs() < 0.01, "{S}");
    // w_0 = 5 / 3 rad/s.
    assert!(followed(&mut Following::default(), 1.6, 0.0, 20.0, false) < 1e-9);
    assert!(followed(&mut Following::default(), 2.0, 0.0, 20.0, false) > 1.9);
    // The model moves with 4000 rad/s2: with a = 1 / SMOOTH, 4000 (T^2 / 2 - a T + a^2 (1 - e^{-T/a})) in T = 0.04 s to a
    // frame that stays, 0 to one as fast.
    let S = followed(&mut Following::default(), 0.0, 400.0, 0.04, false);
    let (T, a) = (0.04, 1.0 / SMOOTH);
    let area = 4000.0 * (0.5 * T * T - a * T + a * a * (1.0 - (-T / a).exp()));
    assert!((S - area / 8.0).abs() < 0.02, "{S}, not {}", area / 8.0);
    let mut watch = Following::default();
    (0..100).for_each(|k| assert!(followed(&mut watch, 4.0 * f64::from(k), 400.0, 1e-3, false) < 0.02));
    let mut watch = Following::default();
    assert!(followed(&mut watch, 0.0, 400.0, 0.3, false) > 1.0);
    assert!(followed(&mut watch, 0.0, 400.0, T_S, true) < 1e-12);
}

/// A frame with a noisy speed, as with injection, that is right on average: +-20 rad/s, 100 times a second.
#[test]
fn a_noisy_speed_is_no_loss() {
    let mut watch = Following::default();
    for k in 0..400 {
        let w = if k % 2 == 0 { 20.0 } else { -20.0 };
        assert!(followed(&mut watch, w, 0.0, 5e-3, false) < 0.1, "{}", watch.S);
    }
}

/// A slipping rotor turns its EMF in the estimated frame; at 100 Hz, w psi_M of both, at right angles, remains of 60 V.
#[test]
fn a_rotor_that_is_driven_against_the_frame_is_seen() {
    for (w, w_hat) in [(-600.0, 20.0), (300.0, -300.0), (-900.0, 300.0)] {
        let level = beside(0.0, w, w_hat);
        assert!(level > 1.5, "{w} against {w_hat} rad/s: {level}");
    }
}

/// A frame that turns by a quarter turn or more in a sample would otherwise vanish in the division by its speed.
#[test]
fn a_frame_that_runs_away_is_lost() {
    let level = beside(0.0, 300.0, 0.6 * PI / T_S);
    assert!(level > 0.99 * LOST, "{level}");
}

/// W of a speed that swings by `swing` (rad/s) with 10 rad/s about a reference for a second.
fn swung(gains: &LockGains, swing: impl Fn(f64) -> f64) -> f64 {
    let mut watch = Following::default();
    (0..10_000)
        .map(|k| {
            watch.swings(gains, swing(T_S * f64::from(k)));
            watch.W
        })
        .fold(0.0, f64::max)
}

/// Half-waves that alternate count, one excursion and its overshoot do not, and neither does a swing that is small.
#[test]
fn a_swing_is_seen() {
    let gains = LockGains::new(&LockParameters::default(), &Motor::default(), T_S, REACH);
    assert!(swung(&gains, |t| 90.0 * (30.0 * t).sin()) > 1.0);
    assert!(swung(&gains, |t| gains.swing * (30.0 * t).sin()) < 1e-9);
    assert!(swung(&gains, |t| 90.0 * (30.0 * t).sin().abs()) < 1e-9, "a drive at its limit");
    // A load step: the maximum is 8 rad, the overshoot a third of it.
    let step = |t: f64| {
        if t < 0.1 {
            80.0
        } else if t < 0.15 {
            -53.0
        } else {
            0.0
        }
    };
    assert!(swung(&gains, step) < 0.4);
}

/// The speed loop rises from zero torque to i_q = 6 A over 6 A / K_i = 1.6875 rad; both count pole pairs. The set-point
/// weight 0.5 leaves half of a change to the integral part, with 4 / (80 rad/s).
#[test]
fn the_gains_know_the_reach_of_the_speed_loop() {
    let mut controller = crate::SensorlessController::default();
    fmu_core::Model::derive(&mut controller);
    let reach = Reach { integral: 3.0 * 1.6875, acceleration: 3.0 / 1.5e-3, lag: 0.5 * 4.0 / 80.0 };
    let expected = LockGains::new(&LockParameters::default(), &controller.parameters.motor, T_S, reach);
    let of = |gains: &LockGains| [gains.w_0, gains.integrates, gains.follows, gains.lags];
    for (gain, expected) in of(&controller.gains.lock).into_iter().zip(of(&expected)) {
        assert!((gain / expected - 1.0).abs() < 1e-9, "{gain}, not {expected}");
    }
}

/// Once the speed is right again, S decays with 8 lock.time = 0.4 s.
#[test]
fn what_has_been_seen_is_forgotten_in_eight_times_the_time() {
    let mut watch = Following { S: 1.0, ..Following::default() };
    for expected in [(-1.0_f64).exp(), (-2.0_f64).exp()] {
        let S = followed(&mut watch, 0.0, 0.0, 0.4, false);
        assert!((S - expected).abs() < 1e-3, "{S}, not {expected}");
    }
}

/// The voltage is smoothed at 50 Hz: 1 - 1/e after 3.2 ms.
#[test]
fn the_voltage_is_smoothed_at_50_hz() {
    let (motor, T_s) = (Motor::default(), 1e-6);
    let gains = LockGains::new(&LockParameters::default(), &motor, T_s, REACH);
    let sample = Sample { u: AlphaBeta::new(2.0, 0.0), ..Sample::default() };
    let mut lock = Lock::default();
    for _ in 0..=3183 {
        lock.update(&gains, &motor, motor.R_s, &sample, Axis::at(0.0), (0.0, None, 0.0));
    }
    assert!((lock.e.d() / 2.0 - 1.0 + (-1.0_f64).exp()).abs() < 1e-3, "{:?}", lock.e);
}
