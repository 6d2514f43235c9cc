//! The switched inverter against closed forms, against the average inverter, and against an independent switched plant.
#![allow(missing_docs, non_snake_case)]

use drive::Pair;
use drive::frame::{AlphaBeta, Phases, SQRT_3};
use drive::math::wrap;
use drive::plant::PmsmPlant;
use drive::plant::switched::InverterMode;
use fmu_core::{Block, Elapsed, Step};
use std::f64::consts::{PI, TAU};

const RPM: f64 = PI / 30.0;

/// A steady state at imposed speed: u_dc in V, electrical frequency in Hz, i_q in A, T in s.
struct Steady([f64; 4]);

/// Parts of a carrier period.
const PARTS: u32 = 400;

impl Steady {
    /// The machine under its steady voltage, over electrical periods that contain whole carrier periods: ripple of the current
    /// beside its fundamental (rms), ripple of the torque (rms), mean and ripple (rms) of the current from the link.
    fn run(&self) -> [f64; 4] {
        let Self([u_dc, f, i_q, T]) = *self;
        let (mut block, w) = (Block::<PmsmPlant>::default(), TAU * f);
        let par = &mut block.model.parameters;
        (par.mechanics.imposed, par.inverter.T_pwm, par.inverter.pwm.mode) = (true, T, InverterMode::Switched);
        let (R, L, psi) = (par.motor.R_s, par.motor.L_d, par.motor.psi_M);
        block.model.inputs.u_dc = u_dc;
        block.initialize();
        let turns = if (1.0 / (f * T)).fract() < 1e-9 { 1.0 } else { 3.0 };
        let count = turns / (f * T);
        // 30 time constants before.
        let (mut now, mut seen) = (Elapsed::ZERO, Vec::new());
        let start = (30.0 * L / (R * T) / count).ceil() * count;
        let mut k = 0.0;
        while k < start + count - 0.5 {
            // The mean of the held reference is that of the rotating voltage.
            let angle = w * T * (k + 0.5);
            let hold = 0.5 * w * T / (0.5 * w * T).sin();
            let (d, q) = (-w * L * i_q * hold, (R * i_q + w * psi) * hold);
            let (sin, cos) = angle.sin_cos();
            for part in 0..PARTS {
                let inputs = &mut block.model.inputs;
                inputs.u = Phases::from_stator(AlphaBeta::new(d * cos - q * sin, d * sin + q * cos));
                let h = T / f64::from(PARTS);
                (inputs.speed_shaft, inputs.angle_shaft) = (w / 3.0, w / 3.0 * (k * T + f64::from(part) * h));
                let step = Step { start: now, h };
                block.step(&step).unwrap();
                now = step.end();
                if k > start - 0.5 {
                    let out = &block.out;
                    seen.push([out.i.a, out.tau_e, out.powers.i_dc]);
                }
            }
            k += 1.0;
        }
        figures(&seen, turns)
    }
}

fn mean(x: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = x.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / n
}

/// [`Steady::run`] of samples of current, torque and link current over these electrical periods.
#[expect(clippy::cast_precision_loss, reason = "a few samples")]
fn figures(seen: &[[f64; 3]], turns: f64) -> [f64; 4] {
    let at = |k: usize| (TAU * turns * (k as f64 + 1.0) / seen.len() as f64).sin_cos();
    let both = |f: fn((f64, f64)) -> f64| 2.0 * mean(seen.iter().enumerate().map(|(k, x)| x[0] * f(at(k))));
    let (s, c) = (both(|(sin, _)| sin), both(|(_, cos)| cos));
    let fundamental = |k: usize| s * at(k).0 + c * at(k).1;
    let [tau, i_dc] = [1, 2].map(|x: usize| mean(seen.iter().map(|seen| seen[x])));
    let ripple = mean(seen.iter().enumerate().map(|(k, x)| (x[0] - fundamental(k)).powi(2))).sqrt();
    let torque = mean(seen.iter().map(|x| (x[1] - tau).powi(2))).sqrt();
    // An edge within a part takes from the square in proportion to the length of the parts.
    let parts = mean(seen.iter().map(|x| (x[2] - i_dc).powi(2)));
    let pairs = mean(seen.chunks(2).map(|x| (0.5 * (x[0][2] + x[1][2]) - i_dc).powi(2)));
    let link = (2.0 * parts - pairs).sqrt();
    [ripple, torque, i_dc, link]
}

