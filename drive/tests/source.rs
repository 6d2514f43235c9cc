//! The sources of the DC link in `PmsmDrive`, in Co-Simulation and in Model Exchange: rectifiers, a battery with limits, brown-out.

use crate::importer::Importer;
use crate::machines::{Machine, RPM, b, c};
use drive::PmsmDrive;
use drive::dc_link::DcSource;
use drive::pmsm_drive::DriveOutputs;
use drive_control::trip::Cause;
use fmu_core::{Block, Model, Step};
use std::f64::consts::TAU;

const T_S: f64 = 1e-4;

/// A drive with a sensor and exact estimates, on a link with the `source`, in Co-Simulation or in Model Exchange.
struct Run {
    importer: Importer<PmsmDrive>,
    exchange: bool,
    angle: f64,
}

impl Run {
    fn new(machine: &Machine, exchange: bool, source: DcSource, set: impl FnOnce(&mut PmsmDrive)) -> Self {
        let mut drive = Block::<PmsmDrive>::default();
        let plant = &mut drive.model.pair.plant.model.parameters;
        (plant.motor, plant.mechanics.J) = (machine.motor.clone(), machine.J);
        drive.model.pair.controller.model.parameters = machine.parameters();
        let link = &mut drive.model.link_parameters.dc_link;
        (drive.model.inputs.u_dc, link.used, link.source) = (machine.u_dc, true, source);
        set(&mut drive.model);
        let importer = Importer::new(drive.model, 1e-5, 1);
        importer.block.model.validate().unwrap();
        Self { importer, exchange, angle: 0.0 }
    }

    fn run(&mut self, seconds: f64, mut each: impl FnMut(f64, &DriveOutputs)) {
        let end = self.importer.now.seconds() + seconds - 1e-9;
        while self.importer.now.seconds() < end {
            let (now, angle) = (self.importer.now.seconds(), self.angle);
            let inputs = self.inputs();
            inputs.angle_shaft = angle;
            let speed = inputs.speed_shaft;
            self.angle += speed * T_S;
            if self.exchange {
                self.importer.event(|_| ());
                self.importer.run(T_S, |drive, t| drive.inputs.angle_shaft = angle + speed * (t - now));
            } else {
                let step = Step { start: self.importer.now, h: T_S };
                self.importer.block.step(&step).unwrap();
                self.importer.now = step.end();
            }
            each(self.importer.now.seconds(), &self.importer.block.out);
        }
    }

    fn inputs(&mut self) -> &mut drive::pmsm_drive::DriveInputs {
        &mut self.importer.block.model.inputs
    }

    fn out(&self) -> &DriveOutputs {
        &self.importer.block.out
    }
}

/// Reverses 1500 rpm: an ideal source takes the energy; a rectifier, or a battery that takes nothing, leaves it to the chopper.
#[test]
fn the_chopper_takes_what_a_rectifier_does_not() {
    for exchange in [false, true] {
        let braking = |source| {
            let mut run = Run::new(&b(), exchange, source, |drive| {
                let link = &mut drive.link_parameters;
                (link.dc_link.C, link.dc_link.R_source, link.dc_link.i_min) = (4e-4, 0.5, 0.0);
                (link.chopper.used, link.chopper.u_on, link.chopper.u_off, link.chopper.R) =
                    (true, 360.0, 350.0, 100.0);
                drive.pair.plant.model.parameters.mechanics.J = 0.01;
                drive.inputs.speed_ref = 1500.0 * RPM;
            });
            run.run(0.6, |_, _| ());
            run.inputs().speed_ref = -1500.0 * RPM;
            let (before, mut least, mut most) = (run.out().link.energy, f64::INFINITY, 0.0_f64);
            run.run(0.3, |_, out| (least, most) = (least.min(out.link.i_source), most.max(out.link.u)));
            let (link, plant) = (run.out().link, &run.out().plant.energy);
            let stored = 0.5 * 4e-4 * (link.u * link.u - 325.0 * 325.0);
            let rest = link.energy.source - link.energy.resistor - link.energy.chopper - plant.r#in - stored;
            println!("{source:?}, {exchange}: {least} A, {most} V, {rest:e} J off, {before:?} {:?}", link.energy);
            assert!(rest.abs() < 2e-3 * link.energy.source, "{rest} J");
            (link.energy.chopper - before.chopper, least, most)
        };
        let (chopper, least, _) = braking(DcSource::Ideal);
        assert!(chopper < 1e-9 && least < -1.5, "an ideal source takes it: {least} A");
        for source in [DcSource::Battery, DcSource::RectifierSingle, DcSource::RectifierThree] {
            let (chopper, least, most) = braking(source);
            assert!(
                chopper > 50.0 && least > -1e-9 && most < 360.1 && most > 359.0,
                "{chopper} J, {least} A, {most} V"
            );
        }
    }
}

