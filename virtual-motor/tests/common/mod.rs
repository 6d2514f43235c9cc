//! The C functions as a C program calls them, with results of Rust.
#![allow(dead_code, unreachable_pub, reason = "a module of several test programs, each of which uses a part")]

use std::ffi::{CStr, CString, c_char};
use virtual_motor::abi::*;
use virtual_motor::pool::MotorId;
use virtual_motor::sensing::{AdcCounts, AdcSetup, EncoderCount, EncoderSetup, TerminalVoltages};

/// Code and text of an error.
pub type Refused = (i32, String);

/// The text of the last error of this thread.
pub fn error_text() -> String {
    let mut text = [0xaa_u8; 1100];
    let len = unsafe { vm_error_text(text.as_mut_ptr().cast(), text.len()) };
    let kept = CStr::from_bytes_until_nul(&text).unwrap().to_str().unwrap().to_owned();
    assert_eq!(kept.len(), len);
    kept
}

/// `Ok` for the status 0.
pub fn checked(status: i32) -> Result<(), Refused> {
    if status == 0 { Ok(()) } else { Err((status, error_text())) }
}

/// A result that a function writes.
pub fn made<T: Copy>(unset: T, call: impl FnOnce(*mut T) -> i32) -> Result<T, Refused> {
    let mut place = unset;
    checked(call(&raw mut place)).map(|()| place)
}

fn text(text: &str) -> CString {
    CString::new(text).unwrap()
}

fn create_from(call: unsafe extern "C" fn(*const c_char, *mut MotorId) -> i32, from: &str) -> Result<MotorId, Refused> {
    made(MotorId::default(), |id| unsafe { call(text(from).as_ptr(), id) })
}

pub fn create() -> Result<MotorId, Refused> {
    made(MotorId::default(), |id| unsafe { vm_create(id) })
}

pub fn create_from_file(path: &str) -> Result<MotorId, Refused> {
    create_from(vm_create_from_motor_file, path)
}

pub fn create_from_text(toml: &str) -> Result<MotorId, Refused> {
    create_from(vm_create_from_motor_text, toml)
}

pub fn create_from_preset(json: &str) -> Result<MotorId, Refused> {
    create_from(vm_create_from_preset, json)
}

pub fn destroy(id: MotorId) -> Result<(), Refused> {
    checked(vm_destroy(id))
}

pub fn find(name: &str) -> Result<u32, Refused> {
    made(0, |variable| unsafe { vm_find(text(name).as_ptr(), variable) })
}

pub fn named(name: &str) -> u32 {
    find(name).unwrap()
}

pub fn set(id: MotorId, variable: u32, value: f64) -> Result<(), Refused> {
    checked(vm_set(id, variable, value))
}

pub fn get(id: MotorId, variable: u32) -> Result<f64, Refused> {
    made(f64::NAN, |value| unsafe { vm_get(id, variable, value) })
}

pub fn time(id: MotorId) -> Result<f64, Refused> {
    made(f64::NAN, |t| unsafe { vm_time(id, t) })
}

pub fn advance(id: MotorId, t: f64, duties: [f64; 3], enable: bool) -> Result<(), Refused> {
    checked(unsafe { vm_advance_duties(id, t, &raw const duties, enable.into()) })
}

pub fn advance_gates(id: MotorId, t: f64, gates: u32) -> Result<(), Refused> {
    checked(vm_advance_gates(id, t, gates))
}

pub fn adc(id: MotorId) -> Result<AdcCounts, Refused> {
    made(AdcCounts::default(), |counts| unsafe { vm_adc(id, counts) })
}

pub fn encoder(id: MotorId) -> Result<EncoderCount, Refused> {
    made(EncoderCount::default(), |count| unsafe { vm_encoder(id, count) })
}

pub fn hall(id: MotorId) -> Result<u32, Refused> {
    made(u32::MAX, |bits| unsafe { vm_hall(id, bits) })
}

pub fn terminals(id: MotorId) -> Result<TerminalVoltages, Refused> {
    made(TerminalVoltages::default(), |terminals| unsafe { vm_terminals(id, terminals) })
}

pub fn get_adc(id: MotorId) -> Result<AdcSetup, Refused> {
    let unset = AdcSetup {
        current_gain: 0.0,
        current_offset: 0.0,
        voltage_gain: 0.0,
        voltage_offset: 0.0,
        bits: 0,
        sensors: 9,
    };
    made(unset, |setup| unsafe { vm_get_adc(id, setup) })
}

pub fn set_adc(id: MotorId, setup: AdcSetup) -> Result<(), Refused> {
    checked(unsafe { vm_set_adc(id, &raw const setup) })
}

pub fn set_encoder(id: MotorId, setup: EncoderSetup) -> Result<(), Refused> {
    checked(unsafe { vm_set_encoder(id, &raw const setup) })
}
