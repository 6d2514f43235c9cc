#![no_main]

#[path = "../subjects/text.rs"]
mod text;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| text::run(bytes));
