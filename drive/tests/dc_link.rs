//! The DC link inside `PmsmDrive`, in Co-Simulation and in Model Exchange: steady state, precharge, brake chopper, energies.
#![allow(clippy::float_cmp)]

use crate::importer::Importer;
use crate::machines::{Machine, RPM, b, c};
use drive::PmsmDrive;
use drive::dc_link::{DcSource, LinkParameters};
use drive::plant::machine::{flux, magnetic_energy};
use drive::pmsm_drive::DriveOutputs;
use drive_base::frame::Dq;
use fmu_core::{Block, Capabilities, ContinuousTime, Description, Differentiable, Events, Exported, Model, Step};

const T_S: f64 = 1e-4;

/// A drive in Co-Simulation or in Model Exchange.
struct Run {
    importer: Importer<PmsmDrive>,
    exchange: bool,
    angle: f64,
    /// Stored energy in J at the start.
    start: f64,
}

impl Run {
    /// With a sensor and exact estimates, after `set`.
    fn new(machine: &Machine, exchange: bool, set: impl FnOnce(&mut PmsmDrive)) -> Self {
        let mut drive = Block::<PmsmDrive>::default();
        let plant = &mut drive.model.pair.plant.model.parameters;
        (plant.motor, plant.mechanics.J) = (machine.motor.clone(), machine.J);
        drive.model.pair.controller.model.parameters = machine.parameters();
        (drive.model.inputs.u_dc, drive.model.link_parameters.dc_link.used) = (machine.u_dc, true);
        set(&mut drive.model);
        let importer = Importer::new(drive.model, 1e-5, 1);
        importer.block.model.validate().unwrap();
        let mut run = Self { importer, exchange, angle: 0.0, start: 0.0 };
        run.start = run.stored();
        run
    }

    fn step(&mut self, h: f64) {
        let (now, angle) = (self.importer.now, self.angle);
        let inputs = &mut self.importer.block.model.inputs;
        inputs.angle_shaft = angle;
        let speed = inputs.speed_shaft;
        self.angle += speed * h;
        if self.exchange {
            self.importer.event(|_| ());
            self.importer.run(h, |drive, t| drive.inputs.angle_shaft = angle + speed * (t - now.seconds()));
        } else {
            let step = Step { start: now, h };
            self.importer.block.step(&step).unwrap();
            self.importer.now = step.end();
        }
    }

    fn run(&mut self, seconds: f64) {
        let end = self.importer.now.seconds() + seconds - 1e-9;
        while self.importer.now.seconds() < end {
            self.step(T_S);
        }
    }

    fn out(&self) -> &DriveOutputs {
        &self.importer.block.out
    }

    /// Energy in J in the capacitor.
    fn in_capacitor(&self) -> f64 {
        let (C, u) = (self.importer.block.model.link_parameters.dc_link.C, self.importer.block.model.link_u());
        0.5 * C * u * u
    }

    /// Energy in J in capacitor, machine and inertia.
    fn stored(&self) -> f64 {
        let (par, out) = (&self.importer.block.model.pair.plant.model.parameters, &self.importer.block.out.plant);
        let i = Dq::new(out.i_d, out.i_q);
        let kinetic = if par.mechanics.imposed { 0.0 } else { 0.5 * par.mechanics.J * out.speed * out.speed };
        self.in_capacitor() + magnetic_energy(&par.motor, par.magnetics(), flux(&par.motor, i)) + kinetic
    }

    /// Checks the energy balance from the source to the shaft since the start; returns the transferred energy in J.
    fn balance(&self, name: &str) -> f64 {
        let (link, plant) = (self.out().link.energy, self.out().plant.energy);
        let change = self.stored() - self.start;
        let rest = link.source - link.resistor - link.chopper - plant.mech - plant.loss - change;
        let passed = link.source.abs() + plant.mech.abs() + link.chopper;
        println!("{name}, {}: {rest:e} J off, {passed} J passed, {link:?}", self.exchange);
        assert!(passed > 1.0 && rest.abs() < 1e-3 * passed, "{name}: {rest} J of {passed} J");
        passed
    }
}

