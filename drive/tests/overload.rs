//! A load that the drive cannot hold is reported in speed control by every drive; a start, a reversal and a load within its torque are
//! not.

use drive::control::estimator::Kind;
use drive::{MappedDrive, PmsmDrive, PmsmDriveMean};
use fmu_core::log::{Said, Warnings};
use fmu_core::{Block, Elapsed, Model, Step, Warns, integrate};

/// The first message with this key in 4 s with the speed references 50 rad/s, -50 rad/s after 2 s and the load `tau` (N.m) from 0.8 s on.
fn message<M: Model + Warns>(key: &str, mut block: Block<M>, tau: f64, set: fn(&mut M, f64, f64)) -> Option<String> {
    let (mut now, mut said) = (Elapsed::ZERO, None);
    for k in 0..4000 {
        set(&mut block.model, if k < 2000 { 50.0 } else { -50.0 }, if k < 800 { 0.0 } else { tau });
        if k == 0 {
            block.initialize();
            block.model.validate().unwrap();
        }
        let step = Step { start: now, h: 1e-3 };
        block.step(&step).unwrap();
        now = step.end();
        let mut sink = |(_, found, text): Said<'_>| {
            if found == key {
                said.get_or_insert_with(text);
            }
        };
        block.model.warn(&mut Warnings::to(&mut sink));
    }
    said
}

fn check(name: &str, tau_max: &str, message: impl Fn(f64) -> Option<String>) {
    for (tau, reported) in [(8.0, true), (-8.0, true), (3.0, false), (-3.0, false)] {
        let said = message(tau);
        println!("{name}, {tau} N.m: {said:?}");
        assert_eq!(said.is_some(), reported, "{name}, {tau} N.m: {said:?}");
        assert!(said.is_none_or(|text| text.contains(tau_max) && text.contains("speed_ref = 50")), "{name}, {tau} N.m");
    }
}

#[test]
fn a_load_above_the_torque_is_reported() {
    for estimator in [Kind::Rasmussen, Kind::Sensored] {
        check(&format!("{estimator:?}"), "tau_max = 4.05", |tau| {
            let mut block = Block::<PmsmDrive>::default();
            block.model.pair.controller.model.parameters.estimator = estimator;
            message("overload", block, tau, |m, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau))
        });
    }
    check("mean", "tau_max = 4.05", |tau| {
        let set = |m: &mut PmsmDriveMean, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau);
        message("overload", Block::<PmsmDriveMean>::default(), tau, set)
    });
    check("mapped", "tau_max = 6.0", |tau| {
        let set = |m: &mut MappedDrive, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau);
        message("overload", Block::<MappedDrive>::default(), tau, set)
    });
}

/// A load of a twentieth of the torque drives a shaft backward whose speed loop is a thousandth as strong; a usual loop holds it.
#[test]
fn a_loop_too_weak_for_its_load_is_reported() {
    for (share, reported) in [(1e-3, true), (1.0, false)] {
        let mut drive = Block::<PmsmDrive>::default();
        drive.model.pair.controller.model.parameters.estimator = Kind::Sensored;
        drive.model.pair.controller.model.parameters.speed_loop.bandwidth *= share;
        let set = |m: &mut PmsmDrive, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau);
        let mut said = vec![message("speed_loop", drive, 0.2, set)];
        let mut mean = Block::<PmsmDriveMean>::default();
        mean.model.drive.controller.speed_loop.bandwidth *= share;
        let set = |m: &mut PmsmDriveMean, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau);
        said.push(message("speed_loop", mean, 0.2, set));
        let mut mapped = Block::<MappedDrive>::default();
        mapped.model.speed_loop.bandwidth *= share;
        let set = |m: &mut MappedDrive, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau);
        said.push(message("speed_loop", mapped, 0.2, set));
        for text in said {
            assert_eq!(text.is_some(), reported, "{share}: {text:?}");
            assert!(text.is_none_or(|text| text.contains("the speed runs away from speed_ref = 50 rad/s")), "{share}");
        }
    }
}

