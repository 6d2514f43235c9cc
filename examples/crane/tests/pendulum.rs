//! The wrapped engine against the closed form: the load swings, the trolley gives way.
#![allow(missing_docs)]

use crane::Crane;
use fmu_core::{Block, Elapsed, Step};
use std::f64::consts::TAU;

/// Small oscillations: w^2 = g/l (1 + m_load/m_trolley).
#[test]
fn it_swings_as_a_pendulum_on_a_free_trolley() {
    let mut crane = Block::<Crane>::default();
    crane.model.start_at(0.05);
    crane.initialize();
    let period = TAU / (9.81 / 2.0 * 1.5_f64).sqrt();
    let (h, mut now, mut crossings) = (2e-3, Elapsed::ZERO, Vec::new());
    while now.seconds() < 5.2 * period {
        let before = crane.out.angle;
        crane.step(&Step { start: now, h }).unwrap();
        now = now.plus(h);
        if before < 0.0 && crane.out.angle >= 0.0 {
            crossings.push(now.seconds() - h * crane.out.angle / (crane.out.angle - before));
        }
    }
    let found = (crossings[4] - crossings[0]) / 4.0;
    assert!((found / period - 1.0).abs() < 2e-3, "{found} s, {period} s");
    // The center of mass stays: no external force along the rail.
    let center = (100.0 * crane.out.x + 50.0 * crane.out.x_load) / 150.0;
    assert!((center - 2.0 * 0.05_f64.sin() / 3.0).abs() < 1e-3, "{center}");
}

/// A constant force accelerates both masses together.
#[test]
fn a_force_moves_it() {
    let mut crane = Block::<Crane>::default();
    crane.model.push(150.0);
    crane.initialize();
    for k in 0..400_u32 {
        crane.step(&Step { start: Elapsed::periods(u64::from(k), 1e-2), h: 1e-2 }).unwrap();
    }
    // 150 N on 150 kg for 4 s: the center of mass is at 8 m.
    let center = (100.0 * crane.out.x + 50.0 * crane.out.x_load) / 150.0;
    assert!((center - 8.0).abs() < 0.05, "{center}");
}
