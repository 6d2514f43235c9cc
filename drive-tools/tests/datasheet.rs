//! The drive of a data sheet: the tables, `MappedDrive` beside the machine that they describe, and refused data sheets.
#![allow(missing_docs, non_snake_case)]

use drive::mapped_drive::map::{SHARES, SPEEDS};
use drive::steady::{Condition, Steady};
use drive::{MappedDrive, PmsmDriveMean};
use drive_tools::datasheet::{self, MappedSheet};
use drive_tools::map::cycle::Cycle;
use drive_tools::map::request::Request;
use drive_tools::map::{self, files};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use fmu_core::{Block, ContinuousTime, Elapsed, Model, Step};
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn motor(name: &str) -> MotorFile {
    MotorFile::read(&root().join(format!("motors/{name}.toml"))).unwrap()
}

fn drive_of(name: &str) -> Steady {
    map::drive(&rules::fixed(&motor(name)).unwrap())
}

/// The data sheet of the map of a machine, with lines added to it.
fn of_map(name: &str, grid: (usize, usize), more: &str) -> MappedSheet {
    let motor = motor(name);
    let map = map::make(&motor, &Request { u_dc: vec![], T: vec![], grid, verify: 0 }).unwrap();
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("map.csv"), files::map_csv(&map)).unwrap();
    let (u_dc, J) = (motor.data.dc_link.u_dc.get_ref(), motor.data.mechanics.J.get_ref());
    let text = format!(
        "name = \"{name}\"\nsource = \"fmu map\"\n[losses]\nfile = \"map.csv\"\n[mechanics]\nJ = {J}\n[dc_link]\nu_dc = {u_dc}\n\
         [bandwidth]\ntorque = 1000\n{more}"
    );
    let path = dir.path().join("sheet.toml");
    fs::write(&path, text).unwrap();
    datasheet::read(&path).unwrap()
}

fn mapped(sheet: &MappedSheet) -> Block<MappedDrive> {
    let mut block = Block::<MappedDrive>::default();
    block.model.map = sheet.map.clone();
    (block.model.shaft.J, block.model.bandwidth) = (sheet.J, sheet.bandwidth);
    block.model.inputs.u_dc = sheet.map.u_dc;
    block
}

