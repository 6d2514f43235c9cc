//! Energy between DC link, machine and shaft is balanced, and a shaft that a drive train turns is the free one's.
#![allow(missing_docs)]
#![allow(non_snake_case, reason = "the papers' symbols")]

mod common;

use common::{Bench, T_S};
use drive::frame::{AlphaBeta, Axis, Dq, Phases, Rotor};
use drive::plant::tables::PlantParameters;

impl Bench {
    /// The voltage that keeps the current `i` (A) of a linear machine with these parameters, turned by half a sample.
    fn hold(&mut self, i: Dq) {
        let motor = &self.block.model.parameters.motor;
        let w = f64::from(motor.n_p) * self.block.out.speed;
        let u = Dq::new(
            motor.R_s * i.d() - w * motor.L_q * i.q(),
            motor.R_s * i.q() + w * (motor.L_d * i.d() + motor.psi_M),
        );
        let axis = Axis::<Rotor>::at(self.block.out.theta_e + 0.5 * T_S * w);
        self.block.model.inputs.u = Phases::from_stator(axis.to_stator(u));
    }

    /// Magnetic energy in J: 1.5 of the integral of i d psi, with the flux linkage that goes with the current.
    fn magnetic(&self) -> f64 {
        let PlantParameters { motor, saturation: s, .. } = &self.block.model.parameters;
        let (i_d, i_q) = (self.block.out.i_d, self.block.out.i_q);
        let (mut x, mut q) = (motor.L_d * i_d, motor.L_q * i_q);
        for _ in 0..200 {
            x = motor.L_d * (i_d - (s.c_2 + s.c_3 * x) * x * x - 0.5 * s.c_x * q * q);
            q = motor.L_q * (i_q - s.c_x * x * q);
        }
        let linear = 0.5 * (x * x / motor.L_d + q * q / motor.L_q);
        1.5 * (linear + s.c_2 * x * x * x / 3.0 + s.c_3 * x * x * x * x / 4.0 + 0.5 * s.c_x * x * q * q)
    }

    fn kinetic(&self) -> f64 {
        let mechanics = &self.block.model.parameters.mechanics;
        if mechanics.imposed { 0.0 } else { 0.5 * mechanics.J * self.block.out.speed * self.block.out.speed }
    }

    /// Net power in W at the last communication point.
    fn net(&self) -> f64 {
        let p = &self.block.out.powers;
        p.p_in - p.p_loss - p.p_mech
    }
}

/// Energy in J that passed the DC link, and how much of it is not accounted for, over `samples` periods in which the current
/// is held at `i` (A) and let go in turn.
fn unbalanced(mut bench: Bench, i: Dq, samples: u32, mut input: impl FnMut(&mut Bench, u32)) -> (f64, f64) {
    let (mut passed, mut lost) = (0.0, -bench.kinetic() - bench.magnetic());
    let h = T_S / 100.0;
    for k in 0..samples {
        bench.hold(if k % 40 < 30 { i } else { Dq::ZERO });
        input(&mut bench, k);
        // The new voltage shows with the next step: one that moves nothing.
        bench.block.model.inputs.angle_shaft = bench.block.out.angle;
        bench.step(1e-15);
        for _ in 0..100 {
            let (before, p_in) = (bench.net(), bench.block.out.powers.p_in);
            // A drive train that turns on where the step ended.
            bench.block.model.inputs.angle_shaft = bench.block.out.angle;
            bench.step(h);
            lost -= 0.5 * (before + bench.net()) * h;
            passed += p_in.abs() * h;
        }
        let p = &bench.block.out.powers;
        assert!((p.p_in - bench.block.model.inputs.u_dc * p.i_dc).abs() < 1e-12, "p_in = u_dc i_dc");
    }
    (passed, lost + bench.kinetic() + bench.magnetic())
}

