//! Protection of the drive, in Co-Simulation and in Model Exchange: over-current and over-voltage trips, and the loss of a
//! sensor during the run.

use crate::machines::{Machine, RPM, b, c};
use drive::PmsmDrive;
use drive::control::trip::Cause;
use drive::estimator::Kind;
use drive::plant::inverter::Gates;
use fmu_core::log::Warnings;
use fmu_core::{Block, ContinuousTime, Elapsed, Model, Step, Warns, integrate};

const T_S: f64 = 1e-4;

/// A drive in Co-Simulation or in Model Exchange.
struct Run {
    drive: Block<PmsmDrive>,
    now: Elapsed,
    exchange: bool,
}

impl Run {
    /// With a sensor and exact estimates, after `set`.
    fn new(machine: &Machine, exchange: bool, set: impl FnOnce(&mut PmsmDrive)) -> Self {
        let mut drive = Block::<PmsmDrive>::default();
        let plant = &mut drive.model.pair.plant.model.parameters;
        (plant.motor, plant.mechanics.J) = (machine.motor.clone(), machine.J);
        drive.model.pair.controller.model.parameters = machine.parameters();
        drive.model.inputs.u_dc = machine.u_dc;
        set(&mut drive.model);
        drive.initialize();
        drive.model.validate().unwrap();
        Self { drive, now: Elapsed::ZERO, exchange }
    }

    /// One sample.
    fn step(&mut self) {
        let inputs = &mut self.drive.model.inputs;
        inputs.angle_shaft = inputs.speed_shaft * self.now.seconds();
        let step = Step { start: self.now, h: T_S };
        if self.exchange {
            integrate::hybrid::<PmsmDrive, 5>(&mut self.drive.model, &step, 1e-5).unwrap();
            let Block { model, out } = &mut self.drive;
            model.observe(step.end(), out);
        } else {
            self.drive.step(&step).unwrap();
        }
        self.now = step.end();
    }

    fn run(&mut self, seconds: f64) {
        let end = self.now.seconds() + seconds - 1e-9;
        while self.now.seconds() < end {
            self.step();
        }
    }

    fn gates(&self) -> Gates {
        self.drive.model.pair.plant.model.inputs.gates()
    }

    fn tripped(&self) -> Cause {
        self.drive.out.controller.tripped
    }

    fn warning(&self) -> String {
        let mut said = String::new();
        self.drive.model.warn(&mut Warnings::to(&mut |(_, _, text)| said += &text()));
        said
    }
}

/// In torque mode on a shaft that turns at `rpm`, with trips.
fn traction(drive: &mut PmsmDrive, rpm: f64) {
    drive.pair.plant.model.parameters.mechanics.imposed = true;
    let par = &mut drive.pair.controller.model.parameters;
    par.speed_loop.torque_mode = true;
    (par.trip.used, par.trip.i, par.trip.u_dc) = (true, 300.0, 450.0);
    drive.inputs.speed_shaft = rpm * RPM;
}

#[test]
fn an_over_voltage_opens_the_gates_until_enable_falls() {
    for exchange in [false, true] {
        let mut run = Run::new(&c(240.0), exchange, |drive| traction(drive, 3000.0));
        run.drive.model.inputs.tau_ref = 80.0;
        run.run(0.1);
        assert!(run.tripped() == Cause::None && (run.drive.out.plant.tau_e - 80.0).abs() < 0.5);
        run.drive.model.inputs.u_dc = 449.9;
        run.run(0.02);
        assert_eq!((run.tripped(), run.gates()), (Cause::None, Gates::Switch));
        // The first sample above the limit trips, and its command takes effect one sample later.
        run.drive.model.inputs.u_dc = 450.1;
        run.step();
        run.step();
        assert_eq!((run.tripped(), run.gates()), (Cause::OverVoltage, Gates::Off), "{exchange}");
        let warning = run.warning();
        assert!(warning.contains("trip.u_dc = 450 V") && warning.contains("the gates are off"), "{warning}");
        run.drive.model.inputs.u_dc = 400.0;
        run.run(0.05);
        assert_eq!(run.tripped(), Cause::OverVoltage, "latched");
        assert!(run.drive.out.plant.i_q.abs() < 1e-6 && !run.drive.out.controller.enabled);
        run.drive.model.inputs.enable = false;
        run.run(2.0 * T_S);
        assert_eq!(run.tripped(), Cause::None, "enable has fallen");
        run.drive.model.inputs.enable = true;
        run.run(0.1);
        assert!(run.drive.out.controller.enabled && (run.drive.out.plant.tau_e - 80.0).abs() < 0.5);
    }
}

