//! The numbers of `drive/control/docs/limits.html`, the limits on every documentation page: each row comes from a run.
#![allow(missing_docs, non_snake_case)]

#[path = "common/rated.rs"]
mod rated;
#[path = "common/shows.rs"]
mod shows;

use drive::Pair;
use drive::estimator::Kind;
use drive::math::wrap;
use drive_study::runner;
use rated::steady;
use shows::shows;
use std::f64::consts::PI;

const PAGE: &str = include_str!("../../drive/control/docs/limits.html");
const RPM: f64 = PI / 30.0;
const T_S: f64 = 1e-4;
/// Resistance of the reference motor in Ohm.
const R: f64 = 2.0;

/// The page must have this row.
fn holds(cells: &[String]) {
    let row = format!("<tr><td>{}</td></tr>", cells.join("</td><td>"));
    shows("drive/control/docs/limits.html", PAGE, &row);
}

/// A number as printed on the page.
fn number(x: f64, decimals: usize) -> String {
    let half = 0.5 * 0.1_f64.powi(i32::try_from(decimals).unwrap());
    let text = format!("{:.decimals$}", if x.abs() < half { 0.0 } else { x });
    text.replace('-', "−")
}

fn degrees(x: f64) -> String {
    number(x, 1) + "°"
}

fn with(R_hat: f64) -> Pair {
    let mut pair = Pair::default();
    pair.controller.model.parameters.motor.R_s = R_hat;
    pair
}

/// Angle error θ^ - θ in deg.
fn error(pair: &Pair) -> f64 {
    wrap(pair.controller.out.theta_est - pair.plant.out.theta_e).to_degrees()
}

/// Runs a pair in steps of `h` (s); `each` is called with it and the time before every step and at the end.
fn run(pair: &mut Pair, h: f64, duration: f64, each: impl FnMut(f64, &mut Pair)) {
    assert!(runner::run_in_steps(pair, h, duration, each).unwrap(), "a step failed");
}

/// The value of an input that comes at `from` (s).
fn from(from: f64, t: f64, value: f64) -> f64 {
    if t >= from - 1e-9 { value } else { 0.0 }
}

/// Minimum and maximum speed in rpm, maximum angle error in deg.
#[derive(Debug)]
struct Seen(f64, f64, f64);

impl Seen {
    fn none() -> Self {
        Self(f64::INFINITY, f64::NEG_INFINITY, 0.0)
    }

    fn see(&mut self, pair: &Pair) {
        let speed = pair.plant.out.speed / RPM;
        *self = Self(self.0.min(speed), self.1.max(speed), self.2.max(error(pair).abs()));
    }

    /// Whether the speed stays and the rotor is where the estimate is.
    fn held(&self) -> bool {
        self.1 - self.0 < 5.0 && self.2 < 60.0
    }
}

#[test]
fn resistance_at_standstill() {
    for factor in [0.8, 0.9, 0.95, 1.0, 1.01, 1.02, 1.1, 1.2] {
        let mut pair = with(factor * R);
        run(&mut pair, T_S, 10.5, |t, p| p.plant.model.inputs.tau_load = from(0.5, t, 2.0));
        let (speed, i) = (pair.plant.out.speed / RPM, pair.controller.out.i);
        let verdict = if speed.abs() < 0.5 { "held" } else { "runs away" };
        holds(&[
            format!("{factor}"),
            number(speed, 1) + " rpm",
            number(i.d, 2) + " A",
            number(i.q, 2) + " A",
            degrees(error(&pair)),
            verdict.into(),
        ]);
    }
}

