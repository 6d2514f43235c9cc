//! Field weakening without a drive: the torque-speed envelope, and the currents inside it.
//!
//! Figures: an independent calculation (brute force over the currents, and closed forms) for three [`machines`]. k_u = 0.95
//! unless another is named.
#![allow(missing_docs, non_snake_case)]

mod machines;

use drive_base::frame::DqHat;
use drive_base::motor::Motor;
use drive_control::envelope::{Limit, WarmStart};
use drive_control::weakening::{Weakening, WeakeningGains};
use machines::{Machine, a, b, c, currents};

#[test]
fn the_envelope() {
    let figures = [
        (a(), 1000.0, 39.4584, 39.4584),
        (a(), 1500.0, 31.7936, 38.4032),
        (a(), 2000.0, 24.9058, 32.8101),
        (a(), 3000.0, 17.0599, 23.7330),
        (a(), 4000.0, 12.9075, 18.2818),
        (b(), 3000.0, 5.0625, 5.0625),
        (b(), 4000.0, 4.2045, 5.0493),
        (b(), 4500.0, 3.0945, 4.5584),
        (b(), 5000.0, 1.7105, 3.4982),
        (c(240.0), 3000.0, 160.612, 160.612),
        (c(240.0), 4000.0, 145.520, 148.200),
        (c(240.0), 6000.0, 105.892, 109.118),
        (c(240.0), 9000.0, 71.4046, 73.9718),
        (c(240.0), 12_000.0, 52.1503, 54.1841),
        (c(400.0), 3000.0, 295.149, 307.700),
        (c(400.0), 4000.0, 218.983, 231.184),
        (c(400.0), 6000.0, 126.747, 134.171),
        (c(400.0), 9000.0, 74.2701, 77.7263),
        (c(400.0), 12_000.0, 52.1988, 54.3298),
    ];
    for (machine, rpm, motoring, generating) in figures {
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
    let figures = [
        (a(), 100.0, 14.0, -0.8376, 5.5798, false),
        (c(240.0), 100.0, 100.0, -108.261, 142.581, false),
        (a(), 1900.0, 10.0, -3.28415, 3.73946, true),
        (a(), 3000.0, 10.0, -8.7774, 3.2841, true),
        (a(), 2500.0, -20.0, -8.06669, -6.67334, true),
        (b(), 4500.0, 2.0, -5.10044, 2.96296, true),
        (c(240.0), 8000.0, 25.0, -36.569, 57.6588, true),
        (c(240.0), 10_000.0, -30.0, -80.3153, -50.2531, true),
        (c(400.0), 9000.0, 60.0, -172.622, 63.7117, true),
    ];
    for (machine, rpm, tau, i_d, i_q, weakens) in figures {
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
    let gains = WeakeningGains::new(&par, machine.limit(100.0, 1.0)[1].tau, true);
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