/// A salient machine that saturates, at 300 rad/s, on an inverter with dead time.
fn hard(par: &mut PlantParameters) {
    par.motor.L_q = 9e-3;
    (par.saturation.c_2, par.saturation.c_3, par.saturation.c_x) = (40.0, 40.0, 7.0);
    (par.inverter.dead_time, par.inverter.T_pwm) = (2e-6, T_S);
    par.mechanics.tau_coulomb = 0.2;
    par.initial.speed = 300.0;
}

#[test]
fn energy_is_balanced_with_the_shaft_free() {
    for (i, tau) in [(Dq::new(-4.0, 3.0), 1.5), (Dq::new(2.0, -5.0), -2.0), (Dq::new(-6.0, 0.5), 0.0)] {
        let (passed, lost) = unbalanced(Bench::new(hard), i, 400, |bench, _| bench.block.model.inputs.tau_load = tau);
        assert!(passed > 1.0 && lost.abs() < 2e-6 * passed, "{i:?}: {lost} J of {passed} J");
    }
}

#[test]
fn energy_is_balanced_with_an_imposed_speed() {
    let imposed = |par: &mut PlantParameters| {
        hard(par);
        par.mechanics.imposed = true;
    };
    for i in [Dq::new(-4.0, 3.0), Dq::new(1.0, -5.0)] {
        // The load of a free shaft is not read.
        let (passed, lost) = unbalanced(Bench::new(imposed), i, 400, |bench, k| {
            let inputs = &mut bench.block.model.inputs;
            (inputs.tau_load, inputs.speed_shaft) = (77.0, 300.0 + f64::from(k % 50));
        });
        assert!(passed > 1.0 && lost.abs() < 2e-6 * passed, "{i:?}: {lost} J of {passed} J");
    }
}

#[test]
fn a_link_without_voltage_carries_current_but_no_power() {
    let mut bench = Bench::new(|par| par.initial.speed = 300.0);
    bench.block.model.inputs.u_dc = 0.0;
    bench.block.model.inputs.u = Phases { a: 100.0, b: -50.0, c: -50.0 };
    for _ in 0..20 {
        bench.step(T_S);
        let (p, i) = (bench.block.out.powers, bench.block.out.i);
        // Leg a is on the upper rail, the others on the lower one: i_dc = i_a.
        assert!(p.p_in == 0.0 && (p.i_dc - i.a).abs() < 1e-12 && i.a.abs() > 0.1, "{p:?} {i:?}");
    }
    bench.block.model.inputs.u = Phases::default();
    bench.step(T_S);
    assert_eq!(bench.block.out.powers.i_dc.to_bits(), 0.0_f64.to_bits(), "all legs on one rail");
}

#[test]
fn a_steady_state_by_hand() {
    // i_q = 4 A held at 200 rad/s, nothing else: p_in = copper + torque times speed.
    let mut bench = Bench::new(|par| par.mechanics.imposed = true);
    bench.block.model.inputs.speed_shaft = 200.0;
    let i = Dq::new(0.0, 4.0);
    for _ in 0..2000 {
        let angle = bench.block.out.angle;
        bench.block.model.inputs.angle_shaft = angle;
        bench.step(1e-9);
        bench.hold(i);
        bench.block.model.inputs.angle_shaft = bench.block.out.angle;
        bench.step(T_S);
    }
    let p = bench.block.out.powers;
    let friction = 2e-4 * 200.0 + 0.03;
    assert!((p.tau_shaft - (0.675 * 4.0 - friction)).abs() < 2e-3, "{p:?}");
    assert!((p.p_mech - p.tau_shaft * 200.0).abs() < 1e-12);
    assert!((p.p_loss - (1.5 * 2.0 * 16.0 + friction * 200.0)).abs() < 0.1, "{p:?}");
    // The voltage is held while the rotor turns: at the end of the step it is half a sample behind.
    assert!((p.i_dc - (p.p_loss + p.p_mech) / 325.0).abs() < 0.1, "{p:?}");
}