/// Ripple of the current (Holmes and Lipo) and of the link's current (Kolar and Round 2006) at the modulation `m`.
fn closed([u_dc, f, i_q, T]: [f64; 4]) -> (f64, [f64; 2]) {
    let (w, L, R, psi) = (TAU * f, 6e-3, 2.0, 0.15);
    let (d, q) = (-w * L * i_q, R * i_q + w * psi);
    let m = 2.0 * d.hypot(q) / u_dc;
    let cos = q / d.hypot(q);
    let distortion =
        1.5 * m * m - 4.0 * SQRT_3 / PI * m.powi(3) + (27.0 / 16.0 - 81.0 * SQRT_3 / (64.0 * PI)) * m.powi(4);
    let link = m * (SQRT_3 / (4.0 * PI) + cos * cos * (SQRT_3 / PI - 9.0 / 16.0 * m));
    (m, [u_dc * T / (24.0 * L) * distortion.sqrt(), i_q * link.sqrt()])
}

/// The figures are those of a plant outside the project; the closed forms leave out the resistance and the ripple's part of the
/// link's current.
#[test]
fn steady_states_have_the_figures_of_an_independent_plant() {
    for (point, m, expected, tolerance) in [
        ([325.0, 50.0, 4.0, 1e-4], 0.3424, [0.07171, 0.06483, 1.01781, 1.63912], [2e-3, 2e-3]),
        ([325.0, 125.0, 4.0, 1e-4], 0.7829, [0.10909, 0.07668, 2.32316, 1.75870], [2e-3, 2e-3]),
        ([325.0, 75.0, 2.0, 2e-4], 0.4609, [0.17356, 0.15244, 0.69034, 0.89735], [2e-3, 1.2e-2]),
        ([200.0, 60.0, 5.0, 5e-5], 0.6750, [0.03187, 0.02487, 2.49563, 2.26767], [2e-3, 2e-3]),
    ] {
        let found = Steady(point).run();
        let (modulation, [ripple, link]) = closed(point);
        println!("{point:?}: {found:.5?}, expected {expected:?}; closed forms {ripple:.5} A, {link:.5} A");
        assert!((modulation - m).abs() < 1e-4, "{modulation}");
        for ((found, expected), tolerance) in found.iter().zip(expected).zip([3e-3, 3e-3, 1e-3, 1e-3]) {
            assert!((found / expected - 1.0).abs() < tolerance, "{point:?}: {found}, not {expected}");
        }
        assert!((found[0] / ripple - 1.0).abs() < tolerance[0] && (found[3] / link - 1.0).abs() < tolerance[1]);
    }
}

/// Lowest speed after 0.8 s, speed at the end (rpm), and angle error at the end (deg) of a load step.
fn load_step(speed_ref: f64, set: impl Fn(&mut Pair)) -> ([f64; 3], Vec<f64>) {
    let mut pair = Pair::default();
    set(&mut pair);
    pair.set_inputs(0.0, 0.0, 325.0);
    pair.start().unwrap();
    let (mut least, mut speeds) = (f64::INFINITY, Vec::new());
    for k in 0..22_000_u32 {
        let t = f64::from(k) * 1e-4;
        let speed = if k >= 1000 { speed_ref * RPM } else { 0.0 };
        pair.set_inputs(speed, if k >= 8000 { 2.0 } else { 0.0 }, 325.0);
        pair.step(1e-4).unwrap();
        let rpm = pair.plant.out.speed / RPM;
        speeds.push(rpm);
        if t >= 0.8 {
            least = least.min(rpm);
        }
    }
    let error = wrap(pair.plant.out.theta_e - pair.controller.out.theta_est).to_degrees();
    ([least, pair.plant.out.speed / RPM, error.abs()], speeds)
}

fn switched(pair: &mut Pair) {
    pair.plant.model.parameters.inverter.pwm.mode = InverterMode::Switched;
}

#[test]
fn the_closed_loop_is_that_of_the_average_inverter() {
    for (speed, lowest) in [(1000.0, 881.84), (0.0, -127.42)] {
        let ([average, ..], a) = load_step(speed, |_| ());
        let ([found, end, _], b) = load_step(speed, switched);
        let most = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("{speed} rpm: lowest {average:.3} and {found:.3} rpm, {end:.3} rpm at the end; {most:.4} rpm apart");
        assert!(most < 0.02 && (found - lowest).abs() < 0.05, "{found} rpm, {most} rpm apart");
    }
}