/// Above the diode speed, 11 138 rpm, gates off would feed 44 kW into the link at 13 500 rpm.
#[test]
fn a_trip_short_circuits_where_the_diodes_would_conduct() {
    for (asc, expected) in [(false, Gates::Off), (true, Gates::Short)] {
        let mut run = Run::new(&c(240.0), false, |drive| {
            traction(drive, 13_500.0);
            drive.pair.controller.model.parameters.trip.asc = asc;
        });
        run.drive.model.inputs.tau_ref = -20.0;
        run.run(0.1);
        assert_eq!(run.tripped(), Cause::None);
        run.drive.model.inputs.u_dc = 460.0;
        run.run(3.0 * T_S);
        run.drive.model.inputs.u_dc = 400.0;
        run.run(0.3);
        assert_eq!((run.tripped(), run.gates()), (Cause::OverVoltage, expected));
        let p_in = run.drive.out.plant.powers.p_in;
        assert!(if asc { p_in == 0.0 } else { p_in < -35e3 }, "{p_in} W");
        // At lower speeds the short circuit ends, with some hysteresis: 10 024 rpm.
        for (rpm, gates) in [(10_500.0, expected), (9900.0, Gates::Off), (10_500.0, Gates::Off), (11_500.0, expected)] {
            run.drive.model.inputs.speed_shaft = rpm * RPM;
            run.run(5.0 * T_S);
            assert_eq!(run.gates(), gates, "{rpm} rpm");
        }
    }
}

/// A lost rotor: the estimate of the angle is wrong by 1.2 rad, and the speed loop drives the current up.
#[test]
fn an_over_current_trips_at_the_first_sample_beyond() {
    for exchange in [false, true] {
        let mut run = Run::new(&b(), exchange, |drive| {
            let par = &mut drive.pair.controller.model.parameters;
            (par.trip.used, par.trip.i, par.trip.u_dc) = (true, 8.0, 400.0);
            // A current loop that overshoots, because its estimate of the resistance is much too low.
            (par.motor.L_d, par.motor.L_q) = (0.03, 0.03);
        });
        run.drive.model.inputs.speed_ref = 1500.0 * RPM;
        let mut most = 0.0_f64;
        for _ in 0..2000 {
            let i = run.drive.out.plant.i;
            let now = i.a.abs().max(i.b.abs()).max(i.c.abs());
            if run.tripped() == Cause::None {
                most = most.max(now);
            }
            run.step();
        }
        assert_eq!((run.tripped(), run.gates()), (Cause::OverCurrent, Gates::Off), "{most} A");
        // The gates opened one sample after the first measurement above the limit.
        assert!(most > 8.0 && most < 12.0, "{most} A");
        assert!(run.warning().contains("trip.i = 8 A"), "{}", run.warning());
    }
}

