//! How much faster than its own time a motor runs, called as a firmware at 20 kHz calls it.
#![allow(missing_docs, clippy::undocumented_unsafe_blocks)]

mod common;

use common::{adc, advance, advance_gates, create, destroy, encoder, named, set};
use std::time::Instant;
use virtual_motor::pool::MotorId;

/// PWM period in s, and dead time in s.
const T: f64 = 50e-6;
const DEAD: f64 = 1e-6;

/// Periods per run: 1 s.
const PERIODS: u32 = 20_000;

/// Duty cycles that turn at 50 Hz.
fn duties(k: u32) -> [f64; 3] {
    let angle = std::f64::consts::TAU * 50.0 * T * f64::from(k);
    [0.0, 2.0, 4.0].map(|x: f64| 0.5 + 0.15 * (angle - x * std::f64::consts::FRAC_PI_3).cos())
}

/// The gates of a leg with the duty cycle `d` at the time `t` (s) of a period: bit 0 the upper one, bit 1 the lower one.
fn leg(d: f64, t: f64) -> u32 {
    let (on, off) = (0.5 * T * (1.0 - d), 0.5 * T * (1.0 + d));
    if (on..on + DEAD).contains(&t) || (off..off + DEAD).contains(&t) {
        0
    } else if (on..off).contains(&t) {
        1
    } else {
        2
    }
}

/// A period by gate signals, from one change to the next.
fn by_gates(id: MotorId, k: u32) {
    let (d, start) = (duties(k), f64::from(k) * T);
    let mut instants = [T; 13];
    for (x, d) in d.into_iter().enumerate() {
        let (on, off) = (0.5 * T * (1.0 - d), 0.5 * T * (1.0 + d));
        instants[4 * x..4 * x + 4].copy_from_slice(&[on, on + DEAD, off, off + DEAD]);
    }
    instants.sort_by(f64::total_cmp);
    let mut last = 0.0;
    for t in instants {
        let middle = 0.5 * (last + t);
        let gates = leg(d[0], middle) | leg(d[1], middle) << 2 | leg(d[2], middle) << 4;
        advance_gates(id, start + t, gates).unwrap();
        last = t;
    }
}

fn by_duties(id: MotorId, k: u32) {
    advance(id, f64::from(k + 1) * T, duties(k), true).unwrap();
}

/// Real-time factor: the median of five runs.
fn factor(values: &[(&str, f64)], period: fn(MotorId, u32)) -> f64 {
    let mut factors = [0.0; 5].map(|_: f64| {
        let id = create().unwrap();
        for &(name, value) in [("inverter.T_pwm", T), ("initial.speed", 100.0)].iter().chain(values) {
            set(id, named(name), value).unwrap();
        }
        let start = Instant::now();
        for k in 0..PERIODS {
            let _ = (adc(id).unwrap(), encoder(id).unwrap());
            period(id, k);
        }
        let factor = 1.0 / start.elapsed().as_secs_f64();
        destroy(id).unwrap();
        factor
    });
    factors.sort_by(f64::total_cmp);
    factors[2]
}

#[test]
#[ignore = "opt-in: cargo test --release -p virtual-motor --test pace -- --ignored --nocapture, on an idle machine"]
fn simulated_time_per_time() {
    let dead = ("inverter.dead_time", DEAD);
    let losses = [dead, ("inverter.u_transistor", 0.9), ("inverter.u_diode", 0.8), ("inverter.r_transistor", 0.02)];
    for (what, values, period) in [
        ("duty cycles, average inverter", &[("inverter.mode", 1.0)][..], by_duties as fn(MotorId, u32)),
        ("duty cycles, switched", &[], by_duties),
        ("duty cycles, switched, dead time of 1 us", &[dead], by_duties),
        ("duty cycles, switched, dead time and drops of the devices", &losses, by_duties),
        ("gate signals, dead time of 1 us: 13 advances per period", &[], by_gates),
        ("gate signals, the same with drops of the devices", &losses, by_gates),
    ] {
        let factor = factor(values, period);
        println!("{what}: {factor:.0}");
        assert!(factor > 1.0, "slower than the motor's own time");
    }
}
