//! `fmu identify` on runs of the project's own plant, and the record in `examples/`.
#![allow(
    missing_docs,
    non_snake_case,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "the symbols of the models; counts of samples"
)]

#[path = "common/on_bench.rs"]
mod on_bench;

use drive::Pair;
use drive_tools::identify::columns::Signals;
use drive_tools::identify::verdict::Quantity;
use drive_tools::identify::{Identified, Options, identify, machine_file};
use drive_tools::tune::motor::MotorFile;
use drive_tools::tune::rules;
use std::path::Path;

const EXAMPLE: &str = include_str!("../../examples/bench.csv");

fn of(text: &str) -> Identified {
    let options = Options {
        n_p: Some(3),
        current: Some(15.0),
        speed: Some(157.0),
        torque: Some(14.0),
        u_dc: Some(540.0),
        delay: Some(0.0),
        every: Some(5),
        ..Options::default()
    };
    let signals = Signals::parse(text, "bench.csv", &options.naming).unwrap();
    identify(&signals, &options).unwrap()
}

fn value<'a>(found: &'a Identified, name: &str) -> &'a Quantity {
    let value = found.values.iter().find(|v| v.name == name).unwrap();
    assert_eq!(value.refused, None, "{name}");
    value
}

/// The results expected from a record of this plant.
fn truth(pair: &Pair) -> [(&'static str, f64); 8] {
    let par = &pair.plant.model.parameters;
    let (motor, mechanics) = (&par.motor, &par.mechanics);
    [
        ("R_s", motor.R_s),
        ("L_d", motor.L_d),
        ("L_q", motor.L_q),
        ("psi_M", motor.psi_M),
        ("J", mechanics.J),
        ("B", mechanics.B),
        ("tau_coulomb", mechanics.tau_coulomb),
        ("u_dead", par.inverter.u_dead(pair.plant.model.inputs.u_dc)),
    ]
}

fn error(value: &Quantity, truth: f64) -> f64 {
    println!("{:12} {:+.2} % +- {:.2} %", value.name, 100.0 * (value.value / truth - 1.0), 100.0 * value.half_width);
    (truth / value.value - 1.0).abs()
}

#[test]
fn the_example_is_the_record_of_today() {
    let text = on_bench::record(on_bench::drive(), on_bench::TIME, on_bench::EVERY);
    assert!(text.len() < 300_000, "{} bytes", text.len());
    assert!(text == EXAMPLE, "cargo run --release -p drive-study --example bench_record > examples/bench.csv");
}

#[test]
fn the_values_of_the_example_lie_inside_their_intervals() {
    let found = of(EXAMPLE);
    let pair = on_bench::drive();
    for (name, truth) in truth(&pair) {
        let value = value(&found, name);
        // The d-axis saturates: the inductance lies between its values at 0 and 10 A.
        let low = if name == "L_d" { chord(&pair, 10.0) } else { truth };
        println!("{name}: {low} to {truth}");
        let (below, above) = (value.value * (1.0 - value.half_width), value.value * (1.0 + value.half_width));
        assert!(above >= low && below <= truth, "{name}: {below} to {above}");
    }
}

/// psi / i of the d-axis at the current `i` in A.
fn chord(pair: &Pair, i: f64) -> f64 {
    let par = &pair.plant.model.parameters;
    let current = |x: f64| x / par.motor.L_d + (par.saturation.s_2 + par.saturation.s_3 * x) * x * x;
    let (mut low, mut high) = (0.0, par.motor.L_d * i);
    for _ in 0..60 {
        let x = 0.5 * (low + high);
        if current(x) < i { low = x } else { high = x }
    }
    low / i
}

/// A machine with the written values yields them again.
#[test]
fn the_machine_file_gives_itself_again() {
    let found = of(EXAMPLE);
    let text = machine_file::text(&found, "bench", "a test");
    let motor = MotorFile::parse(&text, Path::new("bench.toml")).unwrap_or_else(|e| panic!("{e:#}\n{text}"));
    let mut pair = on_bench::drive();
    pair.plant.model.parameters = rules::tune(&motor).unwrap().pair().plant.model.parameters;
    let again = of(&on_bench::record(pair.clone(), on_bench::TIME, on_bench::EVERY));
    for (name, truth) in truth(&pair) {
        assert!((truth / value(&found, name).value - 1.0).abs() < 1e-5, "{name} is written");
        let value = value(&again, name);
        assert!(error(value, truth) < value.half_width, "{name}: {} instead of {truth}", value.value);
    }
}