/// The message about a speed reference (rad/s) that is not reached, in 12 s.
fn not_reached<M: Model + Warns>(set: impl FnOnce(&mut M)) -> Option<String> {
    said("speed_ref", set)
}

/// The first message with this key in 12 s.
fn said<M: Model + Warns>(of: &str, set: impl FnOnce(&mut M)) -> Option<String> {
    let (mut block, mut now, mut said) = (Block::<M>::default(), Elapsed::ZERO, None);
    set(&mut block.model);
    block.initialize();
    while now.seconds() < 12.0 {
        let step = Step { start: now, h: 1e-3 };
        block.step(&step).unwrap();
        now = step.end();
        block.model.warn(&mut Warnings::to(&mut |(_, key, text): Said<'_>| {
            if key == of {
                said.get_or_insert_with(text);
            }
        }));
    }
    said
}

/// A torque that follows in 2 s, or only on one side of standstill.
#[test]
fn a_speed_that_does_not_settle_is_reported() {
    let mean = |bandwidth: f64| {
        said("settles", |m: &mut PmsmDriveMean| {
            (m.drive.controller.current.bandwidth, m.inputs.speed_ref, m.inputs.tau_load) = (bandwidth, 50.0, 1.0);
        })
    };
    let mapped = |bandwidth: f64, peak: f64| {
        said("settles", |m: &mut MappedDrive| {
            (m.bandwidth, m.inputs.speed_ref, m.inputs.tau_load) = (bandwidth, 50.0, 1.0);
            m.map.tau_motor.fill(peak);
        })
    };
    for (name, text) in [("mean", mean(0.5)), ("mapped", mapped(0.5, 6.0)), ("one side", mapped(500.0, 0.6))] {
        let text = text.expect(name);
        println!("{name}: {text}");
        assert!(text.contains("does not settle at speed_ref = 50 rad/s"), "{name}: {text}");
    }
    assert_eq!((mean(500.0), mapped(500.0, 6.0), mapped(200.0, 6.0)), (None, None, None));
}

/// A torque slower than the speed loop is reported at the first step.
#[test]
fn bandwidths_in_the_wrong_order_are_reported() {
    let bandwidths = |bandwidth: f64, torque_mode: bool| {
        let mean = said("bandwidth", |m: &mut PmsmDriveMean| {
            let controller = &mut m.drive.controller;
            (controller.current.bandwidth, controller.speed_loop.torque_mode) = (bandwidth, torque_mode);
        });
        let mapped = said("bandwidth", |m: &mut MappedDrive| {
            (m.bandwidth, m.speed_loop.torque_mode) = (bandwidth, torque_mode);
        });
        [mean, mapped].map(Option::unwrap_or_default)
    };
    for text in bandwidths(20.0, false) {
        assert!(text.contains("speed_loop.bandwidth = 80 rad/s is above current.bandwidth = 20 rad/s"), "{text}");
    }
    assert_eq!([bandwidths(100.0, false), bandwidths(20.0, true)].concat(), [""; 4]);
}

/// Losses in mW, and tables for a voltage in kV, are reported at the first step.
#[test]
fn tables_in_another_unit_are_reported() {
    let losses = said("map.p_loss", |m: &mut MappedDrive| {
        m.map.p_loss.as_flattened_mut().iter_mut().for_each(|p| *p *= 1e3);
    });
    assert!(losses.is_some_and(|text| text.contains("check that map.p_loss is in W")));
    let voltage = said("map.u_dc", |m: &mut MappedDrive| m.map.u_dc *= 1e-3);
    assert!(voltage.is_some_and(|text| text.contains("u_dc = 325 V is more than 3 times map.u_dc = 0.325 V")));
    for key in ["map.p_loss", "map.u_dc"] {
        assert_eq!(said(key, |_: &mut MappedDrive| ()), None);
    }
}

