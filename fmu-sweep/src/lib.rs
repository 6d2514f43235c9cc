//! Many runs of FMUs, of any tool: designs, measures, threads, parts that a killed sweep resumes from.
//!
//! - [`Definition`]: the definition of a sweep, from a TOML file or from a program.
//! - [`Plan`]: the system with its measures; runs rows on threads. [`DesignRows`]: the rows of a design.
//! - [`frequency`]: frequency responses by a swept sine, with the margins of loops.
//! - [`Sweep`]: both, from a file. [`run`]: a sweep into a folder; [`isolate`]: in separate processes.
//!
//! A row is a function of the definition, the seed and its number, and its results have the same bits on every thread, process
//! and machine.
//!
//! ```no_run
//! # fn main() -> Result<(), fmu_sweep::Error> {
//! use fmu_sweep::{Definition, Plan};
//!
//! let definition = Definition::read("sweep.toml".as_ref())?;
//! let plan = Plan::new(&definition, "".as_ref())?;
//! let variables = plan.bind(["p.motor.R_s"])?;
//! let go_on = |_| std::ops::ControlFlow::Continue(());
//! let outcomes = plan.run_many(&variables, &[&[2.9, 3.0, 3.1]], 2, &go_on)?;
//! println!("{:?}", outcomes.measures[0]);
//! # Ok(()) }
//! ```

#![forbid(unsafe_code)]

mod around;
pub mod definition;
mod design;
mod error;
mod files;
pub mod frequency;
pub mod isolate;
mod measure;
mod ordered;
mod output;
mod plan;
mod pool;
mod run;
mod signal;
mod sweep;
mod warned;

pub use definition::{Definition, MeasureDefinition};
pub use design::DesignRows;
pub use error::Error;
pub use fmu_import::threads::available as threads_here;
pub use ordered::Ordered;
pub use output::Failures;
pub use plan::{Plan, ResultColumn, RunResult, RunResults, RunVariable, Runner, last_columns};
pub use run::{Options, Progress, Report, missing, run};
pub use sweep::Sweep;
pub use warned::Warned;
