//! Model Exchange with an integrator in the importer, here Euler's method: `cargo run -p fmu-import --example model_exchange
//! BouncingBall.fmu`. The crate `fmu-system` has better ones.

use fmu_import::{Error, Fmu, Instance, Kind};
use std::path::Path;

fn main() -> Result<(), Error> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/fmu/fmi3/BouncingBall.fmu".into());
    println!("height after each bounce: {:?}", run(Path::new(&path), 3.0)?);
    Ok(())
}

/// Integrates to `stop` (s) with steps of 1 ms; returns the states after each event.
///
/// # Errors
/// The FMU cannot be opened, or refuses a call.
pub(crate) fn run(path: &Path, stop: f64) -> Result<Vec<Vec<f64>>, Error> {
    let mut fmu = Fmu::open(path)?.instantiate_as(Kind::ModelExchange, "fmu", false)?;
    fmu.setup(0.0, Some(stop))?;
    fmu.enter_initialization()?;
    fmu.exit_initialization()?;
    settle(&mut fmu)?;
    let (states, indicators) = fmu.state_and_indicator_counts()?;
    let (mut x, mut dx) = (vec![0.0; states], vec![0.0; states]);
    let (mut z, mut before) = (vec![0.0; indicators], vec![0.0; indicators]);
    let (mut events, h, mut k) = (Vec::new(), 1e-3, 0);
    fmu.get_continuous_states(&mut x)?;
    fmu.get_event_indicators(&mut before)?;
    while f64::from(k) * h < stop {
        fmu.get_derivatives(&mut dx)?;
        x.iter_mut().zip(&dx).for_each(|(x, dx)| *x += h * dx);
        k += 1;
        fmu.set_time(f64::from(k) * h)?;
        fmu.set_continuous_states(&x)?;
        let step = fmu.completed_integrator_step()?;
        fmu.get_event_indicators(&mut z)?;
        if step.enter_event_mode || z.iter().zip(&before).any(|(a, b)| (*a > 0.0) != (*b > 0.0)) {
            fmu.enter_event_mode()?;
            settle(&mut fmu)?;
            fmu.get_continuous_states(&mut x)?;
            fmu.get_event_indicators(&mut z)?;
            events.push(x.clone());
        }
        before.clone_from(&z);
    }
    Ok(events)
}

/// Handles the events of this instant.
fn settle(fmu: &mut Instance) -> Result<(), Error> {
    while fmu.update_discrete_states()?.again {}
    fmu.enter_continuous_time_mode()
}
