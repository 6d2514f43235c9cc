//! `fmu identify` on a population of machines, and the drives that it sets up.
#![allow(
    missing_docs,
    non_snake_case,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "the symbols of the models; counts of samples"
)]

#[path = "../../../drive/control/tests/foreign/mod.rs"]
mod foreign;
mod record;

use drive_tools::csv::Columns;
use drive_tools::identify::columns::{Naming, Signals};
use drive_tools::identify::verdict::Quantity;
use drive_tools::identify::{Identified, Options, identify, machine_file};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use drive_tools::tune::setting::Tuned;
use drive_tools::tune::trial::{self, Task};
use foreign::Motor;
use record::{PLAIN, Part, THOROUGH, record};
use std::path::Path;

/// A number from the environment.
fn from(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

fn found(m: &Motor, seed: u64, index: u64, time: f64, parts: &[Part], every: usize) -> Result<Identified, String> {
    let columns = record(m, seed, index, time, parts, every);
    let options = Options {
        n_p: Some(m.pole_pairs()),
        current: Some(m.I),
        speed: Some(m.speed()),
        torque: Some(m.torque()),
        delay: Some(0.0),
        every: Some(every as u32),
        ..Options::default()
    };
    let signals = Columns::of("record", &columns).and_then(|table| Signals::of(&table, &Naming::default()));
    signals.and_then(|signals| identify(&signals, &options)).map_err(|e| format!("{e:#}"))
}

/// The course of a record and its logging rate, as in the population used to set the intervals.
fn course(index: u64) -> (Vec<Part>, usize) {
    let mut parts = PLAIN.to_vec();
    let kind = index % 7;
    for (speed, i_d, load) in &mut parts {
        if kind == 0 {
            *speed = 0.3;
        }
        if kind == 1 {
            *i_d = 0.0;
        }
        if ![2, 3].contains(&kind) {
            *load = 0.0;
        }
    }
    let every = if index.is_multiple_of(2) { 1 } else { [2, 5, 10][(index / 2 % 3) as usize] };
    (parts, every)
}

const NAMES: [&str; 9] = ["R_s", "L_d", "L_q", "psi_M", "J", "B", "tau_coulomb", "u_dead", "i_zero"];

/// The true values; thresholds of the devices add to the dead time, and no single value represents the sum.
fn truth(m: &Motor) -> [f64; 9] {
    let (u_dead, i_zero) = if m.u_th > 0.0 { (f64::NAN, f64::NAN) } else { (m.u_dead, 2.0 * m.i_x) };
    [m.R, m.L_d, m.L_q, m.psi, m.J, m.B, m.tau_coulomb, u_dead, i_zero]
}

fn value<'a>(found: &'a Identified, name: &str) -> &'a Quantity {
    found.values.iter().find(|v| v.name == name).expect("a quantity")
}

/// Accepted values, their errors, and the number inside their intervals:
/// `FMU_SEED=3 FMU_RECORDS=300 cargo test --release -p drive-tools --test population figures -- --ignored --nocapture`.
#[test]
#[ignore = "two minutes for 300 records"]
fn figures() {
    let (seed, records) = (from("FMU_SEED", 3), from("FMU_RECORDS", 300));
    let mut errors: [Vec<(f64, u64)>; 9] = Default::default();
    let mut inside = [0_usize; 9];
    for index in 0..records {
        let m = Motor::draw(seed, index);
        let (parts, every) = course(index);
        let found = found(&m, seed, index, 6.0, &parts, every).unwrap_or_else(|e| panic!("{index}: {e}"));
        for (k, truth) in truth(&m).into_iter().enumerate() {
            let v = value(&found, NAMES[k]);
            if v.refused.is_none() && truth.is_finite() {
                let error = (v.value / truth - 1.0).abs();
                errors[k].push((error, index));
                inside[k] += usize::from(error <= v.half_width);
            }
        }
    }
    for (k, errors) in errors.iter_mut().enumerate() {
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| {
            100.0
                * errors
                    .get(((errors.len() as f64 * share) as usize).min(errors.len().saturating_sub(1)))
                    .map_or(0.0, |e| e.0)
        };
        println!(
            "{:12} {:3} of {records}: median {:.2}, 95 % {:.2}, 99 % {:.2}, worst {:.2} % ({:?}); inside {:.0} %",
            NAMES[k],
            errors.len(),
            at(0.5),
            at(0.95),
            at(0.99),
            at(1.0),
            errors.iter().rev().take(5).map(|e| (e.1, (1e3 * e.0).round())).collect::<Vec<_>>(),
            100.0 * inside[k] as f64 / errors.len().max(1) as f64
        );
    }
}

