//! The plant in Model Exchange when its gates switch off and on: the diodes block a current only once it has ended.
#![allow(missing_docs, clippy::float_cmp)]

use drive_base::frame::Phases;
use drive_plant::PmsmPlant;
use drive_plant::pwm::InverterMode;
use fmu_core::{Block, ContinuousTime, Elapsed, Events, Step};

const U: Phases = Phases { a: 40.0, b: -20.0, c: -20.0 };

/// i_d and i_q in A, and the derivatives of the two flux linkages in V.
fn electrical(block: &mut Block<PmsmPlant>, now: Elapsed) -> ([f64; 2], [f64; 2]) {
    let mut dx = vec![0.0; PmsmPlant::SCALARS];
    block.model.derivatives(now, &mut dx).unwrap();
    block.model.observe(now, &mut block.out);
    ([block.out.i_d, block.out.i_q], [dx[0], dx[1]])
}

#[test]
fn a_current_flows_on_through_the_diodes() {
    let mut block = Block::<PmsmPlant>::default();
    (block.model.inputs.enable, block.model.inputs.u) = (true, U);
    block.initialize();
    let step = Step { start: Elapsed::ZERO, h: 1e-3 };
    block.step(&step).unwrap();
    let ([i_d, i_q], driven) = electrical(&mut block, step.end());
    assert!(i_d.hypot(i_q) > 1.0, "{i_d} A, {i_q} A");
    block.model.inputs.enable = false;
    for event in [false, true] {
        if event {
            block.model.event(step.end()).unwrap();
        }
        let (i, braked) = electrical(&mut block, step.end());
        assert!((i[0] - i_d).abs() < 1e-9 && (i[1] - i_q).abs() < 1e-9, "{i:?} A, {event}");
        // The diodes put the link's voltage against the current.
        assert!(braked[0] * i_d + braked[1] * i_q < -100.0, "{braked:?} V after {driven:?} V");
    }
}

#[test]
fn blocked_diodes_leave_the_voltage_to_the_switches() {
    let mut block = Block::<PmsmPlant>::default();
    (block.model.inputs.enable, block.model.inputs.u) = (false, U);
    block.initialize();
    block.model.event(Elapsed::ZERO).unwrap();
    assert_eq!(electrical(&mut block, Elapsed::ZERO), ([0.0; 2], [0.0; 2]));
    block.model.inputs.enable = true;
    let (_, [d, q]) = electrical(&mut block, Elapsed::ZERO);
    assert!((d.hypot(q) - 40.0).abs() < 1.0, "{d} V, {q} V");
}

#[test]
fn the_diodes_end_a_current_that_is_small_enough() {
    for (i, ends) in [(1e-3, true), (1.0, false)] {
        let mut block = Block::<PmsmPlant>::default();
        block.model.inputs.enable = true;
        block.initialize();
        *PmsmPlant::STATES[0].at(&mut block.model) += i * block.model.parameters.motor.L_d;
        block.model.inputs.enable = false;
        let ([before, _], _) = electrical(&mut block, Elapsed::ZERO);
        assert!((before / i - 1.0).abs() < 1e-9, "{before} A");
        let changed = block.model.event(Elapsed::ZERO).unwrap().states_changed;
        let ([after, _], _) = electrical(&mut block, Elapsed::ZERO);
        assert_eq!((changed, after), (ends, if ends { 0.0 } else { before }), "{i} A");
    }
}

/// On the switched inverter, an event that ends no current leaves all of them.
#[test]
fn an_event_of_the_switches_leaves_the_currents() {
    let mut block = Block::<PmsmPlant>::default();
    block.model.parameters.inverter.pwm.mode = InverterMode::Switched;
    (block.model.inputs.enable, block.model.inputs.u) = (true, U);
    block.initialize();
    block.model.event(Elapsed::ZERO).unwrap();
    *PmsmPlant::STATES[0].at(&mut block.model) += 0.02;
    let (before, _) = electrical(&mut block, Elapsed::ZERO);
    assert!(before[0] > 1.0, "{before:?} A");
    for at in [0.0, 2e-5, 5e-5] {
        let now = Elapsed::ZERO.plus(at);
        block.model.event(now).unwrap();
        assert_eq!(electrical(&mut block, now).0, before, "{at} s");
    }
}

/// A step at a high speed is taken in parts of a small turn.
#[test]
fn a_long_step_is_as_exact_as_short_ones() {
    let run = |parts: u32| {
        let mut block = Block::<PmsmPlant>::default();
        let parameters = &mut block.model.parameters;
        (parameters.inverter.pwm.mode, parameters.inverter.T_pwm) = (InverterMode::Switched, 1.0);
        (parameters.mechanics.imposed, block.model.inputs.speed_shaft) = (true, 5000.0);
        (block.model.inputs.enable, block.model.inputs.u) = (true, U);
        block.initialize();
        let (h, mut now) = (2e-3 / f64::from(parts), Elapsed::ZERO);
        for _ in 0..parts {
            block.model.inputs.angle_shaft = 5000.0 * now.seconds();
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        [block.out.i_d, block.out.i_q]
    };
    let (one, many) = (run(1), run(200));
    assert!(one.iter().zip(many).all(|(a, b)| (a - b).abs() < 1e-6), "{one:?} A, not {many:?} A");
}
