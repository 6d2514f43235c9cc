//! `PmsmDriveMean` beside `PmsmDrive` on a DC link: sag and chopper, limits of the battery's current, trips, and energies.

use crate::machines::RPM;
use crate::vehicle::Vehicle;
use crate::{lossy, machines};
use drive::dc_link::{DcSource, LinkParameters};
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::{PmsmDrive, PmsmDriveMean};
use drive_control::tables::ControllerParameters;
use drive_control::trip::Cause;
use fmu_core::{Block, ContinuousTime, Elapsed, Events, Model, Step};

/// Settings of machine c with all losses, in torque mode on an imposed shaft and a link of 400 V.
type Set<'a> = &'a dyn Fn(&mut ControllerParameters, &mut LinkParameters);

/// Name, settings, and speeds in rpm with torque references in N.m.
type Case<'a> = (&'a str, Set<'a>, &'a [(f64, f64)]);

fn drive(set: Set<'_>) -> Block<PmsmDrive> {
    let mut block = Block::<PmsmDrive>::default();
    let (mut controller, mut link) = (machines::c(240.0).parameters(), LinkParameters::default());
    controller.speed_loop.torque_mode = true;
    link.dc_link.used = true;
    set(&mut controller, &mut link);
    let pair = &mut block.model.pair;
    (pair.plant.model.parameters, pair.controller.model.parameters) = (lossy::c().par, controller);
    block.model.link_parameters = link;
    block
}

fn mean(set: Set<'_>) -> Block<PmsmDriveMean> {
    let whole = drive(set).model;
    let mut block = Block::<PmsmDriveMean>::default();
    block.model.drive.plant = whole.pair.plant.model.parameters;
    block.model.drive.controller = whole.pair.controller.model.parameters;
    block.model.link_parameters = whole.link_parameters;
    block
}

/// Runs for `seconds` in steps of `h` (s) at `speed` (rad/s); `each` receives the outputs.
fn run<M: Model>(
    block: &mut Block<M>,
    (seconds, h): (f64, f64),
    (speed, tau_ref): (f64, f64),
    inputs: fn(&mut M) -> &mut DriveInputs,
    mut each: impl FnMut(&M::Outputs),
) {
    let set = |block: &mut Block<M>, t: f64| {
        let inputs = inputs(&mut block.model);
        (inputs.u_dc, inputs.tau_ref, inputs.speed_shaft, inputs.angle_shaft) = (400.0, tau_ref, speed, speed * t);
    };
    set(block, 0.0);
    block.initialize();
    block.model.validate().unwrap();
    let mut now = Elapsed::ZERO;
    while now.seconds() < seconds - 0.5 * h {
        set(block, now.seconds());
        let step = Step { start: now, h };
        block.step(&step).unwrap();
        now = step.end();
        each(&block.out);
    }
}

/// Means over the second half of a run: torque at the shaft, p_in, i_source, u_cap, p_chopper.
fn settled<M: Model>(
    block: &mut Block<M>,
    at: (f64, f64),
    inputs: fn(&mut M) -> &mut DriveInputs,
    outputs: fn(&M::Outputs) -> &DriveOutputs,
) -> [f64; 5] {
    let (mut sum, mut count, mut k) = ([0.0; 5], 0.0, 0);
    run(block, (0.24, 2e-4), at, inputs, |out| {
        k += 1;
        if k > 600 {
            let DriveOutputs { plant, link, .. } = outputs(out);
            let now = [plant.powers.tau_shaft, plant.powers.p_in, link.i_source, link.u, link.p_chopper];
            sum.iter_mut().zip(now).for_each(|(sum, x)| *sum += x);
            count += 1.0;
        }
    });
    sum.map(|x| x / count)
}

/// Resistance of the soft source in Ohm.
const SAG: f64 = 0.3;

