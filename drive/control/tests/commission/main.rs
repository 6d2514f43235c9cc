//! Self-commissioning, on a population of machines of an independent plant.
#![allow(missing_docs, non_snake_case)]

#[path = "../foreign/mod.rs"]
mod foreign;
mod many;

use drive_base::frame::Phases;
use drive_control::commission::{
    Commission, CommissionFault as Fault, CommissionMode, CommissionSetup, CommissionState as State, Identified,
    Results,
};
use foreign::{Bench, Class, Motor, between_axes};
use std::fmt::Write as _;

fn setup(motor: &Motor) -> CommissionSetup {
    CommissionSetup {
        mode: if motor.blocked { CommissionMode::Standstill } else { CommissionMode::Spin },
        n_p: motor.pole_pairs(),
        T_s: motor.T,
        delay: 1,
        i: motor.I,
        speed: motor.w_rated,
        t_max: 150.0,
        carrier: motor.T,
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

/// Runs to the end; returns the maximum speed relative to the rated speed, during the swings at standstill and while the
/// machine turns.
fn run_fast(motor: &Motor, seed: u64) -> (Commission, Bench, [f64; 2]) {
    let mut fastest = [0.0_f64; 2];
    let (commission, bench) = run_with(motor, seed, |commission, bench| {
        let turns = usize::from(matches!(commission.state(), State::Start | State::Levels));
        fastest[turns] = fastest[turns].max(bench.w.abs() * motor.n_p / motor.w_rated);
    });
    (commission, bench, fastest)
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

/// The quantities, with the results of the commissioning and the true values.
fn compared(r: &Results, m: &Motor) -> [(&'static str, Identified, f64); 15] {
    let at = |chord: &dyn Fn(f64) -> f64, i: f64| if i == 0.0 { 1.0 } else { chord(i) };
    let d = |i: f64| m.chord_d(i);
    let [s_2, s_3] = if r.i_d == 0.0 { [1.0; 2] } else { m.saturation(r.i_d) };
    [
        ("R_s", r.R_s, m.R),
        ("u_dead", r.u_dead, m.u_dead + m.u_th),
        ("i_zero", r.i_zero, m.i_zero()),
        ("L_d", r.L_d, m.L_d),
        ("L_q", r.L_q, m.L_q),
        ("L_d_plus", r.L_d_plus, at(&d, r.i_d)),
        ("L_d_minus", r.L_d_minus, at(&d, -r.i_d)),
        ("L_q_chord", r.L_q_chord, at(&|i| m.chord_q(i), r.i_q)),
        ("psi_M", r.psi_M, m.psi),
        ("J", r.J, m.J),
        ("B", r.B, m.B),
        ("tau_coulomb", r.tau_coulomb, m.tau_coulomb),
        ("tau_friction", r.tau_friction, m.friction(0.3 * m.w_rated / m.n_p)),
        ("s_2", r.s_2, s_2),
        ("s_3", r.s_3, s_3),
    ]
}

/// Relative errors are within limits; only the values named in `refused` are refused. i_zero, B and tau_coulomb do not count.
fn check(r: &Results, motor: &Motor, refused: &[&str]) {
    for (name, found, truth) in compared(r, motor) {
        let limit = match name {
            "R_s" => 0.002,
            "u_dead" => 0.01,
            "psi_M" => 0.004,
            "J" => 0.015,
            "tau_friction" => 0.03,
            "i_zero" | "B" | "tau_coulomb" | "s_2" | "s_3" => continue,
            _ => 0.02,
        };
        assert!(found.u < 1.0 || refused.contains(&name), "{name} is refused");
        let error = found.value / truth - 1.0;
        assert!(found.u >= 1.0 || error.abs() < limit, "{name}: {:+.3} %, half-width {:.3}", 100.0 * error, found.u);
    }
}

const SPUN: [&str; 3] = ["psi_M", "J", "tau_friction"];

/// Free machines of the population, to 0.1 of the rated speed and with the gates off, and a blocked one: 12 V to 700 V,
/// R T/L up to 1.3, L_q/L_d up to 5, 20 ms to 9 s to the rated speed.
#[test]
fn machines_commission_themselves() {
    for index in [3, 6, 7, 9, 13, 24] {
        let motor = Motor::draw(1, index);
        let (commission, bench, [_, turning]) = run_fast(&motor, index);
        assert_eq!(commission.state(), State::Done, "machine {index}: {:?}", commission.fault());
        // With a great R T/L, the samples of a switching inverter would differ from the mean current by up to 2 %, and its ripple is
        // not known.
        let slow = motor.R * motor.T > 0.3 * motor.L_d;
        let refused: &[&str] = if slow { &["R_s", "psi_M", "J", "tau_friction"] } else { &[] };
        check(commission.results(), &motor, refused);
        assert!(bench.most < 1.1 * motor.I && !commission.results().blocked, "machine {index}");
        let rated = motor.w_rated / motor.n_p;
        assert!(bench.w < 0.12 * rated && turning < 0.5, "machine {index}: {turning} of the rated speed");
    }
    let motor = Motor::draw(2, 51).held();
    let (commission, bench) = run(&motor, 1);
    let r = commission.results();
    assert!(r.blocked && r.north, "{r:?}");
    check(r, &motor, &SPUN);
    assert!(drive_base::math::wrap(r.axis - bench.angle()).abs() < 0.05, "the north pole");
}

/// At standstill, mode Standstill gives the axis and the same results as mode Spin up to that stage.
#[test]
fn standstill_is_the_first_part_of_spin() {
    let motor = Motor::draw(1, 7);
    let setup = CommissionSetup { mode: CommissionMode::Standstill, ..setup(&motor) };
    let (mut commission, mut bench) = (Commission::new(setup), Bench::new(motor.clone(), 7));
    while !is_over(&commission) {
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
    }
    assert!(between_axes(commission.results().axis, bench.angle()).abs() < 0.1);
    check(commission.results(), &motor, &SPUN);
    let (whole, _) = run(&motor, 7);
    assert_eq!((whole.results().R_s, whole.results().L_q), (commission.results().R_s, commission.results().L_q));
}

/// `Off` has no effect; a blocked rotor cannot spin, and the results at standstill are kept.
#[test]
fn nothing_spins_that_must_not() {
    let motor = Motor::draw(2, 51).held();
    let mut commission = Commission::new(CommissionSetup { mode: CommissionMode::Off, ..setup(&motor) });
    for _ in 0..3 {
        let out = commission.update(Phases::default(), motor.u_dc);
        assert!(!out.gates && commission.state() == State::Idle && commission.fault() == Fault::None);
    }
    let setup = CommissionSetup { mode: CommissionMode::Spin, ..setup(&motor) };
    let (mut commission, mut bench) = (Commission::new(setup), Bench::new(motor.clone(), 1));
    while !is_over(&commission) {
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
    }
    assert_eq!((commission.state(), commission.fault()), (State::Refused, Fault::NotFollowing));
    check(commission.results(), &motor, &SPUN);
}

/// Exact sensors, no dead time, a linear machine; then currents and voltages that read 2 % high.
#[test]
fn exact_data_give_exact_values_that_scale_with_the_sensors() {
    let motor = Motor::draw(1, 9).ideal();
    for (g, h) in [(1.0, 1.0), (1.02, 1.0), (1.0, 1.02)] {
        let (mut commission, mut bench) = (Commission::new(setup(&motor)), Bench::new(motor.clone(), 1));
        bench.gain = 1.0 / h;
        while !is_over(&commission) {
            period(&mut commission, &mut bench, g, h * motor.u_dc);
        }
        let r = commission.results();
        for (name, found, truth) in [
            ("R_s", r.R_s, motor.R * h / g),
            ("L_d", r.L_d, motor.L_d * h / g),
            ("L_q", r.L_q, motor.L_q * h / g),
            ("psi_M", r.psi_M, motor.psi * h),
            ("J", r.J, motor.J * h * g),
            ("tau_friction", r.tau_friction, motor.friction(0.3 * motor.w_rated / motor.n_p) * h * g),
        ] {
            let (error, limit) = (found.value / truth - 1.0, if name == "tau_friction" { 5e-3 } else { 5e-4 });
            assert!(found.u < 1.0 && error.abs() < limit, "{name}: {:+.4} % at {g} and {h}", 100.0 * error);
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
        check(commission.results(), &motor, &[]);
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
        if since != 40 && since != 9000 {
            return;
        }
        states.push(commission.state());
        let bytes = postcard::to_stdvec(commission).unwrap();
        assert!(size == 0 || bytes.len() == size, "{} and {size} bytes", bytes.len());
        size = bytes.len();
        *commission = postcard::from_bytes(&bytes).unwrap();
    });
    assert!(whole == restored && size < 60_000, "{size} bytes");
    for state in [State::Probe, State::Align, State::Resistance, State::Swing, State::Axes, State::Saturation] {
        assert!(states.contains(&state), "{state:?}");
    }
    assert!(states.contains(&State::Start) && states.contains(&State::Levels));
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
            check(commission.results(), &motor, &[]);
            continue;
        }
        assert!(matches!(commission.fault(), Fault::NotFollowing | Fault::Current), "{:?}", commission.fault());
        let fault = commission.fault();
        is_safe(&mut commission, fault);
    }
    // The link falls by a fifth, a current is not finite or exceeds its limit, or time runs out.
    for (state, u_dc, gain, fault) in [
        (State::Probe, 0.79, 1.0, Fault::Voltage),
        (State::Saturation, 0.79, 1.0, Fault::Voltage),
        (State::Start, 0.79, 1.0, Fault::Voltage),
        (State::Levels, 0.79, 1.0, Fault::Voltage),
        (State::Levels, 1.0, f64::NAN, Fault::Current),
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
    // The first levels begin after 16 s.
    for t_max in [2.0, 17.0] {
        let mut commission = Commission::new(CommissionSetup { t_max, ..setup(&motor) });
        let mut bench = Bench::new(motor.clone(), 1);
        while !is_over(&commission) {
            period(&mut commission, &mut bench, 1.0, motor.u_dc);
        }
        is_safe(&mut commission, Fault::Time);
    }
    // No machine at all.
    let mut commission = Commission::new(setup(&motor));
    while !is_over(&commission) {
        commission.update(Phases::default(), motor.u_dc);
    }
    is_safe(&mut commission, Fault::Inductance);
}

/// A blocked rotor that comes loose yields no wrong value.
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
            let counts = !matches!(name, "i_zero" | "s_2" | "s_3");
            assert!(found.u >= 1.0 || !counts || error < 0.05, "{name} after {state:?}: {error}");
        }
    }
}

