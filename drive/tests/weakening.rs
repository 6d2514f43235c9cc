//! Field weakening in the closed loop with a sensor; [`envelope`](drive::control::envelope) has its algebra.
//!
//! The figures come from the algebra's tests, for the same machines, with k_u = 0.95 unless noted.

use crate::machines::{Machine, RPM, a, b, c, currents};
use drive::Pair;
use drive::control::envelope::{Envelope, WarmStart};
use drive::control::tables::ControllerParameters;
use drive::estimator::Kind;
use drive::motor::Motor;
use fmu_core::Warns;
use fmu_core::log::Warnings;
use std::f64::consts::TAU;

const T_S: f64 = 1e-4;

/// A drive with a sensor and exact estimates; its shaft turns at an imposed speed.
struct Drive {
    pair: Pair,
    angle: f64,
    machine: Machine,
}

impl Drive {
    /// In torque mode, with an imposed speed, after `set`.
    fn imposed(machine: &Machine, set: impl FnOnce(&mut ControllerParameters)) -> Self {
        Self::start(machine, |pair| {
            pair.plant.model.parameters.mechanics.imposed = true;
            pair.controller.model.parameters.speed_loop.torque_mode = true;
            set(&mut pair.controller.model.parameters);
        })
    }

    fn start(machine: &Machine, set: impl FnOnce(&mut Pair)) -> Self {
        let mut pair = Pair::default();
        let plant = &mut pair.plant.model.parameters;
        (plant.motor, plant.mechanics.J) = (machine.motor.clone(), machine.J);
        pair.controller.model.parameters = machine.parameters();
        set(&mut pair);
        pair.set_inputs(0.0, 0.0, machine.u_dc);
        pair.start().unwrap();
        Self { pair, angle: 0.0, machine: machine.clone() }
    }

    /// One sample at `rpm` with the torque reference `tau` (N.m) on a link of `u_dc` (V).
    fn step(&mut self, rpm: f64, tau: f64, u_dc: f64) {
        let plant = &mut self.pair.plant.model.inputs;
        (plant.speed_shaft, plant.angle_shaft) = (rpm * RPM, self.angle);
        self.pair.controller.model.inputs.tau_ref = tau;
        self.pair.set_inputs(0.0, 0.0, u_dc);
        self.pair.step(T_S).unwrap();
        self.angle += rpm * RPM * T_S;
    }

    /// `seconds` at constant speed and torque.
    fn settle(&mut self, seconds: f64, rpm: f64, tau: f64) {
        let mut t = 0.0;
        while t < seconds {
            self.step(rpm, tau, self.machine.u_dc);
            t += T_S;
        }
    }

    fn torque(&self) -> f64 {
        self.pair.plant.out.tau_e
    }
}

#[test]
fn between_the_ends_the_voltage_can_be_higher() {
    // b at 3900 rpm: full generating torque fits the voltage; without load, the limit is 3783 rpm.
    let (machine, tau, rpm) = (b(), -0.5, 3900.0);
    assert!((machine.limit(rpm, -1.0)[1].tau - 5.0625).abs() < 1e-9);
    let (i, state) = currents(&machine, rpm, tau);
    let excess = machine.envelope().excess(i, machine.w(rpm), machine.U(0.95));
    assert!(state.weakens && excess.abs() < 1e-6 * machine.U(1.0).powi(2), "{i:?}: {excess}");
    assert!((machine.motor.torque(i.d(), i.q()) - tau).abs() < 1e-9, "{i:?}");
}

#[test]
fn full_torque_on_a_slow_ramp() {
    for (machine, top, acceleration, most) in [
        (a(), 4000.0, 400.0, 0.001_65),
        (b(), 5000.0, 400.0, 0.006),
        (c(240.0), 12_000.0, 600.0, 0.001_05),
        (c(400.0), 12_000.0, 800.0, 0.002),
    ] {
        for s in [1.0, -1.0] {
            let mut drive = Drive::imposed(&machine, |_| ());
            let mut rpm = 200.0;
            drive.settle(0.1, rpm, s * 1e4);
            let mut worst = (0.0_f64, 0.0);
            while rpm < top {
                drive.step(rpm, s * 1e4, machine.u_dc);
                let figure = machine.limit(rpm, s)[1].tau;
                let error = s * drive.torque() / figure - 1.0;
                if error.abs() > worst.0.abs() {
                    worst = (error, rpm);
                }
                rpm += acceleration / RPM * T_S;
            }
            println!("{} A, {s}: {:.3} % at {} rpm", machine.i, 100.0 * worst.0, worst.1);
            assert!(worst.0.abs() < most, "{worst:?}");
        }
    }
}

