//! `fmu identify` against a bench of its own: a machine and a controller that share no formula with the drive's plant.

#![allow(
    non_snake_case,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "the symbols of the models; counts of rows"
)]

use drive_study::identify::columns::Signals;
use drive_study::identify::{Complex, Identified, Options, identify, machine_file};
use drive_study::tune::motor::MotorFile;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

const T_S: f64 = 1e-4;
const U_DC: f64 = 540.0;

/// The machine of the bench, its sensors and its run.
#[derive(Clone, Copy)]
struct Bench {
    n_p: f64,
    R: f64,
    L_d: f64,
    L_q: f64,
    psi_M: f64,
    J: f64,
    B: f64,
    tau_coulomb: f64,
    u_dead: f64,
    noise: f64,
    resolution: f64,
    offset: f64,
    steps_of_i_d: bool,
    steps_of_speed: bool,
    time: f64,
}

/// The 2.2 kW machine, ideal.
const IDEAL: Bench = Bench {
    n_p: 3.0,
    R: 3.6,
    L_d: 36e-3,
    L_q: 51e-3,
    psi_M: 0.545,
    J: 15e-3,
    B: 5e-3,
    tau_coulomb: 0.3,
    u_dead: 0.0,
    noise: 0.0,
    resolution: 0.0,
    offset: 0.0,
    steps_of_i_d: true,
    steps_of_speed: true,
    time: 4.0,
};

/// With dead time, noise, offset and a converter of 12 bits.
const REAL: Bench = Bench { u_dead: 6.0, noise: 20e-3, resolution: 30.0 / 2048.0, offset: 0.2, ..IDEAL };

/// A row: time, voltage command, phase currents, electrical angle, load.
#[derive(Clone, Copy)]
struct Row {
    t: f64,
    u: Complex,
    i: [f64; 3],
    theta: f64,
    load: f64,
}

fn phases(x: Complex) -> [f64; 3] {
    let beta = x.im * 0.75_f64.sqrt();
    [x.re, -0.5 * x.re + beta, -0.5 * x.re - beta]
}

fn vector([a, b, c]: [f64; 3]) -> Complex {
    Complex::new((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

impl Bench {
    /// The run: the voltage of a row acts until the next one, computed a sample before.
    fn run(&self) -> Vec<Row> {
        let Self { n_p, R, L_d, L_q, psi_M, J, B, tau_coulomb, .. } = *self;
        let mut seed = 0x5EED_u64;
        let mut uniform = move || {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1_u64 << 53) as f64
        };
        let k_t = 1.5 * n_p * psi_M;
        let (mut i, mut w, mut angle) = (Complex::new(0.0, 0.0), 0.0_f64, 0.3_f64);
        let (mut command, mut sum, mut speed_sum) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0), 0.0);
        let mut rows = Vec::new();
        let pre = 0.05;
        for k in 0..(self.time / T_S) as usize {
            let t = k as f64 * T_S;
            let theta = n_p * angle;
            let stator = phases(i * Complex::cis(theta));
            let measured = stator.map(|x| {
                let noise: f64 = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
                let x = x + self.offset + self.noise * noise;
                if self.resolution > 0.0 { (x / self.resolution).round() * self.resolution } else { x }
            });
            let part = ((t - pre) / (self.time - pre) * 8.0).clamp(0.0, 7.0) as usize;
            let speed =
                157.0 * if self.steps_of_speed { [0.1, 0.3, 0.6, 0.3, -0.2, -0.5, 0.2, 0.45][part] } else { 0.3 };
            let i_d = if self.steps_of_i_d { [0.0, -0.3, 0.0, 0.2, -0.2, 0.0, 0.3, -0.3][part] * 7.5 } else { 0.0 };
            let load = if self.steps_of_speed {
                [0.0, 0.0, 0.0, 3.0, 0.0, -3.0, 4.0, 1.0][part] * (w / 3.0).tanh()
            } else {
                0.0
            };
            rows.push(Row { t, u: command, i: measured, theta: theta.rem_euclid(2.0 * PI), load });
            // The plant over a sample, with its own method.
            let steps = 20;
            let h = T_S / f64::from(steps);
            for _ in 0..steps {
                let slope = |i: Complex, w: f64, angle: f64| {
                    let turn = Complex::cis(n_p * angle);
                    let [a, b, c] = phases(i * turn).map(|x| self.u_dead * (x / 0.05).tanh());
                    let u = (command - vector([a, b, c])) / turn;
                    let e = n_p * w;
                    let d = (u.re - R * i.re + e * L_q * i.im) / L_d;
                    let q = (u.im - R * i.im - e * (L_d * i.re + psi_M)) / L_q;
                    let tau = 1.5 * n_p * (psi_M + (L_d - L_q) * i.re) * i.im;
                    (Complex::new(d, q), (tau - load - B * w - tau_coulomb * (w / 0.05).tanh()) / J)
                };
                if t < pre {
                    break;
                }
                let a = slope(i, w, angle);
                let b = slope(i + a.0 * (0.5 * h), w + 0.5 * h * a.1, angle + 0.5 * h * w);
                (i, angle) = (i + b.0 * h, angle + h * (w + 0.5 * h * a.1));
                w += h * b.1;
            }
            if t < pre {
                continue;
            }
            // The controller, with the measured current of the row and the angle of the sensor.
            let error = speed - w;
            speed_sum = (speed_sum + 0.4 * J * 300.0 / k_t * error * T_S).clamp(-7.0, 7.0);
            let i_q = (J * 30.0 / k_t * error + speed_sum).clamp(-7.0, 7.0);
            let seen = vector(measured.map(|x| x - self.offset)) * Complex::cis(-theta);
            let off = Complex::new(i_d, i_q) - seen;
            let e = n_p * w;
            sum += Complex::new(off.re * R * 800.0, off.im * R * 800.0) * T_S;
            let u = Complex::new(
                800.0 * L_d * off.re - e * L_q * seen.im,
                800.0 * L_q * off.im + e * (psi_M + L_d * seen.re),
            ) + sum;
            command = u * (0.9 * U_DC / 3.0_f64.sqrt() / u.norm()).min(1.0) * Complex::cis(theta + 1.5 * T_S * e);
        }
        rows
    }
}

