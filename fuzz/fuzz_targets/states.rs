#![no_main]

#[path = "../subjects/states.rs"]
mod states;
#[path = "../../tests/stored/trial.rs"]
#[allow(dead_code)]
mod trial;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| states::run(bytes));
