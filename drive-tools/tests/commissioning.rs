//! Self-commissioning of the machines in `motors/` on the project's plant: every accepted result is true.
#![allow(missing_docs, non_snake_case)]

#[path = "../../drive/control/tests/foreign/mod.rs"]
mod foreign;

use drive::Pair;
use drive::control::commission::{CommissionFault as Fault, CommissionState as State, Identified, Results};
use drive::control::commissioning::CommissionMode;
use drive::plant::iron::Iron;
use drive::plant::pwm::{InverterMode, PwmUpdate};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use std::path::{Path, PathBuf};

fn motors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../motors")
}

/// The rotor at the test, and with it the mode.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Rotor {
    Free,
    Blocked,
    Turning,
}

/// Plant and controller of a machine. A `real` inverter has dead time and sensors with offsets, noise and 12 bits.
fn machine(name: &str, rotor: Rotor, real: bool) -> Pair {
    of(&motors().join(format!("{name}.toml")), rotor, real)
}

fn of(path: &Path, rotor: Rotor, real: bool) -> Pair {
    tuned(path, rotor, real).unwrap()
}

/// # Errors
/// The values of the machine contradict each other.
fn tuned(path: &Path, rotor: Rotor, real: bool) -> Result<Pair, String> {
    let motor = MotorFile::read(path).map_err(|e| e.to_string())?;
    let mut pair = rules::tune(&motor).map_err(|e| e.to_string())?.pair();
    let par = &mut pair.controller.model.parameters;
    par.commission.mode = if rotor == Rotor::Turning { CommissionMode::Spin } else { CommissionMode::Standstill };
    par.commission.i = par.limit.i;
    par.commission.speed = *motor.data.rating.speed.get_ref();
    let (I, T_s) = (par.commission.i, par.T_s);
    let plant = &mut pair.plant.model.parameters;
    plant.mechanics.imposed = rotor == Rotor::Blocked;
    plant.initial.theta_e = 0.7;
    // Devices also have thresholds in an inverter without dead time.
    plant.inverter.i_zero = 0.02 * I;
    if real {
        plant.inverter.dead_time = 0.01 * T_s;
        (par.sensor.noise, par.sensor.resolution) = (0.75e-3 * I, 3.0 * I / 4096.0);
        (par.sensor.offset.a, par.sensor.offset.b) = (6e-3 * I, -3e-3 * I);
    }
    Ok(pair)
}

/// Runs until the commissioning is over; returns the results, and the maximum current over `commission.i`.
fn run(pair: &mut Pair) -> (Results, f64) {
    pair.controller.model.inputs.commission_start = true;
    pair.start().unwrap();
    let (h, mut most) = (pair.controller.model.parameters.T_s, 0.0_f64);
    while !matches!(pair.controller.out.commission_state, State::Done | State::Refused) {
        pair.step(h).unwrap();
        let i = pair.plant.out.i;
        most = most.max(i.a.abs()).max(i.b.abs()).max(i.c.abs());
    }
    let results = *pair.controller.model.commissioning_mut().as_ref().unwrap().shown();
    (results, most / pair.controller.model.parameters.commission.i)
}

