//! Self-commissioning at standstill, judged by a foreign plant over a population of machines.
#![allow(missing_docs, non_snake_case)]

mod plant;

use drive_control::commission::{Commission, CommissionFault, CommissionState, Identified, Setup};
use plant::{Bench, Motor, between_axes};

fn setup(motor: &Motor) -> Setup {
    Setup { T_s: motor.T, delay: 1, i: motor.I, speed: motor.w_rated, t_max: 150.0 }
}

/// Runs to the end.
fn run(motor: &Motor, seed: u64) -> (Commission, Bench) {
    let mut commission = Commission::new(setup(motor));
    let mut bench = Bench::new(motor.clone(), seed);
    let trace = std::env::var("TRACE").is_ok();
    let mut last = CommissionState::Idle;
    while !matches!(commission.state(), CommissionState::Done | CommissionState::Refused) {
        let i = bench.measure();
        let out = commission.update(i, motor.u_dc);
        bench.tick(out.u, out.gates);
        if trace && commission.state() != last {
            last = commission.state();
            eprintln!(
                "{:8.3} s {last:?} angle {:.4} w {:.4} most {:.3} I",
                commission.time(),
                bench.angle(),
                bench.w,
                bench.most / motor.I
            );
        }
    }
    (commission, bench)
}

/// Errors of a quantity over a population.
#[derive(Default)]
struct Errors {
    name: &'static str,
    all: Vec<f64>,
    inside: usize,
    refused: usize,
}

impl Errors {
    fn take(&mut self, found: Identified, truth: f64) {
        if found.u >= 1.0 {
            self.refused += 1;
            return;
        }
        let error = (found.value / truth - 1.0).abs();
        self.all.push(100.0 * error);
        self.inside += usize::from(error <= found.u);
    }

    fn at(&self, share: f64) -> f64 {
        let mut sorted = self.all.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        if n == 0 {
            return f64::NAN;
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, clippy::cast_sign_loss)]
        let k = ((share * n as f64).ceil() as usize).clamp(1, n);
        sorted[k - 1]
    }

    fn row(&self) -> String {
        let n = self.all.len();
        format!(
            "{:10} {n:4} accepted {:3} refused; median {:.3} 95 % {:.3} 99 % {:.3} worst {:.3}; inside {} of {n}",
            self.name,
            self.refused,
            self.at(0.5),
            self.at(0.95),
            self.at(0.99),
            self.at(1.0),
            self.inside
        )
    }
}

#[test]
#[ignore = "minutes: cargo test -p drive-control --test commission population -- --ignored --nocapture; MACHINES=40 for fewer"]
fn population() {
    let count = |name: &str, default: u64| std::env::var(name).map_or(default, |n| n.parse().unwrap());
    let (first, n, seed, blocked) =
        (count("FIRST", 0), count("MACHINES", 300), count("SEED", 1), count("BLOCKED", 0) > 0);
    let names = ["R_s", "u_dead", "i_zero", "L_d", "L_q", "L_d_plus", "L_d_minus", "L_q_chord"];
    let mut errors = names.map(|name| Errors { name, ..Errors::default() });
    let (mut times, mut peaks, mut faults, mut axes) = (vec![], vec![], vec![], vec![]);
    for index in first..first + n {
        let mut motor = Motor::draw(seed, index);
        motor.blocked = blocked;
        let (commission, bench) = run(&motor, seed * 31_337 + index);
        let r = commission.results();
        let truths = [
            motor.R,
            motor.u_dead + motor.u_th,
            motor.i_zero(),
            motor.L_d,
            motor.L_q,
            if r.i_d > 0.0 { motor.chord_d(r.i_d) } else { 1.0 },
            if r.i_d > 0.0 { motor.chord_d(-r.i_d) } else { 1.0 },
            if r.i_q > 0.0 { motor.chord_q(r.i_q) } else { 1.0 },
        ];
        let found = [r.R_s, r.u_dead, r.i_zero, r.L_d, r.L_q, r.L_d_plus, r.L_d_minus, r.L_q_chord];
        let mut line = format!(
            "{index:3} {:?} {:?} {:.1} s {:.2} I",
            commission.state(),
            commission.fault(),
            commission.time(),
            bench.most / motor.I
        );
        for k in 0..names.len() {
            errors[k].take(found[k], truths[k]);
            if found[k].u < 1.0 {
                line += &format!(
                    " {} {:+.3} ({:.3})",
                    names[k],
                    100.0 * (found[k].value / truths[k] - 1.0),
                    100.0 * found[k].u
                );
            } else {
                line += &format!(" {} -", names[k]);
            }
        }
        let axis = between_axes(r.axis, bench.angle()).to_degrees();
        line += &format!(
            " axis {axis:+.2} x_d {:.3} x_q {:.3} xi {:.2} blocked {} J/taur i_d {:.2} i_q {:.2}",
            motor.R * motor.T / motor.L_d,
            motor.R * motor.T / motor.L_q,
            motor.L_q / motor.L_d,
            r.blocked,
            r.i_d / motor.I,
            r.i_q / motor.I
        );
        println!("{line}");
        if commission.state() == CommissionState::Refused {
            faults.push((index, commission.fault()));
        } else {
            axes.push(axis.abs());
        }
        times.push(commission.time());
        peaks.push(bench.most / motor.I);
    }
    for e in &errors {
        println!("{}", e.row());
    }
    for (name, mut x) in [("time s", times), ("peak / I", peaks), ("axis deg", axes)] {
        x.sort_by(f64::total_cmp);
        if !x.is_empty() {
            println!("{name}: median {:.3} worst {:.3}", x[x.len() / 2], x[x.len() - 1]);
        }
    }
    println!("faults: {faults:?}");
    let _ = CommissionFault::None;
}
