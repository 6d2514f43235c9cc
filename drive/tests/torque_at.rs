//! `torque.at` = Shaft: the drive gives the torque that is asked for, and its limits are torques that it gives.

use crate::machines::RPM;
use crate::{lossy, machines};
use drive::plant::tables::PlantParameters;
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::torque::TorqueAt;
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::tables::ControllerParameters;
use fmu_core::log::Warnings;
use fmu_core::{Block, Elapsed, Model, Step, Warns};

/// Machines a, b and c with all losses and a hot magnet, in torque mode on an imposed shaft; the speed in rpm up to which the
/// test goes, and a torque in N.m.
fn drives() -> [(&'static str, PlantParameters, ControllerParameters, f64, [f64; 2]); 3] {
    let of = |lossy: lossy::Drive, machine: machines::Machine| {
        let mut controller = machine.parameters();
        controller.speed_loop.torque_mode = true;
        let mut plant = lossy.par;
        (plant.thermal.alpha_R, plant.thermal.alpha_psi, plant.thermal.T_start) = (3.93e-3, -1.1e-3, 353.15);
        (plant, controller, lossy.u_dc)
    };
    let [a, b, c] = [of(lossy::a(), machines::a()), of(lossy::b(), machines::b()), of(lossy::c(), machines::c(240.0))];
    [("a", a.0, a.1, a.2, [1500.0, 12.0]), ("b", b.0, b.1, b.2, [3000.0, 2.0]), ("c", c.0, c.1, c.2, [6000.0, 60.0])]
}

fn drive(plant: &PlantParameters, controller: &ControllerParameters, at: TorqueAt) -> Block<PmsmDrive> {
    let mut block = Block::<PmsmDrive>::default();
    block.model.pair.plant.model.parameters = plant.clone();
    block.model.pair.controller.model.parameters = controller.clone();
    block.model.torque.at = at;
    block
}

fn mean(plant: &PlantParameters, controller: &ControllerParameters, at: TorqueAt) -> Block<PmsmDriveMean> {
    let mut block = Block::<PmsmDriveMean>::default();
    (block.model.drive.plant, block.model.drive.controller) = (plant.clone(), controller.clone());
    block.model.torque.at = at;
    block
}

/// Torque at the shaft, and `tau_min` and `tau_max`, after 0.2 s at this speed.
fn settled<M: Model>(
    mut block: Block<M>,
    (rpm, tau_ref, u_dc): (f64, f64, f64),
    inputs: fn(&mut M) -> &mut DriveInputs,
    outputs: fn(&M::Outputs) -> &DriveOutputs,
) -> (f64, [f64; 2]) {
    let (mut now, speed) = (Elapsed::ZERO, rpm * RPM);
    let set = |block: &mut Block<M>, angle: f64| {
        let inputs = inputs(&mut block.model);
        (inputs.u_dc, inputs.tau_ref, inputs.speed_shaft, inputs.angle_shaft) = (u_dc, tau_ref, speed, angle);
    };
    set(&mut block, 0.0);
    block.initialize();
    block.model.validate().unwrap();
    for k in 0..400 {
        set(&mut block, speed * 5e-4 * f64::from(k));
        let step = Step { start: now, h: 5e-4 };
        block.step(&step).unwrap();
        now = step.end();
    }
    let out = outputs(&block.out);
    (out.plant.powers.tau_shaft, [out.controller.tau_min, out.controller.tau_max])
}

fn of_drive(block: Block<PmsmDrive>, at: (f64, f64, f64)) -> (f64, [f64; 2]) {
    settled(block, at, |m| &mut m.inputs, |out| out)
}

fn of_mean(block: Block<PmsmDriveMean>, at: (f64, f64, f64)) -> (f64, [f64; 2]) {
    settled(block, at, |m| &mut m.inputs, |out| &out.drive)
}

/// In all four quadrants and at standstill, against the air gap, whose torque at the shaft is another.
#[test]
fn the_shaft_has_the_torque_that_is_asked_for() {
    for (name, plant, controller, u_dc, [rpm, tau]) in drives() {
        for (n, share) in
            [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -0.5), (0.3, 0.1), (0.0, 0.5), (0.0, -1.0), (1.0, 0.0)]
        {
            let (at, asked) = ((n * rpm, share * tau, u_dc), share * tau);
            let (plain, _) = of_drive(drive(&plant, &controller, TorqueAt::AirGap), at);
            let (shaft, [low, high]) = of_drive(drive(&plant, &controller, TorqueAt::Shaft), at);
            let (reduced, [least, most]) = of_mean(mean(&plant, &controller, TorqueAt::Shaft), at);
            println!(
                "{name} {:6.0} rpm, asked {asked:7.2}: {plain:8.3}, at the shaft {shaft:8.3}, mean {reduced:8.3}",
                at.0
            );
            assert!((shaft - asked).abs() < 2e-3 * tau, "{name} {at:?}: {shaft}");
            assert!((reduced - asked).abs() < 1e-6 * tau, "{name} {at:?}: {reduced}");
            assert!(
                (low - least).abs() < 2e-3 * most && (high - most).abs() < 2e-3 * most,
                "{name}: {low} {least}, {high} {most}"
            );
            assert!((plain - asked).abs() > 5e-3 * tau, "{name} {at:?}: {plain}");
        }
    }
}

