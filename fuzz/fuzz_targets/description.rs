#![no_main]

#[path = "../subjects/description.rs"]
mod description;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| description::run(bytes));
