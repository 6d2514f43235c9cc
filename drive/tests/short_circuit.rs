//! Active short circuit: currents and torque against their closed forms, the first swing, losses and energy, in
//! Co-Simulation and in Model Exchange.
//!
//! i_d = -w^2 L_q psi_M / (R^2 + w^2 L_d L_q), i_q = -w R psi_M / (R^2 + w^2 L_d L_q), and from a flux linkage psi_0 the first
//! swing reaches at most -(psi_M + |psi_0|) / L_d.

use crate::machines::{Machine, RPM, a, b, c};
use drive::plant::machine::{flux, magnetic_energy};
use drive::plant::signals::PlantOutputs;
use drive::{PmsmDrive, PmsmPlant};
use drive_base::frame::Dq;
use fmu_core::{Block, CompletedSteps, ContinuousTime, Elapsed, Model, Step, integrate};

const T_S: f64 = 1e-4;

/// A plant that is short-circuited at an imposed `rpm`, in steady state; with or without `enable`.
fn shorted(machine: &Machine, rpm: f64, enable: bool) -> Block<PmsmPlant> {
    let seconds = 20.0 * machine.motor.L_q / machine.motor.R_s;
    let mut plant = Block::<PmsmPlant>::default();
    let par = &mut plant.model.parameters;
    (par.motor, par.mechanics.imposed) = (machine.motor.clone(), true);
    let inputs = &mut plant.model.inputs;
    (inputs.asc, inputs.enable, inputs.speed_shaft, inputs.u_dc) = (true, enable, rpm * RPM, machine.u_dc);
    // A command that must have no effect.
    inputs.u.a = 20.0;
    plant.initialize();
    let mut now = Elapsed::ZERO;
    while now.seconds() < seconds {
        plant.model.inputs.angle_shaft = rpm * RPM * now.seconds();
        let step = Step { start: now, h: T_S };
        plant.step(&step).unwrap();
        now = step.end();
    }
    plant
}

fn closed_form(machine: &Machine, rpm: f64) -> Dq {
    let (motor, w) = (&machine.motor, machine.w(rpm));
    let by = motor.psi_M / (motor.R_s * motor.R_s + w * w * motor.L_d * motor.L_q);
    Dq::new(-w * w * motor.L_q * by, -w * motor.R_s * by)
}

#[test]
fn currents_and_torque_are_those_of_the_closed_form() {
    let rpms = [10.0, 50.0, 200.0, 1000.0, 3000.0];
    let figures = [
        (a(), [(-1.1655, 0.4754), (-5.7144, 2.3539), (-17.1969, 8.1669), (-10.8129, 14.4807), (-3.8993, 15.0616)]),
        (b(), [(-0.1590, 0.2356), (-0.7935, 1.1768), (-3.0717, 4.6308), (-8.4227, 17.147), (-5.3048, 23.569)]),
        (c(240.0), [(-3.4766, 11.612), (-20.030, 62.324), (-30.884, 154.78), (-8.1023, 177.27), (-2.7308, 178.25)]),
    ];
    for (machine, expected) in figures {
        for (rpm, (tau, i)) in rpms.into_iter().zip(expected) {
            for enable in [true, false] {
                let plant = shorted(&machine, rpm, enable);
                let PlantOutputs { tau_e, i_d, i_q, powers, .. } = &plant.out;
                let found = Dq::new(*i_d, *i_q);
                assert!((found - closed_form(&machine, rpm)).magnitude() < 1e-5 * i, "{rpm} rpm: {found:?}");
                assert!((tau_e / tau - 1.0).abs() < 2e-4, "{rpm} rpm: {tau_e} N.m, not {tau} N.m");
                assert!((found.magnitude() / i - 1.0).abs() < 1e-4, "{rpm} rpm: {found:?}, not {i} A");
                // No power flows through the link, and all braking power is lost in the copper.
                assert!(powers.p_in == 0.0 && powers.i_dc == 0.0, "{powers:?}");
                let braking = -tau_e * rpm * RPM;
                assert!((powers.losses.cu / braking - 1.0).abs() < 1e-4, "{rpm} rpm: {powers:?}");
            }
        }
    }
}

