//! The paper's start-up, speed steps and load steps, run and measured.

pub mod figures;
pub mod scenario;