#[test]
fn starts_without_a_load() {
    for factor in [0.8, 0.9, 1.0, 1.01, 1.02, 1.05, 1.1, 1.2] {
        let mut cells = vec![format!("{factor}")];
        for speed in [50.0, 500.0, 1500.0] {
            let (mut turned, mut others) = (0, Seen::none());
            for k in 0..12 {
                let (mut pair, mut seen) = (with(factor * R), Seen::none());
                pair.plant.model.parameters.initial.theta_e = f64::from(k) * PI / 6.0;
                run(&mut pair, T_S, 4.0, |t, p| {
                    p.controller.model.inputs.speed_ref = speed * RPM;
                    if t > 3.5 {
                        seen.see(p);
                    }
                });
                if (seen.0 - speed).abs().max((seen.1 - speed).abs()) < 1.0 {
                    turned += 1;
                } else {
                    others = Seen(others.0.min(seen.0), others.1.max(seen.1), 0.0);
                }
            }
            let [low, high] = [others.0, others.1].map(|x| number(x, 0));
            cells.push(match turned {
                12 => "all".into(),
                n if low == high => format!("{n}; others {low} rpm"),
                n => format!("{n}; others {low} to {high} rpm"),
            });
        }
        holds(&cells);
    }
}

#[test]
fn false_lock() {
    let after = |duration: f64, R_hat: f64| {
        let mut pair = with(R_hat);
        pair.plant.model.parameters.initial.theta_e = PI / 3.0;
        run(&mut pair, T_S, duration, |_, p| p.controller.model.inputs.speed_ref = 500.0 * RPM);
        (pair.plant.out.speed / RPM, error(&pair))
    };
    // At 2 s, the swing has died away to 1e-12 of the speed; from there on, it grows from rounding errors.
    let (speed, angle) = after(2.0, R);
    assert!(
        speed.abs() < 1.0 && PAGE.contains(&format!("stays at 0 rpm with {} for more than 2 s", degrees(angle))),
        "{speed} rpm, {angle} deg"
    );
    assert!((after(0.5, 0.9 * R).0 - 500.0).abs() < 1.0);
}

#[test]
fn torque_at_zero_speed() {
    for i_0 in [3.0, 4.0, 5.0, 6.0, 7.0] {
        let mut pair = with(0.9 * R);
        let par = &mut pair.controller.model.parameters;
        (par.zero_speed.i_0, par.limit.i) = (i_0, 9.0);
        let (mut load, mut lost) = (0.0, false);
        run(&mut pair, T_S, 11.0, |t, p| {
            p.plant.model.inputs.tau_load = (0.5 * (t - 0.5)).max(0.0);
            lost |= p.plant.out.speed < -30.0 * RPM;
            if !lost {
                load = p.plant.model.inputs.tau_load;
            }
        });
        assert!(lost);
        holds(&[format!("{i_0} A"), number(load, 2) + " N.m"]);
    }
}

/// Speed up to which each injection method holds rated load, in tenths of the rated speed.
#[test]
fn injection_at_speed() {
    let up_to = |kind: Kind| {
        let speeds = (1..=10).map(|k| 0.1 * f64::from(k));
        let held = speeds.take_while(|&speed| steady(runner::drive(kind), speed, 1.0).holds());
        held.last().map_or("0".into(), |speed| format!("{speed:.1}"))
    };
    let held = |kind: Kind| (kind.name(), up_to(kind));
    let [rotating, pulsating, square, near] =
        [Kind::RotatingInjection, Kind::PulsatingInjection, Kind::SquareWaveInjection, Kind::NearPwmInjection]
            .map(held);
    assert!(rotating.1 == pulsating.1 && pulsating.1 == square.1, "{rotating:?}, {pulsating:?}, {square:?}");
    let sentence = format!(
        "is held up to {} with {}, {} and {}, up to {} with\n{}.",
        square.1, rotating.0, pulsating.0, square.0, near.1, near.0
    );
    shows("drive/control/docs/limits.html", PAGE, &sentence);
}

#[test]
fn generating_load_at_low_speed() {
    for (factor, load) in [(0.8, 1.0), (0.9, 0.5), (0.9, 1.0), (0.9, 2.0), (0.99, 1.0), (1.0, 2.0)] {
        let mut cells = vec![format!("{factor}"), format!("{load} N.m")];
        for speed in [5.0, 10.0, 20.0, 30.0, 50.0, 75.0, 100.0, 200.0] {
            let (mut pair, mut seen) = (with(factor * R), Seen::none());
            run(&mut pair, T_S, 6.0, |t, p| {
                p.controller.model.inputs.speed_ref = from(0.1, t, speed * RPM);
                p.plant.model.inputs.tau_load = from(1.0, t, -load);
                if t > 4.0 {
                    seen.see(p);
                }
            });
            cells.push(if seen.held() { degrees(error(&pair)) } else { "not held".into() });
        }
        holds(&cells);
    }
}