#[test]
fn a_sag_of_the_link() {
    // a at 2000 rpm with 20 N.m; 540 to 400 V in 1 ms, and back.
    let (rpm, tau) = (2000.0, 20.0);
    let sag = |hertz: f64| {
        let mut drive = Drive::imposed(&a(), |p| p.weakening.bandwidth = hertz * TAU);
        drive.settle(0.3, rpm, tau);
        assert!((drive.torque() - tau).abs() < 0.02, "{}", drive.torque());
        let (mut most, mut torques) = (0.0_f64, Vec::new());
        for k in 1..=500_u32 {
            drive.step(rpm, tau, 540.0 - 140.0 * (f64::from(k) * 0.1).min(1.0));
            most = most.max(drive.pair.plant.out.i_d.hypot(drive.pair.plant.out.i_q));
            torques.push(drive.torque());
        }
        drive.settle(0.02, rpm, tau);
        let at = |ms: usize| torques[10 * ms - 1];
        println!("{hertz} Hz: {} {} {} {} N.m, {most} A, {} N.m", at(2), at(5), at(20), at(50), drive.torque());
        assert!((at(50) - 17.48).abs() < 0.1 && most <= 15.05, "{} N.m, {most} A", at(50));
        assert!((drive.torque() - tau).abs() < 0.05, "20 ms after the recovery: {} N.m", drive.torque());
        [at(2), at(5), at(20)]
    };
    let slow = sag(5.0);
    assert!((slow[0] - 14.0).abs() < 1.0 && (slow[1] - 15.4).abs() < 1.5, "{slow:?}");
    assert!((slow[2] - 16.7).abs() < 0.15, "{slow:?}");
    // A faster trim reduces the torque more at first and reaches the new envelope sooner.
    let quick = sag(20.0);
    assert!((quick[1] - 12.6).abs() < 0.25 && (quick[2] - 17.5).abs() < 0.1, "{quick:?}");
}

/// Sets a wrong estimate.
type Wrong = fn(&mut Motor);

/// Share of the true envelope and share of the voltage at full torque at `n` times the base speed with wrong estimates of a.
fn with_wrong(set: Wrong, n: f64) -> (f64, f64) {
    let (rpm, mut now) = (n * 999.14, 200.0);
    let mut drive = Drive::imposed(&a(), |p| set(&mut p.motor));
    while now < rpm {
        drive.step(now, 1e3, 540.0);
        now += 400.0 / RPM * T_S;
    }
    drive.settle(1.0, rpm, 1e3);
    (drive.torque() / a().limit(rpm, 1.0)[1].tau, drive.pair.controller.out.u_share)
}

#[test]
fn injection_ends_before_field_weakening_begins() {
    // Hybrid with the highest accepted w_high: 126.6 rad/s with 150 V of injection.
    let machine = a();
    for s in [1.0, -1.0] {
        let mut drive = Drive::imposed(&machine, |p| {
            p.estimator = Kind::Hybrid;
            p.estimators.tracker.bandwidth = TAU * 40.0;
            (p.estimators.hybrid.w_low, p.estimators.hybrid.w_high) = (63.0, 126.0);
        });
        let (mut rpm, mut weakest) = (0.0, f64::INFINITY);
        drive.settle(0.2, rpm, 0.0);
        while rpm < 2500.0 {
            drive.step(rpm, s * 1e3, machine.u_dc);
            let out = &drive.pair.controller.out;
            if out.weakens {
                weakest = weakest.min(3.0 * out.speed_est.abs());
            }
            rpm += 400.0 / RPM * T_S;
        }
        // On the ramp, the tracker is a few degrees behind.
        drive.settle(0.5, rpm, s * 1e3);
        let share = s * drive.torque() / machine.limit(rpm, s)[1].tau;
        println!("{s}: weakens from {weakest} rad/s on, {share} of the envelope at {rpm} rpm");
        assert!(weakest > 126.0 && weakest < 450.0, "{weakest} rad/s");
        assert!((share - 1.0).abs() < 0.01, "{share} of the envelope");
    }
}

#[test]
fn wrong_estimates() {
    let figures: [(&str, Wrong, [f64; 2], bool); 6] = [
        ("R 0.9", |m| m.R_s *= 0.9, [1.016, 1.020], false),
        ("psi_M 0.92", |m| m.psi_M *= 0.92, [1.021, 1.020], false),
        ("psi_M 1.08", |m| m.psi_M *= 1.08, [0.976, 0.966], false),
        ("L_q 0.8", |m| m.L_q *= 0.8, [1.029, 1.036], true),
        ("L_q 1.2", |m| m.L_q *= 1.2, [0.867, 0.844], false),
        // At 2.5, the calculation gives 0.978, at which |u| is 0.950, not 0.980: see below.
        ("L_d 1.2", |m| m.L_d *= 1.2, [1.029, 1.0184], true),
    ];
    for (name, set, figures, trimmed) in figures {
        for (n, figure) in [1.5, 2.5].into_iter().zip(figures) {
            let (share, u_share) = with_wrong(set, n);
            println!("{name}, {n}: {share:.4} at {u_share:.4}, {figure}");
            assert!((share - figure).abs() < 1e-3, "{name}, {n}: {share}, not {figure}");
            assert!(if trimmed { (u_share - 0.98).abs() < 1e-4 } else { u_share < 0.98 }, "{name}, {n}: {u_share}");
        }
    }
}

