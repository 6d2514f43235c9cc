//! One 10 kHz period of controller and plant: natively, and the same through the C interface with its gets and sets.
#![allow(missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use criterion::{Criterion, criterion_group, criterion_main};
use drive::Pair;
use drive_study::reproduce::scenario::RPM;
use fmu_import::{Fmu, Instance};

const T_S: f64 = 1e-4;

/// At 1000 rpm with a load of 1 N.m.
fn native(c: &mut Criterion) {
    let mut pair = Pair::default();
    pair.start().unwrap();
    pair.set_inputs(1000.0 * RPM, 1.0, 325.0);
    for _ in 0..10_000 {
        pair.step(T_S).unwrap();
    }
    c.bench_function("period/native", |b| b.iter(|| pair.step(T_S).unwrap()));
    assert!((pair.plant.out.speed - 1000.0 * RPM).abs() < 1.0, "the drive is still on its speed");
}

fn start(standard: &str, name: &str) -> Instance {
    let path = common::archives().join(standard).join(name).with_extension("fmu");
    let mut instance = Fmu::open(path).unwrap().instantiate(name, false).unwrap();
    instance.setup(0.0, None).unwrap();
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    instance
}

fn references<const N: usize>(instance: &Instance, names: [&str; N]) -> [u32; N] {
    names.map(|name| instance.variable(name).unwrap().value_reference)
}

fn through_abi(c: &mut Criterion, standard: &str) {
    let (mut plant, mut controller) = (start(standard, "PmsmPlant"), start(standard, "SensorlessController"));
    let (i, u) = (["i_a", "i_b", "i_c"], ["u_a", "u_b", "u_c"]);
    let (plant_i, plant_u) = (references(&plant, i), references(&plant, u));
    let (controller_i, controller_u) = (references(&controller, i), references(&controller, u));
    controller.set_reals(&references(&controller, ["speed_ref"]), &[1000.0 * RPM]).unwrap();
    plant.set_reals(&references(&plant, ["tau_load"]), &[1.0]).unwrap();
    let (mut current, mut voltage, mut k) = ([0.0; 3], [0.0; 3], 0_u32);
    let mut period = || {
        plant.get_reals(&plant_i, &mut current).unwrap();
        controller.get_reals(&controller_u, &mut voltage).unwrap();
        plant.set_reals(&plant_u, &voltage).unwrap();
        controller.set_reals(&controller_i, &current).unwrap();
        let t = f64::from(k) * T_S;
        let _ = plant.do_step(t, T_S).unwrap();
        let _ = controller.do_step(t, T_S).unwrap();
        k += 1;
    };
    for _ in 0..10_000 {
        period();
    }
    c.bench_function(&format!("period/{standard}"), |b| b.iter(&mut period));
}

/// One second of PmsmDrive in steps of 1 ms.
fn whole_drive(c: &mut Criterion) {
    let mut drive = start("fmi3", "PmsmDrive");
    drive.set_reals(&references(&drive, ["speed_ref", "tau_load"]), &[1000.0 * RPM, 1.0]).unwrap();
    let mut k = 0_u32;
    c.bench_function("pmsm_drive/1 s at 1 ms", |b| {
        b.iter(|| {
            for _ in 0..1000 {
                let _ = drive.do_step(f64::from(k) * 1e-3, 1e-3).unwrap();
                k += 1;
            }
        });
    });
}

fn abi(c: &mut Criterion) {
    through_abi(c, "fmi2");
    through_abi(c, "fmi3");
    whole_drive(c);
}

criterion_group!(benches, native, abi);
criterion_main!(benches);