/// The machine's file with its true values; for the inverter, the loss of a leg at large currents, including the thresholds of
/// the devices, and a line of the same slope at zero.
fn true_file(m: &Motor) -> String {
    let Motor { n_p, R, L_d, L_q, psi, J, B, tau_coulomb, u_dc, I, .. } = m;
    let (speed, torque) = (m.speed(), m.torque());
    let u_dead = m.u_dead + m.u_th;
    let i_zero = u_dead / (0.5 * m.u_dead / m.i_x + m.u_th / m.i_y);
    format!(
        "name = \"truth\"\nsource = \"drawn\"\n[machine]\nn_p = {n_p}\nR_s = {R:e}\nL_d = {L_d:e}\nL_q = {L_q:e}\npsi_M = {psi:e}\n\
         [mechanics]\nJ = {J:e}\nB = {B:e}\ntau_coulomb = {tau_coulomb:e}\n[rating]\nspeed = {speed:e}\ntorque = {torque:e}\n\
         current = {I:e}\n[dc_link]\nu_dc = {u_dc:e}\n[inverter]\nu_dead = {u_dead:e}\ni_zero = {i_zero:e}\n"
    )
}

fn tuned(text: &str) -> Result<Tuned, String> {
    MotorFile::parse(text, Path::new("m.toml")).and_then(|m| rules::tune(&m)).map_err(|e| format!("{e:#}"))
}

/// Number of starts and loads, of 12 tasks from two angles each, that a drive holds.
fn held(tuned: &Tuned) -> u32 {
    let mut held = 0;
    for level in [0.1, 0.3, 0.6, 1.0] {
        for share in [0.0, 0.5, 1.0] {
            held += trial::at(tuned, &Task { level, torque: share * tuned.torque, rise: 0.0 }, 2).held;
        }
    }
    held
}

/// From a record to a running drive: the machine with its true values runs with the controller tuned from the identified ones,
/// and holds at least 98 % of the loads that it holds with the controller tuned from the true values. `FMU_RECORDS=40 cargo
/// test --release -p drive-tools --test population chain -- --ignored --nocapture`.
#[test]
#[ignore = "minutes for 40 machines"]
fn chain() {
    let (seed, machines) = (from("FMU_SEED", 1), from("FMU_RECORDS", 40));
    let (mut with_truth, mut with_found, mut tried, mut refused) = (0, 0, 0, 0);
    for index in 0..machines {
        let m = Motor::draw(seed, index);
        let truth = tuned(&true_file(&m));
        // Three times the same course: no single stretch of the record determines a value. A heavy rotor needs the time to change its speed.
        let time = (24.0 + 8.0 * m.J * m.speed() / m.torque()).min(600e3 * m.T);
        let found = found(&m, seed, index, time, &[THOROUGH; 3].concat(), 1).unwrap_or_else(|e| panic!("{index}: {e}"));
        let missing: Vec<String> = ["R_s", "L_d", "L_q", "psi_M", "J"]
            .iter()
            .filter_map(|name| value(&found, name).refused.as_ref().map(|why| format!("{name}: {why}")))
            .collect();
        if !missing.is_empty() {
            refused += 1;
            println!("{index:3} refused: {}", missing.join("; "));
            continue;
        }
        let text = machine_file::text(&found, "found", "a test");
        let (truth, found) = match (truth, tuned(&text)) {
            (Ok(truth), Ok(found)) => (truth, found),
            (Err(a), Err(b)) => {
                println!("{index:3} fmu tune refuses both: {a} | {b}");
                continue;
            }
            (truth, found) => panic!("{index}: fmu tune refuses one: {:?} {:?}", truth.err(), found.err()),
        };
        let found = Tuned { controller: found.controller, ..truth.clone() };
        let (a, b) = (held(&truth), held(&found));
        println!("{index:3} of 24: {a} with the true values, {b} with the identified ones");
        (with_truth, with_found, tried) = (with_truth + a, with_found + b, tried + 24);
    }
    println!(
        "{with_truth} and {with_found} of {tried}; {refused} of {machines} records refuse a value that fmu tune needs"
    );
    assert!(f64::from(with_found) >= 0.98 * f64::from(with_truth));
}
