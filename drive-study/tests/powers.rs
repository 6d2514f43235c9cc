//! Energy between DC link, machine and shaft is balanced, and a shaft turned by a drive train gives the same results as a free
//! one.
#![allow(missing_docs)]
#![allow(non_snake_case, reason = "the papers' symbols")]

mod common;

use common::{SteppedPlant, T_S};
use drive::PmsmDrive;
use drive::frame::{AlphaBeta, Axis, Dq, Phases, Rotor};
use drive::plant::power::Energy;
use drive::plant::tables::PlantParameters;
use fmu_core::{Block, Elapsed, Step};

impl SteppedPlant {
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
            x = motor.L_d * (i_d - (s.s_2 + s.s_3 * x) * x * x - 0.5 * s.s_dq * q * q);
            q = motor.L_q * (i_q - s.s_dq * x * q);
        }
        let linear = 0.5 * (x * x / motor.L_d + q * q / motor.L_q);
        1.5 * (linear + s.s_2 * x * x * x / 3.0 + s.s_3 * x * x * x * x / 4.0 + 0.5 * s.s_dq * x * q * q)
    }

    fn kinetic(&self) -> f64 {
        let mechanics = &self.block.model.parameters.mechanics;
        if mechanics.imposed { 0.0 } else { 0.5 * mechanics.J * self.block.out.speed * self.block.out.speed }
    }

    /// Energy in J that is stored or has left the drive: `energy_in` must equal it up to a constant.
    fn accounted(&self) -> f64 {
        let energy = &self.block.out.energy;
        energy.mech + energy.loss + self.magnetic() + self.kinetic()
    }
}

