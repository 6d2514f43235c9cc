//! Field weakening without a sensor: the drive reaches its speed and stays there, with every estimator.

use drive::Pair;
use drive::control::start::StartMode;
use drive::estimator::{Class, Kind};
use drive::motor::Motor;
use std::f64::consts::{PI, TAU};

const RPM: f64 = PI / 30.0;

/// Minimum and maximum speed in rpm and maximum `lock_lost` in the last three seconds, after a ramp to `target` (rpm) within
/// two seconds and a load of `tau` (N.m).
fn settled(mut pair: Pair, target: f64, tau: f64, u_dc: f64) -> (f64, f64, f64) {
    let (mut low, mut high, mut lost) = (f64::INFINITY, 0.0_f64, 0.0_f64);
    pair.set_inputs(0.0, 0.0, u_dc);
    pair.start().unwrap();
    for k in 0..80_000_u32 {
        let t = 1e-4 * f64::from(k);
        let speed = (target * ((t - 0.6) / 2.0)).clamp(300.0, target);
        pair.set_inputs(speed * RPM, if t > 2.0 { tau } else { 0.0 }, u_dc);
        pair.step(1e-4).unwrap();
        if t > 5.0 {
            let speed = pair.plant.out.speed / RPM;
            (low, high) = (low.min(speed), high.max(speed));
            lost = lost.max(pair.controller.out.lock_lost);
        }
    }
    (low, high, lost)
}

/// The start values with field weakening; without the tracker's minimum bandwidth, 4235 to 4730 rpm.
#[test]
fn the_start_values_hold_4500_rpm() {
    let mut wrong = Vec::new();
    for &kind in Kind::ALL.iter().filter(|kind| !kind.class().injects()) {
        let mut pair = Pair::default();
        let par = &mut pair.controller.model.parameters;
        (par.estimator, par.weakening.used) = (kind, true);
        if kind.class() == Class::BackEmf {
            par.start.mode = StartMode::CurrentFrequency;
        }
        if kind == Kind::VoltageFeedback {
            (par.weakening.k_u, par.weakening.k_t) = (0.9, 0.9);
            (par.current.reference_feed_forward, par.current.integral) = (true, 0.2);
            par.estimators.emf.bandwidth = TAU * 300.0;
        }
        let (low, high, lost) = settled(pair, 4500.0, 1.0, 325.0);
        println!("{}: {low:.1} to {high:.1} rpm, lock_lost {lost:.3}", kind.name());
        if low < 4499.0 || high > 4501.0 || lost > 0.05 {
            wrong.push(format!("{}: {low:.1} to {high:.1} rpm, lock_lost {lost:.3}", kind.name()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Hybrid has a separate bandwidth above the speeds of injection.
#[test]
fn hybrid_holds_a_light_rotor() {
    let mut pair = Pair::default();
    let (plant, par) = (&mut pair.plant.model.parameters, &mut pair.controller.model.parameters);
    (plant.motor, par.motor) = (Motor::IPMSM_2_2_KW, Motor::IPMSM_2_2_KW);
    (plant.mechanics.J, par.J) = (0.012, 0.012);
    (par.estimator, par.weakening.used, par.current.mtpa) = (Kind::Hybrid, true, true);
    par.estimators.tracker.bandwidth = TAU * 40.0;
    (par.limit.i, par.limit.i_q) = (15.0, 15.0);
    let (low, high, lost) = settled(pair, 3500.0, 6.0, 540.0);
    assert!(low > 3499.0 && high < 3501.0 && lost < 0.05, "{low} to {high} rpm, lock_lost {lost}");
}