/// Against a plain integration in steps of 0.5 us of the bridge on its sinusoidal voltages, with the power of the drive.
#[test]
fn the_rectifiers_are_those_of_a_witness() {
    for (source, lines, accuracy) in [(DcSource::RectifierSingle, 2, 0.01), (DcSource::RectifierThree, 6, 0.002)] {
        for exchange in [false, true] {
            let (C, R) = (2e-3, 0.2);
            let mut run = Run::new(&c(240.0), exchange, source, |drive| {
                (drive.pair.plant.model.parameters.mechanics.imposed, drive.inputs.speed_shaft) = (true, 100.0);
                drive.pair.controller.model.parameters.speed_loop.torque_mode = true;
                drive.inputs.tau_ref = 30.0;
                let link = &mut drive.link_parameters.dc_link;
                (link.C, link.R_source) = (C, R);
            });
            let (mut u, mut t, mut worst, mut peak, mut charge) = (400.0_f64, 0.0_f64, 0.0_f64, 0.0_f64, [0.0_f64; 2]);
            run.run(0.1, |now, out| {
                let p = out.means.p_in;
                while t < now - 1e-9 {
                    let U = (0..lines)
                        .map(|k| 400.0 * (TAU * (50.0 * t - f64::from(k) / f64::from(lines))).cos())
                        .fold(0.0, f64::max);
                    let i = ((U - u) / R).max(0.0);
                    u += 0.5e-6 / C * (i - p / u);
                    t += 0.5e-6;
                    charge[0] += i * 0.5e-6;
                }
                if !exchange {
                    charge[1] += out.link.i_source * T_S;
                }
                (worst, peak) = (worst.max((out.link.u - u).abs()), peak.max(400.0 - u));
            });
            println!("{source:?}, {exchange}: {worst} V apart with a ripple of {peak} V, {charge:?} C");
            assert!(worst < 400.0 * accuracy && peak > 5.0 && charge[0] > 0.5, "{worst} V");
            assert!(exchange || (charge[1] / charge[0] - 1.0).abs() < 0.01, "{charge:?}");
        }
    }
}