/// A soft source, at several speeds and torques, beyond the base speed too; a chopper that switches, and one that is always on; the
/// limits of the battery's current in both directions.
#[test]
fn the_steady_state_on_a_link_is_that_of_the_drive() {
    let sag: Set<'_> = &|_, link| link.dc_link.R_source = SAG;
    let chopper: Set<'_> = &|_, link| {
        link.dc_link.R_source = 5.0;
        let chopper = &mut link.chopper;
        (chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (true, 425.0, 423.0, 12.0);
    };
    let battery: Set<'_> = &|controller, link| {
        link.dc_link.R_source = 0.1;
        (controller.dc.used, controller.dc.max, controller.dc.min) = (true, 60.0, -40.0);
    };
    let cases: [Case<'_>; 3] = [
        (
            "sag",
            sag,
            &[(2000.0, 100.0), (3000.0, 80.0), (6000.0, 60.0), (8000.0, 300.0), (6000.0, -60.0), (-3000.0, -80.0)],
        ),
        ("chopper", chopper, &[(3000.0, -20.0), (3000.0, -45.0), (3000.0, -65.0), (-5000.0, 30.0)]),
        (
            "battery",
            battery,
            &[(3000.0, 40.0), (3000.0, 150.0), (6000.0, 150.0), (3000.0, -150.0), (6000.0, -150.0), (-4000.0, -150.0)],
        ),
    ];
    for (name, set, points) in cases {
        for &(rpm, tau) in points {
            let at = (rpm * RPM, tau);
            let whole = settled(&mut drive(set), at, |m| &mut m.inputs, |out| out);
            let mut block = mean(set);
            let reduced = settled(&mut block, at, |m| &mut m.inputs, |out| &out.drive);
            println!("{name:8} {rpm:6.0} rpm {tau:6.1} N.m: {whole:10.3?} {reduced:10.3?}");
            // Relative to the torque, power and current of the machine, and to the source's voltage.
            for (k, (a, b)) in whole.iter().zip(reduced).enumerate() {
                let of = [60.0_f64, 2e4, 60.0, 400.0, 2e4][k].max(a.abs());
                assert!((a - b).abs() < 1e-3 * of, "{name} {rpm} rpm {tau} N.m, value {k}: {b}, not {a}");
            }
        }
    }
}

/// A rectifier under load, whose ripple the mean does not have, and braking into the chopper; the same with a battery at its minimum.
#[test]
fn the_other_sources_are_those_of_the_drive() {
    for (source, tau) in [DcSource::RectifierSingle, DcSource::RectifierThree, DcSource::Battery]
        .into_iter()
        .flat_map(|source| [(source, 20.0), (source, 40.0), (source, -40.0)])
    {
        let set: Set<'_> = &|_, link| {
            let dc_link = &mut link.dc_link;
            (dc_link.source, dc_link.C, dc_link.R_source, dc_link.i_max, dc_link.i_min) =
                (source, 4e-3, 0.2, 200.0, -10.0);
            let chopper = &mut link.chopper;
            (chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (true, 425.0, 423.0, 12.0);
        };
        let at = (2000.0 * RPM, tau);
        let whole = settled(&mut drive(set), at, |m| &mut m.inputs, |out| out);
        let reduced = settled(&mut mean(set), at, |m| &mut m.inputs, |out| &out.drive);
        println!("{source:?} {tau:6.1} N.m: {whole:10.3?} {reduced:10.3?}");
        for (k, (a, b)) in whole.iter().zip(reduced).enumerate() {
            let of = [60.0_f64, 2e4, 60.0, 400.0, 2e4][k].max(a.abs());
            assert!((a - b).abs() < 3e-3 * of, "{source:?} {tau} N.m, value {k}: {b}, not {a}");
        }
        let takes = if source == DcSource::Battery { -10.0 } else { 0.0 };
        assert!(tau > 0.0 || (reduced[2] - takes).abs() < 1e-9 && reduced[4] > 1e3, "{reduced:?}");
    }
}