/// The quantities with the result, the true value, and the maximum error. In a leg, transistor and diode conduct in turn.
fn compared(pair: &Pair, r: &Results) -> [(&'static str, Identified, f64, f64); 7] {
    let par = &pair.plant.model.parameters;
    let (motor, devices) = (&par.motor, &par.inverter.devices);
    let R_s = motor.R_s + 0.5 * (devices.r_transistor + devices.r_diode);
    let u_dead = par.inverter.u_dead(pair.plant.model.inputs.u_dc) + 0.5 * (devices.u_transistor + devices.u_diode);
    [
        ("R_s", r.R_s, R_s, 0.002),
        ("L_d", r.L_d, motor.L_d, 0.01),
        ("L_q", r.L_q, motor.L_q, 0.01),
        ("u_dead", r.u_dead, u_dead, 0.025),
        // 0.13 % of flat-24v, in steps of a fifth too.
        ("psi_M", r.psi_M, motor.psi_M, 0.0015),
        ("J", r.J, par.mechanics.J, 0.005),
        (
            "tau_friction",
            r.tau_friction,
            par.mechanics.friction(0.3 * pair.controller.model.parameters.commission.speed),
            0.05,
        ),
    ]
}

/// Commissions a machine, compares the accepted values with the true ones, and returns the refused ones.
fn judge(name: &str, rotor: Rotor, real: bool) -> Vec<&'static str> {
    let mut pair = machine(name, rotor, real);
    let (r, most) = run(&mut pair);
    let out = &pair.controller.out;
    print!("{name:15} {rotor:8?} real {real:5} {:?} {:4.1} s {most:.2} I", out.commission_state, pair.now.seconds());
    let lost = out.commission_fault == Fault::Lost && rotor == Rotor::Turning && loses(name, real);
    assert!(out.commission_state == State::Done || lost, "{name}: {:?}", out.commission_fault);
    assert!(!out.enabled && most < 1.35, "{name}: {most} I");
    assert!(rotor == Rotor::Blocked || !r.blocked, "{name}: a free rotor is not taken for a blocked one");
    let mut refused = vec![];
    for (quantity, found, truth, limit) in compared(&pair, &r) {
        if found.u >= 1.0 {
            refused.push(quantity);
            continue;
        }
        let error = found.value / truth - 1.0;
        print!(", {quantity} {:+.3} % +-{:.2}", 100.0 * error, 100.0 * found.u);
        assert!(error.abs() < limit, "{name}: {quantity} {}, not {truth}", found.value);
        // The shares of transistor and diode follow the voltage, which no interval contains.
        assert!(error.abs() < 2.0 * found.u + 1e-3, "{name}: {quantity} {error} outside of twice {}", found.u);
    }
    println!("; refused {refused:?}");
    refused
}

/// Values of several runs.
#[derive(Default)]
struct Tally {
    accepted: usize,
    /// Accepted values whose interval does not contain the true value.
    outside: Vec<String>,
    /// Runs that ended with a fault.
    refused: Vec<String>,
}

impl Tally {
    /// Commissions a machine, and prints errors and half-widths in %.
    fn take(&mut self, name: &str, pair: &mut Pair) {
        let (r, most) = run(pair);
        let out = &pair.controller.out;
        print!("{name} {:?} {:4.1} s {most:.2} I", out.commission_state, pair.now.seconds());
        if out.commission_fault != Fault::None {
            self.refused.push(format!("{name} {:?}", out.commission_fault));
        }
        for (quantity, found, truth, _) in compared(pair, &r) {
            if found.u >= 1.0 {
                print!(", {quantity} -");
                continue;
            }
            self.accepted += 1;
            let error = found.value / truth - 1.0;
            let values = format!("{quantity} {:+.3} % +-{:.3}", 100.0 * error, 100.0 * found.u);
            print!(", {values}");
            if error.abs() > found.u + 1e-4 {
                self.outside.push(format!("{name} {values}"));
            }
        }
        println!();
    }
}

/// A reluctance machine with a weak magnet and one with much iron loss are lost when they turn.
fn loses(name: &str, real: bool) -> bool {
    name == "pmsyrm-5.5kw" || (name == "traction-63kw" && !real)
}

/// Results that are refused, and why: a reluctance machine with a weak magnet does not rest on a direct current along the
/// d-axis, and the currents of iron loss do not fit the loops: 14 to 35 % of their amplitude are left. Without dead time there is no
/// u_dead. Without L_d there is neither psi_M nor friction, and a friction of less than 1 % of the rated torque may be refused.
fn expected(name: &str, rotor: Rotor, real: bool) -> Vec<&'static str> {
    let (weak, iron) =
        (name == "pmsyrm-5.5kw" && rotor != Rotor::Blocked, ["traction-63kw", "traction-100kw"].contains(&name));
    let dead = real || iron;
    let (stands, lost) = (rotor != Rotor::Turning, loses(name, real));
    let smooth = name == "ipmsm-2.2kw" || (name == "traction-60kw" && real);
    [
        ("R_s", weak),
        ("L_d", weak || iron),
        ("L_q", weak || iron),
        ("u_dead", !dead),
        ("psi_M", stands || lost || iron),
        ("J", stands || lost),
        ("tau_friction", stands || lost || iron || smooth),
    ]
    .into_iter()
    .filter_map(|(quantity, refused)| refused.then_some(quantity))
    .collect()
}