/// In torque mode on a shaft that turns at `rpm`.
fn imposed(drive: &mut PmsmDrive, rpm: f64, tau_ref: f64) {
    drive.pair.plant.model.parameters.mechanics.imposed = true;
    drive.pair.controller.model.parameters.speed_loop.torque_mode = true;
    (drive.inputs.speed_shaft, drive.inputs.tau_ref) = (rpm * RPM, tau_ref);
}

#[test]
fn at_rest_the_voltage_is_that_of_the_closed_form() {
    for exchange in [false, true] {
        for (R, tau) in [(0.2, 80.0), (0.2, -80.0), (1e-4, 80.0), (1.0, 60.0)] {
            let mut run = Run::new(&c(240.0), exchange, |drive| {
                imposed(drive, 3000.0, tau);
                drive.link_parameters.dc_link.R_source = R;
                if exchange {
                    // A stiff source requires short steps of the importer's solver: 10 us here.
                    drive.link_parameters.dc_link.C = (2e-5 / R).max(5e-4);
                }
            });
            run.run(0.3);
            let (u, p) = (run.out().link.u, run.out().means.p_in);
            let expected = 0.5 * (400.0 + (400.0_f64 * 400.0 - 4.0 * R * p).sqrt());
            println!("{exchange}, {R} Ohm, {tau} N.m: {u} V, not {expected} V");
            // In Model Exchange the voltage follows the power within T_s.
            let (allowed, i) = (if exchange { 5e-4 } else { 1e-9 }, (400.0 - u) / R);
            assert!((u / expected - 1.0).abs() < allowed, "{R} Ohm: {u} V, not {expected} V");
            assert!((run.out().link.i_source / i - 1.0).abs() < 1e-6, "{} A, not {i} A", run.out().link.i_source);
            assert!(p.abs() > 15e3 && (p > 0.0) == (tau > 0.0), "{p} W");
            assert!(
                (run.importer.block.model.pair.controller.model.inputs.u_dc - u).abs() < 0.5,
                "the controller measures it"
            );
        }
    }
}

#[test]
fn the_precharge_loses_what_the_capacitor_holds() {
    for exchange in [false, true] {
        for R_precharge in [20.0, 100.0] {
            let mut run = Run::new(&c(240.0), exchange, |drive| {
                (drive.link_parameters.dc_link.R_precharge, drive.inputs.speed_ref) = (R_precharge, 0.0);
            });
            // 95 % after three time constants; until then the controller rests.
            let charged = 5e-4 * (R_precharge + 0.1) * 20.0_f64.ln();
            run.run(charged - 3e-4);
            let out = run.out();
            assert!(out.link.precharges && !out.controller.enabled && out.link.u < 380.0, "{:?}", out.link);
            run.run(6e-4);
            let out = run.out();
            assert!(!out.link.precharges && out.controller.enabled, "{:?} at {}", out.link, run.importer.now.seconds());
            run.run(0.2);
            let (link, full) = (run.out().link, 0.5 * 5e-4 * 400.0 * 400.0);
            println!("{exchange}, {R_precharge} Ohm: {link:?}");
            assert!((link.u - 400.0).abs() < 1e-6, "{} V", link.u);
            assert!((link.energy.resistor / full - 1.0).abs() < 1e-4, "{} J, not {full} J", link.energy.resistor);
            assert!((link.energy.source / (2.0 * full) - 1.0).abs() < 1e-4, "{} J", link.energy.source);
        }
    }
}

