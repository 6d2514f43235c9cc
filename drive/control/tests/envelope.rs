//! Field weakening without a drive: the torque-speed envelope, and the currents inside it.
//!
//! Figures: an independent calculation (brute force over the currents, and closed forms) for three [`machines`]. k_u = 0.95
//! unless stated otherwise.
#![allow(missing_docs, non_snake_case)]

mod machines;

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use drive_control::envelope::{Limit, WarmStart};
use drive_control::tracking::LeastTracker;
use drive_control::weakening::{Weakening, WeakeningGains};
use machines::{Machine, a, b, c, currents, envelope_figures, inside_figures};

#[test]
fn the_envelope() {
    for (machine, rpm, motoring, generating) in envelope_figures() {
        for (s, figure) in [(1.0, motoring), (-1.0, generating)] {
            let [cold, warm] = machine.limit(rpm, s);
            let digits = if figure > 100.0 { 6e-4 } else { 6e-5 };
            println!("{rpm} rpm {s}: {} {} (cold), {figure}", warm.tau, cold.tau);
            assert!((warm.tau - figure).abs() < digits, "{rpm} rpm {s}: {} N.m, not {figure}", warm.tau);
            assert!((cold.tau / figure - 1.0).abs() < 1e-4, "cold, {rpm} rpm {s}: {} N.m", cold.tau);
        }
    }
}

#[test]
fn the_base_speed() {
    let figures = [
        (a(), 999.14, 1060.71, 39.4584, Some((-4.8812, 14.1836))),
        (b(), 3330.11, 3520.86, 5.0625, None),
        (c(240.0), 3075.23, 3239.27, 160.612, Some((-150.986, 186.556))),
        (c(400.0), 1889.26, f64::NAN, 385.562, Some((-263.661, 300.804))),
    ];
    for (machine, at_095, at_1, torque, currents) in figures {
        let [_, Limit { i, tau }] = machine.limit(100.0, 1.0);
        assert!((tau - torque).abs() < 6e-4, "{tau} N.m, not {torque}");
        if let Some((i_d, i_q)) = currents {
            assert!((i.d() - i_d).abs() < 6e-4 && (i.q() - i_q).abs() < 6e-4, "{i:?}");
        }
        for (k_u, figure) in [(0.95, at_095), (1.0, at_1)] {
            let fits = |rpm: f64| machine.envelope().excess(i, machine.w(rpm), machine.U(k_u)) <= 0.0;
            let base = Machine::last_speed(fits);
            println!("base speed {base} rpm, {figure}");
            assert!(figure.is_nan() || (base - figure).abs() < 6e-3, "{base} rpm, not {figure}");
            let closed = machine.envelope().base_speed(machine.U(k_u)) / machine.w(1.0);
            assert!((closed - base).abs() < 1e-9 * base, "{closed} rpm, not {base}");
        }
    }
}

#[test]
fn the_greatest_speed_and_the_onset_of_mtpv() {
    let greatest = Machine::last_speed(|rpm| b().limit(rpm, 1.0)[1].tau > 0.0);
    assert!((greatest - 5384.7).abs() < 0.06, "{greatest} rpm");
    let c = c(400.0);
    for (s, figure) in [(1.0, 4892.0), (-1.0, 5113.0)] {
        let onset = Machine::last_speed(|rpm| c.limit(rpm, s)[1].i.magnitude() > c.i - 1e-6);
        assert!((onset - figure).abs() < 0.06, "{onset} rpm, not {figure}");
    }
    for (rpm, figure) in [(6000.0, 350.44), (9000.0, 278.89)] {
        let i = c.limit(rpm, 1.0)[1].i.magnitude();
        assert!((i - figure).abs() < 6e-3, "{i} A, not {figure}");
    }
}

#[test]
fn resistance_counts() {
    // Without R, a would give 20.54 N.m at 3000 rpm, 20 % more; c 1.5 to 2.9 %, growing with speed.
    let without = |m: &Machine| Machine { motor: Motor { R_s: 1e-9, ..m.motor.clone() }, ..m.clone() };
    let tau = without(&a()).limit(3000.0, 1.0)[1].tau;
    assert!((tau - 20.54).abs() < 6e-3, "{tau}");
    for (i, rpm, figure) in [(240.0, 6000.0, 1.015), (240.0, 12_000.0, 1.020), (400.0, 6000.0, 1.029)] {
        let share = without(&c(i)).limit(rpm, 1.0)[1].tau / c(i).limit(rpm, 1.0)[1].tau;
        assert!((share - figure).abs() < 6e-4, "{rpm} rpm: {share}");
    }
}

#[test]
fn points_inside() {
    for (machine, rpm, tau, i_d, i_q, weakens) in inside_figures() {
        let (i, state) = currents(&machine, rpm, tau);
        let error = (i - DqHat::new(i_d, i_q)).magnitude() / machine.i;
        println!("{rpm} rpm {tau} N.m: {i:?}, {i_d} {i_q}: {error:e}");
        assert!(error < 1e-4 && state.weakens == weakens, "{rpm} rpm {tau} N.m: {i:?}");
        // The other direction of rotation is the mirror image.
        let (mirrored, _) = currents(&machine, -rpm, -tau);
        assert!((mirrored - DqHat::new(i.d(), -i.q())).magnitude() < 1e-9 * machine.i, "{mirrored:?}");
    }
}

#[test]
fn an_injected_voltage_is_taken_off() {
    let (machine, rpm, injected) = (a(), 1500.0, 40.0);
    let (par, w) = (machine.parameters(), machine.w(rpm));
    let k = par.motor.torque_constant();
    let gains = WeakeningGains::new(
        &par.motor,
        &par.limit,
        machine.limit(100.0, 1.0)[1].tau,
        true,
        1.0,
        LeastTracker::default(),
    );
    let mut state = Weakening::default();
    let both =
        (0..9).map(|n| state.limits(&gains, &par.weakening, (w, machine.u_dc, injected), 1e3, n)).last().unwrap();
    for (i, s) in [(both.1, 1.0), (both.0, -1.0)] {
        let mut warm = WarmStart::default();
        let mut limit = || machine.envelope().limit(w, s, machine.U(0.95) - injected, &mut warm).tau;
        let figure = (0..9).map(|_| limit()).last().unwrap();
        assert!(
            (i * k - figure).abs() < 1e-6 && figure < machine.limit(rpm, s)[1].tau - 2.0,
            "{} N.m, {figure}",
            i * k
        );
    }
}
