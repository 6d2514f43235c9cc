//! An FMU whose steps can be made to fail and to panic: `tests/platforms.rs` runs it on every platform.
#![allow(missing_docs, dead_code, unreachable_pub)]

mod model;

fmu_export::export!(model::Probe);
