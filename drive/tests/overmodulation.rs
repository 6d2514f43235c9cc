//! Overmodulation in the closed loop: the torque that its voltage allows, in the running drive and by algebra, and the plant's own
//! modulator.

use crate::machines::{Machine, RPM, a, b, c};
use drive::Pair;
use drive::steady::{Condition, Steady};
use drive_base::frame::{AlphaBeta, Phases};
use drive_base::overmodulation::ModulationMode;
use drive_plant::PmsmPlant;
use drive_plant::pwm::InverterMode;
use fmu_core::{Block, Elapsed, Step};
use std::f64::consts::{FRAC_2_PI, TAU};

const T_S: f64 = 1e-4;
const BEYOND: [ModulationMode; 3] =
    [ModulationMode::MinimumPhase, ModulationMode::MinimumMagnitude, ModulationMode::SixStep];

/// Means over half a second at an imposed speed with the maximum torque.
#[derive(Debug)]
struct Means {
    tau: f64,
    u_share: f64,
    /// Maximum current in A.
    i: f64,
    /// Share of the samples with the output `voltage_limited`.
    limited: f64,
}

fn pair(machine: &Machine, mode: ModulationMode, k_u: f64) -> Pair {
    let mut pair = Pair::default();
    let plant = &mut pair.plant.model.parameters;
    (plant.motor, plant.mechanics.J, plant.mechanics.imposed) = (machine.motor.clone(), machine.J, true);
    let par = &mut pair.controller.model.parameters;
    *par = machine.parameters();
    (par.speed_loop.torque_mode, par.modulation.mode) = (true, mode);
    (par.weakening.k_u, par.weakening.k_t) = (k_u, k_u.max(0.98));
    pair
}

fn run(mut pair: Pair, u_dc: f64, rpm: f64) -> Means {
    pair.set_inputs(0.0, 0.0, u_dc);
    pair.start().unwrap();
    let (mut angle, mut means, n) = (0.0, Means { tau: 0.0, u_share: 0.0, i: 0.0, limited: 0.0 }, 5000);
    for step in 0..20_000 {
        let inputs = &mut pair.plant.model.inputs;
        let speed = rpm * RPM * (f64::from(step) / 8000.0).min(1.0);
        (inputs.speed_shaft, inputs.angle_shaft) = (speed, angle);
        pair.controller.model.inputs.tau_ref = 1e4;
        pair.set_inputs(0.0, 0.0, u_dc);
        pair.step(T_S).unwrap();
        angle += speed * T_S;
        if step >= 20_000 - n {
            means.tau += pair.plant.out.tau_e / f64::from(n);
            means.u_share += pair.controller.out.u_share / f64::from(n);
            means.limited += f64::from(u8::from(pair.controller.out.voltage_limited)) / f64::from(n);
        }
        means.i = means.i.max(pair.plant.out.i.to_stator().magnitude());
    }
    means
}

/// The running drive gives the torque that the algebra of `PmsmDriveMean` and the maps promises for a voltage within 3 %, because the
/// current loop samples and answers the harmonics; and more than without overmodulation.
#[test]
fn the_torque_is_that_of_the_voltage() {
    for (machine, rpm) in [(a(), 2500.0), (a(), 4000.0), (b(), 4500.0), (c(240.0), 6000.0)] {
        let linear = run(pair(&machine, ModulationMode::Linear, 0.95), machine.u_dc, rpm);
        for mode in BEYOND {
            let by_algebra = |k_u: f64| {
                let drive = pair(&machine, mode, k_u);
                let (plant, controller) = (&drive.plant.model.parameters, &drive.controller.model.parameters);
                let steady = Steady::new(plant.clone(), controller.clone());
                let at = Condition { speed: rpm * RPM, u_dc: machine.u_dc, temperatures: steady.start_temperatures() };
                steady.at(&at).by_reference(1e4)
            };
            let (low, point, high) = (by_algebra(0.97 * 0.95), by_algebra(0.95), by_algebra(1.005 * 0.95));
            assert!((point.u_share - 0.95 * mode.reach()).abs() < 2e-3, "{rpm} {mode:?}: {}", point.u_share);
            let means = run(pair(&machine, mode, 0.95), machine.u_dc, rpm);
            println!("{rpm} {mode:?}: {means:?}, by algebra {} N.m; linear {}", point.tau_e, linear.tau);
            assert!(means.tau > low.tau_e && means.tau < high.tau_e, "{rpm} {mode:?}");
            assert!((means.u_share / point.u_share - 1.0).abs() < 0.035, "{rpm} {mode:?}");
            assert!(means.tau > (1.0 + 0.75 * (mode.reach() - 1.0)) * linear.tau, "{rpm} {mode:?}");
            assert!(means.i < 1.1 * machine.i, "{rpm} {mode:?}");
        }
    }
}

