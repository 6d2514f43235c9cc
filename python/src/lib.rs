//! The compiled part of the Python package `fmurun`: FMUs and runs; `fmurun/*.py` is what users import.
//!
//! Every function that Python calls goes through `error::gate`: a panic becomes an `FmuError`.

#![deny(unsafe_code)]

mod batch;
mod cache;
mod course;
mod describe;
mod error;
mod exchange;
mod frequency;
mod identify;
mod input;
mod instance;
mod lane;
mod page;
mod plan;
mod record;
mod simulation;
mod stepping;
mod tune;

use pyo3::prelude::*;

/// The module `fmurun._core`.
#[pymodule]
mod _core {
    #[pymodule_export]
    use super::batch::Batch;
    #[pymodule_export]
    use super::cache::{Fmu, open};
    #[pymodule_export]
    use super::describe::suggest;
    #[pymodule_export]
    use super::error::panic;
    #[pymodule_export]
    use super::frequency::{frequency_response, loop_properties, phases};
    #[pymodule_export]
    use super::identify::identify;
    #[pymodule_export]
    use super::instance::{FmuState, Instance};
    #[pymodule_export]
    use super::page::run_page;
    #[pymodule_export]
    use super::plan::{Plan, paths, read_definition};
    #[pymodule_export]
    use super::simulation::Simulation;
    #[pymodule_export]
    use super::tune::{datasheet, tune};
}