/// A rotor that is blocked or loaded between two levels yields no wrong value; the gates go off.
#[test]
fn a_rotor_that_is_held_or_loaded_gives_no_wrong_value() {
    let motor = Motor::draw(1, 7);
    let rated = 0.75 * motor.n_p * motor.psi * motor.I;
    let (begins, ends) = (16.0, 23.0);
    for n in 0..14_u32 {
        let at = begins + (ends - begins) * f64::from(n / 2) / 7.0;
        let (mut commission, bench) = run_with(&motor, 1, |commission, bench| {
            if commission.time() > at && n % 2 == 0 {
                bench.motor.blocked = true;
                bench.w = 0.0;
            } else if commission.time() > at.max(18.0) {
                bench.load = 0.2 * rated;
            }
        });
        for (name, found, truth) in compared(commission.results(), &motor) {
            let (error, limit) = ((found.value / truth - 1.0).abs(), if name.starts_with("tau") { 0.15 } else { 0.05 });
            let counts = !matches!(name, "i_zero" | "s_2" | "s_3");
            assert!(found.u >= 1.0 || !counts || error < limit, "{name} at {at} s, case {n}: {error}");
        }
        let out = commission.update(Phases::default(), motor.u_dc);
        assert!(!out.gates && bench.most < 1.35 * motor.I, "{at} s, case {n}");
    }
}

