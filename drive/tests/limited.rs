//! `voltage_limited` and `current_limited` say that the drive is at a limit, and only then.
#![allow(missing_docs)]

use drive::Pair;

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
    // 6 A give 4.05 N.m; the torque limit acts as well.
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
