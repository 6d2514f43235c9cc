//! Two FMUs, connected and recorded: `cargo run -p fmu-system --example two_fmus target/fmu/fmi3`.

use fmu_system::cosimulation::{Schedule, Settings, System};
use fmu_system::{Error, Fmu};
use std::ops::ControlFlow;
use std::path::Path;

fn main() -> Result<(), Error> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "target/fmu/fmi3".into());
    for (t, speed) in run(Path::new(&folder))?.iter().step_by(1000) {
        println!("{t:.1} s: {speed:.3} rad/s");
    }
    Ok(())
}

/// Speeds up plant and controller; returns times (s) and speeds (rad/s).
///
/// # Errors
/// The FMU cannot be opened, or refuses a call.
pub(crate) fn run(folder: &Path) -> Result<Vec<(f64, f64)>, Error> {
    let mut system = System::default();
    system.add("plant", &Fmu::open(folder.join("PmsmPlant.fmu"))?, false)?;
    system.add("controller", &Fmu::open(folder.join("SensorlessController.fmu"))?, false)?;
    system.connect_by_name()?; // inputs to the outputs of the same name; or connect("plant.i_a", "controller.i_a")
    system.set("plant.motor.R_s", "2.1")?;
    let schedule = Schedule::parse("0:0,0.1:52.36").map_err(|cause| Error::usage("schedule", cause))?;
    system.input("controller.speed_ref", schedule)?;
    system.record("plant.speed")?;
    let settings = Settings { start: 0.0, stop: 0.5, step: 1e-4, sequential: false };
    let recording = system.run(&settings, |_| Ok(ControlFlow::Continue(())))?;
    let speed = recording.column("plant.speed").map_or(&[][..], |column| &column.values);
    Ok(recording.time.iter().copied().zip(speed.iter().copied()).collect())
}