#[test]
fn it_brakes_the_most_at_this_speed() {
    for (machine, rpm, tau) in [(a(), 315.31, -19.1168), (b(), 1061.03, -8.4375), (c(240.0), 127.95, -34.6647)] {
        let at = |rpm: f64| shorted(&machine, rpm, false).out.tau_e;
        let [below, most, above] = [0.97, 1.0, 1.03].map(|share| at(share * rpm));
        assert!((most / tau - 1.0).abs() < 1e-5, "{most} N.m, not {tau} N.m");
        assert!(most < below && most < above, "{below} N.m, {most} N.m, {above} N.m");
    }
}

/// Begins at full torque, with the sensor and field weakening, and ends again.
#[test]
fn the_first_swing_is_that_of_the_flux_linkage_before() {
    for (machine, rpm, swing) in [(c(240.0), 6000.0, -468.0), (a(), 1500.0, -22.5)] {
        let mut drive = Block::<PmsmDrive>::default();
        let pair = &mut drive.model.pair;
        let plant = &mut pair.plant.model.parameters;
        (plant.motor, plant.mechanics.imposed) = (machine.motor.clone(), true);
        pair.controller.model.parameters = machine.parameters();
        pair.controller.model.parameters.speed_loop.torque_mode = true;
        let inputs = &mut drive.model.inputs;
        (inputs.u_dc, inputs.speed_shaft, inputs.tau_ref) = (machine.u_dc, rpm * RPM, 1e4);
        drive.initialize();
        let (mut now, mut least) = (Elapsed::ZERO, 0.0_f64);
        let mut run = |drive: &mut Block<PmsmDrive>, seconds: f64, asc: bool| {
            let end = now.seconds() + seconds - 1e-9;
            least = 0.0;
            while now.seconds() < end {
                let inputs = &mut drive.model.inputs;
                (inputs.angle_shaft, inputs.asc) = (rpm * RPM * now.seconds(), asc);
                let step = Step { start: now, h: 0.25 * T_S };
                drive.step(&step).unwrap();
                now = step.end();
                least = least.min(drive.out.plant.i_d);
            }
            least
        };
        run(&mut drive, 0.2, false);
        let motor = &machine.motor;
        let psi_0 = flux(motor, Dq::new(drive.out.plant.i_d, drive.out.plant.i_q)).magnitude();
        let full = drive.out.plant.tau_e;
        let least = run(&mut drive, 0.3, true);
        let bound = -(motor.psi_M + psi_0) / motor.L_d;
        println!("{rpm} rpm: {least} A, bound {bound} A, steady {} A", drive.out.plant.i_d);
        assert!((least / swing - 1.0).abs() < 0.01 && least > bound, "{least} A, not {swing} A; {bound} A");
        let steady = closed_form(&machine, rpm).d();
        assert!((drive.out.plant.i_d / steady - 1.0).abs() < 1e-3, "{} A, not {steady} A", drive.out.plant.i_d);
        let status = &drive.out.controller;
        assert!(status.short_circuit && !status.enabled && status.tau_max.abs() < 1e-12, "{status:?}");
        // The controller starts again, at speed: it has a sensor.
        run(&mut drive, 0.2, false);
        let status = &drive.out.controller;
        assert!(!status.short_circuit && status.enabled, "{status:?}");
        assert!((drive.out.plant.tau_e / full - 1.0).abs() < 1e-3, "{} N.m", drive.out.plant.tau_e);
    }
}

/// A traction machine with all losses coasts down from 3000 rpm.
fn runs_down(exchange: bool) -> Block<PmsmPlant> {
    let machine = c(240.0);
    let mut plant = Block::<PmsmPlant>::default();
    let par = &mut plant.model.parameters;
    (par.motor, par.mechanics.J, par.initial.speed) = (machine.motor.clone(), machine.J, 3000.0 * RPM);
    (par.iron.G_e, par.iron.G_h, par.mechanics.k_w) = (3e-3, 5.0, 2e-7);
    let devices = &mut par.inverter.devices;
    (devices.u_transistor, devices.r_transistor, devices.u_diode, devices.r_diode) = (0.8, 2.2e-3, 0.9, 1.6e-3);
    (devices.E_sw, devices.i_sw, devices.u_sw) = (25e-3, 300.0, 400.0);
    par.inverter.dead_time = 2e-6;
    (plant.model.inputs.asc, plant.model.inputs.u_dc) = (true, 400.0);
    plant.initialize();
    let mut now = Elapsed::ZERO;
    for _ in 0..500 {
        let step = Step { start: now, h: T_S };
        if exchange {
            let Block { model, out } = &mut plant;
            model.complete(now).unwrap();
            integrate::hybrid::<PmsmPlant, 4>(model, &step, 5e-6).unwrap();
            model.complete(step.end()).unwrap();
            model.observe(step.end(), out);
        } else {
            plant.step(&step).unwrap();
        }
        now = step.end();
    }
    plant
}