/// The lowest speed at 1000 rpm is that of an independent calculation, [`Witness`] in the same loop with steps of 6 ns to 0.1 us:
/// 839.098 rpm. It depends on small changes: 1e-6 of the inertia change it by 0.2 rpm.
#[test]
fn the_closed_loop_with_dead_time() {
    for (speed, lowest, average) in [(1000.0, 839.098, 785.0), (0.0, -164.90, -164.93)] {
        let dead = |pair: &mut Pair| pair.plant.model.parameters.inverter.dead_time = 2e-6;
        let ([by_zone, ..], _) = load_step(speed, dead);
        let ([found, end, error], _) = load_step(speed, |pair| {
            switched(pair);
            dead(pair);
        });
        println!(
            "{speed} rpm: lowest {found:.3}, {end:.3} rpm and {error:.3} deg at the end; average {by_zone:.3} rpm"
        );
        assert!((found - lowest).abs() < 0.05, "{found} rpm");
        assert!((by_zone - average).abs() < 0.1, "{by_zone} rpm");
    }
}

/// A plant of its own, without salience: between the instants of a period steps of 1 us, with dead time of 20 ns, in which the
/// legs' voltages are those that end the step with no current, limited to the rails.
struct Witness {
    i: [f64; 2],
    w: f64,
    theta: f64,
    /// End in s of a dead time of the last period, from the beginning of the present one.
    until: [f64; 3],
    /// Number of steps in which a leg blocked.
    blocked: u32,
}

impl Witness {
    fn phases([a, b]: [f64; 2]) -> [f64; 3] {
        [a, 0.5 * (SQRT_3 * b - a), -0.5 * (SQRT_3 * b + a)]
    }

    /// A period of `T` (s) with the references `u` (V), a dead time of `dead` (s), and the load `tau` (N.m).
    fn period(&mut self, T: f64, u: [f64; 3], dead: f64, tau: f64) {
        let (u_dc, R, L, psi, J, B) = (325.0, 2.0, 6e-3, 0.15, 1.5e-3, 2e-4);
        let common = -0.5 * (u.into_iter().fold(f64::MIN, f64::max) + u.into_iter().fold(f64::MAX, f64::min));
        let pulses = u.map(|u| {
            let d = (0.5 + (u + common) / u_dc).clamp(0.0, 1.0);
            [0.5 * T * (1.0 - d), 0.5 * T * (1.0 + d)]
        });
        let mut instants = vec![0.0, T];
        for (pulse, until) in pulses.iter().zip(self.until) {
            instants.extend(pulse.iter().flat_map(|t| [*t, t + dead]).chain([until]).filter(|t| (0.0..T).contains(t)));
        }
        instants.sort_by(f64::total_cmp);
        for span in instants.windows(2).filter(|span| span[1] - span[0] > 1e-15) {
            let middle = 0.5 * (span[0] + span[1]);
            let (mut v, mut is_dead) = ([0.0; 3], [false; 3]);
            for x in 0..3 {
                let [on, off] = pulses[x];
                let since = if middle > off {
                    middle - off
                } else if middle > on {
                    middle - on
                } else {
                    T
                };
                is_dead[x] = since < dead || middle < self.until[x];
                v[x] = if middle > on && middle < off { u_dc } else { 0.0 };
            }
            let any = is_dead.contains(&true);
            let count = ((span[1] - span[0]) / if any { 2e-8 } else { 1e-6 }).ceil();
            let h = (span[1] - span[0]) / count;
            let mut left = count;
            while left > 0.5 {
                let (sin, cos) = (3.0 * self.theta).sin_cos();
                let e = [-3.0 * self.w * psi * sin, 3.0 * self.w * psi * cos];
                let free = Self::phases([0, 1].map(|k| self.i[k] - h / L * (R * self.i[k] + e[k])));
                let mut rounds = if any { 30 } else { 0 };
                while rounds > 0 {
                    for x in (0..3).filter(|&x| is_dead[x]) {
                        let others: f64 = (0..3).filter(|&y| y != x).map(|y| v[y]).sum();
                        v[x] = (1.5 * (others / 3.0 - free[x] * L / h)).clamp(0.0, u_dc);
                    }
                    rounds -= 1;
                }
                self.blocked += u32::from((0..3).any(|x| is_dead[x] && v[x] > 0.0 && v[x] < u_dc));
                let u = [(2.0 * v[0] - v[1] - v[2]) / 3.0, (v[1] - v[2]) / SQRT_3];
                let slope = |[a, b, w, theta]: [f64; 4]| {
                    let (sin, cos) = (3.0 * theta).sin_cos();
                    let tau_e = 4.5 * psi * (b * cos - a * sin);
                    [
                        (u[0] - R * a + 3.0 * w * psi * sin) / L,
                        (u[1] - R * b - 3.0 * w * psi * cos) / L,
                        (tau_e - tau - B * w - 0.03 * (w / 0.3).tanh()) / J,
                        w,
                    ]
                };
                // Heun's method.
                let x = [self.i[0], self.i[1], self.w, self.theta];
                let first = slope(x);
                let second = slope([0, 1, 2, 3].map(|k| x[k] + h * first[k]));
                let [a, b, w, theta] = [0, 1, 2, 3].map(|k| x[k] + 0.5 * h * (first[k] + second[k]));
                *self = Self { i: [a, b], w, theta, ..*self };
                left -= 1.0;
            }
        }
        self.until = pulses.map(|[_, off]| off + dead - T);
    }
}

