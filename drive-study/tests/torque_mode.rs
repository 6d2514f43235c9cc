//! Torque reference instead of speed control, and the ramp of the speed reference.
#![allow(missing_docs, non_snake_case)]

use drive::Pair;
use drive::estimator::Kind;
use drive::motor::Motor;
use drive_study::runner;
use fmu_core::Warns;

const T_S: f64 = 1e-4;

/// A drive on the sensor in torque mode, at 0.2 of the rated speed, after 50 ms of `tau_ref` (N.m).
fn torque(tau_ref: f64, set: impl FnOnce(&mut Pair)) -> Pair {
    let mut pair = runner::drive(Kind::Sensored);
    pair.controller.model.parameters.speed_loop.torque_mode = true;
    pair.plant.model.parameters.mechanics.J = 100.0;
    pair.plant.model.parameters.initial.speed = 0.2 * runner::RATED_SPEED;
    set(&mut pair);
    pair.start().unwrap();
    pair.controller.model.inputs.tau_ref = tau_ref;
    for _ in 0..500 {
        // The speed reference has no effect.
        pair.set_inputs(-1e3, 0.0, 540.0);
        pair.step(T_S).unwrap();
    }
    pair
}

#[test]
fn the_torque_is_the_reference() {
    for mtpa in [false, true] {
        for tau in [-10.0, -1.0, 0.0, 3.0, 14.0] {
            let pair = torque(tau, |pair| pair.controller.model.parameters.current.mtpa = mtpa);
            assert!((pair.plant.out.tau_e - tau).abs() < 0.15, "{tau} N.m: {}", pair.plant.out.tau_e);
            assert_eq!(pair.controller.out.i_ref.d < -1e-3, mtpa && tau != 0.0);
        }
    }
}

#[test]
fn within_the_limits() {
    let pair = torque(1e6, |pair| pair.controller.model.parameters.limit.tau = 5.0);
    assert!((pair.plant.out.tau_e - 5.0).abs() < 0.15, "limit.tau: {}", pair.plant.out.tau_e);
    let limited = |pair: &mut Pair| {
        let par = &mut pair.controller.model.parameters;
        (par.limit.i_q, par.current.mtpa) = (4.0, false);
    };
    let pair = torque(-1e6, limited);
    assert!((pair.controller.out.i_ref.q + 4.0).abs() < 1e-12, "limit.i_q: {:?}", pair.controller.out.i_ref);
}

#[test]
fn beside_the_low_speed_current() {
    // Rasmussen at standstill with a locked rotor: i_d = 5 A has priority over i_q, and the torque comes from i_q.
    let mut pair = Pair::default();
    pair.controller.model.parameters.speed_loop.torque_mode = true;
    pair.plant.model.parameters.mechanics.imposed = true;
    pair.start().unwrap();
    for tau in [0.675, -100.0] {
        pair.controller.model.inputs.tau_ref = tau;
        pair.set_inputs(0.0, 0.0, 325.0);
        pair.step(T_S).unwrap();
        pair.step(T_S).unwrap();
        let i_ref = pair.controller.out.i_ref;
        let i_q = (tau / 0.675).max(-(7.5 * 7.5 - i_ref.d * i_ref.d).sqrt());
        assert!((i_ref.q - i_q).abs() < 1e-9 && (i_ref.d - 5.0).abs() < 1e-2, "{tau} N.m: {i_ref:?}");
    }
}

#[test]
fn the_i_f_start_waits_for_a_torque() {
    let mut pair = runner::drive(Kind::ExtendedEmf);
    let par = &mut pair.controller.model.parameters;
    (par.speed_loop.torque_mode, par.start.mode) = (true, drive::control::start::StartMode::CurrentFrequency);
    pair.start().unwrap();
    let mut run = |tau: f64, samples: u32| {
        pair.controller.model.inputs.tau_ref = tau;
        for _ in 0..samples {
            pair.set_inputs(1.0, 0.0, 540.0);
            pair.step(T_S).unwrap();
        }
        pair.plant.out.speed
    };
    assert!(run(0.0, 8000).abs() < 0.5, "a speed reference does not start it");
    let speed = run(-2.0, 8000);
    assert!(speed < -0.2 * runner::RATED_SPEED, "{speed} rad/s: to the side of the torque, and on with it");
}

