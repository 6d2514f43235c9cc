//! `SensorlessControllerClocked` through its C functions: with the plant it gives the bits of the native pair that exchanges its
//! values at every T_s, in Co-Simulation with Event Mode, Model Exchange and Scheduled Execution.
#![allow(missing_docs, non_snake_case, clippy::float_cmp, clippy::borrow_as_ptr)]
#![allow(clippy::undocumented_unsafe_blocks, reason = "an importer calls C functions")]

#[path = "common/controller.rs"]
mod controller;

use controller::{Controller, Kind, OK, reference};
use drive::{Pair, PmsmPlant, SensorlessControllerClocked};
use fmu_core::{Block, Elapsed, Step};
use fmu_export::abi::types::*;
use std::ptr::null_mut;

fmu_export::export!(SensorlessControllerClocked: Clocked + ScheduledExecution + Warns);

use fmi::*;

const ERROR: c_int = 3;
const SAMPLE: u32 = 1;

/// Inputs set by the importer at sample k: a start, a reversal, load steps.
fn inputs(k: u32) -> (f64, f64) {
    let speed = [0.0, 50.0, 150.0, -100.0, 30.0][(k as usize / 20_000).min(4)];
    (speed, if k % 30_000 > 15_000 { 1.5 } else { 0.0 })
}

const SAMPLES: u32 = 100_000;

/// The pair as stepped by its importer: commands and measurements, as bits.
fn jacobi(T_s: f64) -> Vec<[u64; 6]> {
    let mut pair = Pair::default();
    pair.controller.model.parameters.T_s = T_s;
    pair.start().unwrap();
    (0..SAMPLES)
        .map(|k| {
            let (speed, load) = inputs(k);
            pair.set_inputs(speed, load, 325.0);
            pair.step(T_s).unwrap();
            let (u, i) = (pair.controller.out.u, pair.plant.out.i);
            [u.a, u.b, i.a, i.b, pair.plant.out.speed, pair.controller.out.speed_est].map(f64::to_bits)
        })
        .collect()
}

fn clocked(kind: Kind, T_s: f64) -> Vec<[u64; 6]> {
    let controller = Controller::new(kind, 0.0, None, null_mut());
    if T_s != 1e-4 {
        assert_eq!(unsafe { fmi3SetIntervalDecimal(controller.it, &SAMPLE, 1, &T_s) }, OK);
        assert_eq!(controller.get(&[reference("T_s")]), [T_s]);
    }
    assert_eq!(controller.exit(), OK);
    let mut plant = Block::<PmsmPlant>::default();
    plant.initialize();
    plant.model.inputs.u_dc = 325.0;
    let commands = ["u_a", "u_b", "u_c", "speed_est"].map(reference);
    let gates = ["enabled", "short_circuit"].map(reference);
    let measured = ["i_a", "i_b", "i_c", "theta_meas", "speed_meas", "speed_ref", "u_dc"].map(reference);
    let mut bits = Vec::new();
    let mut now = Elapsed::ZERO;
    let mut t = 0.0;
    for k in 0..=SAMPLES {
        let (speed, load) = inputs(k);
        let (m, it) = (plant.out.measured(), controller.it);
        let set = || {
            controller.set(&measured, &[m.i.a, m.i.b, m.i.c, m.theta_e, m.speed, speed, 325.0]);
        };
        // The command of the last sample is read at the tick, before the currents of this one count.
        match kind {
            Kind::Se => {
                set();
                assert_eq!(unsafe { fmi3ActivateModelPartition(it, SAMPLE, t) }, OK);
            }
            _ => assert_eq!(unsafe { fmi3SetClock(it, &SAMPLE, 1, &Fmi3Boolean(1)) }, OK),
        }
        let (command, [enable, asc]) = (controller.get(&commands), controller.get_booleans(gates));
        if kind != Kind::Se {
            set();
            controller.update();
        }
        if k > 0 {
            let [u_a, u_b, speed_est] = [command[0], command[1], command[3]];
            bits.push([u_a, u_b, plant.out.i.a, plant.out.i.b, plant.out.speed, speed_est].map(f64::to_bits));
        }
        let u = drive::frame::Phases { a: command[0], b: command[1], c: command[2] };
        let inputs = &mut plant.model.inputs;
        (inputs.u, inputs.enable, inputs.asc, inputs.tau_load) = (u, enable, asc, load);
        plant.step(&Step { start: now, h: T_s }).unwrap();
        now = now.plus(T_s);
        if kind != Kind::Se {
            controller.proceed(t, T_s, now.seconds());
        }
        t = if kind == Kind::Cs { t + T_s } else { now.seconds() };
    }
    bits
}

#[test]
fn the_clocked_controller_gives_the_bits_of_the_pair() {
    for T_s in [1e-4, 8e-5] {
        let pair = jacobi(T_s);
        assert!(pair.iter().any(|row| f64::from_bits(row[4]) > 100.0), "it runs");
        for kind in [Kind::Cs, Kind::Me, Kind::Se] {
            let ours = clocked(kind, T_s);
            assert_eq!(ours.len(), pair.len());
            if let Some(k) = ours.iter().zip(&pair).position(|(a, b)| a != b) {
                panic!("{kind:?}, T_s = {T_s}: sample {k}: {:?} and {:?}", ours[k], pair[k]);
            }
        }
    }
}

#[test]
fn a_delay_of_0_is_refused() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let controller = Controller::new(kind, 0.0, None, null_mut());
        let (vr, zero) = (reference("timing.delay"), 0);
        assert_eq!(unsafe { fmi3SetInt32(controller.it, &vr, 1, &zero, 1) }, OK);
        assert_eq!(controller.exit(), ERROR);
    }
}
