//! Steps of every size.

use super::*;
use drive_plant::pwm::InverterMode;

const RPM: f64 = std::f64::consts::PI / 30.0;

/// Times in s of a speed step and a load step, multiples of every compared step size.
type Events = (f64, f64);

/// Speed reference and load at `t` (s).
fn inputs(t: f64, events: Events) -> (f64, f64) {
    let t = t + 1e-9;
    (if t < events.0 { 0.0 } else { 500.0 * RPM }, if t < events.1 { 0.0 } else { 1.5 })
}

fn drive(h: f64, steps: u32, events: Events, mode: InverterMode) -> Block<PmsmDrive> {
    let mut block = Block::<PmsmDrive>::default();
    with_dead_time(&mut block.model.pair, mode);
    block.model.pair.plant.model.parameters.initial.theta_e = std::f64::consts::PI;
    block.initialize();
    block.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    for k in 0..steps {
        (block.model.inputs.speed_ref, block.model.inputs.tau_load) = inputs(f64::from(k) * h, events);
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
    }
    block
}

/// With a dead time if it switches.
fn with_dead_time(pair: &mut Pair, mode: InverterMode) {
    let inverter = &mut pair.plant.model.parameters.inverter;
    inverter.pwm.mode = mode;
    inverter.dead_time = if mode == InverterMode::Switched { 1e-6 } else { 0.0 };
}

#[test]
fn steps_of_many_samples_are_the_pair_bit_for_bit() {
    for &mode in InverterMode::ALL {
        steps_are_the_pair(mode);
    }
}

fn steps_are_the_pair(mode: InverterMode) {
    let (mut pair, events) = (Pair::default(), (0.05, 0.4));
    with_dead_time(&mut pair, mode);
    pair.plant.model.parameters.initial.theta_e = std::f64::consts::PI;
    pair.start().unwrap();
    for k in 0..6000_u32 {
        let (speed_ref, tau_load) = inputs(f64::from(k) * 1e-4, events);
        pair.set_inputs(speed_ref, tau_load, 325.0);
        pair.step(1e-4).unwrap();
    }
    for (h, steps) in [(1e-4, 6000), (1e-3, 600), (1e-2, 60)] {
        let out = drive(h, steps, events, mode).out;
        assert_eq!((&out.plant, &out.controller), (&pair.plant.out, &pair.controller.out), "h = {h}, {mode:?}");
    }
    assert!((pair.plant.out.speed - 500.0 * RPM).abs() < 20.0 * RPM, "{}", pair.plant.out.speed / RPM);
}

#[test]
fn other_steps_also_stop_at_the_samples() {
    // 0.7 and 3.3 samples: the pair would lose the angle or the drive; here only the rounding of the time differs.
    let events = (0.0504, 0.399);
    let reference = drive(1e-4, 4200, events, InverterMode::Average).out.plant;
    for (h, steps) in [(0.7e-4, 6000), (3.5e-4, 1200), (1.4e-3, 300)] {
        let out = drive(h, steps, events, InverterMode::Average).out.plant;
        assert!((out.speed - reference.speed).abs() < 1e-4, "h = {h}: {} {}", out.speed, reference.speed);
        assert!((out.i_q - reference.i_q).abs() < 1e-4, "h = {h}: {} {}", out.i_q, reference.i_q);
    }
}

#[test]
fn an_imposed_shaft_turns_on_within_a_step() {
    // A drive train accelerates for 0.3 s in steps of 1 ms; the drive takes each in one step, the pair in ten.
    let mut pair = Pair::default();
    pair.plant.model.parameters.mechanics.imposed = true;
    // With a sensor: a sensorless drive can lose an imposed shaft, and then amplifies rounding errors.
    pair.controller.model.parameters.estimator = crate::estimator::Kind::Sensored;
    let mut drive = Block::<PmsmDrive>::default();
    drive.model.pair = pair.clone();
    drive.initialize();
    pair.start().unwrap();
    let (mut now, mut angle) = (Elapsed::ZERO, 0.0);
    for k in 0..300_u32 {
        let speed = 0.2 * f64::from(k);
        let inputs = &mut drive.model.inputs;
        (inputs.speed_ref, inputs.speed_shaft, inputs.angle_shaft) = (speed + 1.0, speed, angle);
        let step = Step { start: now, h: 1e-3 };
        drive.step(&step).unwrap();
        now = step.end();
        for sample in 0..10_u32 {
            pair.set_inputs(speed + 1.0, 0.0, 325.0);
            let inputs = &mut pair.plant.model.inputs;
            (inputs.speed_shaft, inputs.angle_shaft) = (speed, angle + speed * 1e-4 * f64::from(sample));
            pair.step(1e-4).unwrap();
        }
        angle += 1e-3 * speed;
        let (ours, theirs) = (&drive.out.plant, &pair.plant.out);
        assert!((ours.angle - angle).abs() < 1e-9 && (ours.theta_e - theirs.theta_e).abs() < 1e-9);
        assert!((ours.powers.tau_shaft - theirs.powers.tau_shaft).abs() < 1e-6, "{ours:?} {theirs:?}");
    }
    assert!(drive.out.plant.powers.tau_shaft.abs() > 1.0, "{:?}", drive.out.plant);
}
