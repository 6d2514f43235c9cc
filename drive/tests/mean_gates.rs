//! `PmsmDriveMean` beside `PmsmDrive` while the gates do not switch: diodes that rectify, with saliency and losses, on a stiff and on
//! a soft link; a current that goes on below the speed at which it begins; active short circuit, also by a trip; energies.

use crate::machines::RPM;
use crate::{lossy, machines};
use drive::dc_link::{DcSource, LinkParameters};
use drive::plant::tables::PlantParameters;
use drive::pmsm_drive::{DriveInputs, DriveOutputs};
use drive::{PmsmDrive, PmsmDriveMean};
use drive_base::motor::Motor;
use drive_control::tables::ControllerParameters;
use drive_control::trip::Cause;
use fmu_core::{Block, ContinuousTime, Elapsed, Events, Model, Step};

/// A drive in torque mode with a sensor on an imposed shaft.
#[derive(Clone)]
struct Setup {
    plant: PlantParameters,
    controller: ControllerParameters,
    link: LinkParameters,
    u_dc: f64,
}

impl Setup {
    fn new(plant: &lossy::Drive, machine: &machines::Machine) -> Self {
        let mut controller = machine.parameters();
        controller.speed_loop.torque_mode = true;
        Self { plant: plant.par.clone(), controller, link: LinkParameters::default(), u_dc: plant.u_dc }
    }

    /// A machine without losses whose L_q is eight times its L_d: it generates below the speed at which the diodes open.
    fn salient() -> Self {
        let mut drive = Self::new(&lossy::c(), &machines::c(240.0));
        let motor = Motor { n_p: 3, R_s: 18e-3, L_d: 0.3e-3, L_q: 2.4e-3, psi_M: 66e-3 };
        drive.plant = PlantParameters { motor: motor.clone(), ..PlantParameters::default() };
        drive.plant.mechanics.imposed = true;
        drive.controller.motor = motor;
        drive
    }

    /// The mechanical speed in rad/s at which the diodes open.
    fn opening(&self) -> f64 {
        let (motor, u_diode) = (&self.plant.motor, self.plant.inverter.devices.u_diode);
        (self.u_dc + 2.0 * u_diode) / (3.0_f64.sqrt() * motor.psi_M * f64::from(motor.n_p))
    }

    fn whole(&self) -> Block<PmsmDrive> {
        let mut block = Block::<PmsmDrive>::default();
        let pair = &mut block.model.pair;
        (pair.plant.model.parameters, pair.controller.model.parameters) = (self.plant.clone(), self.controller.clone());
        block.model.link_parameters = self.link.clone();
        block
    }

    fn mean(&self) -> Block<PmsmDriveMean> {
        let mut block = Block::<PmsmDriveMean>::default();
        (block.model.drive.plant, block.model.drive.controller) = (self.plant.clone(), self.controller.clone());
        block.model.link_parameters = self.link.clone();
        block
    }
}

/// A drive over time; the shaft turns on from one run to the next.
struct Running<M: Model> {
    block: Block<M>,
    now: Elapsed,
    angle: f64,
    inputs: fn(&mut M) -> &mut DriveInputs,
    outputs: fn(&M::Outputs) -> &DriveOutputs,
}

fn whole(drive: &Setup) -> Running<PmsmDrive> {
    Running { block: drive.whole(), now: Elapsed::ZERO, angle: 0.0, inputs: |m| &mut m.inputs, outputs: |out| out }
}

fn mean(drive: &Setup) -> Running<PmsmDriveMean> {
    Running {
        block: drive.mean(),
        now: Elapsed::ZERO,
        angle: 0.0,
        inputs: |m| &mut m.inputs,
        outputs: |out| &out.drive,
    }
}