#[test]
fn communication_step() {
    for samples in [0.7, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0] {
        let mut cells = vec![format!("{samples} T<sub>s</sub>")];
        for speed in [500.0, 1000.0, 1500.0] {
            let (mut pair, mut seen) = (Pair::default(), Seen::none());
            run(&mut pair, samples * T_S, 1.4, |t, p| {
                p.controller.model.inputs.speed_ref = from(0.1, t, speed * RPM);
                if t > 1.1 {
                    seen.see(p);
                }
            });
            let swings = format!("swings by {} rpm", number(seen.1 - seen.0, 0));
            cells.push(match &seen {
                Seen(.., angle) if *angle > 90.0 => "lost".into(),
                _ if seen.held() => degrees(error(&pair)),
                _ => swings,
            });
        }
        holds(&cells);
    }
}

#[test]
fn dead_time() {
    let drive = |name: &str, dead: bool, compensated: f64, real_sensors: bool| {
        let mut pair = Pair::default();
        if real_sensors {
            let sensor = &mut pair.controller.model.parameters.sensor;
            (sensor.noise, sensor.offset.a, sensor.offset.b) = (0.01, 0.02, -0.02);
        }
        if dead {
            pair.plant.model.parameters.inverter.dead_time = 2e-6;
            pair.controller.model.parameters.compensation.u_dead = 6.5 * compensated;
        }
        let compensation = &mut pair.controller.model.parameters.compensation;
        compensation.observe = name.contains("observed");
        compensation.calibrate = name.contains("calibrated");
        pair
    };
    // A drive that measures its offsets is off for 50 ms.
    let starts = |p: &Pair, t: f64| !p.controller.model.parameters.compensation.calibrate || t >= 0.05 - 1e-9;
    let plant = drive("", true, 0.0, false).plant.model;
    let (u, motor) = (plant.parameters.inverter.u_dead(325.0), &plant.parameters.motor);
    let speed = u / (f64::from(motor.n_p) * motor.psi_M) / RPM;
    let sentence = format!("cost a leg {u:.1} V, the EMF of {speed:.0} rpm");
    shows("drive/control/docs/limits.html", PAGE, &sentence);
    for (name, dead, compensated, real_sensors) in [
        ("no dead time", false, 0.0, false),
        ("no dead time, real sensors", false, 0.0, true),
        ("0 %", true, 0.0, false),
        ("90 %", true, 0.9, false),
        ("100 %", true, 1.0, false),
        ("100 %, real sensors", true, 1.0, true),
        ("100 %, observed", true, 1.0, false),
        ("100 %, real sensors, observed, calibrated", true, 1.0, true),
        ("90 %, real sensors, observed, calibrated", true, 0.9, true),
        ("110 %", true, 1.1, false),
    ] {
        let mut cells = vec![name.to_owned()];
        for speed in [20.0, 1000.0] {
            let (mut pair, mut seen) = (drive(name, dead, compensated, real_sensors), Seen::none());
            run(&mut pair, T_S, 3.0, |t, p| {
                p.controller.model.inputs.enable = starts(p, t);
                p.controller.model.inputs.speed_ref = from(0.1, t, speed * RPM);
                if t > 1.0 {
                    seen.see(p);
                }
            });
            cells.push(format!("{} to {} rpm", number(seen.0, 0), number(seen.1, 0)));
        }
        let mut pair = drive(name, dead, compensated, real_sensors);
        run(&mut pair, T_S, 6.5, |t, p| {
            p.controller.model.inputs.enable = starts(p, t);
            p.plant.model.inputs.tau_load = from(0.5, t, 2.0);
        });
        cells.push(format!("{} at {} rpm", degrees(error(&pair)), number(pair.plant.out.speed / RPM, 1)));
        holds(&cells);
    }
}