/// The file of some rows.
fn file(rows: &[Row]) -> String {
    let mut text = String::from("t [s],u_alpha,u_beta,i_a,i_b,i_c,theta,tau_load,u_dc\n");
    for Row { t, u, i, theta, load } in rows {
        let _ = writeln!(text, "{t},{},{},{},{},{},{theta},{load},{U_DC}", u.re, u.im, i[0], i[1], i[2]);
    }
    text
}

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

#[test]
fn wrong_columns_are_named() {
    let rows = REAL.run();
    let swapped: Vec<Row> = rows.iter().map(|r| Row { i: [r.i[0], r.i[2], r.i[1]], ..*r }).collect();
    let why = refused(&of(&file(&swapped), &given()).unwrap(), "psi_M");
    assert!(why.contains("phases b and c swapped"), "{why}");
    // More current: resistance and inductances shrink by as much, the magnet's flux stays.
    let more: Vec<Row> = rows.iter().map(|r| Row { i: r.i.map(|x| 1.02 * x), ..*r }).collect();
    let (one, other) = (of(&file(&rows), &given()).unwrap(), of(&file(&more), &given()).unwrap());
    for (name, ratio) in [("L_d", 1.02), ("L_q", 1.02), ("psi_M", 1.0)] {
        assert!((value(&one, name) / value(&other, name) / ratio - 1.0).abs() < 1e-3, "{name}");
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
fn bad_files_are_named_by_place() {
    let rows = IDEAL.run();
    let good = file(&rows);
    let line = |k: usize| good.lines().nth(k).unwrap().to_owned();
    let with = |k: usize, text: &str| good.replacen(&line(k), text, 1);
    let options = given();
    for (text, message) in [
        (with(100, &line(99)), "r.csv:101:t: 0.0098 s does not follow 0.0098 s"),
        (with(100, &line(100).replacen(',', ",NaN,", 1)), "r.csv:101: expected 9 numbers, found 10"),
        (with(5, &line(5).replace("540", "x")), "r.csv:6:u_dc: \"x\" is not a finite number"),
        (good.lines().take(1000).collect::<Vec<_>>().join("\n"), "r.csv: has 999 rows; expected at least 2000"),
        (good.replace("u_alpha", "a").replace("u_beta", "b"), "r.csv: has no voltage: expected u_a,u_b,u_c"),
        (good.replace("theta", "x"), "r.csv: has no angle"),
        (good.replace("u_dc", "u_dc [mV]"), "r.csv:5"),
    ] {
        let error = of(&text, &options).unwrap_err();
        assert!(error.starts_with(message) && error.lines().count() == 1, "{error}");
    }
    let error = of(&good, &Options { n_p: None, ..given() }).unwrap_err();
    assert!(error.starts_with("--n-p is missing"), "{error}");
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
