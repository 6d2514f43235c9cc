//! Many runs of one FMU on all cores: `cargo run -p fmu-sweep --example sweep target/fmu/fmi3/PmsmDrive.fmu`.

use fmu_sweep::definition::{Definition, MeasureDefinition, MeasureFunction};
use fmu_sweep::{Error, Plan};
use std::ops::ControlFlow;
use std::path::Path;

fn main() -> Result<(), Error> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/fmu/fmi3/PmsmDrive.fmu".into());
    for (load, speed) in run(Path::new(&path), &[0.0, 1.0, 2.0, 3.0])? {
        println!("{load} N.m: {speed:.2} rad/s at the lowest");
    }
    Ok(())
}

/// Loads the running drive; returns each load (N.m) and the lowest speed (rad/s) after the start.
///
/// # Errors
/// The FMU cannot be opened, or refuses a call.
pub(crate) fn run(path: &Path, loads: &[f64]) -> Result<Vec<(f64, f64)>, Error> {
    let mut definition =
        Definition { fmus: vec![path.display().to_string()], stop: Some(0.5), ..Definition::default() };
    definition.input.insert("speed_ref", "50".into());
    let lowest = MeasureDefinition { after: Some(0.3), ..MeasureDefinition::new("speed", MeasureFunction::Min) };
    definition.measure.insert("lowest", lowest);
    let plan = Plan::new(&definition, Path::new(""))?;
    let variables = plan.bind(["tau_load"])?;
    let results = plan.run_many(&variables, &[loads], 2, &|_| ControlFlow::Continue(()))?;
    Ok(loads.iter().copied().zip(results.measures[0].iter().map(|x| x.real())).collect())
}