/// A reference beyond `tau_max` gives `tau_max` at the shaft, also in field weakening, and so with `tau_min`.
#[test]
fn the_limits_are_torques_of_the_shaft() {
    for (name, plant, controller, u_dc, [rpm, tau]) in drives() {
        for n in [0.5, 1.3, -1.3] {
            for side in [20.0, -20.0] {
                let at = (n * rpm, side * tau, u_dc);
                let (shaft, limits) = of_drive(drive(&plant, &controller, TorqueAt::Shaft), at);
                let (reduced, same) = of_mean(mean(&plant, &controller, TorqueAt::Shaft), at);
                let [limit, of_mean] = [limits, same].map(|[low, high]| if side > 0.0 { high } else { low });
                println!(
                    "{name} {:6.0} rpm: {shaft:8.3} of {limit:8.3} N.m, mean {reduced:8.3} of {of_mean:8.3}",
                    at.0
                );
                assert!((shaft / limit - 1.0).abs() < 2e-3, "{name} {at:?}: {shaft}, not {limit}");
                assert!((reduced / of_mean - 1.0).abs() < 1e-6, "{name} {at:?}: {reduced}, not {of_mean}");
            }
        }
    }
}

/// The warning of a clipped reference has the numbers of the shaft.
#[test]
fn a_clipped_reference_is_reported_as_it_was_asked() {
    let [_, _, (_, plant, controller, u_dc, _)] = drives();
    let mut block = drive(&plant, &controller, TorqueAt::Shaft);
    let speed = 6000.0 * RPM;
    let inputs = &mut block.model.inputs;
    (inputs.u_dc, inputs.tau_ref, inputs.speed_shaft) = (u_dc, 190.0, speed);
    block.initialize();
    let mut now = Elapsed::ZERO;
    for k in 0..120 {
        block.model.inputs.angle_shaft = speed * 0.01 * f64::from(k);
        let step = Step { start: now, h: 0.01 };
        block.step(&step).unwrap();
        now = step.end();
    }
    let mut said = Vec::new();
    let mut sink = |(_, _, message): fmu_core::log::Said<'_>| said.push(message());
    block.model.warn(&mut Warnings::to(&mut sink));
    let limit = block.out.controller.tau_max;
    assert!(
        said.iter().any(|text| text.contains("tau_ref = 190 N.m") && text.contains(&format!("to {limit} N.m"))),
        "{said:?}"
    );
}

/// A free shaft: the torque at the shaft accelerates the inertia, through a reversal with Coulomb friction and at any step.
#[test]
fn a_free_shaft_accelerates_by_it() {
    let [_, (_, mut plant, controller, u_dc, _), _] = drives();
    plant.mechanics.imposed = false;
    plant.initial.speed = -60.0;
    for h in [1e-3, 2e-2] {
        let (mut whole, mut reduced) =
            (drive(&plant, &controller, TorqueAt::Shaft), mean(&plant, &controller, TorqueAt::Shaft));
        let (tau, J) = (0.4, plant.mechanics.J);
        for inputs in [&mut whole.model.inputs, &mut reduced.model.inputs] {
            (inputs.u_dc, inputs.tau_ref) = (u_dc, tau);
        }
        whole.initialize();
        reduced.initialize();
        let mut now = Elapsed::ZERO;
        while now.seconds() < 0.5 - 0.5 * h {
            let step = Step { start: now, h };
            whole.step(&step).unwrap();
            reduced.step(&step).unwrap();
            now = step.end();
        }
        let speed = -60.0 + tau / J * 0.5;
        let [a, b] = [whole.out.plant.speed, reduced.out.drive.plant.speed];
        println!("h = {h} s: {a:.2} and {b:.2} rad/s of {speed:.2}");
        assert!((a - speed).abs() < 0.01 * speed && (b - speed).abs() < 0.01 * speed, "{a} {b} {speed}");
    }
}