#[test]
fn machines_find_their_values() {
    use Rotor::{Blocked, Free, Turning};
    for (name, rotor) in
        [("ipmsm-2.2kw", Turning), ("hub-36v", Blocked), ("traction-60kw", Free), ("flat-24v", Turning)]
    {
        assert_eq!(judge(name, rotor, true), expected(name, rotor, true), "{name}");
    }
}

#[test]
#[ignore = "17 machines, free and blocked, with an ideal and a real inverter, a minute: \
            cargo test -p drive-tools --test commissioning -- --ignored --nocapture"]
fn all_machines_find_their_values() {
    let mut names: Vec<_> = std::fs::read_dir(motors()).unwrap().map(|e| e.unwrap().path()).collect();
    names.sort();
    assert!(names.len() >= 17);
    for name in names.iter().map(|path| path.file_stem().unwrap().to_str().unwrap()) {
        for rotor in [Rotor::Free, Rotor::Blocked, Rotor::Turning] {
            for real in [false, true] {
                assert_eq!(judge(name, rotor, real), expected(name, rotor, real), "{name}");
            }
        }
    }
}

/// Accepted values are inside their intervals. `pmsyrm-5.5kw` is refused as with an average inverter; with Single, `elevator-5kw` and
/// `traction-80kw` are lost at the lowest level with dead time, where it takes a fifth of the EMF.
#[test]
#[ignore = "all machines on switching legs, updated once and twice a period, without dead time, with 1 % and with 2 % of T_s, two minutes: \
            cargo test --release -p drive-tools --test commissioning -- --ignored --nocapture switching; \
            COMMISSION_MOTORS=FOLDER takes other machines"]
fn all_machines_on_switching_legs_find_true_values() {
    let other = std::env::var_os("COMMISSION_MOTORS").map(PathBuf::from);
    let mut paths: Vec<_> =
        std::fs::read_dir(other.clone().unwrap_or_else(motors)).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|x| x == "toml"));
    paths.sort();
    let (mut runs, mut tally) = (0, Tally::default());
    let settings = [PwmUpdate::Single, PwmUpdate::Double].map(|update| [0.0, 0.01, 0.02].map(|share| (update, share)));
    for path in &paths {
        let name = path.file_stem().unwrap().to_str().unwrap();
        for (update, share) in settings.into_iter().flatten() {
            let mut pair = match tuned(path, Rotor::Turning, true) {
                Ok(pair) => pair,
                Err(why) if other.is_some() => {
                    println!("{why}");
                    break;
                }
                Err(why) => panic!("{why}"),
            };
            let T_s = pair.controller.model.parameters.T_s;
            let plant = &mut pair.plant.model.parameters;
            plant.iron = Iron::default();
            plant.inverter.pwm.mode = InverterMode::Switched;
            (plant.inverter.pwm.update, plant.inverter.dead_time) = (update, share * T_s);
            plant.inverter.T_pwm = update.each_period() * T_s;
            pair.controller.model.parameters.commission.update = update;
            runs += 1;
            tally.take(&format!("{name:15} {update:?} {share:4}"), &mut pair);
        }
    }
    let Tally { accepted, outside, refused } = tally;
    println!("{accepted} values of {runs} runs, outside of their intervals {outside:?}; runs refused {refused:?}");
    assert!(outside.len() * 50 <= accepted, "more than 2 % are outside: {outside:?}");
    assert!(other.is_some() || refused.len() <= 10, "{refused:?}");
}

