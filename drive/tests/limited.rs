//! `voltage_limited` and `current_limited` are true exactly when the drive is at a limit.

use drive::{Pair, PmsmDrive};
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Model, Step, Warns};

const RPM: f64 = std::f64::consts::PI / 30.0;

/// Shares of 0.2 s in which voltage and current were limited, after `settle` (s) at `rpm` with the load `tau` (N.m) on a
/// link of `u_dc` (V).
fn shares(rpm: f64, tau: f64, u_dc: f64, settle: f64, set: impl FnOnce(&mut Pair)) -> (f64, f64) {
    let mut pair = Pair::default();
    set(&mut pair);
    pair.start().unwrap();
    let (mut voltage, mut current, mut k) = (0, 0, 0_u32);
    while f64::from(k) * 1e-4 < settle + 0.2 {
        let t = f64::from(k) * 1e-4;
        pair.set_inputs(rpm * RPM, if t > 0.3 { tau } else { 0.0 }, u_dc);
        pair.step(1e-4).unwrap();
        if t >= settle {
            let out = &pair.controller.out;
            (voltage, current) = (voltage + u32::from(out.voltage_limited), current + u32::from(out.current_limited));
        }
        k += 1;
    }
    (f64::from(voltage) / 2000.0, f64::from(current) / 2000.0)
}

#[test]
fn nothing_is_limited_in_steady_operation() {
    assert_eq!(shares(1000.0, 2.0, 325.0, 1.0, |_| ()), (0.0, 0.0));
    assert_eq!(shares(-1000.0, 2.0, 325.0, 1.0, |_| ()), (0.0, 0.0));
}

#[test]
fn a_speed_step_runs_at_the_current_limit() {
    let (voltage, current) = shares(3000.0, 0.0, 325.0, 0.0, |_| ());
    assert!(voltage < 0.05 && current > 0.2, "{voltage} {current}");
}

#[test]
fn a_load_above_the_limit_stays_there() {
    // 6 A give 4.05 N.m; the torque limit is also active.
    assert!(shares(1000.0, 4.5, 325.0, 0.35, |_| ()).1 > 0.95);
    assert!(shares(1000.0, 2.0, 325.0, 0.5, |p| p.controller.model.parameters.limit.tau = 1.5).1 > 0.95);
    let torque_mode = |tau_ref: f64| {
        move |p: &mut Pair| {
            let controller = &mut p.controller.model;
            (controller.parameters.speed_loop.torque_mode, controller.inputs.tau_ref) = (true, tau_ref);
        }
    };
    assert!(shares(0.0, 0.0, 325.0, 0.0, torque_mode(5.0)).1 > 0.95);
    assert!(shares(0.0, 0.0, 325.0, 0.0, torque_mode(-0.5)).1 < 0.05);
}

#[test]
fn a_low_link_limits_the_voltage() {
    // The EMF at 2000 rpm is 94 V; a hexagon of 150 V reaches 87 V in every direction.
    let (voltage, _) = shares(2000.0, 0.0, 150.0, 1.0, |_| ());
    assert!(voltage > 0.5, "{voltage}");
}

/// Warnings of `PmsmDrive` with their keys within a second at 1 ms, with the load `tau` (N.m) from 0.5 s on.
fn warnings(tau: f64, set: impl FnOnce(&mut PmsmDrive)) -> Vec<(&'static str, String)> {
    let mut drive = Block::<PmsmDrive>::default();
    set(&mut drive.model);
    drive.initialize();
    drive.model.validate().unwrap();
    let (mut now, mut logged) = (Elapsed::ZERO, Vec::new());
    for k in 0..1000_u32 {
        drive.model.inputs.speed_ref = 50.0;
        drive.model.inputs.tau_load = if k >= 500 { tau } else { 0.0 };
        let step = Step { start: now, h: 1e-3 };
        drive.step(&step).unwrap();
        now = step.end();
        let mut sink = |(_, key, message): fmu_core::log::Said<'_>| logged.push((key, message()));
        drive.model.warn(&mut Warnings::to(&mut sink));
    }
    logged
}

/// A load of more than twice the torque of the drive is reported once, by name, in either direction; a smaller load or the load
/// of an imposed shaft is not.
#[test]
fn a_load_far_above_the_torque_is_reported_once() {
    for (tau, reported) in [(100.0, true), (-100.0, true), (3.0, false), (-3.0, false)] {
        let logged = warnings(tau, |_| ());
        let loads: Vec<_> = logged.iter().filter(|(key, _)| *key == "tau_load").collect();
        assert_eq!(loads.len(), usize::from(reported), "{tau} N.m: {logged:?}");
        for (_, message) in loads {
            for part in [&format!("tau_load = {tau} N.m"), "tau_min", "4.05 N.m", "controller.limit.i"] {
                assert!(message.contains(part), "{part}: {message}");
            }
        }
    }
    assert!(
        !warnings(100.0, |d| d.pair.plant.model.parameters.mechanics.imposed = true).iter().any(|w| w.0 == "tau_load")
    );
}

/// At the maximum bandwidth, the current stays near its limit; a refused drive exceeds it by far.
#[test]
fn the_current_loop_holds_its_limit_at_the_bound() {
    let greatest = |T_s: f64, active: bool| {
        let mut pair = Pair::default();
        let par = &mut pair.controller.model.parameters;
        (par.T_s, par.current.active_resistance) = (T_s, active);
        pair.set_inputs(0.0, 0.0, 325.0);
        pair.initialize();
        let (mut t, mut most) = (0.0, 0.0_f64);
        while t < 1.0 {
            pair.set_inputs(if t > 0.2 { 80.0 } else { 0.0 }, if t > 0.6 { 2.0 } else { 0.0 }, 325.0);
            pair.step(T_s).unwrap();
            t += T_s;
            most = most.max(pair.plant.out.i_d.hypot(pair.plant.out.i_q));
        }
        most
    };
    for active in [false, true] {
        let (bound, beyond) = (greatest(2.4e-4, active), greatest(1e-3, active));
        println!("active resistance {active}: {bound} A at the bound, {beyond} A at 1 ms, limit 7.5 A");
        // The limit at modulation covers one sample: it maintains the first and bounds the second.
        assert!(bound < 1.01 * 7.5 && beyond > 1.5 * 7.5, "{bound} {beyond} A");
    }
}
