#![no_main]

#[path = "../subjects/motor.rs"]
mod motor;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| motor::run(bytes));
