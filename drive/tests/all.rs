//! The tests of whole drives, as one program: what they have in common compiles once.
#![allow(missing_docs, non_snake_case)]

mod battery;
mod cold_winding;
mod commissioning;
mod coupling;
mod dc_link;
mod derating;
mod energies;
mod idle;
mod importer;
mod limited;
mod losses;
#[path = "../plant/tests/lossy/mod.rs"]
mod lossy;
#[path = "../control/tests/machines/mod.rs"]
mod machines;
mod mean;
mod mean_gates;
mod mean_link;
mod model_exchange;
mod options;
mod overload;
mod overmodulation;
mod parameters;
mod protection;
#[path = "../control/tests/random_machines/mod.rs"]
mod random_machines;
mod saturated;
mod saturation;
mod sensors;
mod short_circuit;
mod source;
mod start_state;
mod steady;
mod switched;
mod tangent;
mod temperature;
mod torque_at;
mod tracking;
mod tuned;
mod vehicle;
mod weakening;
mod weakening_sensorless;
