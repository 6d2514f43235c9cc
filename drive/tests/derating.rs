//! The derating of a hot winding, in `PmsmDrive` and in `PmsmDriveMean`, in torque and in speed control.

use crate::machines::RPM;
use crate::{lossy, machines};
use drive::derating::Derating;
use drive::plant::thermal::ThermalMode;
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::tables::ControllerParameters;
use fmu_core::{Block, Elapsed, Model, Step};

fn derating() -> Derating {
    Derating { used: true, T_winding: 400.0, T_winding_max: 440.0, ..Derating::default() }
}

fn controller(torque_mode: bool) -> ControllerParameters {
    let mut controller = machines::c(240.0).parameters();
    controller.speed_loop.torque_mode = torque_mode;
    controller
}

fn whole(derating: Derating, torque_mode: bool) -> Block<PmsmDrive> {
    let mut block = Block::<PmsmDrive>::default();
    let pair = &mut block.model.pair;
    pair.plant.model.parameters = lossy::c().par;
    pair.plant.model.parameters.thermal.mode = ThermalMode::Imposed;
    pair.controller.model.parameters = controller(torque_mode);
    block.model.derating = derating;
    block
}

fn mean(derating: Derating, torque_mode: bool) -> Block<PmsmDriveMean> {
    let mut block = Block::<PmsmDriveMean>::default();
    block.model.drive.plant = lossy::c().par;
    block.model.drive.plant.thermal.mode = ThermalMode::Imposed;
    block.model.drive.controller = controller(torque_mode);
    block.model.drive.derating = derating;
    block
}

/// Torque at the shaft, `tau_min` and `tau_max` after 0.2 s with the winding at `T` (K).
fn settled<M: Model>(
    mut block: Block<M>,
    (rpm, tau_ref, T): (f64, f64, f64),
    inputs: fn(&mut M) -> &mut DriveInputs,
    outputs: fn(&M::Outputs) -> &DriveOutputs,
) -> [f64; 3] {
    let (mut now, speed) = (Elapsed::ZERO, rpm * RPM);
    let set = |block: &mut Block<M>, t: f64| {
        let inputs = inputs(&mut block.model);
        (inputs.u_dc, inputs.tau_ref, inputs.speed_ref) = (400.0, tau_ref, 10.0 * tau_ref);
        (inputs.speed_shaft, inputs.angle_shaft, inputs.thermal.imposed.winding) = (speed, speed * t, T);
    };
    set(&mut block, 0.0);
    block.initialize();
    block.model.validate().unwrap();
    for _ in 0..200 {
        set(&mut block, now.seconds());
        let step = Step { start: now, h: 1e-3 };
        block.step(&step).unwrap();
        now = step.end();
    }
    let out = outputs(&block.out);
    [out.plant.powers.tau_shaft, out.controller.tau_min, out.controller.tau_max]
}

#[test]
fn the_torque_of_a_hot_winding_is_its_share() {
    let of_drive = |d: Derating, mode, at| settled(whole(d, mode), at, |m| &mut m.inputs, |out| out);
    let of_mean = |d: Derating, mode, at| settled(mean(d, mode), at, |m| &mut m.inputs, |out| &out.drive);
    for torque_mode in [true, false] {
        for (rpm, tau) in [(2000.0, 1e3), (2000.0, -1e3), (-2000.0, 1e3)] {
            let [_, _, full] = of_drive(Derating::default(), torque_mode, (rpm, tau, 430.0));
            for (T, share) in [(300.0, 1.0), (410.0, 0.75), (430.0, 0.25), (450.0, 0.0)] {
                let [a, b] =
                    [of_drive(derating(), torque_mode, (rpm, tau, T)), of_mean(derating(), torque_mode, (rpm, tau, T))];
                println!("{rpm} rpm, {T} K: {a:.3?} and {b:.3?} of {full:.3} N.m");
                for [shaft, low, high] in [a, b] {
                    assert!(
                        (high - share * full).abs() < 1e-9 * full && (low + share * full).abs() < 1e-9 * full,
                        "{T} K"
                    );
                    // Friction and iron take their part, and the machine's torque is that of the estimates.
                    assert!((shaft - share * full * tau.signum()).abs() < 0.04 * full, "{T} K: {shaft}");
                }
                assert!((a[0] - b[0]).abs() < 1e-3 * full, "{T} K: {a:?}, {b:?}");
            }
        }
        // In field weakening, the lower of both limits.
        let [free, hot] = [300.0, 430.0].map(|T| of_drive(derating(), torque_mode, (7000.0, 1e3, T)));
        let [of_mean_free, of_mean_hot] = [300.0, 430.0].map(|T| of_mean(derating(), torque_mode, (7000.0, 1e3, T)));
        assert!((free[2] / of_mean_free[2] - 1.0).abs() < 2e-3 && (hot[2] / of_mean_hot[2] - 1.0).abs() < 1e-9);
        assert!(hot[2] < 0.6 * free[2], "{hot:?} {free:?}");
    }
}

/// The user's curve in both drives: at the points of the table and between them.
#[test]
fn the_torque_follows_a_table() {
    let mut curve = Derating { used: true, by_table: true, ..Derating::default() };
    curve.at = [350.0, 380.0, 400.0, 430.0, 430.0, 430.0, 430.0, 430.0];
    curve.shares = [1.0, 0.9, 0.5, 0.2, 0.2, 0.2, 0.2, 0.2];
    let of_drive = |d: Derating, at| settled(whole(d, true), at, |m| &mut m.inputs, |out| out);
    let of_mean = |d: Derating, at| settled(mean(d, true), at, |m| &mut m.inputs, |out| &out.drive);
    let [_, _, full] = of_drive(Derating::default(), (2000.0, 1e3, 300.0));
    for (T, share) in [(340.0, 1.0), (365.0, 0.95), (390.0, 0.7), (415.0, 0.35), (450.0, 0.2)] {
        let at = (2000.0, 1e3, T);
        let [a, b] = [of_drive(curve.clone(), at), of_mean(curve.clone(), at)];
        println!("{T} K: {a:.3?} and {b:.3?} of {full:.3} N.m");
        assert!((a[2] - share * full).abs() < 1e-9 * full && (b[2] - share * full).abs() < 1e-9 * full, "{T} K");
        assert!((a[0] - b[0]).abs() < 1e-3 * full, "{T} K: {a:?}, {b:?}");
    }
}
