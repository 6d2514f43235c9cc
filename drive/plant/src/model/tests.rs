//! Steps of every size, and the balance of the power.

use super::*;
use drive_base::frame::AlphaBeta;

/// Current (A) of `motor` after each of 20 samples of 0.1 ms in steps of `h` (s), at the `speed` (rad/s), with a voltage
/// that jumps at every sample.
fn currents(motor: &Motor, speed: f64, h: f64) -> Vec<Dq> {
    let mut block = Block::<PmsmPlant>::default();
    block.model.parameters.motor = motor.clone();
    (block.model.parameters.initial.speed, block.model.parameters.mechanics.J) = (speed, 1e-2);
    block.initialize();
    let w = f64::from(motor.n_p) * speed;
    let mut now = Elapsed::ZERO;
    let sample = |k: u32| {
        let theta = w * 1e-4 * f64::from(k) + 1.8;
        let e = motor.psi_M * w;
        block.model.inputs.u_dc = 1e4;
        block.model.inputs.u = Phases::from_stator(AlphaBeta::new(e * theta.cos(), e * theta.sin() + f64::from(k % 3)));
        let mut done = 0.0;
        while done < 1e-4 - 0.5 * h {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
            done += h;
        }
        Dq::new(block.out.i_d, block.out.i_q)
    };
    (0..20).map(sample).collect()
}

#[test]
fn a_step_of_a_sample_period_is_as_good_as_64() {
    // Two steps in rotor axes instead of one in stator axes give errors of 8.5, 0.9 and 92 uA.
    let servo = Motor { n_p: 4, R_s: 0.2, L_d: 1.2e-3, L_q: 1.2e-3, psi_M: 0.09 };
    // At 20 000 rpm, the rotor turns 0.84 rad in a sample: four steps.
    for (motor, rpm, allowed) in [
        (&Motor::default(), 4500.0, 2e-6),
        (&Motor::IPMSM_2_2_KW, 3000.0, 3e-7),
        (&servo, 4500.0, 1e-5),
        (&servo, 20_000.0, 1e-5),
    ] {
        let speed = rpm * std::f64::consts::PI / 30.0;
        let (coarse, fine) = (currents(motor, speed, 1e-4), currents(motor, speed, 1e-4 / 64.0));
        let error = coarse.iter().zip(&fine).map(|(&a, &b)| (a - b).magnitude()).fold(0.0, f64::max);
        assert!(error < allowed && error > 0.0, "{error} A with {motor:?} at {rpm} rpm");
        assert!(fine[19].magnitude() > 0.1, "the current is not trivial: {:?}", fine[19]);
    }
}

#[test]
fn a_voltage_that_depends_on_the_currents_is_integrated_in_short_steps() {
    // Within 2 ms, the phase currents pass the zone of the dead time, +-0.5 A.
    let after = |h: f64, steps: u32| {
        let mut block = Block::<PmsmPlant>::default();
        let PlantParameters { inverter, initial, .. } = &mut block.model.parameters;
        (inverter.dead_time, inverter.i_zero, initial.speed) = (4e-6, 0.5, 200.0);
        block.model.inputs.u = Phases::from_stator(AlphaBeta::new(-80.0, 60.0));
        block.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..steps {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        Dq::new(block.out.i_d, block.out.i_q)
    };
    let (coarse, fine) = (after(2e-3, 1), after(1e-6, 2000));
    let error = (coarse - fine).magnitude();
    // The kinks at the edges of the zone cost the method its order: 0.6 mA; with substeps of 400 us, 4 mA.
    assert!(error < 1e-3 && fine.magnitude() > 1.0, "{error} A, {fine:?}");
}

#[test]
fn dead_time_stops_a_current_at_zero() {
    // A voltage below u_dead, 6.5 V, in every leg drives at most the zone's current, even in a narrow zone.
    for i_zero in [0.1, 1e-3] {
        let mut block = Block::<PmsmPlant>::default();
        let inverter = &mut block.model.parameters.inverter;
        (inverter.dead_time, inverter.i_zero) = (2e-6, i_zero);
        block.model.inputs.u = Phases { a: 4.0, b: -2.0, c: -2.0 };
        block.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..100 {
            let step = Step { start: now, h: 1e-4 };
            block.step(&step).unwrap();
            now = step.end();
            assert!(block.out.i.a.abs() < i_zero, "{} A with a zone of {i_zero} A", block.out.i.a);
        }
    }
}

#[test]
fn power_is_balanced() {
    // Over 20 ms: electrical energy in = copper loss + friction + change of magnetic and kinetic energy.
    let mut block = Block::<PmsmPlant>::default();
    block.model.inputs.u = Phases { a: 20.0, b: -10.0, c: -10.0 };
    block.model.parameters.motor.L_q = 9e-3;
    block.model.parameters.initial.theta_e = 0.9;
    block.initialize();
    let energy = |b: &Block<PmsmPlant>| {
        let PlantParameters { motor, mechanics, .. } = &b.model.parameters;
        let (i_d, i_q) = (b.out.i_d, b.out.i_q);
        0.75 * (motor.L_d * i_d * i_d + motor.L_q * i_q * i_q) + 0.5 * mechanics.J * b.out.speed * b.out.speed
    };
    let power = |b: &Block<PmsmPlant>| {
        let u = b.model.inputs.u;
        let input = u.a * b.out.i.a + u.b * b.out.i.b + u.c * b.out.i.c;
        let loss = 1.5 * b.model.parameters.motor.R_s * (b.out.i_d * b.out.i_d + b.out.i_q * b.out.i_q);
        input - loss - b.model.parameters.mechanics.friction(b.out.speed) * b.out.speed
    };
    let (mut now, mut work, mut last) = (Elapsed::ZERO, 0.0, power(&block));
    let h = 1e-6;
    for _ in 0..20_000 {
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        let next = power(&block);
        work += 0.5 * h * (last + next);
        last = next;
    }
    assert!((energy(&block) - work).abs() < 1e-6 * work.abs(), "{} J stored, {work} J net in", energy(&block));
    assert!(energy(&block) > 0.01);
}

#[test]
fn a_step_beyond_all_measure_is_refused() {
    let mut block = Block::<PmsmPlant>::default();
    block.initialize();
    let fault = block.step(&Step { start: Elapsed::ZERO, h: 1e300 }).unwrap_err();
    assert!(fault.message().contains("at most 1000 s"), "{fault}");
}