/// With double update the ripple is that of a carrier of two samples: taken for one sample, `psi_M` is outside its interval.
#[test]
fn double_update_has_the_ripple_of_two_samples() {
    let of = |update: PwmUpdate| {
        let mut pair = tuned(&motors().join("hub-36v.toml"), Rotor::Turning, true).unwrap();
        let par = &mut pair.controller.model.parameters;
        par.commission.update = update;
        let inverter = &mut pair.plant.model.parameters.inverter;
        (inverter.pwm.mode, inverter.pwm.update) = (InverterMode::Switched, PwmUpdate::Double);
        (inverter.T_pwm, inverter.dead_time) = (2.0 * par.T_s, 0.01 * par.T_s);
        let mut tally = Tally::default();
        tally.take(&format!("{update:?}"), &mut pair);
        tally
    };
    let right = of(PwmUpdate::Double);
    assert!(right.accepted >= 7 && right.outside.is_empty() && right.refused.is_empty(), "{:?}", right.outside);
    let wrong = of(PwmUpdate::Single).outside;
    assert!(wrong.iter().any(|value| value.contains("psi_M")), "{wrong:?}");
}

/// A machine of the population that `cargo test -p drive-control --test commission` commissions, without saturation and cogging, on
/// switching legs.
fn drawn(motor: &foreign::Motor, update: PwmUpdate) -> Pair {
    let mut pair = Pair::default();
    let (par, plant) = (&mut pair.controller.model.parameters, &mut pair.plant.model.parameters);
    let n_p = motor.pole_pairs();
    (plant.motor.n_p, plant.motor.R_s, plant.motor.L_d) = (n_p, motor.R, motor.L_d);
    (plant.motor.L_q, plant.motor.psi_M) = (motor.L_q, motor.psi);
    let mechanics = &mut plant.mechanics;
    (mechanics.J, mechanics.B, mechanics.tau_coulomb) = (motor.J, motor.B, motor.tau_coulomb);
    mechanics.w_coulomb = 0.001 * motor.w_rated / motor.n_p;
    plant.initial.theta_e = motor.theta_0;
    plant.inverter.pwm.mode = InverterMode::Switched;
    plant.inverter.pwm.update = update;
    plant.inverter.T_pwm = update.each_period() * motor.T;
    plant.inverter.dead_time = motor.u_dead / motor.u_dc * motor.T;
    (par.T_s, par.motor.n_p, par.limit.i, par.zero_speed.i_0) = (motor.T, n_p, motor.I, 0.0);
    (par.commission.mode, par.commission.i, par.commission.update) = (CommissionMode::Spin, motor.I, update);
    par.commission.speed = motor.w_rated / motor.n_p;
    (par.sensor.noise, par.sensor.resolution) = (1.5e-3 * motor.I, 3.0 * motor.I / 4096.0);
    (par.sensor.offset.a, par.sensor.offset.b, par.sensor.offset.c) = motor.offset.into();
    pair.set_inputs(0.0, 0.0, motor.u_dc);
    pair
}

/// Prints errors and half-widths in %. `MACHINES`, `FROM` and `SEED` select others.
#[test]
#[ignore = "300 machines on switching legs with a dead time of 0.5 % to 3 % of T_s: \
            cargo test --release -p drive-tools --test commissioning -- --ignored --nocapture population"]
fn a_population_on_switching_legs_finds_true_values() {
    let number = |name: &str, default: u64| std::env::var(name).map_or(default, |n| n.parse().unwrap());
    let (n, seed) = (number("MACHINES", 300), number("SEED", 1));
    let mut tally = Tally::default();
    for index in number("FROM", 0)..n {
        let motor = foreign::Motor::draw(seed, index);
        let update = [PwmUpdate::Single, PwmUpdate::Double][usize::from(index % 2 == 1)];
        let mut pair = drawn(&motor, update);
        tally.take(&format!("{index:3} {update:?}"), &mut pair);
    }
    let Tally { accepted, outside, refused } = tally;
    println!("{accepted} values, outside {}: {outside:?}; {} runs refused {refused:?}", outside.len(), refused.len());
    assert!(outside.len() * 20 <= accepted, "more than 5 % are outside");
}