/// A free run: speed and angle at the beginning of every step of `h` (s), and the currents at its end.
fn free(h: f64, steps: u32) -> Vec<(f64, f64, AlphaBeta, Phases)> {
    let mut bench = Bench::new(accelerated);
    bench.block.model.inputs.tau_load = 0.4;
    (0..steps)
        .map(|k| {
            let (speed, angle) = (bench.block.out.speed, bench.block.out.angle);
            excite(&mut bench, k, h);
            let u = bench.block.model.inputs.u.to_stator();
            bench.step(h);
            (speed, angle, u, bench.block.out.i)
        })
        .collect()
}

fn accelerated(par: &mut PlantParameters) {
    hard(par);
    par.inverter.dead_time = 0.0;
    par.initial.theta_e = 0.9;
}

/// A voltage that accelerates and brakes, a function of time alone.
fn excite(bench: &mut Bench, k: u32, h: f64) {
    let t = f64::from(k) * h;
    let theta = 0.9 + 3.0 * 300.0 * t;
    let u = Dq::new(-10.0, 135.0 + 20.0 * (400.0 * t).sin());
    bench.block.model.inputs.u = Phases::from_stator(Axis::<Rotor>::at(theta).to_stator(u));
}

/// Greatest deviation of a current (A) and of the speed (rad/s) that `tau_shaft` gives, when the free run is imposed, and
/// the bound of the former: an acceleration turns the true rotor on by half of it times h^2 before the next angle comes.
fn imposed(h: f64, steps: u32) -> (f64, f64, f64) {
    let run = free(h, steps);
    let mut bench = Bench::new(|par| {
        accelerated(par);
        (par.mechanics.imposed, par.initial.theta_e) = (true, 0.0);
    });
    (bench.block.model.inputs.speed_shaft, bench.block.model.inputs.angle_shaft) = (run[0].0, run[0].1);
    bench.block.initialise();
    let PlantParameters { motor, mechanics, .. } = bench.block.model.parameters.clone();
    let (mut apart, mut speed, mut off, mut fastest) = (0.0_f64, run[0].0, 0.0_f64, 0.0_f64);
    let mut tau = bench.block.out.powers.tau_shaft;
    for &(w, angle, u, i) in &run {
        off = off.max((speed - w).abs());
        let inputs = &mut bench.block.model.inputs;
        (inputs.u, inputs.speed_shaft, inputs.angle_shaft) = (Phases::from_stator(u), w, angle);
        bench.step(h);
        let (out, tau_last) = (&bench.block.out, tau);
        tau = out.powers.tau_shaft;
        speed += h * (0.5 * (tau + tau_last) - 0.4) / mechanics.J;
        fastest = fastest.max((tau - 0.4).abs() / mechanics.J);
        apart = apart.max((out.i.a - i.a).abs()).max((out.i.b - i.b).abs()).max((out.i.c - i.c).abs());
    }
    let psi = motor.psi_M + (motor.L_q - motor.L_d) * 10.0;
    let bound = psi * f64::from(motor.n_p) * 0.5 * fastest * h * h / motor.L_d;
    (apart, off, bound)
}

#[test]
fn an_imposed_shaft_is_the_free_one() {
    let (coarse, off_coarse, bound_coarse) = imposed(4e-5, 1500);
    let (fine, off, bound) = imposed(1e-5, 6000);
    // Saturation lowers the inductance that turns flux linkage into current: by half at most here.
    assert!(fine < 2.0 * bound && coarse < 2.0 * bound_coarse, "{fine} A, {bound} A; {coarse} A, {bound_coarse} A");
    assert!((coarse / fine - 16.0).abs() < 3.0, "of second order, nothing adds up: {coarse} A, {fine} A");
    assert!(off < 0.02 && off < off_coarse, "speed from tau_shaft: {off} rad/s off, {off_coarse} rad/s at 40 us");
}