#[test]
fn a_trip_that_operation_would_reach_is_refused() {
    let refused = |set: fn(&mut PmsmDrive)| {
        let mut drive = PmsmDrive::default();
        drive.pair.controller.model.parameters.trip.used = true;
        set(&mut drive);
        drive.derive();
        drive.validate().unwrap_err().message().to_owned()
    };
    let message = refused(|drive| drive.pair.controller.model.parameters.trip.i = 7.0);
    assert!(message.contains("trip.i = 7 A") && message.contains("above limit.i = 7.5 A"), "{message}");
    let message = refused(|drive| drive.pair.controller.model.parameters.trip.u_dc = 300.0);
    assert!(message.contains("trip.u_dc = 300 V") && message.contains("325 V"), "{message}");
    let message = refused(|drive| drive.pair.controller.model.parameters.trip.i = f64::NAN);
    assert!(message.contains("trip.i"), "{message}");
    // Without trips, no limit is checked.
    let mut drive = PmsmDrive::default();
    drive.pair.controller.model.parameters.trip.i = -1.0;
    drive.derive();
    drive.validate().unwrap();
}

#[test]
fn a_lost_sensor_hands_over_to_the_fallback() {
    for exchange in [false, true] {
        for fallback in [Kind::Rasmussen, Kind::ExtendedEmf, Kind::KalmanFilter, Kind::FluxObserver] {
            let mut run = Run::new(&b(), exchange, |drive| {
                drive.pair.controller.model.parameters.fallback = fallback;
                drive.pair.controller.model.parameters.weakening.used = false;
            });
            let inputs = &mut run.drive.model.inputs;
            (inputs.speed_ref, inputs.tau_load) = (1500.0 * RPM, 2.0);
            run.run(0.4);
            let before = run.drive.out.clone();
            assert!(!before.controller.sensor_lost && (before.plant.speed - 1500.0 * RPM).abs() < 0.1);
            run.drive.model.inputs.sensor_valid = false;
            let (mut torque, mut speed) = (0.0_f64, 0.0_f64);
            for _ in 0..3000 {
                run.step();
                let out = &run.drive.out;
                torque = torque.max((out.plant.tau_e - before.plant.tau_e).abs());
                speed = speed.max((out.plant.speed - before.plant.speed).abs());
            }
            println!(
                "{fallback:?}, {exchange}: {torque} N.m, {speed} rad/s, lost {}",
                run.drive.out.controller.lock_lost
            );
            let out = &run.drive.out.controller;
            assert!(out.sensor_lost && out.enabled && out.lock_lost < 0.01, "{fallback:?}: {out:?}");
            assert!(torque < 0.01 && speed < 0.05, "{fallback:?}, {exchange}: {torque} N.m, {speed} rad/s");
            // The sensor's values no longer have an effect, and the drive does not switch back automatically.
            run.drive.model.inputs.sensor_valid = true;
            run.run(0.1);
            assert!(run.drive.out.controller.sensor_lost);
            run.drive.model.inputs.enable = false;
            run.run(3.0 * T_S);
            run.drive.model.inputs.enable = true;
            run.run(0.3);
            let out = &run.drive.out;
            assert!(!out.controller.sensor_lost && (out.plant.speed - 1500.0 * RPM).abs() < 1.0, "{out:?}");
        }
    }
}

#[test]
fn without_a_fallback_the_sensor_stays_in_use() {
    let run = |valid: bool| {
        let mut run = Run::new(&b(), false, |drive| drive.inputs.sensor_valid = valid);
        run.drive.model.inputs.speed_ref = 1000.0 * RPM;
        run.run(0.2);
        run.drive.out
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_fallback_that_cannot_work_is_refused() {
    let mut drive = PmsmDrive::default();
    let par = &mut drive.pair.controller.model.parameters;
    (par.estimator, par.fallback, par.weakening.used) = (Kind::Sensored, Kind::PulsatingInjection, true);
    drive.derive();
    let message = drive.validate().unwrap_err().message().to_owned();
    assert!(message.contains("sensor.fallback") && message.contains("PulsatingInjection"), "{message}");
    // It is checked only if it is in use.
    drive.pair.controller.model.parameters.estimator = Kind::Rasmussen;
    drive.derive();
    drive.validate().unwrap();
}
