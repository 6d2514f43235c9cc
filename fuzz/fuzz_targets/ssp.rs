#![no_main]

#[path = "../subjects/ssp.rs"]
mod ssp;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| ssp::run(bytes));