#[test]
fn the_ramp_leads_the_speed() {
    let mut pair = Pair::default();
    pair.controller.model.parameters.speed_loop.ramp = 100.0;
    pair.start().unwrap();
    let mut worst = 0.0_f64;
    for k in 0..10_000_u32 {
        pair.set_inputs(if k < 1000 { 0.0 } else { 50.0 }, 0.0, 325.0);
        pair.step(T_S).unwrap();
        let t = T_S * f64::from(k);
        if (0.2..0.6).contains(&t) {
            worst = worst.max((pair.plant.out.speed - 100.0 * (t - 0.1)).abs());
        }
    }
    // Set-point weight 0.5 and a slope: behind by slope (1 - b) t_is / w_s - ... , 2.5 rad/s at most.
    assert!(worst < 4.0, "{worst} rad/s beside the ramp");
    assert!((pair.plant.out.speed - 50.0).abs() < 0.2, "{}", pair.plant.out.speed);
}

/// A shaft that pulsates at half of its speed, like that of an engine: the observer follows with the angle error dw W / (W^2 +
/// w_n^2), and `lock_lost` reports an observer that does not follow. In all of them the current stays within its limit wherever
/// the hexagon allows.
#[test]
fn a_pulsating_shaft() {
    let (n_p, speed) = (21.0, 150.0);
    for (share, w_n, tau_ref, found) in [
        (0.1, 300.0, 0.0, true),
        (0.2, 600.0, 0.0, true),
        (0.3, 1200.0, 0.0, true),
        (0.7, 300.0, 0.0, false),
        (0.5, 300.0, 0.0, false),
        (0.5, 300.0, -7.5, false),
        (0.5, 600.0, -7.5, true),
    ] {
        let mut pair = Pair::default();
        let plant = &mut pair.plant.model;
        plant.parameters.motor = Motor { n_p: 21, R_s: 0.03, L_d: 60e-6, L_q: 60e-6, psi_M: 0.004 };
        plant.parameters.mechanics.imposed = true;
        let par = &mut pair.controller.model.parameters;
        par.motor = plant.parameters.motor.clone();
        (par.limit.i, par.limit.i_q, par.zero_speed.i_0, par.lock.u) = (60.0, 60.0, 20.0, 1.0);
        (par.speed_loop.torque_mode, par.speed_est, par.estimators.rasmussen.w_n) = (true, speed, w_n);
        plant.inputs.speed_shaft = speed;
        pair.set_inputs(0.0, 0.0, 48.0);
        pair.start().unwrap();
        let at = |t: f64| speed * (1.0 + share * (0.5 * speed * t).sin());
        let (mut angle, mut error, mut lost) = (0.0, 0.0_f64, 0.0_f64);
        let (mut most, mut cut, mut since) = (0.0_f64, 0, 0);
        for k in 0..15_000_u32 {
            let t = T_S * f64::from(k);
            let inputs = &mut pair.plant.model.inputs;
            (inputs.speed_shaft, inputs.angle_shaft) = (at(t), angle);
            angle += T_S * at(t + 0.5 * T_S);
            pair.controller.model.inputs.tau_ref = tau_ref;
            pair.step(T_S).unwrap();
            since = if pair.controller.out.voltage_limited { 0 } else { since + 1 };
            cut += u32::from(pair.controller.out.current_limited);
            // Once the hexagon has allowed the correction and it has acted.
            if since > 5 {
                most = most.max(pair.controller.model.inputs.i.to_stator().magnitude());
            }
            if k > 5000 {
                error = error.max(runner::rotor_ahead(&pair).abs());
                lost = lost.max(pair.controller.out.lock_lost);
            }
        }
        let W = 0.5 * speed;
        let expected = (n_p * share * speed * W / (W * W + w_n * w_n)).to_degrees();
        println!("+-{share}, {w_n} rad/s: {error} deg, expected {expected} deg, lock_lost {lost}, {most} A");
        // The EMF of a lost estimate is turned by up to 0.3 w T_s too little or too much in the first interval, twice that in the second.
        let w = n_p * speed * (1.0 + share);
        let off = if found { 0.02 * 60.0 } else { 3.0 * 0.3 * w * T_S * w * 0.004 * T_S / 60e-6 };
        assert!(most < 60.0 + off, "{most} A beyond the limit of 60 A by more than {off} A");
        assert!(found && tau_ref == 0.0 || cut > 0, "the limit should act");
        if found {
            assert!((error - expected).abs() < 0.15 * expected + 1.0, "{error} deg, not {expected} deg");
            assert!(lost < 0.8, "{lost}");
        } else {
            assert!(error > 60.0 && lost > 1.0, "{error} deg: {lost}");
        }
    }
}