/// Braking from 1500 rpm into a source with a high resistance: the chopper limits the voltage.
fn braking(exchange: bool) -> Run {
    let mut run = Run::new(&b(), exchange, |drive| {
        let LinkParameters { dc_link, chopper } = &mut drive.link_parameters;
        (dc_link.C, dc_link.R_source) = (2e-4, 20.0);
        (chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (true, 345.0, 335.0, 100.0);
        drive.pair.plant.model.parameters.mechanics.J = 0.01;
        drive.inputs.speed_ref = 1500.0 * RPM;
    });
    run.run(0.6);
    run.importer.block.model.inputs.speed_ref = -1500.0 * RPM;
    run
}

#[test]
fn the_chopper_keeps_the_voltage() {
    let (mut most, mut switchings) = ([0.0_f64; 2], [0_u32; 2]);
    let mut runs = [false, true].map(braking);
    for run in &runs {
        assert!(run.out().link.energy.chopper == 0.0 && run.out().link.u < 330.0, "{:?}", run.out().link);
    }
    for _ in 0..3000 {
        for (k, run) in runs.iter_mut().enumerate() {
            let before = run.out().link.chops;
            run.step(T_S);
            most[k] = most[k].max(run.out().link.u);
            switchings[k] += u32::from(run.out().link.chops != before);
        }
    }
    println!("{most:?} V, {switchings:?} switchings, {:?}", runs.each_ref().map(|run| run.out().link.energy));
    for (k, run) in runs.iter().enumerate() {
        run.balance("braking");
        let link = run.out().link;
        assert!(most[k] < 345.01 && most[k] > 344.0 && switchings[k] > 10, "{most:?} {switchings:?}");
        assert!(link.energy.chopper > 10.0 && !link.chops, "{link:?}");
    }
    let [a, b] = runs.each_ref().map(|run| run.out().link.energy.chopper);
    assert!((a / b - 1.0).abs() < 0.01, "{a} J, {b} J");
}

#[test]
fn the_energies_are_balanced_in_every_case() {
    let mut passed = [vec![], vec![]];
    for exchange in [false, true] {
        let mut balance = |run: &Run, name: &str| {
            passed[usize::from(exchange)].push((run.out().link.energy, run.balance(name)));
        };
        // Cycles of torque on a source with a resistance, and a source that sags.
        let mut run = Run::new(&c(240.0), exchange, |drive| imposed(drive, 3000.0, 80.0));
        for k in 0..20 {
            run.importer.block.model.inputs.tau_ref = if k % 3 == 0 { -100.0 } else { 100.0 };
            run.importer.block.model.inputs.u_dc = if (8..12).contains(&k) { 350.0 } else { 400.0 };
            run.run(0.02);
        }
        balance(&run, "torque steps and a sag");
        // Precharge, start and acceleration.
        let mut run = Run::new(&c(240.0), exchange, |drive| {
            (drive.link_parameters.dc_link.R_precharge, drive.inputs.speed_ref) = (50.0, 2000.0 * RPM);
        });
        run.run(0.6);
        assert!(run.out().plant.speed > 1500.0 * RPM, "{} rad/s", run.out().plant.speed);
        balance(&run, "precharge and start");
        // Above the diode speed the gates open, and the chopper takes part of the power.
        let mut run = Run::new(&c(240.0), exchange, |drive| {
            imposed(drive, 13_500.0, -20.0);
            let LinkParameters { dc_link, chopper } = &mut drive.link_parameters;
            (dc_link.R_source, chopper.used, chopper.u_on, chopper.u_off, chopper.R) = (0.3, true, 420.0, 410.0, 5.0);
        });
        run.run(0.02);
        run.importer.block.model.inputs.enable = false;
        run.run(0.1);
        assert!(run.out().plant.powers.p_in < -10e3 && run.out().link.energy.chopper > 100.0, "{:?}", run.out().link);
        balance(&run, "gates off");
        run.importer.block.model.inputs.asc = true;
        run.run(0.1);
        balance(&run, "short circuit");
    }
    // In Model Exchange the source's energy follows from the balance and equals that of Co-Simulation.
    let [stepped, exchanged] = passed;
    for ((a, all), (b, _)) in stepped.iter().zip(&exchanged) {
        let off = [a.source - b.source, a.resistor - b.resistor, a.chopper - b.chopper];
        println!("{off:?} J of {a:?}");
        assert!(off.iter().all(|x| x.abs() < 5e-3 * all), "{off:?} J of {a:?}");
    }
}

/// A source with a time constant of 10 ns needs no extra steps and acts like an ideal one.
#[test]
fn a_stiff_source_is_an_ideal_one() {
    let run = |used: bool| {
        let mut run = Run::new(&c(240.0), false, |drive| {
            imposed(drive, 3000.0, 80.0);
            let link = &mut drive.link_parameters.dc_link;
            (link.used, link.C, link.R_source) = (used, 1e-5, 1e-3);
        });
        run.run(0.1);
        run
    };
    let (linked, without) = (run(true), run(false));
    let (a, b) = (&linked.out().plant, &without.out().plant);
    assert!((linked.out().link.u - 400.0).abs() < 0.1 && a.powers.p_in > 15e3, "{:?}", linked.out().link);
    assert!((a.tau_e / b.tau_e - 1.0).abs() < 1e-4 && (a.powers.p_in / b.powers.p_in - 1.0).abs() < 1e-4);
    linked.balance("stiff");
    // Without the link, the source supplies the inverter.
    let link = without.out().link;
    assert!(link.u == 0.0 && link.i_source == without.out().plant.powers.i_dc && link.i_rms == 0.0, "{link:?}");
}

#[test]
fn the_communication_step_does_not_matter() {
    let at = |h: f64, steps: u32| {
        let mut run = braking(false);
        for _ in 0..steps {
            run.step(h);
        }
        (run.out().link.u, run.out().link.energy, run.out().plant.i_q)
    };
    assert_eq!(at(1e-4, 2000), at(1e-2, 20));
    let (fine, odd) = (at(1e-4, 2100), at(0.7e-4, 3000));
    assert!((fine.0 - odd.0).abs() < 0.5 && (fine.1.chopper / odd.1.chopper - 1.0).abs() < 0.02, "{fine:?} {odd:?}");
}

/// More power than the source can supply: the link collapses, and no energy is lost or gained.
#[test]
fn a_link_that_collapses_stays_finite() {
    let mut run = Run::new(&c(240.0), false, |drive| {
        imposed(drive, 3000.0, 100.0);
        (drive.link_parameters.dc_link.R_source, drive.link_parameters.dc_link.C) = (5.0, 1e-4);
    });
    run.run(0.3);
    let link = run.out().link;
    assert!(link.u >= 0.0 && link.u < 300.0 && link.i_source.is_finite(), "{link:?}");
    run.balance("collapse");
}

#[test]
fn the_ripple_current_follows_the_modulation() {
    for exchange in [false, true] {
        let mut run = Run::new(&c(240.0), exchange, |drive| imposed(drive, 2500.0, 80.0));
        run.run(0.1);
        // The steady state in the rotor frame.
        let (link, plant, motor) = (run.out().link, &run.out().plant, c(240.0).motor);
        let (w, i) = (c(240.0).w(2500.0), Dq::new(plant.i_d, plant.i_q));
        let u = i * motor.R_s + flux(&motor, i).turned() * w;
        let (m, cos) = (2.0 * u.magnitude() / link.u, u.dot(i) / (u.magnitude() * i.magnitude()));
        let pi = std::f64::consts::PI;
        let share = 3.0_f64.sqrt() / (4.0 * pi) + cos * cos * (3.0_f64.sqrt() / pi - 9.0 * m / 16.0);
        let expected = i.magnitude() / 2.0_f64.sqrt() * (2.0 * m * share).sqrt();
        assert!(link.i_rms > 20.0 && (link.i_rms / expected - 1.0).abs() < 0.02, "{} A, not {expected} A", link.i_rms);
    }
}

/// The tangent against differences, in every state and in the source's voltage.
#[test]
fn the_derivatives_are_exact() {
    let mut run = braking(true);
    run.run(0.0123);
    let now = run.importer.now;
    let drive = &run.importer.block.model;
    assert!(drive.link_u() > 330.0);
    let rates = |model: &PmsmDrive| {
        let mut dx = [0.0; 5];
        model.derivatives(now, &mut dx).unwrap();
        let mut out = DriveOutputs::default();
        model.observe(now, &mut out);
        let link = out.link;
        (
            [dx[0], dx[1], dx[2], dx[3], dx[4]],
            [link.u, link.i_source, link.p_chopper, link.i_rms, out.plant.powers.i_dc],
        )
    };
    for k in 0..6 {
        let step = |model: &mut PmsmDrive, by: f64| {
            if k < 5 {
                *PmsmDrive::STATES[k].at(model) += by;
            } else {
                model.inputs.u_dc += by;
            }
            model.settle();
        };
        let mut along = PmsmDrive::default();
        along.inputs.u_dc = 0.0;
        let plant = &mut along.pair.plant.model.inputs;
        (plant.u_dc, plant.tau_load) = (0.0, 0.0);
        along.inputs.thermal = zero(&along);
        step(&mut along, 1.0);
        let (mut dx, mut out) = ([0.0; 5], DriveOutputs::default());
        drive.tangent(now, &along, &mut dx, &mut out).unwrap();
        let tangent = [out.link.u, out.link.i_source, out.link.p_chopper, out.link.i_rms, out.plant.powers.i_dc];
        let small = [1e-6, 1e-6, 1e-4, 1e-6, 1e-4, 1e-4][k];
        let [(up, out_up), (down, out_down)] = [small, -small].map(|by| {
            let mut moved = drive.clone();
            step(&mut moved, by);
            rates(&moved)
        });
        for (exact, (up, down)) in
            dx.iter().chain(&tangent).zip(up.iter().chain(&out_up).zip(down.iter().chain(&out_down)))
        {
            let difference = (up - down) / (2.0 * small);
            assert!((exact - difference).abs() < 1e-5 * (1.0 + difference.abs()), "{k}: {exact}, not {difference}");
        }
    }
}

fn zero(drive: &PmsmDrive) -> drive::plant::thermal::ThermalInputs {
    drive.inputs.thermal.zip(&drive.inputs.thermal, |_, _| 0.0)
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = |set: fn(&mut LinkParameters)| {
        let mut drive = PmsmDrive::default();
        drive.link_parameters.dc_link.used = true;
        set(&mut drive.link_parameters);
        drive.derive();
        drive.validate().unwrap_err().message().to_owned()
    };
    for (set, parts) in [
        ((|p| p.dc_link.C = 0.0) as fn(&mut LinkParameters), ["dc_link.C = 0 F", "above 0 F"]),
        (|p| p.dc_link.C = f64::NAN, ["dc_link.C = NaN", "above 0 F"]),
        (|p| p.dc_link.R_source = 0.0, ["dc_link.R_source = 0 Ohm", "above 0 Ohm"]),
        (|p| p.dc_link.R_precharge = -1.0, ["dc_link.R_precharge = -1 Ohm", "at least 0 Ohm"]),
        (
            |p| (p.chopper.used, p.chopper.u_off) = (true, 360.0),
            ["chopper.u_off = 360 V", "below chopper.u_on = 360 V"],
        ),
        (|p| (p.chopper.used, p.chopper.u_off) = (true, 325.0), ["chopper.u_off = 325 V", "above u_dc, 325 V"]),
        (|p| (p.chopper.used, p.chopper.R) = (true, 0.0), ["chopper.R = 0 Ohm", "above 0 Ohm"]),
        (|p| (p.chopper.used, p.dc_link.used) = (true, false), ["chopper.use", "dc_link.use"]),
        (|p| (p.dc_link.source, p.dc_link.i_max) = (DcSource::Battery, 0.0), ["dc_link.i_max = 0 A", "above 0 A"]),
        (|p| (p.dc_link.source, p.dc_link.i_min) = (DcSource::Battery, 1.0), ["dc_link.i_min = 1 A", "at most 0 A"]),
        (
            |p| (p.dc_link.source, p.dc_link.f_mains) = (DcSource::RectifierSingle, 0.0),
            ["dc_link.f_mains = 0 Hz", "at most 1000 Hz"],
        ),
    ] {
        let message = refused(set);
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    }
    // Parts that are not in use are not checked.
    let mut drive = PmsmDrive::default();
    (drive.link_parameters.dc_link.C, drive.link_parameters.chopper.u_off) = (0.0, 1e3);
    drive.derive();
    drive.validate().unwrap();
    assert_eq!(PmsmDrive::INDICATORS.len(), 5);
}

/// Dependencies are found by probing; the chopper is on at some of the points.
#[test]
fn the_choppers_power_depends_on_the_voltage() {
    struct Drive;
    impl Exported for Drive {
        type Model = PmsmDrive;
        const CAN: Capabilities<PmsmDrive> = Capabilities::NONE.ContinuousTime().Events().Differentiable();
    }
    let description = Description::exported::<Drive>().unwrap();
    let reference = |name: &str| description.variable(name).unwrap().value_reference;
    for (name, on) in [("p_chopper", "u_cap"), ("i_source", "u_cap"), ("i_source", "u_dc"), ("i_cap_rms", "u_cap")] {
        let known = description.variable(name).unwrap().dependencies.clone().unwrap();
        assert!(known.contains(&reference(on)), "{name} depends on {on}");
    }
}
