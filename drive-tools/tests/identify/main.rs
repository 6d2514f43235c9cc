//! `fmu identify` against its own bench: a machine and a controller that share no formula with the drive's plant.

#![allow(
    non_snake_case,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "the symbols of the models; counts of rows"
)]

mod bad_input;
mod bench;

use bench::{Bench, IDEAL, REAL, Row, U_DC, file, phases, vector};
use drive_tools::identify::columns::Signals;
use drive_tools::identify::{Complex, Identified, Options, identify, machine_file};
use drive_tools::tune::motor::MotorFile;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

fn given() -> Options {
    Options { n_p: Some(3), current: Some(15.0), delay: Some(0.0), ..Options::default() }
}

fn of(text: &str, options: &Options) -> Result<Identified, String> {
    Signals::parse(text, "r.csv", &options.naming).and_then(|s| identify(&s, options)).map_err(|e| format!("{e:#}"))
}

fn value(found: &Identified, name: &str) -> f64 {
    let value = found.values.iter().find(|v| v.name == name).unwrap();
    assert_eq!(value.refused, None, "{name}");
    value.value
}

fn refused(found: &Identified, name: &str) -> String {
    let value = found.values.iter().find(|v| v.name == name).unwrap();
    value.refused.clone().unwrap_or_else(|| panic!("{name} = {} +- {}", value.value, value.half_width))
}

/// Relative deviations from the machine of the bench.
fn errors(found: &Identified, bench: &Bench) -> Vec<(&'static str, f64)> {
    let Bench { R, L_d, L_q, psi_M, J, .. } = *bench;
    [("R_s", R), ("L_d", L_d), ("L_q", L_q), ("psi_M", psi_M), ("J", J)]
        .map(|(name, truth)| (name, value(found, name) / truth - 1.0))
        .to_vec()
}

#[test]
fn exact_data_give_the_machine() {
    let found = of(&file(&IDEAL.run()), &given()).unwrap();
    for (name, error) in errors(&found, &IDEAL) {
        println!("{name} {:+.4} %", 100.0 * error);
        assert!(error.abs() < 5e-4, "{name}: {:.4} %", 100.0 * error);
    }
    assert!(
        (value(&found, "B") / IDEAL.B - 1.0).abs() < 0.01 && (value(&found, "tau_coulomb") / 0.3 - 1.0).abs() < 0.01
    );
}

#[test]
fn real_data_lie_inside_the_intervals_and_become_a_machine_file() {
    let found = of(&file(&REAL.run()), &given()).unwrap();
    for v in &found.values {
        println!("{} {} {} {:?}", v.name, v.value, v.half_width, v.refused);
    }
    let Bench { L_d, L_q, psi_M, J, .. } = REAL;
    for (name, truth) in [("L_d", L_d), ("L_q", L_q), ("psi_M", psi_M), ("J", J)] {
        let width = found.values.iter().find(|v| v.name == name).unwrap().half_width;
        assert!((value(&found, name) / truth - 1.0).abs() < width, "{name}");
    }
    let text = machine_file::text(&found, "bench", "a test");
    println!("{text}");
}

#[test]
fn a_record_that_does_not_tell_is_refused_by_name() {
    let found = of(&file(&Bench { steps_of_i_d: false, ..REAL }.run()), &given()).unwrap();
    assert_eq!(refused(&found, "L_d"), "i_d was constant: record steps of i_d");
    let found = of(&file(&Bench { steps_of_speed: false, ..REAL }.run()), &given()).unwrap();
    for name in ["L_q", "J", "B", "tau_coulomb"] {
        assert_eq!(refused(&found, name), "the speed was constant: record two speeds");
    }
    let rows = REAL.run();
    let unloaded = file(&rows).replace("tau_load", "other");
    let found = of(&unloaded, &given()).unwrap();
    assert_eq!(refused(&found, "J"), "the load is unknown: add tau_load or tau_shaft, or give --load none");
}

