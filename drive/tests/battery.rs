//! Limits of the DC-link current: kept within 5 % in steady state with exact parameters, without hunting, in Co-Simulation
//! and in Model Exchange.

use crate::importer::Importer;
use crate::machines::{Machine, RPM, a, b, c};
use drive::PmsmDrive;
use drive::control::battery::DcLimits;
use drive::pmsm_drive::DriveOutputs;
use fmu_core::log::Warnings;
use fmu_core::{Model, Step};

const T_S: f64 = 1e-4;

struct Run {
    importer: Importer<PmsmDrive>,
    exchange: bool,
    angle: f64,
}

impl Run {
    /// With a sensor, exact estimates and limits of `dc`, after `set`.
    fn new(machine: &Machine, exchange: bool, dc: &DcLimits, set: impl FnOnce(&mut PmsmDrive)) -> Self {
        let mut drive = PmsmDrive::default();
        let plant = &mut drive.pair.plant.model.parameters;
        (plant.motor, plant.mechanics.J) = (machine.motor.clone(), machine.J);
        drive.pair.controller.model.parameters = machine.parameters();
        drive.pair.controller.model.parameters.dc = dc.clone();
        drive.inputs.u_dc = machine.u_dc;
        set(&mut drive);
        let importer = Importer::new(drive, 2e-5, 1);
        importer.block.model.validate().unwrap();
        Self { importer, exchange, angle: 0.0 }
    }

    fn step(&mut self) {
        let angle = self.angle;
        let inputs = &mut self.importer.block.model.inputs;
        inputs.angle_shaft = angle;
        let (speed, start) = (inputs.speed_shaft, self.importer.now);
        self.angle += speed * T_S;
        if self.exchange {
            self.importer.event(|_| ());
            self.importer.run(T_S, |drive, t| drive.inputs.angle_shaft = angle + speed * (t - start.seconds()));
        } else {
            let step = Step { start, h: T_S };
            self.importer.block.step(&step).unwrap();
            self.importer.now = step.end();
        }
    }

    fn out(&self) -> &DriveOutputs {
        &self.importer.block.out
    }
}

fn limits(max: f64, min: f64) -> DcLimits {
    DcLimits { used: true, max, min }
}

#[test]
fn full_torque_keeps_the_limits_in_both_directions() {
    for exchange in [false, true] {
        for (machine, dc, rpms) in [
            (c(240.0), limits(60.0, -40.0), [500.0, 3000.0, 9000.0]),
            (a(), limits(3.0, -2.0), [200.0, 1000.0, 2500.0]),
            (b(), limits(2.0, -1.0), [300.0, 1500.0, 4000.0]),
        ] {
            for (rpm, s) in rpms.into_iter().flat_map(|rpm: f64| [(rpm, 1.0), (rpm, -1.0), (-rpm, 1.0), (-rpm, -1.0)]) {
                for weakening in [true, false] {
                    if !weakening && rpm.abs() > 1000.0 {
                        continue;
                    }
                    let mut run = Run::new(&machine, exchange, &dc, |drive| {
                        drive.pair.plant.model.parameters.mechanics.imposed = true;
                        let par = &mut drive.pair.controller.model.parameters;
                        (par.speed_loop.torque_mode, par.weakening.used) = (true, weakening);
                        (drive.inputs.speed_shaft, drive.inputs.tau_ref) = (rpm * RPM, s * rpm.signum() * 1e4);
                    });
                    let (mut sum, mut low, mut high, n) = (0.0, f64::INFINITY, f64::NEG_INFINITY, 500_u32);
                    for k in 0..2000 {
                        run.step();
                        if k >= 2000 - n {
                            sum += run.out().means.p_in / machine.u_dc / f64::from(n);
                            let tau = run.out().plant.tau_e;
                            (low, high) = (low.min(tau), high.max(tau));
                        }
                    }
                    let out = run.out();
                    let tau = if s * rpm > 0.0 { out.controller.tau_max } else { out.controller.tau_min };
                    let free =
                        if weakening { machine.limit(rpm.abs(), s)[1].tau } else { machine.limit(1.0, s)[1].tau };
                    let allowed = if s > 0.0 { dc.max } else { dc.min };
                    // Where the drive cannot take that much, its other limits are active.
                    if tau.abs() < 0.98 * free {
                        let off = sum / allowed - 1.0;
                        assert!(off.abs() < 0.05, "{rpm} rpm, {s}: {sum} A of {allowed} A");
                        assert!(out.controller.current_limited, "{rpm} rpm, {s}");
                    } else {
                        assert!(sum / allowed < 1.05, "{rpm} rpm, {s}: {sum} A of {allowed} A");
                    }
                    let mean = 0.5 * (low + high);
                    assert!((mean / tau - 1.0).abs() < 0.02, "{rpm} rpm, {s}: {mean} N.m, announced {tau} N.m");
                    assert!(high - low < 0.01 * mean.abs() + 0.01, "{rpm} rpm, {s}: hunting, {low} to {high} N.m");
                }
            }
        }
    }
}

