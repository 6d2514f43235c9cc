//! A master for several FMUs: connects outputs to inputs, feeds inputs over time, runs, records.
//!
//! The [`Method`] determines how: by default the FMUs step themselves (Co-Simulation); they can use event mode and early return
//! of FMI 3.0, or the master integrates their states (Model Exchange).
//!
//! At every communication point `t = start + k h` the master reads all outputs and sets all inputs; then it steps all FMUs
//! (Jacobi), so that values sent at `t` act from `t` on. With [`Settings::sequential`] it steps them one after the other in the
//! order they were added, each with the new outputs of those before it (Gauss-Seidel).
//!
//! ```no_run
//! # fn main() -> Result<(), fmu_import::Error> {
//! use fmu_import::Fmu;
//! use fmu_system::cosimulation::{Schedule, Settings, System};
//!
//! let mut system = System::default();
//! system.add("plant", &Fmu::open("target/fmu/fmi3/PmsmPlant.fmu")?, false)?;
//! system.add("controller", &Fmu::open("target/fmu/fmi3/SensorlessController.fmu")?, false)?;
//! system.connect_by_name()?;
//! system.set("plant.motor.R_s", "3.0")?;
//! system.input("controller.speed_ref", Schedule::parse("0:0,0.1:52.36").unwrap())?;
//! system.record("plant.speed")?;
//! let settings = Settings { start: 0.0, stop: 1.0, step: 1e-4, sequential: false };
//! let recording = system.run(&settings, |_| Ok(std::ops::ControlFlow::Continue(())))?;
//! println!("{:?}", recording.column("plant.speed").unwrap().values.last());
//! # Ok(()) }
//! ```
//!
//! For many runs of one system there is [`SystemPlan`].

mod connect;
mod continuous;
mod coupled;
mod events;
mod exchange;
mod grid;
mod iteration;
mod loops;
mod method;
mod parts;
mod plan;
mod point;
mod quantity;
mod recording;
mod run;
mod schedule;
mod sequence;
mod system;
mod tables;
mod terminals;
mod wiring;

pub use crate::integration::Solver;
pub use connect::incompatible;
pub use coupled::{Equations, Feed, Fmus};
pub use exchange::Inputs;
pub use grid::{CoarseSteps, Settings};
pub use method::{Integration, Method};
pub use plan::{PlanTarget, SystemPlan, Worker};
pub use point::{CommunicationPoint, Ended, with_name};
pub use recording::{Column, Recording, TextColumn, item};
pub use schedule::{Schedule, Sine};
pub use sequence::Sequence;
pub use system::System;
pub(crate) use wiring::converted;
pub use wiring::{Crossing, Outlet, Transformation, Units};
