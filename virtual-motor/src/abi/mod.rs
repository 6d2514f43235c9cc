//! The C functions; `include/virtual_motor.h` documents them. Each is one to three lines through the `gate`, and follows no pointer
//! itself.
//!
//! # Safety
//! A pointer is NULL, or that of what the header states, which lasts for the call and which nothing else uses meanwhile. This is
//! what C promises to every function here.

#![expect(clippy::missing_safety_doc, reason = "one promise for all functions, in the file's doc comment")]

mod gate;
mod pointer;

use crate::motor::VirtualMotor;
use crate::pool::{self, MotorId};
use crate::sensing::{AdcCounts, AdcSetup, EncoderCount, EncoderSetup, TerminalVoltages};
use crate::variables;
use gate::{gate, give};
use std::ffi::c_char;
use std::path::Path;

/// Creates the reference motor.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_create(motor: *mut MotorId) -> i32 {
    // SAFETY: what C promises.
    let motor = unsafe { pointer::out(motor, "motor") };
    give(motor, || pool::insert(|| Ok(VirtualMotor::default())))
}

/// Creates the motor of a motor file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_create_from_motor_file(path: *const c_char, motor: *mut MotorId) -> i32 {
    // SAFETY: what C promises.
    let (path, motor) = unsafe { (pointer::text(path, "path"), pointer::out(motor, "motor")) };
    give(motor, || pool::insert(|| VirtualMotor::from_motor_file(Path::new(path?))))
}

/// Creates the motor of the text of a motor file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_create_from_motor_text(text: *const c_char, motor: *mut MotorId) -> i32 {
    // SAFETY: what C promises.
    let (text, motor) = unsafe { (pointer::text(text, "text"), pointer::out(motor, "motor")) };
    give(motor, || pool::insert(|| VirtualMotor::from_motor_text(text?)))
}

/// Creates the motor of a preset.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_create_from_preset(json: *const c_char, motor: *mut MotorId) -> i32 {
    // SAFETY: what C promises.
    let (json, motor) = unsafe { (pointer::text(json, "json"), pointer::out(motor, "motor")) };
    give(motor, || pool::insert(|| VirtualMotor::from_preset(json?)))
}

/// Destroys a motor.
#[unsafe(no_mangle)]
pub extern "C" fn vm_destroy(motor: MotorId) -> i32 {
    gate(|| pool::remove(motor))
}

/// Returns 1 for the id of a motor, otherwise 0.
#[unsafe(no_mangle)]
pub extern "C" fn vm_is_valid(motor: MotorId) -> i32 {
    pool::contains(motor).into()
}

/// The number of a variable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_find(name: *const c_char, variable: *mut u32) -> i32 {
    // SAFETY: what C promises.
    let (name, variable) = unsafe { (pointer::text(name, "name"), pointer::out(variable, "variable")) };
    give(variable, || variables::find(name?))
}

/// The name of a variable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_name(variable: u32, text: *mut c_char, size: usize) -> i32 {
    // SAFETY: what C promises.
    gate(|| variables::name(variable).map(|name| unsafe { pointer::copy(name, text, size) }))
}

/// Sets a variable.
#[unsafe(no_mangle)]
pub extern "C" fn vm_set(motor: MotorId, variable: u32, value: f64) -> i32 {
    gate(|| pool::with(motor, |motor| motor.set(variable, value)))
}

/// Reads a variable.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_get(motor: MotorId, variable: u32, value: *mut f64) -> i32 {
    // SAFETY: what C promises.
    let value = unsafe { pointer::out(value, "value") };
    give(value, || pool::with(motor, |motor| motor.get(variable)))
}

/// The present time of a motor.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_time(motor: MotorId, t: *mut f64) -> i32 {
    // SAFETY: what C promises.
    let t = unsafe { pointer::out(t, "t") };
    give(t, || pool::with(motor, |motor| Ok(motor.time())))
}

/// Advances to a time with duty cycles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_advance_duties(motor: MotorId, t: f64, duties: *const [f64; 3], enable: i32) -> i32 {
    // SAFETY: what C promises.
    let duties = unsafe { pointer::value(duties, "duties") };
    gate(|| pool::with(motor, |motor| motor.advance_duties(t, duties?, enable != 0)))
}

/// Advances to a time with gate signals.
#[unsafe(no_mangle)]
pub extern "C" fn vm_advance_gates(motor: MotorId, t: f64, gates: u32) -> i32 {
    gate(|| pool::with(motor, |motor| motor.advance_gates(t, gates)))
}

/// Counts of the converter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_adc(motor: MotorId, counts: *mut AdcCounts) -> i32 {
    // SAFETY: what C promises.
    let counts = unsafe { pointer::out(counts, "counts") };
    give(counts, || pool::with(motor, VirtualMotor::adc))
}

/// The reading of the encoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_encoder(motor: MotorId, count: *mut EncoderCount) -> i32 {
    // SAFETY: what C promises.
    let count = unsafe { pointer::out(count, "count") };
    give(count, || pool::with(motor, |motor| Ok(motor.encoder())))
}

/// The bits of the Hall sensors.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_hall(motor: MotorId, bits: *mut u32) -> i32 {
    // SAFETY: what C promises.
    let bits = unsafe { pointer::out(bits, "bits") };
    give(bits, || pool::with(motor, |motor| Ok(motor.hall())))
}

/// The terminals of the machine.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_terminals(motor: MotorId, terminals: *mut TerminalVoltages) -> i32 {
    // SAFETY: what C promises.
    let terminals = unsafe { pointer::out(terminals, "terminals") };
    give(terminals, || pool::with(motor, VirtualMotor::terminals))
}

/// The channels of the converter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_get_adc(motor: MotorId, setup: *mut AdcSetup) -> i32 {
    // SAFETY: what C promises.
    let setup = unsafe { pointer::out(setup, "setup") };
    give(setup, || pool::with(motor, |motor| Ok(motor.adc_setup())))
}

/// Sets the channels of the converter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_set_adc(motor: MotorId, setup: *const AdcSetup) -> i32 {
    // SAFETY: what C promises.
    let setup = unsafe { pointer::value(setup, "setup") };
    gate(|| pool::with(motor, |motor| motor.set_adc(setup?)))
}

/// The encoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_get_encoder(motor: MotorId, setup: *mut EncoderSetup) -> i32 {
    // SAFETY: what C promises.
    let setup = unsafe { pointer::out(setup, "setup") };
    give(setup, || pool::with(motor, |motor| Ok(motor.encoder_setup())))
}

/// Sets the encoder.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_set_encoder(motor: MotorId, setup: *const EncoderSetup) -> i32 {
    // SAFETY: what C promises.
    let setup = unsafe { pointer::value(setup, "setup") };
    gate(|| pool::with(motor, |motor| motor.set_encoder(setup?)))
}

/// Sets the angle of the Hall sensors.
#[unsafe(no_mangle)]
pub extern "C" fn vm_set_hall(motor: MotorId, offset: f64) -> i32 {
    gate(|| pool::with(motor, |motor| motor.set_hall(offset)))
}

/// The text of this thread's last error; returns its length.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vm_error_text(text: *mut c_char, size: usize) -> usize {
    gate::last(|error| {
        // SAFETY: what C promises.
        unsafe { pointer::copy(error, text, size) };
        error.len()
    })
}
