//! The command `fmu`.
fn main() {}
