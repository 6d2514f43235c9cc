//! Self-commissioning at standstill, judged by a foreign plant over a population of machines.
#![allow(missing_docs, non_snake_case)]

mod plant;

use drive_base::frame::Phases;
use drive_control::commission::{
    Commission, CommissionFault as Fault, CommissionSetup, CommissionState as State, Commissioning, Identified, Results,
};
use plant::{Bench, Motor, between_axes};
use std::fmt::Write as _;

fn setup(motor: &Motor) -> CommissionSetup {
    CommissionSetup {
        mode: Commissioning::Standstill,
        n_p: motor.pole_pairs(),
        T_s: motor.T,
        delay: 1,
        i: motor.I,
        speed: motor.w_rated,
        t_max: 150.0,
    }
}

fn is_over(commission: &Commission) -> bool {
    matches!(commission.state(), State::Done | State::Refused)
}

/// One period.
fn period(commission: &mut Commission, bench: &mut Bench, gain: f64, u_dc: f64) {
    let Phases { a, b, c } = bench.measure();
    let out = commission.update(Phases { a: gain * a, b: gain * b, c: gain * c }, u_dc);
    bench.tick(out.u, out.gates);
}

/// The quantities of the turning machine.
fn spun(r: &Results, m: &Motor) -> [(&'static str, Identified, f64); 5] {
    [
        ("psi_M", r.psi_M, m.psi),
        ("J", r.J, m.J),
        ("B", r.B, m.B),
        ("tau_coulomb", r.tau_coulomb, m.tau_coulomb),
        ("tau_friction", r.tau_friction, m.friction(0.3 * m.w_rated / m.n_p)),
    ]
}

#[test]
#[ignore = "scratch"]
fn scratch() {
    let from: u64 = std::env::var("FROM").map_or(0, |n| n.parse().unwrap());
    let to: u64 = std::env::var("TO").map_or(10, |n| n.parse().unwrap());
    let seed: u64 = std::env::var("SEED").map_or(1, |n| n.parse().unwrap());
    let trace = std::env::var("TRACE").is_ok();
    for index in from..to {
        let motor = Motor::draw(seed, index);
        let mut s = setup(&motor);
        s.mode = Commissioning::Spin;
        let (mut c, mut bench) = (Commission::new(s), Bench::new(motor.clone(), seed * 31337 + index));
        let (mut n, mut last, mut begun, mut spin_most) = (0u64, State::Idle, 0.0, 0.0f64);
        let mut still_most = 0.0;
        let mut seen = String::new();
        let every: u64 = std::env::var("EVERY").map_or(1 << 40, |n| n.parse().unwrap());
        while !is_over(&c) {
            period(&mut c, &mut bench, 1.0, motor.u_dc);
            n += 1;
            if c.state() != last {
                last = c.state();
                if last == State::Start { begun = c.time(); still_most = bench.most; bench.most = 0.0; }
            }
            if matches!(c.state(), State::Start | State::Levels) {
                spin_most = spin_most.max(bench.most);
                if trace {
                    let text = c.debug();
                    let key = text.split('|').next().unwrap().to_string();
                    if key != seen || (n % every == 0) {
                        println!("{:.3} {:?} w {:.3} i {:.4} {:.4} off {:.4} {}", c.time(), c.state(), bench.w * motor.n_p / motor.w_rated, bench.dq()[0] / motor.I, bench.dq()[1] / motor.I, drive_base::math::wrap(c.angle() - bench.angle()), if every < 10 { "" } else { &text });
                        seen = key;
                    }
                }
            }
        }
        let x = motor.J * motor.w_rated / motor.n_p / (1.5 * motor.n_p * motor.psi * 0.5 * motor.I);
        print!("{index:3} {:?} {:?} {:.1} {:.1} s, i {:.2} {:.2}, w_r {:.0} T_a {:.3} Lq/Ld {:.2} psi {:.3}", c.state(), c.fault(), begun, c.time(), still_most / motor.I, spin_most / motor.I, motor.w_rated, x, motor.L_q / motor.L_d, motor.psi * motor.w_rated / motor.u_dc * 1.732);
        let [a, b, ax, r] = c.scratch();
        print!(" LL {:.3} {:.3} axis {ax:.3} R {:.3} x {:.3} {:.3} LqI/psi {:.2} u_d {:.3}", a / motor.L_d, b / motor.L_q, r / motor.R, motor.R * motor.T / motor.L_d, motor.R * motor.T / motor.L_q, motor.L_q * motor.I / motor.psi, motor.u_dead / motor.u_dc * 1.732);
        if trace {
            for x in [0.003, 0.005, 0.007, 0.01, 0.014, 0.02, 0.028, 0.04, 0.06, 0.1] {
                println!("leg at {x} I: {:+.3} % of u_dead (true {:.3})", 100.0 * (c.leg(x * motor.I) - motor.leg(x * motor.I)) / motor.u_dead, motor.leg(x * motor.I) / motor.u_dead);
            }
            println!("sigma {:.4} I", motor.sigma / motor.I);
        }
        for (name, found, truth) in spun(c.results(), &motor) {
            print!(", {name} {:+.3} ({:.3})", 100.0 * (found.value / truth - 1.0), 100.0 * found.u);
        }
        println!();
    }
}

/// Runs to the end; `meddle` may change anything before each sample.
fn run_with(motor: &Motor, seed: u64, mut meddle: impl FnMut(&mut Commission, &mut Bench)) -> (Commission, Bench) {
    let (mut commission, mut bench) = (Commission::new(setup(motor)), Bench::new(motor.clone(), seed));
    while !is_over(&commission) {
        meddle(&mut commission, &mut bench);
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
    }
    (commission, bench)
}

fn run(motor: &Motor, seed: u64) -> (Commission, Bench) {
    run_with(motor, seed, |_, _| ())
}

/// The quantities, with what the commissioning has found and the truth.
fn compared(r: &Results, m: &Motor) -> [(&'static str, Identified, f64); 8] {
    let at = |chord: &dyn Fn(f64) -> f64, i: f64| if i == 0.0 { 1.0 } else { chord(i) };
    let d = |i: f64| m.chord_d(i);
    [
        ("R_s", r.R_s, m.R),
        ("u_dead", r.u_dead, m.u_dead + m.u_th),
        ("i_zero", r.i_zero, m.i_zero()),
        ("L_d", r.L_d, m.L_d),
        ("L_q", r.L_q, m.L_q),
        ("L_d_plus", r.L_d_plus, at(&d, r.i_d)),
        ("L_d_minus", r.L_d_minus, at(&d, -r.i_d)),
        ("L_q_chord", r.L_q_chord, at(&|i| m.chord_q(i), r.i_q)),
    ]
}

/// Relative errors are within `limits` for R_s, the dead time and the inductances; nothing but what `refused` names is refused.
fn check(r: &Results, motor: &Motor, limits: [f64; 3], refused: &[&str]) {
    for (name, found, truth) in compared(r, motor) {
        let limit = match name {
            "R_s" => limits[0],
            "u_dead" => limits[1],
            "i_zero" => continue,
            _ => limits[2],
        };
        assert!(found.u < 1.0 || refused.contains(&name), "{name} is refused");
        let error = found.value / truth - 1.0;
        assert!(found.u >= 1.0 || error.abs() < limit, "{name}: {:+.3} %, half-width {:.3}", 100.0 * error, found.u);
    }
}

/// Free and blocked machines of the population: 12 V to 700 V, R T/L up to 1.3, L_q/L_d up to 5.
#[test]
fn machines_commission_themselves() {
    for index in [3, 6, 7, 9, 24] {
        let motor = Motor::draw(1, index);
        let (commission, bench) = run(&motor, index);
        assert_eq!(commission.state(), State::Done, "machine {index}: {:?}", commission.fault());
        check(commission.results(), &motor, [0.002, 0.01, 0.02], &[]);
        assert!(bench.most < 1.1 * motor.I && !commission.results().blocked, "machine {index}");
        assert!(between_axes(commission.results().axis, bench.angle()).abs() < 0.1);
    }
    let motor = Motor::draw(2, 51).held();
    let (commission, bench) = run(&motor, 1);
    let r = commission.results();
    assert!(r.blocked && r.north, "{r:?}");
    check(r, &motor, [0.002, 0.01, 0.02], &[]);
    assert!(drive_base::math::wrap(r.axis - bench.angle()).abs() < 0.05, "the north pole");
}

/// Exact sensors, no dead time, a linear machine; and the same with currents that read 2 % high.
#[test]
fn exact_data_give_exact_values_that_scale_with_the_sensors() {
    let motor = Motor::draw(1, 9).ideal();
    for gain in [1.0, 1.02] {
        let (mut commission, mut bench) = (Commission::new(setup(&motor)), Bench::new(motor.clone(), 1));
        while !is_over(&commission) {
            period(&mut commission, &mut bench, gain, motor.u_dc);
        }
        let r = commission.results();
        for (name, found, truth) in [("R_s", r.R_s, motor.R), ("L_d", r.L_d, motor.L_d), ("L_q", r.L_q, motor.L_q)] {
            let error = found.value * gain / truth - 1.0;
            assert!(found.u < 1.0 && error.abs() < 5e-4, "{name}: {:+.4} % at {gain}", 100.0 * error);
        }
    }
}

/// The command that acts is the one of `timing.delay`.
#[test]
fn every_delay_gives_the_same_values() {
    for delay in [0, 2] {
        let motor = Motor::draw(1, 7);
        let setup = CommissionSetup { delay, ..setup(&motor) };
        let (mut commission, mut bench) = (Commission::new(setup), Bench::new(motor.clone(), 1));
        bench.delay = usize::try_from(delay).unwrap();
        while !is_over(&commission) {
            period(&mut commission, &mut bench, 1.0, motor.u_dc);
        }
        check(commission.results(), &motor, [0.002, 0.01, 0.02], &[]);
    }
}

/// Stored and restored in the middle of each state, the run has the same bits, and the stored state one size.
#[test]
fn a_restored_run_is_the_same_run() {
    let motor = Motor::draw(1, 7);
    let (whole, _) = run(&motor, 5);
    let (mut size, mut states, mut last, mut since) = (0, vec![], State::Idle, 0);
    let (restored, _) = run_with(&motor, 5, |commission, _| {
        since = if commission.state() == last { since + 1 } else { 0 };
        last = commission.state();
        if since != 40 {
            return;
        }
        states.push(commission.state());
        let bytes = postcard::to_stdvec(commission).unwrap();
        assert!(size == 0 || bytes.len() == size, "{} and {size} bytes", bytes.len());
        size = bytes.len();
        *commission = postcard::from_bytes(&bytes).unwrap();
    });
    assert!(whole == restored && size < 40_000, "{size} bytes");
    for state in [State::Probe, State::Align, State::Resistance, State::Swing, State::Axes, State::Saturation] {
        assert!(states.contains(&state), "{state:?}");
    }
}

/// After any fault the gates are off and stay off.
fn is_safe(commission: &mut Commission, fault: Fault) {
    assert_eq!((commission.state(), commission.fault()), (State::Refused, fault));
    for _ in 0..3 {
        let out = commission.update(Phases::default(), 100.0);
        assert!(!out.gates && out.u.magnitude() == 0.0);
    }
}

#[test]
fn an_abort_at_any_time_is_safe() {
    let motor = Motor::draw(1, 7);
    let (commission, mut bench) = (Commission::new(setup(&motor)), Bench::new(motor.clone(), 5));
    let (mut commission, mut n) = (commission, 0_u32);
    while !is_over(&commission) {
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
        n += 1;
        if n % 997 == 0 && !is_over(&commission) {
            let mut aborted = commission.clone();
            aborted.abort();
            is_safe(&mut aborted, Fault::Aborted);
        }
    }
    let mut done = commission;
    done.abort();
    assert_eq!(done.state(), State::Done, "an abort after the end changes nothing");
}

#[test]
fn faults_are_named_and_safe() {
    let motor = Motor::draw(1, 7);
    // The rotor turns at the start; so slowly that the dead time hides its EMF, the alignment brakes it.
    for (share, hidden) in [(0.05, true), (0.3, false), (-1.0, false)] {
        let start = |commission: &mut Commission, bench: &mut Bench| {
            if commission.state() == State::Offsets {
                bench.w = share * motor.w_rated / motor.n_p;
            }
        };
        let (mut commission, _) = run_with(&motor, 1, start);
        if hidden && commission.state() == State::Done {
            check(commission.results(), &motor, [0.002, 0.01, 0.02], &[]);
            continue;
        }
        assert!(matches!(commission.fault(), Fault::NotFollowing | Fault::Current), "{:?}", commission.fault());
        let fault = commission.fault();
        is_safe(&mut commission, fault);
    }
    // The link falls by a fifth, a current is not finite or beyond its limit, the time is over.
    for (state, u_dc, gain, fault) in [
        (State::Probe, 0.79, 1.0, Fault::Voltage),
        (State::Saturation, 0.79, 1.0, Fault::Voltage),
        (State::Resistance, 1.0, 4.0, Fault::Current),
        (State::Axes, 1.0, f64::NAN, Fault::Current),
        (State::Swing, f64::NAN, 1.0, Fault::Voltage),
    ] {
        let (mut commission, mut bench) = (Commission::new(setup(&motor)), Bench::new(motor.clone(), 1));
        while !is_over(&commission) {
            let now = commission.state() == state;
            let (gain, u_dc) = if now { (gain, u_dc) } else { (1.0, 1.0) };
            period(&mut commission, &mut bench, gain, u_dc * motor.u_dc);
        }
        is_safe(&mut commission, fault);
    }
    let mut commission = Commission::new(CommissionSetup { t_max: 2.0, ..setup(&motor) });
    let mut bench = Bench::new(motor.clone(), 1);
    while !is_over(&commission) {
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
    }
    is_safe(&mut commission, Fault::Time);
    // No machine at all.
    let mut commission = Commission::new(setup(&motor));
    while !is_over(&commission) {
        commission.update(Phases::default(), motor.u_dc);
    }
    is_safe(&mut commission, Fault::Inductance);
}

/// A blocked rotor that gives way gives no wrong value.
#[test]
fn a_rotor_that_comes_loose_gives_no_wrong_value() {
    for state in [State::Align, State::Resistance, State::Axes, State::Saturation] {
        let motor = Motor::draw(2, 51).held();
        let (commission, bench) = run_with(&motor, 1, |commission, bench| {
            if commission.state() == state {
                bench.motor.blocked = false;
            }
        });
        for (name, found, truth) in compared(commission.results(), &bench.motor) {
            let error = (found.value / truth - 1.0).abs();
            assert!(found.u >= 1.0 || name == "i_zero" || error < 0.05, "{name} after {state:?}: {error}");
        }
    }
}

/// Errors of a quantity over a population.
#[derive(Default)]
struct Errors {
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

    /// The least error in % that `percent` of the errors do not exceed.
    fn at(&self, percent: usize) -> f64 {
        let mut sorted = self.all.clone();
        sorted.sort_by(f64::total_cmp);
        (sorted.len() * percent).div_ceil(100).checked_sub(1).map_or(f64::NAN, |k| sorted[k])
    }
}

/// Prints errors and half-widths in % (-100 and 100: refused), and compares those of 300 free machines of seed 1 with the
/// limits: errors in % at 95 and 99 %, greatest share refused, share inside the intervals. `MACHINES`, `SEED` and `BLOCKED=1`
/// select others.
#[test]
#[ignore = "a minute: cargo test -p drive-control --test commission population -- --ignored --nocapture"]
fn population() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |n| n.parse().unwrap());
    let (n, seed, blocked) = (number("MACHINES", 300), number("SEED", 1), number("BLOCKED", 0) > 0);
    let limits = [
        ("R_s", 0.18, 0.39, 5, 93),
        ("u_dead", 0.27, 1.35, 5, 93),
        ("i_zero", 9.0, 20.0, 10, 93),
        ("L_d", 1.125, 1.95, 5, 93),
        ("L_q", 2.4, 4.5, 18, 93),
        ("L_d_plus", 0.9, 1.2, 5, 93),
        ("L_d_minus", 0.9, 1.2, 5, 93),
        ("L_q_chord", 2.25, 4.2, 18, 93),
    ];
    let mut errors: Vec<Errors> = limits.iter().map(|_| Errors::default()).collect();
    let (mut times, mut peaks, mut faults) = (vec![], vec![], vec![]);
    for index in 0..n {
        let motor = Motor::draw(seed, index);
        let motor = if blocked { motor.held() } else { motor };
        let (commission, bench) = run(&motor, seed * 31_337 + index);
        let r = commission.results();
        let mut line =
            format!("{index:3} {:?} {:?} {:.1} s", commission.state(), commission.fault(), commission.time());
        for (errors, (name, found, truth)) in errors.iter_mut().zip(compared(r, &motor)) {
            errors.take(found, truth);
            let error = 100.0 * (found.value / truth - 1.0);
            write!(line, ", {name} {error:+.3} ({:.3})", 100.0 * found.u).unwrap();
        }
        let axis = between_axes(r.axis, bench.angle()).to_degrees();
        let x = [motor.L_d, motor.L_q].map(|L| motor.R * motor.T / L);
        println!("{line}, axis {axis:+.2} deg, R T/L {:.3} {:.3}, L_q/L_d {:.2}", x[0], x[1], motor.L_q / motor.L_d);
        if commission.state() == State::Refused {
            faults.push((index, commission.fault()));
        }
        times.push(commission.time());
        peaks.push(bench.most / motor.I);
    }
    let judged = n == 300 && seed == 1 && !blocked;
    let mut beyond = vec![];
    for (e, (name, at_95, at_99, refused, inside)) in errors.iter().zip(limits) {
        let all = e.all.len();
        let [median, most_95, most_99, worst] = [50, 95, 99, 100].map(|percent| e.at(percent));
        println!(
            "{name:9} {all:3} accepted, {:2} refused; median {median:.3}, 95 % {most_95:.3}, 99 % {most_99:.3}, worst {worst:.3}; \
             {} inside",
            e.refused, e.inside
        );
        if most_95 > at_95 || most_99 > at_99 || 100 * e.refused > refused * 300 || 100 * e.inside < inside * all {
            beyond.push(name);
        }
    }
    for (name, x) in [("time in s", &mut times), ("greatest current over I", &mut peaks)] {
        x.sort_by(f64::total_cmp);
        println!("{name}: median {:.2}, worst {:.2}", x[x.len() / 2], x[x.len() - 1]);
    }
    println!("faults: {faults:?}");
    assert!(!judged || beyond.is_empty(), "beyond the limits: {beyond:?}");
}