/// The current of a battery stays within its limits, in both directions; beyond them, the voltage gives way.
#[test]
fn a_battery_keeps_its_limits() {
    for exchange in [false, true] {
        for (tau, limit) in [(20.0, None), (60.0, Some(40.0)), (-60.0, Some(-30.0))] {
            let mut run = Run::new(&c(240.0), exchange, DcSource::Battery, |drive| {
                (drive.pair.plant.model.parameters.mechanics.imposed, drive.inputs.speed_shaft) = (true, 300.0);
                drive.pair.controller.model.parameters.speed_loop.torque_mode = true;
                drive.inputs.tau_ref = tau;
                let link = &mut drive.link_parameters.dc_link;
                (link.C, link.R_source, link.i_max, link.i_min) = (5e-3, 0.1, 40.0, -30.0);
            });
            let mut extremes = [f64::INFINITY, f64::NEG_INFINITY];
            run.run(0.05, |_, out| {
                extremes = [extremes[0].min(out.link.i_source), extremes[1].max(out.link.i_source)];
            });
            let (link, plant) = (run.out().link, &run.out().plant.energy);
            let stored = 0.5 * 5e-3 * (link.u * link.u - 400.0 * 400.0);
            let rest = link.energy.source - link.energy.resistor - plant.r#in - stored;
            println!("{tau} N.m, {exchange}: {extremes:?} A, {} V, {rest:e} J off", link.u);
            assert!(rest.abs() < 1e-3 * link.energy.source.abs() && link.energy.resistor > 0.0, "{rest} J");
            assert!(extremes[0] >= -30.0 - 1e-9 && extremes[1] <= 40.0 + 1e-9, "{extremes:?} A");
            match limit {
                None => assert!(link.i_source > 10.0 && link.i_source < 30.0 && link.u > 396.0, "{link:?}"),
                Some(limit) => {
                    assert!((link.i_source - limit).abs() < 1e-9, "{link:?}");
                    assert!(if limit > 0.0 { link.u < 390.0 } else { link.u > 410.0 }, "{link:?}");
                }
            }
        }
    }
}

/// The mains fail for 60 ms: the link discharges, the drive trips by the voltage and, with a restart voltage, starts again when it is
/// back; without one it rests until `enable` falls.
#[test]
fn a_brown_out_trips_and_restarts() {
    for exchange in [false, true] {
        for restart in [0.0, 290.0] {
            let mut run = Run::new(&b(), exchange, DcSource::RectifierThree, |drive| {
                drive.link_parameters.dc_link.R_source = 0.5;
                let trip = &mut drive.pair.controller.model.parameters.trip;
                (trip.used, trip.i, trip.u_dc, trip.u_dc_min, trip.u_dc_restart) = (true, 50.0, 420.0, 230.0, restart);
                (drive.inputs.speed_ref, drive.inputs.tau_load) = (1000.0 * RPM, 2.0);
            });
            run.run(0.4, |_, _| ());
            assert!(run.out().controller.enabled && (run.out().plant.speed / RPM - 1000.0).abs() < 5.0);
            run.inputs().u_dc = 0.0;
            run.run(0.06, |_, out| assert!(out.link.i_source >= 0.0, "nothing flows back: {:?}", out.link));
            assert_eq!(run.out().controller.tripped, Cause::UnderVoltage, "{:?}", run.out().link);
            let low = run.out().link.u;
            run.inputs().u_dc = 325.0;
            run.run(0.5, |_, _| ());
            let (out, rpm) = (run.out(), run.out().plant.speed / RPM);
            println!("{exchange}, {restart} V: {low} V, then {:?} at {rpm} rpm", out.controller.tripped);
            assert!(low < 230.0 && low > 100.0, "{low} V");
            if restart > 0.0 {
                assert!(out.controller.tripped == Cause::None && (rpm - 1000.0).abs() < 10.0, "{rpm} rpm");
            } else {
                assert!(out.controller.tripped == Cause::UnderVoltage && !out.controller.enabled && rpm < 500.0);
            }
        }
    }
}

/// A restart voltage outside its range is refused.
#[test]
fn a_restart_voltage_lies_between_the_trips() {
    for (restart, fits) in
        [(0.0, true), (199.0, false), (200.0, true), (449.0, true), (450.0, false), (f64::NAN, false)]
    {
        let mut drive = PmsmDrive::default();
        let trip = &mut drive.pair.controller.model.parameters.trip;
        (trip.used, trip.u_dc, trip.u_dc_min, trip.u_dc_restart) = (true, 450.0, 200.0, restart);
        drive.derive();
        let said = drive.validate();
        assert_eq!(said.is_ok(), fits, "{restart}: {said:?}");
        assert!(said.is_ok_and(|()| true) || fits || drive.validate().unwrap_err().message().contains("u_dc_restart"));
    }
}