/// 3000 rpm are 314 rad/s: 3000 rad/s are beyond the voltage of the link.
#[test]
fn a_speed_beyond_the_voltage_is_reported() {
    for (speed, reported) in [(300.0, false), (3000.0, true), (-3000.0, true)] {
        let drive = not_reached(|m: &mut PmsmDrive| m.inputs.speed_ref = speed);
        let weakening = not_reached(|m: &mut PmsmDrive| {
            (m.inputs.speed_ref, m.pair.controller.model.parameters.weakening.used) = (speed, true);
        });
        let mean = not_reached(|m: &mut PmsmDriveMean| m.inputs.speed_ref = speed);
        for (name, said) in [("drive", drive), ("weakening", weakening), ("mean", mean)] {
            println!("{name}, {speed} rad/s: {said:?}");
            assert_eq!(said.is_some(), reported, "{name}, {speed} rad/s: {said:?}");
            assert!(
                said.is_none_or(|text| text.contains(&format!("speed_ref = {speed} rad/s is not reached"))),
                "{name}"
            );
        }
    }
}

/// Whether the drive with this estimator says that it has lost the rotor, under a load (N.m) from 0.8 s on; blind: `lock_lost` reports
/// nothing; exchange: in Model Exchange.
fn slips(estimator: Kind, blind: bool, exchange: bool, tau: f64) -> Option<String> {
    let (mut block, mut now, mut said) = (Block::<PmsmDrive>::default(), Elapsed::ZERO, None);
    let par = &mut block.model.pair.controller.model.parameters;
    par.estimator = estimator;
    if blind {
        par.lock.time = 1e4;
    }
    block.initialize();
    for k in 0..4000 {
        let inputs = &mut block.model.inputs;
        (inputs.speed_ref, inputs.tau_load) = (if k < 2000 { 100.0 } else { -100.0 }, if k < 800 { 0.0 } else { tau });
        let step = Step { start: now, h: 1e-3 };
        if exchange {
            integrate::hybrid::<PmsmDrive, 5>(&mut block.model, &step, 50e-6).unwrap();
        } else {
            block.step(&step).unwrap();
        }
        now = step.end();
        block.model.warn(&mut Warnings::to(&mut |(_, key, text): Said<'_>| {
            if key == "slip" {
                said.get_or_insert_with(text);
            }
        }));
    }
    said
}

#[test]
fn a_rotor_that_the_controller_believes_to_have_is_reported() {
    for exchange in [false, true] {
        let said = slips(Kind::FluxObserver, true, exchange, 2.5).unwrap();
        println!("{said}");
        assert!(said.contains("the estimate has lost the rotor") && said.contains("speed_est = "), "{said}");
    }
    for estimator in [Kind::Rasmussen, Kind::VoltageModel, Kind::ExtendedEmf, Kind::KalmanFilter, Kind::Sensored] {
        for exchange in [false, true] {
            assert_eq!(slips(estimator, false, exchange, 1.0), None, "{estimator:?}, exchange: {exchange}");
        }
    }
}

/// If a drive is lost and its current loop is slower than its speed loop, the message names the bandwidths instead of the machine's data.
#[test]
fn a_current_loop_slower_than_the_speed_loop_is_named() {
    for estimator in [Kind::Rasmussen, Kind::Sensored] {
        let said = |bandwidth: f64, key| {
            let mut block = Block::<PmsmDrive>::default();
            let par = &mut block.model.pair.controller.model.parameters;
            (par.estimator, par.current.bandwidth) = (estimator, bandwidth);
            message(key, block, 0.5, |m, speed, tau| (m.inputs.speed_ref, m.inputs.tau_load) = (speed, tau))
        };
        let text = said(10.0, "bandwidth").expect("a message");
        assert!(text.starts_with("speed_loop.bandwidth = 80 rad/s is above current.bandwidth = 10 rad/s"), "{text}");
        assert_eq!(said(10.0, "lock_lost"), None, "{estimator:?}");
        assert_eq!(said(400.0, "bandwidth"), None, "{estimator:?}");
    }
}