/// In speed control, with the link and its source inside the drive: the limit applies to the source's current.
#[test]
fn an_acceleration_keeps_the_current_of_the_source() {
    for exchange in [false, true] {
        let mut run = Run::new(&c(240.0), exchange, &limits(50.0, -30.0), |drive| {
            let link = &mut drive.link_parameters.dc_link;
            (link.used, link.R_source) = (true, 0.3);
            drive.inputs.speed_ref = 4000.0 * RPM;
        });
        let (mut most, mut at_limit, mut overshoot) = (0.0_f64, 0, 0.0_f64);
        for k in 0..6000 {
            run.step();
            let out = run.out();
            // At first the magnetic field also takes power.
            most = most.max(if k < 200 { 0.0 } else { out.link.i_source });
            at_limit += u32::from((out.link.i_source / 50.0 - 1.0).abs() < 0.05);
            overshoot = overshoot.max(out.plant.speed / (4000.0 * RPM) - 1.0);
        }
        println!("{most} A, {at_limit} samples at the limit, {overshoot}");
        assert!(most < 1.05 * 50.0 && at_limit > 1000, "{most} A, {at_limit} samples");
        assert!(overshoot < 0.01 && run.out().plant.speed > 3900.0 * RPM, "{overshoot}, {}", run.out().plant.speed);
        run.importer.block.model.inputs.speed_ref = 500.0 * RPM;
        let mut least = 0.0_f64;
        for k in 0..4000 {
            run.step();
            least = least.min(if k < 200 { 0.0 } else { run.out().link.i_source });
        }
        println!("{least} A");
        assert!(least > 1.05 * -30.0 && least < -28.0, "{least} A");
    }
}

#[test]
fn limits_of_the_wrong_sign_are_refused() {
    let refused = |max: f64, min: f64| {
        let mut drive = PmsmDrive::default();
        drive.pair.controller.model.parameters.dc = limits(max, min);
        drive.derive();
        drive.validate().unwrap_err().message().to_owned()
    };
    let message = refused(-1.0, -5.0);
    assert!(message.contains("limit.i_dc_max = -1 A") && message.contains("at least 0 A"), "{message}");
    let message = refused(5.0, 1.0);
    assert!(message.contains("limit.i_dc_min = 1 A") && message.contains("at most 0 A"), "{message}");
    let mut drive = PmsmDrive::default();
    drive.pair.controller.model.parameters.dc = DcLimits { used: false, max: -1.0, min: 1.0 };
    drive.derive();
    drive.validate().unwrap();
}

/// i_0 = 5 A alone requires 1.5 * 2 Ohm * 25 A2 / 325 V = 0.231 A.
#[test]
fn the_current_of_standstill_is_within_the_limit_and_the_drive_starts() {
    for (max, i_0) in [(0.1, (0.1_f64 * 325.0 / 6.0).sqrt()), (0.2, (0.2_f64 * 325.0 / 6.0).sqrt()), (1.0, 5.0)] {
        let mut drive = PmsmDrive::default();
        let par = &mut drive.pair.controller.model.parameters;
        (par.motor.R_s, par.dc) = (2.0, limits(max, -max));
        let mut importer = Importer::new(drive, 2e-5, 1);
        let (mut most, mut warned) = (0.0_f64, Vec::new());
        for k in 0..30_000 {
            importer.block.model.inputs.speed_ref = if k < 5000 { 0.0 } else { 300.0 * RPM };
            let step = Step { start: importer.now, h: T_S };
            importer.block.step(&step).unwrap();
            importer.now = step.end();
            let out = &importer.block.out;
            if k == 4999 {
                assert!((out.controller.i_ref.d - i_0).abs() < 1e-6, "{max} A: {:?}", out.controller.i_ref);
                fmu_core::Warns::warn(
                    &importer.block.model,
                    &mut Warnings::to(&mut |(_, key, text)| warned.push((key, text()))),
                );
            }
            // While the current rises, the magnetic field also takes power.
            most = most.max(if k % 5000 < 200 { 0.0 } else { out.means.p_in / 325.0 });
        }
        assert!(most < 1.05 * max, "{max} A: {most} A");
        let speed = importer.block.out.plant.speed;
        assert!((speed / (300.0 * RPM) - 1.0).abs() < 0.01, "{max} A: {speed} rad/s");
        let named = warned.iter().any(|(key, text)| *key == "limit.i_dc_max" && text.contains("= 0.231 A"));
        assert!(named == (i_0 < 5.0) && warned.len() < 2, "{warned:?}");
    }
}