impl<M: Model> Running<M> {
    /// Runs for `seconds` in steps of `h` (s) at `speed` (rad/s); returns the means over the last fifth: torque at the shaft, p_in,
    /// i_d, i_q, u_cap.
    fn run(&mut self, (seconds, h): (f64, f64), speed: f64, set: impl Fn(&mut DriveInputs)) -> [f64; 5] {
        let start = self.now;
        let (mut sum, mut count) = ([0.0; 5], 0.0);
        while self.now.since(start) < seconds - 0.5 * h {
            let inputs = (self.inputs)(&mut self.block.model);
            (inputs.speed_shaft, inputs.angle_shaft) = (speed, self.angle);
            set(inputs);
            if self.now == Elapsed::ZERO {
                self.block.initialize();
                self.block.model.validate().unwrap();
            }
            let step = Step { start: self.now, h };
            self.block.step(&step).unwrap();
            (self.now, self.angle) = (step.end(), self.angle + speed * h);
            if self.now.since(start) > 0.8 * seconds {
                let DriveOutputs { plant, link, .. } = (self.outputs)(&self.block.out);
                let now = [plant.powers.tau_shaft, plant.powers.p_in, plant.i_d, plant.i_q, link.u];
                sum.iter_mut().zip(now).for_each(|(sum, x)| *sum += x);
                count += 1.0;
            }
        }
        sum.map(|x| x / count)
    }

    fn out(&self) -> &DriveOutputs {
        (self.outputs)(&self.block.out)
    }
}

/// Relative to the torque, the power and the current of the machine where these are not exceeded.
fn same(what: &str, a: [f64; 5], b: [f64; 5], machine: &machines::Machine) {
    let i = machine.i;
    let tau = machine.motor.torque_constant() * i;
    let of = [tau, 1.5 * machine.u_dc * i / 3.0_f64.sqrt(), i, i, machine.u_dc];
    println!("{what}: {a:10.3?} {b:10.3?}");
    for k in 0..5 {
        let of = of[k].max(a[k].abs());
        assert!((a[k] - b[k]).abs() < 1e-3 * of, "{what}, value {k}: {}, not {}", b[k], a[k]);
    }
}

/// With the gates off at several speeds, up and down, on a stiff link and on one with a source resistance.
#[test]
fn the_diodes_rectify_as_in_the_drive() {
    let cases = [
        ("a", Setup::new(&lossy::a(), &machines::a()), machines::a()),
        ("b", Setup::new(&lossy::b(), &machines::b()), machines::b()),
        ("c", Setup::new(&lossy::c(), &machines::c(240.0)), machines::c(240.0)),
    ];
    for (name, stiff, machine) in cases {
        let mut soft = stiff.clone();
        (soft.link.dc_link.used, soft.link.dc_link.R_source) = (true, 0.02 * machine.u_dc / machine.i);
        for (link, drive) in [("stiff", stiff), ("soft", soft)] {
            // The other machines, on a stiff link only, for the time.
            if link == "soft" && name != "c" {
                continue;
            }
            let u_dc = drive.u_dc;
            let (mut full, mut reduced) = (whole(&drive), mean(&drive));
            for share in [0.9, 1.1, 2.0, 1.3, 0.98] {
                let speed = if name == "b" { -share } else { share } * drive.opening();
                let off = |i: &mut DriveInputs| (i.u_dc, i.enable) = (u_dc, false);
                let a = full.run((0.25, 1e-4), speed, off);
                let b = reduced.run((0.25, 0.05), speed, off);
                same(&format!("{name} {link} {share:4.2}"), a, b, &machine);
                assert!((share < 1.0) == (b[1].abs() < 1e-9), "{share}: {b:?}");
                let powers = reduced.out().plant.powers;
                assert!((powers.p_in - powers.p_mech - powers.p_loss).abs() < 1e-9 * powers.p_mech.abs());
            }
        }
    }
}

