//! Machines with short time constants against closed forms: a current that settles in microseconds, a rotor that follows friction at once,
//! and one that swings with the inductance. Steps of 100 us and 1 ms are many times as long.
#![allow(missing_docs, non_snake_case)]

use drive_base::frame::Phases;
use drive_plant::PmsmPlant;
use drive_plant::pwm::InverterMode;
use fmu_core::{Block, Elapsed, Model, Step};

/// A plant whose rotor stands, with the voltage `u` (V) on the alpha axis.
fn plant(R_s: f64, L: f64, u: f64) -> Block<PmsmPlant> {
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    (par.motor.R_s, par.motor.L_d, par.motor.L_q, par.motor.psi_M) = (R_s, L, L, 1e-9);
    (par.mechanics.J, par.mechanics.tau_coulomb) = (1e3, 0.0);
    (block.model.inputs.u, block.model.inputs.u_dc) = (Phases { a: u, b: -0.5 * u, c: -0.5 * u }, 100.0);
    block
}

/// Steps of `h` (s) up to `t` (s); `seen` gets the time and the block after each.
fn run(block: &mut Block<PmsmPlant>, h: f64, t: f64, mut seen: impl FnMut(f64, &Block<PmsmPlant>)) {
    block.initialize();
    block.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    while now.seconds() < t - 0.5 * h {
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        seen(now.seconds(), block);
    }
}

/// i = u/R (1 - exp(-R t/L)), and the energy of the copper.
#[test]
fn a_current_that_settles_in_microseconds() {
    let (R, u) = (10.0, 10.0);
    for L in [4e-3, 1e-3, 4e-4, 3e-4, 1e-4, 1e-5, 2e-6] {
        for h in [1e-5, 1e-4, 1e-3] {
            let (mut block, mut worst) = (plant(R, L, u), 0.0_f64);
            run(&mut block, h, 2e-3, |t, block| {
                let exact = u / R * (1.0 - (-R * t / L).exp());
                worst = worst.max((block.out.i.a - exact).abs());
            });
            let x = (-R * 2e-3 / L).exp();
            let time = 2e-3 - L / R * (2.0 * (1.0 - x) - 0.5 * (1.0 - x * x));
            let (energy, exact) = (block.out.energy.loss, 1.5 * u * u / R * time);
            println!("L = {L} H, {h} s: {worst:.1e} A, {:.1e} of the energy", energy / exact - 1.0);
            assert!(
                worst < 3e-5 && (energy / exact - 1.0).abs() < 1e-4,
                "{L} H, {h} s: {worst} A, {energy} J, not {exact} J"
            );
        }
    }
}

/// The mean of the current over pulses, and the current through devices with resistance.
#[test]
fn the_switched_and_the_lossy_inverter_with_a_short_time_constant() {
    let (R, u) = (10.0, 10.0);
    for L in [4e-4, 1e-4, 1e-5] {
        let mut switched = plant(R, L, u);
        switched.model.parameters.inverter.pwm.mode = InverterMode::Switched;
        let mut mean = 0.0;
        run(&mut switched, 2e-7, 2e-3, |t, block| mean += if t > 1e-3 { 2e-4 * block.out.i.a } else { 0.0 });
        let mut coarse = plant(R, L, u);
        coarse.model.parameters.inverter.pwm.mode = InverterMode::Switched;
        run(&mut coarse, 1e-3, 2e-3, |_, _| {});
        let [fine, coarse] = [switched, coarse].map(|block| block.out.energy.loss);
        assert!((coarse / fine - 1.0).abs() < 1e-3, "{coarse} J in steps of 1 ms, not {fine} J");
        let mut lossy = plant(R, L, u);
        let devices = &mut lossy.model.parameters.inverter.devices;
        (devices.r_transistor, devices.r_diode) = (1.0, 1.0);
        run(&mut lossy, 1e-4, 2e-3, |_, _| {});
        println!("L = {L} H: {mean} A switched, {} A with 1 Ohm of devices", lossy.out.i.a);
        assert!((mean - 1.0).abs() < 2e-3, "{mean} A");
        assert!((lossy.out.i.a - u / 11.0).abs() < 1e-6, "{} A", lossy.out.i.a);
    }
}

/// J dw/dt = -B w - tau, and the swing of J against L at the frequency n_p psi_M sqrt(3/(2 J L)) of a short-circuited machine.
#[test]
fn a_rotor_that_is_as_fast() {
    let (B, tau) = (0.1, 2.0);
    for J in [1e-4, 3e-6, 1e-7] {
        let mut block = plant(10.0, 1e-3, 0.0);
        (block.model.parameters.mechanics.J, block.model.parameters.mechanics.B) = (J, B);
        block.model.inputs.tau_load = tau;
        let mut worst = 0.0_f64;
        run(&mut block, 1e-4, 2e-3, |t, block| {
            let exact = -tau / B * (1.0 - (-B * t / J).exp());
            worst = worst.max((block.out.speed - exact).abs());
        });
        println!("J = {J} kg.m2: {worst:.1e} rad/s");
        assert!(worst < 1e-3, "J = {J} kg.m2: {worst} rad/s");
    }
    let (J, L, psi_M) = (1e-8, 1e-5, 3e-3);
    let mut block = plant(0.01, L, 0.0);
    let par = &mut block.model.parameters;
    (par.mechanics.J, par.mechanics.B, par.motor.psi_M, par.motor.n_p) = (J, 0.0, psi_M, 1);
    block.model.inputs.tau_load = 1e-6;
    let mut coarse = block.clone();
    let (mut all, mut worst) = (Vec::new(), 0.0_f64);
    run(&mut block, 1e-6, 2e-3, |_, block| all.push(block.out.speed));
    let mut last = 0;
    run(&mut coarse, 1e-4, 2e-3, |_, block| {
        last += 100;
        worst = worst.max((block.out.speed - all[last - 1]).abs());
    });
    let most = all.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    println!("{worst:.1e} of {most:.1e} rad/s");
    assert!(worst < 1e-3 * most && most > 0.0, "{worst} of {most} rad/s");
}

#[test]
fn a_time_constant_of_no_machine_is_refused() {
    let message = plant(10.0, 0.9e-6, 0.0).model.validate().unwrap_err().to_string();
    assert!(
        message.starts_with("motor.R_s = 10 Ohm is not allowed: at most 9.0000 Ohm with motor.L_d = 0.0000009 H"),
        "{message}"
    );
}