/// Energies in J from the link of both drives over the example's cycle, with the torque at the shaft in the middle of each
/// second, `gear` times as fast and as strong; `u_dc` in V.
fn cycle(drive: &Steady, sheet: &MappedSheet, (gear, share): (f64, f64), u_dc: f64) -> [f64; 2] {
    let mut mean = Block::<PmsmDriveMean>::default();
    mean.model.drive = drive.clone();
    let mut block = mapped(sheet);
    (block.model.shaft.imposed, block.model.speed_loop.torque_mode) = (true, true);
    (mean.model.inputs.u_dc, block.model.inputs.u_dc) = (u_dc, u_dc);
    mean.initialize();
    block.initialize();
    block.model.validate().unwrap();
    let (mut now, mut angle) = (Elapsed::ZERO, 0.0);
    for [speed, tau] in Cycle::example().unwrap().points() {
        let (speed, tau) = (speed * gear, tau * share);
        let condition = Condition { speed, u_dc, temperatures: drive.start_temperatures() };
        let tau_ref = drive.at(&condition).by_shaft(tau).unwrap_or_else(|| panic!("{speed} rad/s, {tau} N.m")).tau_ref;
        let inputs = &mut mean.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft, inputs.tau_ref) = (speed, angle, tau_ref);
        let inputs = &mut block.model.inputs;
        (inputs.speed_shaft, inputs.angle_shaft, inputs.tau_ref) = (speed, angle, tau);
        for _ in 0..20 {
            let step = Step { start: now, h: 0.05 };
            mean.step(&step).unwrap();
            block.step(&step).unwrap();
            (now, angle) = (step.end(), angle + speed * step.h);
            (mean.model.inputs.angle_shaft, block.model.inputs.angle_shaft) = (angle, angle);
        }
    }
    let of = &block.out.energy;
    assert!((of.r#in - of.mech - of.loss).abs() < 1e-9 * of.r#in.abs());
    let loss = mean.out.drive.plant.energy.loss;
    println!("losses {:+.2} %", 100.0 * (of.loss / loss - 1.0));
    [mean.out.drive.plant.energy.r#in, of.r#in]
}

/// A drive by the tables of `fmu map` uses the energy of the machine within 0.1 %.
#[test]
fn the_tables_of_a_machine_give_its_energy() {
    for (name, scale, grid) in [
        ("traction-63kw", (1.0, 0.75), (47, 41)),
        ("traction-100kw", (1.0, 1.0), (47, 41)),
        ("traction-100kw", (1.0, 1.0), (21, 21)),
        ("hub-36v", (0.03, 0.04), (47, 41)),
    ] {
        let (drive, sheet) = (drive_of(name), of_map(name, grid, ""));
        let [mean, mapped] = cycle(&drive, &sheet, scale, sheet.map.u_dc);
        let error = mapped / mean - 1.0;
        println!("{name}: {mean:.0} J and {mapped:.0} J, {:+.3} %", 100.0 * error);
        assert!(error.abs() < 1e-3, "{name}: {mean} J and {mapped} J");
    }
}

/// The tables of 400 V at 340 V: the losses of the cycle change little.
#[test]
fn another_voltage_changes_the_energy_little() {
    let (drive, sheet) = (drive_of("traction-63kw"), of_map("traction-63kw", (47, 41), ""));
    let [mean, mapped] = cycle(&drive, &sheet, (0.9, 0.6), 340.0);
    println!("{mean:.0} J and {mapped:.0} J, {:+.3} %", 100.0 * (mapped / mean - 1.0));
    assert!((mapped / mean - 1.0).abs() < 5e-3, "{mean} J and {mapped} J");
}

/// Gates off and on under load: the drive accelerates on its ramp from the speed that is left, without a jerk.
#[test]
fn it_begins_again_at_the_speed_that_is_left() {
    let sheet = of_map("traction-63kw", (21, 21), "");
    let (ramp, load) = (100.0, 10.0);
    for by_voltage in [false, true] {
        let mut block = mapped(&sheet);
        block.model.speed_loop.ramp = ramp;
        let (u_dc, mut now, mut most, mut before) = (sheet.map.u_dc, Elapsed::ZERO, 0.0_f64, 0.0);
        block.model.map.u_min = 0.8 * u_dc;
        (block.model.inputs.speed_ref, block.model.inputs.tau_load) = (300.0, load);
        block.initialize();
        while now.seconds() < 8.0 {
            let off = (4.0..4.5).contains(&now.seconds());
            let inputs = &mut block.model.inputs;
            if by_voltage {
                inputs.u_dc = if off { 0.5 * u_dc } else { u_dc };
            } else {
                inputs.enable = !off;
            }
            let (step, speed) = (Step { start: now, h: 1e-3 }, block.out.speed);
            block.step(&step).unwrap();
            now = step.end();
            if now.seconds() > 4.5005 {
                most = most.max((block.out.speed - speed) / step.h);
            } else {
                before = block.out.speed;
            }
        }
        println!("{before} rad/s are left; at most {most} rad/s2, then {} rad/s", block.out.speed);
        assert!(before < 200.0 && (block.out.speed - 300.0).abs() < 0.1, "{before}, {} rad/s", block.out.speed);
        assert!(most < 1.3 * ramp, "{most} rad/s2 on a ramp of {ramp} rad/s2");
    }
}

/// A start in speed control with a load, coasting, and the balance of energies and kinetic energy at any step.
#[test]
fn a_free_shaft_balances() {
    let sheet = of_map("traction-63kw", (47, 41), "");
    for h in [1e-3, 1e-2, 0.3] {
        let mut block = mapped(&sheet);
        block.model.inputs.speed_ref = 300.0;
        block.model.inputs.tau_load = 20.0;
        block.initialize();
        let (mut now, mut reached) = (Elapsed::ZERO, 0.0);
        while now.seconds() < 6.0 {
            if now.seconds() > 3.0 {
                (block.model.inputs.enable, block.model.inputs.tau_load) = (false, 1.0);
            } else {
                reached = block.out.speed;
            }
            let step = Step { start: now, h };
            block.step(&step).unwrap();
            now = step.end();
        }
        let (out, J) = (&block.out, sheet.J);
        let kept = 0.5 * J * out.speed * out.speed;
        let missing = out.energy.r#in - out.energy.mech - out.energy.loss - kept;
        assert!(missing.abs() < 1e-6 * out.energy.r#in, "h = {h} s: {missing} J of {} J", out.energy.r#in);
        assert!((reached - 300.0).abs() < 1.0 && !out.enabled && out.speed < 299.0, "h = {h} s: {reached} rad/s");
    }
}

/// Model Exchange integrates the same equations as a step.
#[test]
fn both_interfaces_agree() {
    let sheet = of_map("traction-63kw", (47, 41), "");
    let mut stepped = mapped(&sheet);
    stepped.model.inputs.speed_ref = 200.0;
    stepped.model.inputs.tau_load = 15.0;
    stepped.model.map.t_overload = 3.0;
    let mut solved = stepped.clone();
    stepped.initialize();
    solved.initialize();
    let (h, count) = (2e-5, 50_000);
    let mut dx = [0.0; 9];
    for _ in 0..count {
        // The midpoint rule.
        let start: Vec<f64> = MappedDrive::STATES.iter().map(|s| *s.at(&mut solved.model)).collect();
        for part in [0.5 * h, h] {
            solved.model.derivatives(Elapsed::ZERO, &mut dx).unwrap();
            for (k, state) in MappedDrive::STATES.iter().enumerate() {
                *state.at(&mut solved.model) = start[k] + part * dx[k];
            }
        }
    }
    let mut now = Elapsed::ZERO;
    for _ in 0..100 {
        let step = Step { start: now, h: 0.01 };
        stepped.step(&step).unwrap();
        now = step.end();
    }
    let mut out = solved.out.clone();
    solved.model.observe(Elapsed::ZERO, &mut out);
    let one = &stepped.out;
    for (name, a, b) in [
        ("speed", one.speed, out.speed),
        ("angle", one.angle, out.angle),
        ("overload", one.overload, out.overload),
        ("energy_in", one.energy.r#in, out.energy.r#in),
        ("energy_loss", one.energy.loss, out.energy.loss),
    ] {
        assert!((a - b).abs() < 2e-3 * b.abs(), "{name}: {a} and {b}");
    }
}

/// The peak torque lasts as long as the data sheet says, then the continuous torque remains.
#[test]
fn the_peak_torque_ends() {
    let sheet = datasheet::read(&root().join("src/commands/datasheet.toml")).unwrap();
    let mut block = mapped(&sheet);
    (block.model.shaft.imposed, block.model.speed_loop.torque_mode) = (true, true);
    (block.model.inputs.tau_ref, block.model.inputs.speed_shaft) = (100.0, 10.0);
    block.initialize();
    let (mut now, mut ended) = (Elapsed::ZERO, None);
    while now.seconds() < 200.0 {
        let step = Step { start: now, h: 0.1 };
        block.step(&step).unwrap();
        now = step.end();
        if ended.is_none() && block.out.tau_max < 99.0 {
            ended = Some(now.seconds());
        }
    }
    let ended = ended.unwrap();
    // The limit begins to fall at 0.95.
    assert!((27.0..30.5).contains(&ended), "{ended} s");
    assert!((50.0..52.0).contains(&block.out.tau_shaft), "{} N.m", block.out.tau_shaft);
    // A drive without that time keeps its peak torque.
    let mut block = mapped(&of_map("traction-63kw", (21, 21), ""));
    (block.model.shaft.imposed, block.model.speed_loop.torque_mode) = (true, true);
    block.model.inputs.tau_ref = 1e3;
    block.initialize();
    block.step(&Step { start: Elapsed::ZERO, h: 1e3 }).unwrap();
    assert!((block.out.tau_shaft / block.model.map.tau_motor[0] - 1.0).abs() < 1e-2 && block.out.overload == 0.0);
}

#[test]
fn the_example_gives_its_own_points() {
    let sheet = datasheet::read(&root().join("src/commands/datasheet.toml")).unwrap();
    let mut block = mapped(&sheet);
    (block.model.shaft.imposed, block.model.speed_loop.torque_mode) = (true, true);
    let rpm = std::f64::consts::PI / 30.0;
    for (speed, tau, efficiency) in
        [(2000.0, 40.0, 0.93), (4000.0, 60.0, 0.95), (6000.0, 40.0, 0.95), (2000.0, 100.0, 0.88)]
    {
        (block.model.inputs.speed_shaft, block.model.inputs.tau_ref) = (speed * rpm, tau);
        block.initialize();
        let mut now = Elapsed::ZERO;
        for _ in 0..2 {
            let step = Step { start: now, h: 1.0 };
            block.step(&step).unwrap();
            now = step.end();
        }
        let found = block.out.efficiency;
        assert!((found - efficiency).abs() < 4e-3, "{speed} rpm, {tau} N.m: {found}, not {efficiency}");
    }
    assert_eq!((sheet.map.speed.len(), sheet.map.p_loss[0].len()), (SPEEDS, SHARES));
    assert!(sheet.notes.iter().any(|note| note.contains("generator")), "{:?}", sheet.notes);
}

/// Odd losses are kept, with a warning.
#[test]
fn odd_losses_are_reported() {
    let example = fs::read_to_string(root().join("src/commands/datasheet.toml")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("sheet.toml");
    for (from, to, note) in [
        (
            "[0.86, 0.93, 0.93",
            "[0.86, 0.39, 0.93",
            "at 2000 rpm, the losses fall from 6552 W at 20 N.m to 630.6 W at 40 N.m",
        ),
        (
            "[0.82, 0.93, 0.95",
            "[0.82, 0.93, 0.995",
            "at 6000 rpm, the losses fall from 945.9 W at 20 N.m to 126.3 W at 40 N.m",
        ),
        (
            "610, 1130]",
            "610, 370]",
            "losses.no_load is 370 W at 8000 rpm, but 1251 W at 5 N.m and 1657 W at 20 N.m lead to 1224 W",
        ),
        ("320, 610, 1130]", "500, 1000, 370]", "no_load is 500 W at 4000 rpm, but 369.6 W at 5 N.m"),
        ("320, 610, 1130]", "500, 1000, 370]", "; 2 other speeds are odd, too"),
        (
            "0.75, 0.9, 1.2]",
            "0.75, 1.9, 1.2]",
            "torque.drag = 1.9 N.m at 6000 rpm takes 1194 W with the gates off, but the drive loses 610 W",
        ),
        (
            "0.4, 0.6, 0.75, 0.9, 1.2]",
            "0.0004, 0.0006, 0.00075, 0.0009, 0.0012]",
            "torque.drag = 0.0006 N.m at 3000 rpm takes 0.1885 W",
        ),
        ("J = 0.02", "J = 0.03", ""),
    ] {
        assert!(example.contains(from), "{from}");
        fs::write(&path, example.replacen(from, to, 1)).unwrap();
        let notes = datasheet::read(&path).unwrap().doubts;
        assert_eq!(notes.is_empty(), note.is_empty(), "{notes:?}");
        assert!(note.is_empty() || notes.iter().any(|said| said.contains(note)), "{notes:?} instead of {note}");
    }
}

#[test]
fn what_is_wrong_is_named() {
    let example = fs::read_to_string(root().join("src/commands/datasheet.toml")).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("sheet.toml");
    let refused = |from: &str, to: &str| {
        assert!(example.contains(from), "{from}");
        fs::write(&path, example.replacen(from, to, 1)).unwrap();
        let error = datasheet::read(&path).unwrap_err();
        let text = format!("{error:#}");
        assert!(text.contains("sheet.toml"), "{text}");
        text
    };
    for (from, to, message) in [
        (
            "0.86, 0.84",
            "86, 0.84",
            "losses.efficiency[1][2] = 86 at 500 rpm, 20 N.m is greater than 1: write 94 % as 0.94",
        ),
        (
            "rpm = [0, 3000, 4500",
            "rpm = [0, 4500, 3000",
            "torque.rpm[3] = 3000 must be greater than torque.rpm[2] = 4500",
        ),
        ("torque = [5, 20,", "torque = [25, 20,", "losses.torque[2] = 20 must be greater than losses.torque[1] = 25"),
        (
            "continuous = [50, 50, 50",
            "continuous = [50, 50, 70",
            "torque.continuous[3] = 70 N.m is above torque.peak[3] = 66 N.m",
        ),
        ("peak = [100, 100", "peak = [100", "torque.peak has 4 values, but torque.rpm or torque.speed has 5"),
        ("peak = [100, 100", "peak = [120, 100", "losses.torque ends at 100 N.m, but torque.peak is 120 N.m at 0 rpm"),
        ("4000, 6000, 8000]", "4000, 6000, 7000]", "torque goes up to 8000 rpm, but losses only up to 7000 rpm"),
        ("0.80, 0.75, 0.71]", "0.80, 0.75]", "losses.efficiency[1] has 5 values, but losses.torque has 6"),
        ("u_min = 280", "u_min = 480", "dc_link.u_min = 480 V must be from 0 to u_dc = 400 V"),
        ("J = 0.02", "J = -0.02", "mechanics.J = -0.02 must be greater than 0"),
        ("peak_time = 30", "peak_time = -1", "torque.peak_time = -1 must be greater than 0 s"),
        ("J = 0.02", "inertia = 0.02", "unknown field `inertia`"),
        ("efficiency = [", "file = \"map.csv\"\nefficiency = [", "losses has file and a table"),
    ] {
        let text = refused(from, to);
        assert!(text.contains(message), "{text}");
    }
}
