//! Co-Simulation of one FMU: `cargo run -p fmu-import --example co_simulation target/fmu/fmi3/PmsmDrive.fmu`.

use fmu_import::{Error, Fmu};
use std::path::Path;

fn main() -> Result<(), Error> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/fmu/fmi3/PmsmDrive.fmu".into());
    println!("{:.3} rad/s at the end", run(Path::new(&path))?);
    Ok(())
}

/// Starts the drive with a larger inertia; returns its speed (rad/s) after 0.5 s.
///
/// # Errors
/// The FMU cannot be opened, or refuses a call.
pub(crate) fn run(path: &Path) -> Result<f64, Error> {
    let fmu = Fmu::open(path)?;
    let mut drive = fmu.instantiate("drive", false)?;
    drive.set("plant.mechanics.J", 2e-3)?; // kg.m2
    drive.set_text("controller.estimator", "FluxObserver")?;
    drive.setup(0.0, Some(0.5))?;
    drive.enter_initialization()?;
    drive.set_text("speed_ref", "500 rpm")?; // a number is in the variable's unit, rad/s
    drive.exit_initialization()?;
    for k in 0..500 {
        if drive.do_step(f64::from(k) * 1e-3, 1e-3)?.is_break() {
            break; // the FMU has ended the simulation
        }
    }
    drive.terminate()?;
    drive.get_as("speed")
}