/// Energies of source, resistance, chopper and inverter, and those of the drive, at steps from 1 ms to 1 s over a cycle.
#[test]
fn the_energies_are_balanced_at_any_step() {
    let set: Set<'_> = &|controller, link| {
        link.dc_link.R_source = SAG;
        let chopper = &mut link.chopper;
        (chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (true, 405.0, 403.0, 20.0);
        (controller.dc.used, controller.dc.max, controller.dc.min) = (true, 150.0, -60.0);
    };
    let vehicle = Vehicle::new();
    let mut totals = Vec::new();
    for (h, end) in [(1e-2, vehicle.end()), (0.1, vehicle.end()), (1.0, vehicle.end()), (1e-3, 200.0)] {
        let mut block = mean(set);
        block.model.inputs.u_dc = 400.0;
        block.initialize();
        block.model.validate().unwrap();
        let (mut now, mut angle) = (Elapsed::ZERO, 0.0);
        while now.seconds() < end - 0.5 * h {
            let [speed, tau] = vehicle.at(now.seconds() + 0.5 * h);
            let inputs = &mut block.model.inputs;
            (inputs.speed_shaft, inputs.tau_ref, inputs.angle_shaft) = (speed, tau, angle);
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            (now, angle) = (step.end(), angle + speed * h);
        }
        let out = &block.out.drive;
        let (plant, link) = (&out.plant.energy, &out.link.energy);
        let rests = [link.source - link.resistor - link.chopper - plant.r#in, plant.r#in - plant.mech - plant.loss];
        println!(
            "h = {h} s: {:.0} J from the source, {:.0} J resistance, {:.0} J chopper, rests {rests:?} J",
            link.source, link.resistor, link.chopper
        );
        assert!(rests.iter().all(|rest| rest.abs() < 1e-4 * link.source), "{h} s: {rests:?}");
        assert!(link.resistor > 1e3 && (link.chopper > 1e4 || end < vehicle.end()), "{link:?}");
        totals.push([link.source, link.resistor, link.chopper]);
    }
    for (k, of) in totals[0].iter().enumerate() {
        assert!((totals[1][k] / of - 1.0).abs() < 0.01, "{totals:?}");
    }
}

/// Beyond trip.u_dc and below trip.u_dc_min the gates are off until `enable` falls, in both drives.
#[test]
fn the_voltage_trips_both_drives() {
    let set: Set<'_> = &|controller, link| {
        link.dc_link.R_source = 1.0;
        (controller.trip.used, controller.trip.i, controller.trip.u_dc, controller.trip.u_dc_min) =
            (true, 500.0, 430.0, 350.0);
    };
    for (tau, cause) in
        [(-40.0, Cause::None), (-65.0, Cause::OverVoltage), (70.0, Cause::UnderVoltage), (40.0, Cause::None)]
    {
        let at = (3000.0 * RPM, tau);
        let (mut whole, mut reduced) = (drive(set), mean(set));
        run(&mut whole, (0.2, 1e-3), at, |m| &mut m.inputs, |_| ());
        run(&mut reduced, (0.2, 1e-3), at, |m| &mut m.inputs, |_| ());
        let (a, b) = (&whole.out.controller, &reduced.out.drive.controller);
        assert_eq!((a.tripped, b.tripped), (cause, cause), "{tau} N.m");
        assert_eq!((a.enabled, b.enabled), (cause == Cause::None, cause == Cause::None), "{tau} N.m");
        if cause != Cause::None {
            assert!(reduced.out.drive.plant.powers.p_in.abs() < 1e-9, "the gates are off");
            let step = |block: &mut Block<PmsmDriveMean>, enable: bool| {
                (block.model.inputs.enable, block.model.inputs.tau_ref) = (enable, 10.0);
                block.step(&Step { start: Elapsed::ZERO, h: 1e-3 }).unwrap();
                block.out.drive.controller.tripped
            };
            assert_eq!([true, false, true].map(|enable| step(&mut reduced, enable)), [cause, Cause::None, Cause::None]);
        }
    }
}

/// In Model Exchange, outputs and rates of the link's energies are those of the point, and a trip acts from the next event on.
#[test]
fn model_exchange_has_the_link() {
    let set: Set<'_> = &|controller, link| {
        link.dc_link.R_source = 1.0;
        (controller.trip.used, controller.trip.i, controller.trip.u_dc) = (true, 500.0, 430.0);
    };
    let mut block = mean(set);
    run(&mut block, (0.1, 1e-3), (3000.0 * RPM, -40.0), |m| &mut m.inputs, |_| ());
    let (mut dx, mut out) = (vec![0.0; PmsmDriveMean::STATES.len()], block.out.clone());
    block.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
    block.model.observe(Elapsed::ZERO, &mut out);
    let of = |name: &str| dx[PmsmDriveMean::STATES.iter().position(|state| state.name == name).unwrap()];
    let (link, p_in) = (&out.drive.link, out.drive.plant.powers.p_in);
    assert!((of("energy_source") - 400.0 * link.i_source).abs() < 1e-6 * p_in.abs(), "{dx:?}");
    assert!((of("energy_resistor") - link.i_source * link.i_source).abs() < 1e-6 * p_in.abs(), "{dx:?}");
    assert!((of("energy_in") - p_in).abs() < 1e-9 * p_in.abs() && link.u > 405.0, "{link:?}");
    block.model.inputs.u_dc = 440.0;
    block.model.event(Elapsed::ZERO).unwrap();
    block.model.observe(Elapsed::ZERO, &mut out);
    assert_eq!((out.drive.controller.tripped, out.drive.controller.enabled), (Cause::OverVoltage, false));
}