/// A source that takes nothing back, or little, leaves the power of the diodes to the chopper: the link rises above its source, or
/// the machine's EMF stays below it.
#[test]
fn the_diodes_feed_the_chopper_of_a_source_that_takes_nothing() {
    let machine = machines::c(240.0);
    for source in [DcSource::Battery, DcSource::RectifierThree] {
        let mut drive = Setup::new(&lossy::c(), &machine);
        let u_dc = drive.u_dc;
        let LinkParameters { dc_link, chopper, .. } = &mut drive.link;
        (dc_link.used, dc_link.source, dc_link.R_source, dc_link.i_min) = (true, source, 0.1, 0.0);
        // A narrow hysteresis, so that the mean voltage of a chopper that switches is known.
        (chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (true, 1.101 * u_dc, 1.099 * u_dc, 2.0);
        let (mut full, mut reduced) = (whole(&drive), mean(&drive));
        for share in [0.9, 1.3, 2.0] {
            let speed = share * drive.opening();
            let off = |i: &mut DriveInputs| (i.u_dc, i.enable) = (u_dc, false);
            let a = full.run((0.3, 1e-5), speed, off);
            let b = reduced.run((0.3, 0.05), speed, off);
            same(&format!("{source:?} {share:4.2}"), a, b, &machine);
            let link = reduced.out().link;
            assert!(
                link.i_source.abs() < 1e-9 && (link.p_chopper + b[1]).abs() < 1e-6 * (1.0 + b[1].abs()),
                "{link:?}"
            );
            assert_eq!(share > 1.2, link.p_chopper > 1e3, "{link:?}");
        }
    }
}

/// A salient machine: at rest the diodes block below their opening speed; a current that flows goes on to a lower speed, and jumps.
#[test]
fn a_current_goes_on_below_the_speed_at_which_it_begins() {
    let drive = Setup::salient();
    let machine = machines::c(240.0);
    let (mut full, mut reduced) = (whole(&drive), mean(&drive));
    let off = |i: &mut DriveInputs| (i.u_dc, i.enable) = (400.0, false);
    let mut flows = Vec::new();
    for share in [0.7, 0.9, 0.98, 1.05, 0.98, 0.9, 0.85, 0.82, 0.78, 0.9] {
        let speed = share * drive.opening();
        let a = full.run((0.4, 1e-4), speed, off);
        let b = reduced.run((0.4, 0.1), speed, off);
        same(&format!("salient {share:4.2}"), a, b, &machine);
        flows.push(b[1] < -1e3);
    }
    assert_eq!(flows, [false, false, false, true, true, true, true, true, false, false]);
    // Switched off at full current, the drive falls into the generating state or blocks, as the transient decides.
    for (share, tau) in [(0.9, -60.0), (0.9, 60.0), (0.75, -60.0), (0.5, 100.0)] {
        let speed = share * drive.opening();
        let (mut full, mut reduced) = (whole(&drive), mean(&drive));
        let on = |i: &mut DriveInputs| (i.u_dc, i.tau_ref) = (400.0, tau);
        full.run((0.2, 1e-4), speed, on);
        reduced.run((0.2, 0.05), speed, on);
        let a = full.run((0.4, 1e-4), speed, off);
        let b = reduced.run((0.4, 0.05), speed, off);
        same(&format!("switched off at {share:4.2}, {tau} N.m"), a, b, &machine);
    }
}

/// The steady currents and torques of a short circuit, by the input and by a trip, with all losses.
#[test]
fn a_short_circuit_brakes_as_in_the_drive() {
    for (name, drive, machine) in [
        ("a", Setup::new(&lossy::a(), &machines::a()), machines::a()),
        ("b", Setup::new(&lossy::b(), &machines::b()), machines::b()),
        ("c", Setup::new(&lossy::c(), &machines::c(240.0)), machines::c(240.0)),
    ] {
        for rpm in [0.0, 60.0, 130.0, 400.0, -1000.0, 6000.0] {
            let u_dc = drive.u_dc;
            let set = |i: &mut DriveInputs| (i.u_dc, i.asc) = (u_dc, true);
            let a = whole(&drive).run((1.0, 1e-4), rpm * RPM, set);
            let mut reduced = mean(&drive);
            let mut b = reduced.run((1.0, 0.1), rpm * RPM, set);
            let (emf, devices) = (machine.w(rpm).abs() * machine.motor.psi_M, &drive.plant.inverter.devices);
            if machine.w(rpm).abs() < 35.0 && emf < 5.0 * (devices.u_transistor + devices.u_diode) {
                // The harmonics of the thresholds are left out at such a speed.
                for (k, of) in [(0, machine.motor.torque_constant() * machine.i), (2, machine.i), (3, machine.i)] {
                    assert!((b[k] - a[k]).abs() < 0.01 * of, "{name} {rpm} rpm: {b:?}, not {a:?}");
                    b[k] = a[k];
                }
            }
            same(&format!("{name} {rpm} rpm"), a, b, &machine);
            let out = reduced.out();
            assert!(out.controller.short_circuit && !out.controller.enabled && out.plant.powers.p_in == 0.0);
        }
    }
}

/// `trip.asc` shorts where the EMF exceeds the link, and ends at 0.9 of it.
#[test]
fn a_trip_shorts_the_machine_above_the_voltage_of_the_link() {
    let mut drive = Setup::new(&lossy::c(), &machines::c(240.0));
    let trip = &mut drive.controller.trip;
    (trip.used, trip.asc, trip.i, trip.u_dc) = (true, true, 500.0, 430.0);
    let (mut full, mut reduced) = (whole(&drive), mean(&drive));
    let opening = 400.0 / (3.0_f64.sqrt() * 66e-3 * 3.0);
    for (share, u_dc, tripped, shorts) in [
        (0.5, 400.0, false, false),
        (0.5, 440.0, true, false),
        (1.2, 400.0, true, true),
        (0.95, 400.0, true, true),
        (0.85, 400.0, true, false),
        (0.95, 400.0, true, false),
    ] {
        let set = |i: &mut DriveInputs| (i.u_dc, i.tau_ref) = (u_dc, 50.0);
        let a = full.run((0.2, 1e-4), share * opening, set);
        let b = reduced.run((0.2, 0.02), share * opening, set);
        if tripped {
            same(&format!("{share} {u_dc} V"), a, b, &machines::c(240.0));
        }
        for out in [full.out(), reduced.out()] {
            let found = (out.controller.tripped, out.controller.short_circuit);
            assert_eq!(found, (if tripped { Cause::OverVoltage } else { Cause::None }, shorts), "{share} {u_dc} V");
        }
    }
}

/// A free shaft coasts down from twice the opening speed, and brakes in a short circuit, at steps from 1 ms to 1 s.
#[test]
fn the_energies_are_balanced_at_any_step() {
    let mut drive = Setup::new(&lossy::c(), &machines::c(240.0));
    (drive.link.dc_link.used, drive.link.dc_link.R_source) = (true, 0.05);
    let J = 2.0;
    (drive.plant.mechanics.imposed, drive.plant.mechanics.J) = (false, J);
    let start = 2.0 * drive.opening();
    drive.plant.initial.speed = start;
    for asc in [false, true] {
        let mut ends = Vec::new();
        for h in [1e-2, 0.1, 1.0] {
            let mut reduced = mean(&drive);
            reduced.run((20.0, h), 0.0, |i| (i.u_dc, i.enable, i.asc) = (400.0, false, asc));
            let out = reduced.out();
            let (plant, link) = (&out.plant.energy, &out.link.energy);
            let kept = 0.5 * J * (out.plant.speed * out.plant.speed - start * start);
            let rests =
                [link.source - link.resistor - link.chopper - plant.r#in, plant.r#in - plant.mech - plant.loss - kept];
            println!("asc {asc}, h = {h} s: {:.2} rad/s, {plant:?} {link:?}, rests {rests:?} J", out.plant.speed);
            assert!(rests.iter().all(|rest| rest.abs() < 1e-4 * kept.abs()), "{h} s: {rests:?}");
            assert!((plant.r#in < -1e5) != asc, "{plant:?}");
            ends.push([out.plant.speed, plant.loss]);
        }
        for end in &ends {
            for k in 0..2 {
                assert!((end[k] / ends[0][k] - 1.0).abs() < 2e-3, "{ends:?}");
            }
        }
    }
}

/// In Model Exchange, the rates and outputs with the gates off are those of the step.
#[test]
fn model_exchange_rectifies_too() {
    let drive = Setup::salient();
    let mut reduced = mean(&drive);
    let speed = 0.9 * drive.opening();
    reduced.run((0.2, 0.05), 1.05 * drive.opening(), |i| (i.u_dc, i.enable) = (400.0, false));
    let stepped = reduced.run((0.2, 0.05), speed, |_| ());
    let (mut dx, block) = (vec![0.0; PmsmDriveMean::STATES.len()], &mut reduced.block);
    let mut out = block.out.clone();
    block.model.event(Elapsed::ZERO).unwrap();
    block.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
    block.model.observe(Elapsed::ZERO, &mut out);
    let rate = dx[PmsmDriveMean::STATES.iter().position(|state| state.name == "energy_in").unwrap()];
    let p_in = out.drive.plant.powers.p_in;
    assert!(
        (p_in / stepped[1] - 1.0).abs() < 1e-6 && (rate - p_in).abs() < 1e-9 && p_in < -1e3,
        "{p_in} {rate} {stepped:?}"
    );
    block.model.inputs.asc = true;
    block.model.event(Elapsed::ZERO).unwrap();
    block.model.observe(Elapsed::ZERO, &mut out);
    assert!(out.drive.controller.short_circuit && out.drive.plant.powers.p_in == 0.0);
}