/// A blocked rotor: resistance and inductances, and no more.
#[test]
fn a_record_at_standstill_tells_the_stator() {
    for bench in [Bench { blocked: true, ..IDEAL }, Bench { blocked: true, ..REAL }] {
        let found = of(&file(&bench.run()), &given()).unwrap();
        for (name, truth) in [("R_s", bench.R), ("L_d", bench.L_d), ("L_q", bench.L_q)] {
            let width = found.values.iter().find(|v| v.name == name).unwrap().half_width;
            let error = value(&found, name) / truth - 1.0;
            println!("{name} {:+.3} % +- {:.2} %", 100.0 * error, 100.0 * width);
            assert!(error.abs() < width, "{name}");
        }
        for name in ["psi_M", "J", "B", "tau_coulomb"] {
            assert_eq!(refused(&found, name), "the rotor stood still: record a turning rotor");
        }
        let text = machine_file::text(&found, "bench", "a test");
        assert!(text.contains("# speed = ...") && text.contains("# psi_M"), "{text}");
    }
}

#[test]
fn the_delay_is_found() {
    let rows = REAL.run();
    // A controller that logs its new command beside the current it has just measured.
    let early: Vec<Row> = rows.windows(2).map(|w| Row { u: w[1].u, ..w[0] }).collect();
    let found = of(&file(&early), &Options { delay: None, ..given() }).unwrap();
    assert!((found.timing.delay - 1.0).abs() < 1e-9, "{:?}", found.timing);
    assert!((value(&found, "L_q") / REAL.L_q - 1.0).abs() < 0.02);
}

#[test]
fn forms_of_columns_agree() {
    let rows = REAL.run();
    let one = of(&file(&rows), &given()).unwrap();
    let mut text = String::from("t [ms];d_a;d_b;d_c;i_alpha [mA];i_beta [mA];theta [deg];tau_shaft;u_dc\n");
    for Row { t, u, i, theta, load } in &rows {
        // The common part of the phases keeps the duties within 0 to 1.
        let u = phases(*u);
        let common = 0.5 * (u[0].min(u[1]).min(u[2]) + u[0].max(u[1]).max(u[2]));
        let d = u.map(|u| 0.5 + (u - common) / U_DC);
        let i = vector(*i) * 1e3;
        let angle = theta * 180.0 / PI;
        let row = format!("{};{};{};{};{};{};{angle};{load};{U_DC}", t * 1e3, d[0], d[1], d[2], i.re, i.im);
        let _ = writeln!(text, "{}", row.replace('.', ","));
    }
    let other = of(&text, &given()).unwrap();
    for name in ["L_d", "L_q", "psi_M", "J"] {
        assert!((value(&one, name) / value(&other, name) - 1.0).abs() < 1e-9, "{name}");
    }
    // The vectors in rotor axes, and a log of one in five samples.
    let axes = |rows: &[Row]| {
        let mut text = String::from("t,u_d,u_q,i_d,i_q,theta,tau_load,u_dc\n");
        for Row { t, u, i, theta, load } in rows {
            let (u, i) = (u * Complex::cis(-theta), vector(*i) * Complex::cis(-theta));
            let _ = writeln!(text, "{t},{},{},{},{},{theta},{load},{U_DC}", u.re, u.im, i.re, i.im);
        }
        text
    };
    let decimated: Vec<Row> = rows.iter().step_by(5).copied().collect();
    let every = Options { every: Some(5), ..given() };
    let near = |text: &str, options: &Options, names: &[(&str, f64)]| {
        let other = of(text, options).unwrap();
        for (name, truth) in names {
            assert!((value(&other, name) / truth - 1.0).abs() < 0.02, "{name}");
        }
    };
    near(&axes(&rows), &given(), &[("L_d", REAL.L_d), ("L_q", REAL.L_q), ("psi_M", REAL.psi_M), ("J", REAL.J)]);
    near(&file(&decimated), &every, &[("psi_M", REAL.psi_M), ("J", REAL.J)]);
}

#[test]
fn the_machine_file_is_read_by_tune() {
    let found = of(&file(&IDEAL.run()), &given()).unwrap();
    let text = machine_file::text(&found, "bench", "a test");
    let motor = MotorFile::parse(&text, Path::new("bench.toml")).unwrap_or_else(|e| panic!("{e:#}\n{text}"));
    assert!((motor.data.machine.R_s.get_ref() / IDEAL.R - 1.0).abs() < 5e-4);
}