/// A rotor that is held in its first start does not follow: the gates go off until it rests, and the next start succeeds.
#[test]
fn a_start_that_fails_coasts_and_is_tried_again() {
    let motor = Motor::draw(1, 7);
    let (mut commission, mut bench) = (Commission::new(setup(&motor)), Bench::new(motor.clone(), 1));
    let mut off = 0.0;
    while !is_over(&commission) {
        let starts = commission.state() == State::Start;
        bench.motor.blocked = starts && off == 0.0;
        if bench.motor.blocked {
            bench.w = 0.0;
        }
        let out = commission.update(bench.measure(), motor.u_dc);
        off += if starts && !out.gates { motor.T } else { 0.0 };
        bench.tick(out.u, out.gates);
    }
    assert!(off > 0.499, "the gates are off for {off} s");
    assert_eq!(commission.state(), State::Done, "{:?}", commission.fault());
    check(commission.results(), &motor, &[]);
}

/// Above psi_M / (L_q - L_d) = 12.5 A the rotor rests with its magnet at an angle to the current, far above it with the q-axis
/// along the current.
#[test]
fn a_magnet_beside_the_current_swaps_no_inductance() {
    let motor = Motor::reluctance(50.0);
    let (commission, _) = run(&motor, 1);
    assert_eq!((commission.state(), commission.fault()), (State::Done, Fault::None));
    check(commission.results(), &motor, &["tau_friction"]);
    // 0.4 I = 8 A align; the steps of the staircase beyond 12.5 A turn the rotor. 0.25 Wb are less than 0.25 psi_r.
    let motor = Motor::reluctance(20.0);
    let (commission, _) = run(&motor, 1);
    assert!(matches!(commission.fault(), Fault::Flux | Fault::NotFollowing), "{:?}", commission.fault());
    check(commission.results(), &motor, &SPUN);
}

/// A machine that needs long finishes with fewer levels.
#[test]
fn short_time_leaves_levels_out() {
    let motor = Motor::draw(1, 5);
    let (mut commission, mut bench) =
        (Commission::new(CommissionSetup { t_max: 60.0, ..setup(&motor) }), Bench::new(motor.clone(), 1));
    while !is_over(&commission) {
        period(&mut commission, &mut bench, 1.0, motor.u_dc);
    }
    assert_eq!(commission.state(), State::Done, "{:?}", commission.fault());
    check(commission.results(), &motor, &["tau_friction"]);
}