/// At a low speed, every phase current passes zero within dead times: the plant blocks where the witness does.
#[test]
fn dead_time_with_blocking_diodes_is_that_of_a_witness() {
    for (dead, amplitude, f) in [(2e-6, 14.0, 10.0), (5e-6, 22.0, 15.0), (2e-6, 60.0, 50.0), (0.0, 30.0, 20.0)] {
        let mut block = Block::<PmsmPlant>::default();
        let par = &mut block.model.parameters;
        (par.inverter.dead_time, par.inverter.pwm.mode) = (dead, InverterMode::Switched);
        block.initialize();
        let mut witness = Witness { i: [0.0; 2], w: 0.0, theta: 0.0, until: [0.0; 3], blocked: 0 };
        let (mut now, mut most) = (Elapsed::ZERO, 0.0_f64);
        for k in 0..400_u32 {
            let t = 1e-4 * f64::from(k);
            let u = [0.0, 1.0, 2.0].map(|x| amplitude * (TAU * (f * t * (t / 0.02).min(1.0) - x / 3.0)).cos());
            let [a, b, c] = u;
            block.model.inputs.u = Phases { a, b, c };
            block.model.inputs.tau_load = 0.1;
            let step = Step { start: now, h: 1e-4 };
            block.step(&step).unwrap();
            now = step.end();
            witness.period(1e-4, u, dead, 0.1);
            let i = Witness::phases(witness.i);
            for (ours, theirs) in [(block.out.i.a, i[0]), (block.out.i.b, i[1]), (block.out.i.c, i[2])] {
                most = most.max((ours - theirs).abs());
            }
            most = most.max((block.out.speed - witness.w).abs());
        }
        println!("{dead} s, {amplitude} V, {f} Hz: {most:e} A or rad/s apart, blocked in {} steps", witness.blocked);
        assert!(most < 2e-5 && (dead == 0.0 || witness.blocked > 100), "{dead} s: {most:e} A");
    }
}

/// However long the communication steps are, and wherever they end, the machine is the same.
#[test]
fn any_step_gives_the_same() {
    let run = |h: f64, n: u32| {
        let mut block = Block::<PmsmPlant>::default();
        let par = &mut block.model.parameters;
        (par.inverter.dead_time, par.inverter.pwm.mode, par.initial.speed) = (2e-6, InverterMode::Switched, 20.0);
        block.model.inputs.u = Phases { a: 12.0, b: -3.0, c: -9.0 };
        block.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..n {
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        let out = &block.out;
        [out.i.a, out.i.b, out.speed, out.angle, out.energy.r#in, out.energy.loss]
    };
    let whole = run(1.4e-3, 10);
    for (h, n) in [(1e-4, 140), (7e-5, 200), (1e-6, 14_000), (1.4e-2, 1)] {
        let found = run(h, n);
        for (a, b) in found.iter().zip(whole) {
            assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{h} s: {found:?}, not {whole:?}");
        }
    }
}