/// Harmonics of these orders in units of u_dc of the voltage at the terminals of a machine at rest, for a reference of the magnitude `r`
/// (in units of u_dc) with 240 samples per turn. They follow from its currents: u = (R + j w L) i.
fn spectrum(mode: ModulationMode, inverter: InverterMode, r: f64, orders: &[i32]) -> Vec<f64> {
    let (u_dc, h, per_turn) = (300.0, 1e-4, 240);
    let f = 1.0 / (h * f64::from(per_turn));
    let mut block = Block::<PmsmPlant>::default();
    let par = &mut block.model.parameters;
    par.mechanics.imposed = true;
    (par.inverter.pwm.mode, par.inverter.pwm.modulation.mode) = (inverter, mode);
    let (R, L) = (par.motor.R_s, par.motor.L_d);
    block.model.inputs.u_dc = u_dc;
    block.initialize();
    let (mut now, mut sums) = (Elapsed::ZERO, vec![[0.0; 2]; orders.len()]);
    for k in 0..6 * per_turn {
        let angle = TAU * f * h * (f64::from(k) + 0.5);
        block.model.inputs.u = Phases::from_stator(AlphaBeta::new(r * u_dc * angle.cos(), r * u_dc * angle.sin()));
        // Between two samples of the references, the current is not sinusoidal.
        for _ in 0..10 {
            let step = Step { start: now, h: 0.1 * h };
            block.step(&step).unwrap();
            now = step.end();
            if k >= 4 * per_turn {
                for (sum, &order) in sums.iter_mut().zip(orders) {
                    let (sin, cos) = (TAU * f * f64::from(order) * now.seconds()).sin_cos();
                    *sum = [sum[0] + block.out.i.a * cos, sum[1] + block.out.i.a * sin];
                }
            }
        }
    }
    let n = f64::from(2 * per_turn * 10);
    let impedance = |order: i32| R.hypot(TAU * f * f64::from(order) * L);
    let of = |(sum, &order): (&[f64; 2], &i32)| 2.0 / n * sum[0].hypot(sum[1]) * impedance(order) / u_dc;
    sums.iter().zip(orders).map(of).collect()
}

/// The plant's modulator has the fundamentals of the closed forms, averaged and switched.
#[test]
fn the_modulator_of_the_plant() {
    use ModulationMode::{Linear, MinimumMagnitude, MinimumPhase, SixStep};
    for inverter in [InverterMode::Average, InverterMode::Switched] {
        for (mode, r, expected) in [
            (Linear, 0.5, 0.5),
            (MinimumPhase, 30.0, 0.6057),
            (MinimumMagnitude, 0.7, 0.6117),
            (MinimumMagnitude, 1.0, 0.6246),
            (MinimumMagnitude, 3.0, 0.6353),
            (SixStep, 0.5, 0.5),
            (SixStep, 0.7, FRAC_2_PI),
        ] {
            let found = spectrum(mode, inverter, r, &[1])[0];
            println!("{inverter:?} {mode:?} {r}: {found:.5}, expected {expected:.5}");
            assert!((found / expected - 1.0).abs() < 2e-3, "{inverter:?} {mode:?} {r}: {found}, not {expected}");
        }
        let orders = [1, 5, 7, 11, 13];
        for (found, order) in spectrum(SixStep, inverter, 1.0, &orders).into_iter().zip(orders) {
            let expected = FRAC_2_PI / f64::from(order);
            println!("{inverter:?}, order {order}: {found:.5}, expected {expected:.5}");
            assert!((found - expected).abs() < 2e-3, "{inverter:?} {order}: {found}, not {expected}");
        }
    }
}
