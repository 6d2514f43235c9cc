//! An importer: runs any FMU of FMI 2.0 and FMI 3.0, Co-Simulation and Model Exchange, from any tool, with one interface for
//! both standards.
//!
//! - [`Fmu`] and [`Instance`]: one FMU with valid calls only; [`raw`]: single calls, valid or not, for a checker.
//! - [`quantity`], [`written`], [`csv`](mod@csv): numbers with units, names and tables, as a user writes them; [`threads`]: work for several threads.
//! - [`replay`](mod@replay): the calls that an FMU recorded in another importer, repeated and compared.
//! - [`elf`], [`platform`]: requirements and platforms of binaries.
//! - [`guard`]: separate processes for FMUs of unknown origin; [`limits`]: limits of these processes and of files.
//!
//! `examples/` has a run in Co-Simulation and one in Model Exchange. Several FMUs together are the subject of the crate
//! `fmu-system`.
//!
//! `abi` is the only module with `unsafe` code: every pointer passed to an FMU points to memory of the size that the standard
//! requires. No importer can check the FMU itself: its code runs in this process with all of its rights.
//!
//! ```no_run
//! # fn main() -> Result<(), fmu_import::Error> {
//! let fmu = fmu_import::Fmu::open("target/fmu/fmi3/PmsmPlant.fmu")?;
//! let mut plant = fmu.instantiate("plant", false)?;
//! plant.setup(0.0, Some(1.0))?;
//! plant.enter_initialization()?;
//! plant.exit_initialization()?;
//! let _ = plant.do_step(0.0, 1e-4)?;
//! let speed: f64 = plant.get_as("speed")?;
//! println!("{speed} rad/s");
//! # Ok(()) }
//! ```

#![deny(unsafe_code)]

#[allow(unsafe_code)]
mod abi;
mod archive;
pub mod csv;
pub mod elf;
mod error;
mod fmu;
mod folder;
pub mod guard;
mod instance;
pub mod limits;
pub mod machine;
mod number;
pub mod platform;
pub mod quantity;
mod standard;
mod text;
pub mod threads;
pub mod trace;
mod typed;
mod value;
pub mod whole;
pub mod written;

pub use abi::journal;
pub use abi::library::describe;
pub use abi::log::{Logging, Message, Status};
pub use abi::raw;
pub use abi::replay;
pub use archive::{check_entries, document};
pub use error::{EntryError, Error};
pub use fmu::{Fmu, Outline, Unpacked, contents, outline};
pub use folder::Folder;
pub use instance::{FmuState, Instance};
pub use number::Number;
pub use quantity::suggest;
pub use standard::{CompletedStep, Kind, Stepped, Update};
pub use text::{file_uri, once, printable, printable_lines};
pub use typed::OtherType;
pub use value::Values;
// The types in signatures of this crate.
pub use model_description::{self, BaseType, Causality, FmiVersion, ModelDescription, ModelVariable, Variability};
