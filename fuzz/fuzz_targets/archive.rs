#![no_main]

#[path = "../subjects/archive.rs"]
mod archive;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| archive::run(bytes));