#[test]
fn what_the_rotor_loses_is_lost_in_copper_and_devices() {
    let [stepped, exchanged] = [false, true].map(runs_down);
    for plant in [&stepped, &exchanged] {
        let (par, out) = (&plant.model.parameters, &plant.out);
        let kinetic = |speed: f64| 0.5 * par.mechanics.J * speed * speed;
        let i = Dq::new(out.i_d, out.i_q);
        let stored = magnetic_energy(&par.motor, par.magnetics(), flux(&par.motor, i)) + kinetic(out.speed);
        let passed = kinetic(3000.0 * RPM) - kinetic(out.speed);
        let rest = kinetic(3000.0 * RPM) - stored - out.energy.loss - out.energy.mech + out.energy.r#in;
        println!("{passed} J, {rest} J off, {:?}", out.energy);
        assert!(passed > 20.0 && rest.abs() < 1e-3 * passed, "{rest} J of {passed} J");
        assert!(out.energy.r#in == 0.0, "{:?}", out.energy);
        let losses = &out.powers.losses;
        assert!(losses.cond > 0.1 * losses.cu && losses.iron > 0.0 && losses.sw == 0.0, "{losses:?}");
    }
    let apart = |a: f64, b: f64| (a / b - 1.0).abs();
    let (s, e) = (&stepped.out, &exchanged.out);
    assert!(apart(s.speed, e.speed) < 1e-5 && apart(s.i_d, e.i_d) < 1e-4 && apart(s.i_q, e.i_q) < 1e-4, "{s:?} {e:?}");
    assert!(apart(s.energy.loss, e.energy.loss) < 1e-4, "{:?} {:?}", s.energy, e.energy);
}

/// In Model Exchange, from full torque into the short circuit and out of it again.
#[test]
fn model_exchange_takes_the_same_way() {
    let machine = b();
    let mut stepped = Block::<PmsmDrive>::default();
    stepped.model.pair.plant.model.parameters.motor = machine.motor.clone();
    stepped.model.pair.controller.model.parameters = machine.parameters();
    stepped.model.inputs.speed_ref = 2000.0 * RPM;
    stepped.initialize();
    let (mut integrated, mut now, mut braked) = (stepped.clone(), Elapsed::ZERO, 0.0_f64);
    for k in 0..3000 {
        for drive in [&mut stepped, &mut integrated] {
            let inputs = &mut drive.model.inputs;
            (inputs.asc, inputs.enable) = ((600..900).contains(&k), !(500..700).contains(&k));
        }
        let step = Step { start: now, h: T_S };
        stepped.step(&step).unwrap();
        integrate::hybrid::<PmsmDrive, 5>(&mut integrated.model, &step, 5e-6).unwrap();
        now = step.end();
        integrated.model.observe(now, &mut integrated.out);
        let (a, b) = (&stepped.out.plant, &integrated.out.plant);
        assert_eq!(stepped.out.controller.short_circuit, integrated.out.controller.short_circuit, "{k}");
        let error = (a.i_d - b.i_d).hypot(a.i_q - b.i_q);
        assert!(error < 1e-3 && (a.speed - b.speed).abs() < 1e-3, "{k}: {error} A, {} rad/s", a.speed - b.speed);
        if stepped.out.controller.short_circuit {
            braked = braked.min(a.tau_e);
        }
    }
    assert!(
        braked < -7.0 && stepped.out.plant.speed > 0.99 * 2000.0 * RPM,
        "{braked} N.m, {}",
        stepped.out.plant.speed
    );
    assert!(stepped.model.validate().is_ok());
}