#[test]
fn a_wrong_l_d_settles_at_the_mtpv_of_the_estimates() {
    // With L_d^ = 1.2 L_d, psi_M / L_d^ = 12.6 A < 15 A: at 2.5 times base speed the estimates have an MTPV inside the
    // circle. The trim settles where its currents need 0.98 of the voltage with the true machine. This point is unique, because
    // that voltage rises with U. (The controller requests 0.03 % more than the mean over a sample, a turn of 4.5 degrees.)
    let (rpm, truth) = (2.5 * 999.14, a());
    let wrong = Envelope::new(&Motor { L_d: 1.2 * truth.motor.L_d, ..truth.motor.clone() }, truth.i);
    let at = |U: f64| {
        let mut warm = WarmStart::default();
        (0..6).map(|_| wrong.limit(truth.w(rpm), 1.0, U, &mut warm).i).last().unwrap()
    };
    let excess = |U: f64| truth.envelope().excess(at(U), truth.w(rpm), truth.U(0.98));
    let voltages: Vec<f64> = (0..60).map(|k| excess(truth.U(0.65 + 0.005 * f64::from(k)))).collect();
    assert!(voltages.is_sorted());
    let (mut low, mut high) = (truth.U(0.65), truth.U(0.95));
    for _ in 0..60 {
        let mid = 0.5 * (low + high);
        *(if excess(mid) <= 0.0 { &mut low } else { &mut high }) = mid;
    }
    let i = at(low);
    let share = truth.motor.torque(i.d(), i.q()) / truth.limit(rpm, 1.0)[1].tau;
    assert!(i.magnitude() < 14.6 && (share - 1.0181).abs() < 1e-4, "{i:?}: {share}");
}

#[test]
fn a_speed_step_to_two_and_a_half_times_base_speed() {
    let mut drive = Drive::start(&a(), |pair| {
        let par = &mut pair.controller.model.parameters;
        (par.speed_loop.bandwidth, par.speed_loop.b) = (TAU * 5.0, 1.0);
    });
    let target = 2500.0 * RPM;
    let (mut times, mut most) = ([0.0; 2], 0.0_f64);
    for k in 0..10_000_u32 {
        drive.pair.set_inputs(target, 0.0, 540.0);
        drive.pair.step(T_S).unwrap();
        let speed = drive.pair.plant.out.speed / target;
        most = most.max(speed);
        for (time, share) in times.iter_mut().zip([0.1, 0.9]) {
            if speed < share {
                *time = f64::from(k) * T_S;
            }
        }
    }
    let rise = times[1] - times[0];
    println!("rise {rise} s, overshoot {} %", 100.0 * (most - 1.0));
    assert!((rise - 0.145).abs() < 1e-3 && most < 1.00005, "{rise} s, {most}");
    assert!((drive.pair.plant.out.speed / target - 1.0).abs() < 1e-4);
}

#[test]
fn a_clipped_request_is_told() {
    // a at 2000 rpm gives 24.9058 N.m; 24 N.m are possible.
    for (tau, seconds, clipped, warns) in
        [(24.0, 1.1, false, false), (100.0, 0.9, true, false), (100.0, 1.1, true, true), (-100.0, 1.1, true, true)]
    {
        let mut drive = Drive::imposed(&a(), |_| ());
        drive.settle(seconds, 2000.0, tau);
        let (out, mut messages) = (&drive.pair.controller.out, Vec::new());
        let mut sink = |(_, key, message): fmu_core::log::Said<'_>| messages.push((key, message()));
        drive.pair.controller.model.warn(&mut Warnings::to(&mut sink));
        assert!((out.tau_max - 24.9058).abs() < 1e-3 && (out.tau_min + 32.8101).abs() < 1e-3, "{out:?}");
        assert!(out.weakens && (out.u_share - 0.95).abs() < 2e-3, "{out:?}");
        assert_eq!(out.current_limited, clipped, "{tau} N.m");
        assert_eq!(messages.iter().any(|(key, _)| *key == "tau_ref"), warns, "{tau} N.m: {messages:?}");
        if warns {
            assert!(messages[0].1.contains(&format!("tau_ref = {tau} N.m has been clipped")), "{messages:?}");
        }
    }
}

#[test]
fn below_the_base_speed_nothing_changes() {
    // A ramp and a load step at 0.6 of the base speed have the same bits as without weakening.
    for kind in [Kind::Sensored, Kind::Rasmussen] {
        let run = |used: bool| {
            let machine = if kind == Kind::Rasmussen { b() } else { a() };
            let mut drive = Drive::start(&machine, |pair| {
                pair.controller.model.parameters.estimator = kind;
                pair.controller.model.parameters.weakening.used = used;
                pair.controller.model.parameters.speed_loop.ramp = 400.0;
            });
            for k in 0..5000_u32 {
                drive.pair.set_inputs(600.0 * RPM, if k > 3000 { 2.0 } else { 0.0 }, machine.u_dc);
                drive.pair.step(T_S).unwrap();
            }
            drive.pair
        };
        let [with, without] = [run(true), run(false)];
        assert!((with.plant.out.speed - 600.0 * RPM).abs() < 1.0);
        assert_eq!((&with.plant.out, &with.controller.out), (&without.plant.out, &without.controller.out));
    }
}