/// The reference drive with R^ = `share` R and without a load, 2.7 s after `i_q` (A) of torque: the speed as a share of that at
/// full torque, and whether standstill was reported.
fn moved(share: f64, i_q: f64, set: impl FnOnce(&mut Pair)) -> (f64, bool) {
    let mut pair = Pair::default();
    let mechanics = &mut pair.plant.model.parameters.mechanics;
    (mechanics.J, mechanics.B, mechanics.tau_coulomb) = (0.05, 0.0, 0.0);
    let R = pair.plant.model.parameters.motor.R_s;
    let par = &mut pair.controller.model.parameters;
    (par.motor.R_s, par.J, par.speed_loop.torque_mode) = (share * R, 0.05, true);
    set(&mut pair);
    pair.start().unwrap();
    let (tau, mut said) = (i_q * pair.plant.model.parameters.motor.torque_constant(), false);
    for k in 0..30_000 {
        pair.controller.model.inputs.tau_ref = if k < 3000 { 0.0 } else { tau };
        pair.set_inputs(0.0, 0.0, 325.0);
        pair.step(T_S).unwrap();
        let mut hear = |(_, key, _): fmu_core::log::Said<'_>| said |= key == "stands";
        pair.controller.model.warn(&mut fmu_core::log::Warnings::to(&mut hear));
    }
    (pair.plant.out.speed / (2.7 * tau / 0.05), said)
}

/// With R^ < R the drive does not produce a torque below 0.4 of (2 - sqrt 2) i_0 sqrt((R - R^) i_0 / (psi_M c_1)), and reports
/// it; above the full value, and with R^ = R, the rotor turns.
#[test]
fn a_small_torque_that_moves_nothing_is_said() {
    let i_0 = 5.0_f64;
    let (share, c_1) = (0.9, 50.0);
    let threshold = (2.0 - 2.0_f64.sqrt()) * i_0 * ((1.0 - share) * 2.0 * i_0 / (0.15 * c_1)).sqrt();
    let set = |pair: &mut Pair| pair.controller.model.parameters.estimators.rasmussen.c_1 = c_1;
    let (below, said) = moved(share, 0.35 * threshold, set);
    assert!(below < 0.5 && said, "R^ = {share} R: {below} of the speed at 0.35 of {threshold} A, said: {said}");
    let (above, said) = moved(share, threshold, set);
    assert!(above > 0.8 && !said, "R^ = {share} R: {above} of the speed at {threshold} A, said: {said}");
    let (exact, said) = moved(1.0, 0.3, |_| ());
    assert!(exact > 0.8 && !said, "R^ = R: {exact} of the speed");
}

/// With `release`, a zero torque reference means no current, and a new torque reference turns the rotor; without it, i_0 flows,
/// and holds a small load if R^ < R.
#[test]
fn no_torque_releases_the_shaft() {
    for release in [false, true] {
        let mut pair = Pair::default();
        let par = &mut pair.controller.model.parameters;
        par.speed_loop.torque_mode = true;
        par.zero_speed.release = release;
        pair.start().unwrap();
        let mut run = |tau: f64, load: f64, samples: u32| {
            for _ in 0..samples {
                pair.controller.model.inputs.tau_ref = tau;
                pair.set_inputs(0.0, load, 325.0);
                pair.step(T_S).unwrap();
            }
            let i = pair.controller.model.inputs.i.to_stator().magnitude();
            (i, pair.plant.out.speed, pair.controller.out.tau_max)
        };
        let (i, _, most) = run(0.0, 0.0, 3000);
        assert_eq!(i > 4.9, !release, "release {release}: {i} A");
        assert!(
            (most - 0.675 * (7.5_f64 * 7.5 - 25.0).sqrt()).abs() < 1e-6,
            "the limit acts on the torque: {most} N.m"
        );
        let (_, speed, _) = run(0.0, -0.1, 2000);
        assert_eq!(speed > 5.0, release, "release {release}: {speed} rad/s under a load of 0.1 N.m");
        let (_, speed, _) = run(1.0, 0.0, 2000);
        assert!(speed > 60.0, "release {release}: {speed} rad/s after 0.2 s of 1 N.m");
    }
}
