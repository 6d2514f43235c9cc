//! After its creation, a motor allocates nothing. A separate test program: it replaces the allocator.
#![allow(missing_docs, non_snake_case, clippy::undocumented_unsafe_blocks)]

mod common;
#[path = "../../fmu-export/tests/counting/mod.rs"]
mod counting;

use common::{
    adc, advance, advance_gates, create, create_from_file, destroy, encoder, get, get_adc, hall, named, set, set_adc,
    terminals, time,
};
use counting::{calls, neighbor};
use virtual_motor::pool::MotorId;
use virtual_motor::sensing::{AdcSetup, LOW_SIDE};

/// Everything that a firmware does in its loop, and before.
fn run(id: MotorId, what: &str) {
    let variables = ["inverter.dead_time", "tau_load", "u_dc", "motor.R_s", "speed", "psi_d"];
    let [dead_time, tau_load, u_dc, R_s, speed, psi_d] = variables.map(named);
    let before = calls();
    assert_eq!(named("speed"), speed);
    set(id, dead_time, 1e-6).unwrap();
    let link = get(id, u_dc).unwrap();
    let resistance = get(id, R_s).unwrap();
    let mut setup = get_adc(id).unwrap();
    setup.sensors = LOW_SIDE;
    set_adc(id, setup).unwrap();
    for k in 1..=2000_u32 {
        let t = 50e-6 * f64::from(k);
        if k % 3 == 0 {
            advance_gates(id, t - 20e-6, [0x29, 0x00, 0x16, 0x2a][k as usize % 4]).unwrap();
        }
        advance(id, t, [0.51, 0.49, 0.5], k % 50 > 0).unwrap();
        let _ = (adc(id).unwrap(), encoder(id).unwrap(), hall(id).unwrap(), terminals(id).unwrap());
        assert!(get(id, speed).unwrap().is_finite() && get(id, psi_d).unwrap().is_finite() && time(id).unwrap() > 0.0);
        set(id, tau_load, if k > 1000 { 0.01 } else { 0.0 }).unwrap();
        set(id, u_dc, link * (1.0 - 1e-6 * f64::from(k))).unwrap();
        set(id, R_s, resistance * (1.0 + 1e-6 * f64::from(k))).unwrap();
    }
    assert_eq!(calls() - before - NAMES, 0, "{what}");
}

/// Calls of the allocator by `named` of this test, which makes a C string: one allocation and one deallocation.
const NAMES: u64 = 2;

#[test]
fn a_motor_allocates_nothing_after_its_creation() {
    let _neighbor = neighbor();
    let id = create().unwrap();
    run(id, "the reference motor");
    destroy(id).unwrap();
    for name in ["servo-48v", "drone-22v", "hub-36v", "pmsyrm-5.5kw"] {
        let path = format!("{}/../motors/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let id = create_from_file(&path).unwrap();
        run(id, name);
        destroy(id).unwrap();
    }
    let before = calls();
    let _ = AdcSetup { ..get_adc(create().unwrap()).unwrap() };
    assert!(calls() > before, "the counter counts");
}