/// Energy in J that passed the DC link both ways, and the unaccounted part, over 40 ms in steps of `h` (s) in which the current
/// is alternately held at `i` (A) and released.
fn unbalanced(mut plant: SteppedPlant, i: Dq, h: f64, mut input: impl FnMut(&mut SteppedPlant, u32)) -> (f64, f64) {
    let (mut passed, mut sums, start) = (0.0, Energy::default(), plant.accounted());
    for k in 0..whole(0.04 / h) {
        // A voltage is held for at least three steps, so it turns relative to the rotor.
        if k % 3 == 0 {
            plant.hold(if k % 40 < 30 { i } else { Dq::ZERO });
        }
        // A drive train that turns on where the step ended.
        plant.block.model.inputs.angle_shaft = plant.block.out.angle;
        input(&mut plant, k);
        plant.step(h);
        let p = &plant.block.out.powers;
        assert!((p.p_in - plant.block.model.inputs.u_dc * p.i_dc).abs() <= 1e-12 * p.p_in.abs(), "p_in = u_dc i_dc");
        sums.add(&Energy { r#in: p.p_in * h, mech: p.p_mech * h, loss: p.p_loss * h });
        passed += p.p_in.abs() * h;
    }
    let energy = plant.block.out.energy;
    for (mean, energy) in [(sums.r#in, energy.r#in), (sums.mech, energy.mech), (sums.loss, energy.loss)] {
        assert!((mean - energy).abs() < 1e-12 * passed, "the powers are means: {mean} J, {energy} J");
    }
    (passed, energy.r#in - (plant.accounted() - start))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a number of steps")]
fn whole(x: f64) -> u32 {
    x.round() as u32
}

/// Steps in s below, at and above the sample period; none divides another.
const STEPS: [f64; 4] = [7e-6, 3.7e-5, T_S, 1e-3];

/// The balance is exact up to the integration error. The dead time has a kink where a current crosses zero, which a substep
/// of 50 us misses: twice the error.
fn balanced(case @ (.., dead_time): (f64, Dq, f64), passed: f64, lost: f64) {
    let allowed = if dead_time > 0.0 { 2e-6 } else { 1e-6 };
    assert!(passed > 1.0 && lost.abs() < allowed * passed, "(h, i, dead time) = {case:?}: {lost} J of {passed} J");
}

/// A salient machine that saturates, at 300 rad/s, on an inverter with `dead_time` (s).
fn hard(par: &mut PlantParameters, dead_time: f64) {
    par.motor.L_q = 9e-3;
    (par.saturation.s_2, par.saturation.s_3, par.saturation.s_dq) = (40.0, 40.0, 7.0);
    (par.inverter.dead_time, par.inverter.T_pwm) = (dead_time, T_S);
    par.mechanics.tau_coulomb = 0.2;
    par.initial.speed = 300.0;
}

#[test]
fn energy_is_balanced_with_the_shaft_free() {
    for h in STEPS {
        for (i, tau) in [(Dq::new(-4.0, 3.0), 1.5), (Dq::new(2.0, -5.0), -2.0), (Dq::new(-6.0, 0.5), 0.0)] {
            for dead_time in [0.0, 2e-6] {
                let (passed, lost) = unbalanced(SteppedPlant::new(|par| hard(par, dead_time)), i, h, |plant, _| {
                    plant.block.model.inputs.tau_load = tau;
                });
                balanced((h, i, dead_time), passed, lost);
            }
        }
    }
}

#[test]
fn energy_is_balanced_with_an_imposed_speed() {
    let imposed = |par: &mut PlantParameters, dead_time: f64| {
        hard(par, dead_time);
        par.mechanics.imposed = true;
    };
    for h in STEPS {
        for i in [Dq::new(-4.0, 3.0), Dq::new(1.0, -5.0)] {
            // The load of a free shaft is not read; the angle of the drive train jumps by the effect of an acceleration.
            for dead_time in [0.0, 2e-6] {
                let (passed, lost) = unbalanced(SteppedPlant::new(|par| imposed(par, dead_time)), i, h, |plant, k| {
                    let inputs = &mut plant.block.model.inputs;
                    (inputs.tau_load, inputs.speed_shaft) = (77.0, 300.0 + f64::from(k % 50));
                    inputs.angle_shaft = plant.block.out.angle + 1e-3 * f64::from(k % 2);
                });
                balanced((h, i, dead_time), passed, lost);
            }
        }
    }
}

#[test]
fn a_link_without_voltage_carries_current_but_no_power() {
    let mut plant = SteppedPlant::new(|par| par.initial.speed = 300.0);
    plant.block.model.inputs.u_dc = 0.0;
    plant.block.model.inputs.u = Phases { a: 100.0, b: 25.0, c: -50.0 };
    for _ in 0..20 {
        plant.step(T_S);
        let (p, i) = (plant.block.out.powers, plant.block.out.i);
        // Leg a is on the upper rail, leg c on the lower one, leg b half of the period on either: i_dc = i_a + i_b / 2.
        assert!(p.p_in == 0.0 && (p.i_dc - i.a - 0.5 * i.b).abs() < 1e-12, "{p:?} {i:?}");
        assert!(i.a.abs() > 0.1 && i.b.abs() > 0.1, "{i:?}");
    }
    plant.block.model.inputs.u = Phases::default();
    plant.step(T_S);
    assert_eq!(plant.block.out.powers.i_dc.to_bits(), 0.0_f64.to_bits(), "all legs on one rail");
    // During the dead time, the diode of every leg feeds the link, here 4 % of the period.
    (plant.block.model.parameters.inverter.dead_time, plant.block.model.parameters.inverter.T_pwm) = (4e-6, T_S);
    plant.step(T_S);
    let (p, Phases { a, b, c }) = (plant.block.out.powers, plant.block.out.i);
    let leg = |i: f64| i.abs() * (i.abs() / plant.block.model.parameters.inverter.i_zero).min(1.0);
    let feed = 0.04 * (leg(a) + leg(b) + leg(c));
    assert!(feed > 0.01 && (p.i_dc + feed).abs() < 1e-12, "{p:?}, {feed} A");
}

#[test]
fn before_the_first_step_only_the_shaft_has_power() {
    for speed in [200.0, -200.0] {
        let mut plant = SteppedPlant::new(|par| par.initial.speed = speed);
        plant.block.model.inputs.tau_load = 1.5;
        plant.block.initialize();
        let (p, friction) = (plant.block.out.powers, 2e-4 * 200.0 + 0.03);
        assert!(p.p_in == 0.0 && p.i_dc == 0.0 && (p.p_mech - 1.5 * speed).abs() < 1e-9, "{p:?}");
        assert!((p.p_loss - friction * 200.0).abs() < 1e-9, "{p:?}");
    }
}

#[test]
fn the_drive_shows_the_means_of_its_last_sample_period() {
    // Steps that divide no period: the energies at the ends of the periods come from a drive that steps by T_s.
    let drive = || {
        let mut drive = Block::<PmsmDrive>::default();
        drive.model.inputs.speed_ref = 50.0;
        drive.model.inputs.tau_load = 0.5;
        drive.initialize();
        drive
    };
    let step = |drive: &mut Block<PmsmDrive>, start: Elapsed, h: f64| {
        drive.step(&Step { start, h }).unwrap();
        start.plus(h)
    };
    let (mut whole, mut parts) = (drive(), drive());
    let (mut now, mut t) = (Elapsed::ZERO, Elapsed::ZERO);
    for k in 1..=2000_u32 {
        let before = whole.out.plant.energy;
        now = step(&mut whole, now, T_S);
        while t.since(now) < -0.31 * T_S {
            t = step(&mut parts, t, 0.3 * T_S);
        }
        let rest = now.since(t);
        t = step(&mut parts, t, rest);
        let (p, after) = (parts.out.plant.powers, whole.out.plant.energy);
        for (mean, energy) in [
            (p.p_in, after.r#in - before.r#in),
            (325.0 * p.i_dc, after.r#in - before.r#in),
            (p.p_mech, after.mech - before.mech),
            (p.p_loss, after.loss - before.loss),
        ] {
            assert!(
                (mean - energy / T_S).abs() < 1e-3 * (1.0 + mean.abs()),
                "sample {k}: {mean} W, {} W",
                energy / T_S
            );
        }
    }
    let p = parts.out.plant.powers;
    assert!(p.p_in > 20.0 && p.p_mech > 20.0 && p.p_loss > 1.0, "{p:?}");
}

#[test]
fn a_steady_state_by_hand() {
    // Only i_q = 4 A, held at 200 rad/s: p_in = copper + torque times speed, regardless of the voltage's turn in the step.
    let mut plant = SteppedPlant::new(|par| par.mechanics.imposed = true);
    plant.block.model.inputs.speed_shaft = 200.0;
    for _ in 0..2000 {
        plant.hold(Dq::new(0.0, 4.0));
        plant.block.model.inputs.angle_shaft = plant.block.out.angle;
        plant.step(T_S);
    }
    let p = plant.block.out.powers;
    let friction = 2e-4 * 200.0 + 0.03;
    // A held voltage that turns by 0.06 rad against the rotor is shorter by 0.06^2 / 24 on average: 14 mV of the 90 V of EMF,
    // 7 mA across 2 Ohm, 0.2 % of the current.
    assert!((p.p_mech / ((0.675 * 4.0 - friction) * 200.0) - 1.0).abs() < 2e-3, "{p:?}");
    assert!((p.p_loss / (1.5 * 2.0 * 16.0 + friction * 200.0) - 1.0).abs() < 4e-3, "{p:?}");
    assert!((p.p_in - p.p_loss - p.p_mech).abs() < 1e-4 * p.p_in, "{p:?}");
}

/// A free run: speed and angle at the beginning of every step of `h` (s), and the currents at its end.
fn free(h: f64, steps: u32) -> Vec<(f64, f64, AlphaBeta, Phases)> {
    let mut plant = SteppedPlant::new(accelerated);
    plant.block.model.inputs.tau_load = 0.4;
    (0..steps)
        .map(|k| {
            let (speed, angle) = (plant.block.out.speed, plant.block.out.angle);
            excite(&mut plant, k, h);
            let u = plant.block.model.inputs.u.to_stator();
            plant.step(h);
            (speed, angle, u, plant.block.out.i)
        })
        .collect()
}

fn accelerated(par: &mut PlantParameters) {
    hard(par, 0.0);
    par.initial.theta_e = 0.9;
}

/// A voltage that accelerates and brakes, as a function of time.
fn excite(plant: &mut SteppedPlant, k: u32, h: f64) {
    let t = f64::from(k) * h;
    let theta = 0.9 + 3.0 * 300.0 * t;
    let u = Dq::new(-10.0, 135.0 + 20.0 * (400.0 * t).sin());
    plant.block.model.inputs.u = Phases::from_stator(Axis::<Rotor>::at(theta).to_stator(u));
}

/// Maximum deviation of a current (A) and of the speed (rad/s) from `tau_shaft` when the free run is imposed, and the bound of
/// the former: between two angles, an acceleration a turns the true rotor by a h^2 / 2.
fn imposed(h: f64, steps: u32) -> (f64, f64, f64) {
    let run = free(h, steps);
    let mut plant = SteppedPlant::new(|par| {
        accelerated(par);
        (par.mechanics.imposed, par.initial.theta_e) = (true, 0.0);
    });
    (plant.block.model.inputs.speed_shaft, plant.block.model.inputs.angle_shaft) = (run[0].0, run[0].1);
    plant.block.initialize();
    let PlantParameters { motor, mechanics, .. } = plant.block.model.parameters.clone();
    let (mut apart, mut speed, mut off, mut fastest) = (0.0_f64, run[0].0, 0.0_f64, 0.0_f64);
    for &(w, angle, u, i) in &run {
        off = off.max((speed - w).abs());
        let inputs = &mut plant.block.model.inputs;
        (inputs.u, inputs.speed_shaft, inputs.angle_shaft) = (Phases::from_stator(u), w, angle);
        plant.step(h);
        let out = &plant.block.out;
        // The torque is the mean over the step.
        let acceleration = (out.powers.tau_shaft - 0.4) / mechanics.J;
        speed += h * acceleration;
        fastest = fastest.max(acceleration.abs());
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
    assert!((coarse / fine - 16.0).abs() < 3.0, "not of second order, or errors add up: {coarse} A, {fine} A");
    assert!(off < 0.02 && off < off_coarse, "speed from tau_shaft: {off} rad/s off, {off_coarse} rad/s at 40 us");
}
